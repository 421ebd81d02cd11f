//! Acquisition of open records: the force between samples, and AC coupled channels.

use std::f64::consts::TAU;
use std::str::FromStr;

use mechid_checks::{
    Alternative, Cause, Finding, after_spectral_fit, is_noise, log_residual_power,
};
use mechid_estimate::frequency_domain::{
    ChangedRecords, OutputErrorFit, equivalent_force, output_error_from, output_error_pooling,
    thin_step,
};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::Discretisation;
use mechid_signal::Extent;
use mechid_spectra::{FrequencyData, Pooling};
use serde::{Deserialize, Serialize};

use super::open_records::joined;
use crate::AnalysisError;
use crate::limits::{ACQUISITION_ROUNDS, ACQUISITION_SETTLED};
use crate::measurement::Block;

/// Properties of the acquisition that the fit of open records takes into account.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Acquisition {
    /// Assumption on the force between its samples, held or linear; `None` for a band-limited
    /// force.
    pub between_samples: Option<Discretisation>,
    /// Channels behind a first-order high-pass.
    pub ac_coupling: Vec<AcCoupling>,
}

/// A channel behind a first-order high-pass, written `a1=0.5`: its name and the corner frequency in
/// Hz.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcCoupling {
    /// Name of the channel.
    pub channel: String,
    /// Corner frequency, in Hz.
    pub corner_hz: f64,
}

impl FromStr for AcCoupling {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.rsplit_once('=').and_then(|(channel, hz)| {
            let corner_hz =
                hz.trim().parse().ok().filter(|hz: &f64| *hz > 0.0 && hz.is_finite())?;
            let channel = channel.trim();
            (!channel.is_empty()).then(|| Self { channel: channel.to_owned(), corner_hz })
        });
        parsed.ok_or_else(|| {
            format!(
                "an AC-coupled channel is written as its name and the corner frequency in Hz, such as \
                 a1=0.5, not `{text}`"
            )
        })
    }
}

impl Acquisition {
    /// Returns whether the settings are the defaults: band-limited force, no high-pass.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the lines of a record, corrected as if all channels had the same AC coupling.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if a channel does not exist, or for Euler's rule.
    pub(super) fn uncoupled(
        &self,
        mut data: FrequencyData,
        held: &Block,
    ) -> Result<FrequencyData, AnalysisError> {
        if self.between_samples == Some(Discretisation::Euler) {
            let why =
                "euler is available only with `domain` time; for spectra choose held or linear"
                    .to_owned();
            return Err(AnalysisError::Setting { setting: "between_samples", why });
        }
        let (names, kind) = (&held.names, held.response().1);
        for AcCoupling { channel, corner_hz } in &self.ac_coupling {
            let index = |names: &[String]| names.iter().position(|name| name == channel);
            let (response, force) = (index(names.response(kind)), index(&names.force));
            if response.is_none() && force.is_none() {
                let channels: Vec<&str> =
                    names.force.iter().chain(names.response(kind)).map(String::as_str).collect();
                let why = format!(
                    "{} has no fitted channel {channel}; the fitted channels are {}",
                    held.file,
                    channels.join(", ")
                );
                return Err(AnalysisError::Setting { setting: "ac_coupling", why });
            }
            let (responses, forces) = (Vec::from_iter(response), Vec::from_iter(force));
            data = data.with_high_pass_alike(&responses, &forces, TAU * corner_hz);
        }
        Ok(data)
    }

    /// Fits the records again with the assumption `between_samples` on the force between its
    /// samples, which are `dt` (s) apart. Returns the fit, and the records in which each force is
    /// replaced by the equivalent force: the band-limited force that causes the same response.
    ///
    /// # Source
    /// Successive substitution: the equivalent force depends on the system only through the
    /// response above half the sampling rate.
    pub(super) fn refitted(
        &self,
        fit: OutputErrorFit,
        records: &[FrequencyData],
        dt: f64,
        unknowns: &Unknowns,
        pooling: Pooling,
    ) -> Result<(OutputErrorFit, Vec<FrequencyData>), AnalysisError> {
        let mut last = (fit, records.to_vec());
        let Some(between) = self.between_samples else { return Ok(last) };
        let mut settled = pooling == Pooling::AllLines;
        // Largest change of a parameter in the last round, in standard errors, and its ratio to the
        // change in the previous round.
        let (mut change, mut decrease) = (f64::INFINITY, 1.0);
        for round in 0..ACQUISITION_ROUNDS {
            let system = last.0.estimate.system()?;
            let equivalent =
                records.iter().map(|record| equivalent_force(record, &system, dt, between));
            let Some(equivalent) = equivalent.collect::<Option<Vec<_>>>() else {
                let why = "the response of the identified system to a force that is held or linear between its samples cannot be computed: leave this setting out, or check the fit".to_owned();
                return Err(AnalysisError::Setting { setting: "between_samples", why });
            };
            let data = joined(&equivalent)?;
            // The fits assume white noise until the equivalent force hardly changes.
            let is_last = round + 1 == ACQUISITION_ROUNDS;
            let of_round = if settled || is_last { pooling } else { Pooling::AllLines };
            // The first round searches anew, because the band-limited force may have led to a wrong
            // minimum.
            let fit = match round {
                0 => output_error_pooling(&data, unknowns, of_round),
                _ => output_error_from(&data, unknowns, &last.0, of_round)
                    .or_else(|_| output_error_pooling(&data, unknowns, of_round)),
            }?;
            let before = change;
            change = largest_change(&last.0.estimate, &fit.estimate);
            last = (fit, equivalent);
            // The first round with the final noise model may change the estimate much, although the
            // next change is small. The next change is predicted as the change in this round times
            // `decrease`, the ratio of the changes in the two rounds before this round.
            if settled && change * f64::min(decrease, 1.0) < ACQUISITION_SETTLED {
                break;
            }
            decrease = if before.is_finite() { change / before } else { 1.0 };
            settled |= change < ACQUISITION_SETTLED;
        }
        Ok(last)
    }
}

/// Force that is held or linear between its samples, as an explanation of a residual.
pub(super) struct BetweenSamples {
    kind: Discretisation,
    fit: OutputErrorFit,
    /// Ratio of two residual powers, that of the fit with a held or linear force and that of the
    /// fit with a band-limited force: the geometric mean over the channels, as in the likelihood of
    /// white noise.
    pub(super) remaining: f64,
    /// `true` if the fit with a held or linear force has less residual power than the fit with a
    /// band-limited force, and no test of its residual warns.
    pub(super) leaves_noise: bool,
}

impl BetweenSamples {
    /// Returns this kind of force as the cause of the residual.
    pub(super) fn explanation(self) -> Explanation {
        let cause = Cause::BetweenSamples { between_samples: self.kind };
        let finding = Finding::Alternative(Alternative { cause, remaining: self.remaining });
        Explanation { finding, fit: Some(self.fit) }
    }
}

/// Cause of a residual.
pub(super) struct Explanation {
    pub(super) finding: Finding,
    /// Fit whose model includes the cause of the residual, on the lines of a [`BandLimitedFit`];
    /// `None` if there is no such fit.
    pub(super) fit: Option<OutputErrorFit>,
}

/// Fit of open records with a band-limited force, as the reference for fits with other explanations
/// of the residual. Long records are fitted on a part of their lines.
pub(super) struct BandLimitedFit<'a> {
    records: Vec<FrequencyData>,
    fit: OutputErrorFit,
    /// Mean over the channels of the logarithms of their residual powers.
    level: f64,
    unknowns: &'a Unknowns,
    pooling: Pooling,
}

impl<'a> BandLimitedFit<'a> {
    /// Fits a part of the lines if the records are long; the search begins at `fit`, the fit to all
    /// lines. `None` if the search fails.
    pub(super) fn new(
        records: &[FrequencyData],
        fit: &'a OutputErrorFit,
        pooling: Pooling,
    ) -> Option<Self> {
        let unknowns = fit.estimate.unknowns();
        let step = thin_step(&joined(records).ok()?, unknowns);
        // Records with errors of pulses, which are common to all lines, have no part.
        let thinned: Option<Option<Vec<_>>> =
            (step > 1).then(|| records.iter().map(|record| record.thinned(step)).collect());
        let (records, fit) = match thinned.flatten() {
            Some(thinned) => {
                let fit =
                    output_error_from(&joined(&thinned).ok()?, unknowns, fit, pooling).ok()?;
                (thinned, fit)
            }
            None => (records.to_vec(), fit.clone()),
        };
        let level = level(&fit, &records)?;
        Some(Self { records, fit, level, unknowns, pooling })
    }

    /// Fits the records with each of the `kinds` of force between samples, `dt` (s) apart, in place
    /// of the band-limited force, and returns the best fit. If the residual of the best fit so far
    /// is only noise, another kind is fitted only if it reduces the residual power under the
    /// assumption of white noise. `None` without kinds, or if no fit succeeds.
    ///
    /// # Source
    /// Maximum likelihood after elimination of the noise levels of the channels.
    pub(super) fn between_samples(
        &self,
        kinds: &[Discretisation],
        dt: f64,
    ) -> Option<BetweenSamples> {
        let mut best: Option<BetweenSamples> = None;
        for kind in self.likeliest_first(kinds, dt) {
            let noise = best.as_ref().filter(|best| best.leaves_noise);
            let has_chance = noise.is_none_or(|best| self.leaves_less(kind, best, dt));
            let fitted = has_chance.then(|| self.between_samples_as(kind, dt)).flatten();
            best =
                fitted.into_iter().chain(best).min_by(|a, b| a.remaining.total_cmp(&b.remaining));
        }
        best
    }

    /// Returns whether one kind of force leaves less residual power than the best kind so far. The
    /// power of this kind is minimised from two initial estimates: the fit with the best kind so
    /// far, and the band-limited fit.
    fn leaves_less(&self, kind: Discretisation, best: &BetweenSamples, dt: f64) -> bool {
        let log_power = |kind: Discretisation, near: &OutputErrorFit| {
            let data = joined(&self.equivalent(near, kind, dt)?).ok()?;
            ChangedRecords::from_fit(&data, self.unknowns, near)?.log_residual_power(&data)
        };
        let least = log_power(best.kind, &best.fit).unwrap_or(f64::INFINITY);
        let near = [&best.fit, &self.fit];
        near.into_iter().any(|near| log_power(kind, near).is_some_and(|power| power < least))
    }

    /// Returns the records with equivalent band-limited forces: in the system of `fit`, each of
    /// these forces causes the same response as the measured force with the assumption `kind`
    /// between its samples.
    fn equivalent(
        &self,
        fit: &OutputErrorFit,
        kind: Discretisation,
        dt: f64,
    ) -> Option<Vec<FrequencyData>> {
        let system = fit.estimate.system().ok()?;
        self.records.iter().map(|record| equivalent_force(record, &system, dt, kind)).collect()
    }

    /// Returns the kinds of force in the order of rising residual power; the power is computed with
    /// the system of the band-limited fit.
    fn likeliest_first(&self, kinds: &[Discretisation], dt: f64) -> Vec<Discretisation> {
        let power = |kind: Discretisation| {
            self.remaining(&self.fit, &self.equivalent(&self.fit, kind, dt)?)
        };
        let mut ranked: Vec<(f64, Discretisation)> =
            kinds.iter().map(|kind| (power(*kind).unwrap_or(f64::INFINITY), *kind)).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.into_iter().map(|(_, kind)| kind).collect()
    }

    /// Fits the records with one kind of force between samples `dt` (s) apart.
    fn between_samples_as(&self, kind: Discretisation, dt: f64) -> Option<BetweenSamples> {
        let Self { records, unknowns, pooling, .. } = self;
        let acquisition = Acquisition { between_samples: Some(kind), ..Acquisition::default() };
        let refitted = acquisition.refitted(self.fit.clone(), records, dt, unknowns, *pooling);
        let (fit, equivalent) = refitted.ok()?;
        let remaining = self.remaining(&fit, &equivalent)?;
        let after = after_spectral_fit(&closed(&fit, &equivalent)?, &fit.estimate, Extent::Open);
        let leaves_noise = remaining < 1.0 && after.is_ok_and(|after| is_noise(&after.records));
        Some(BetweenSamples { kind, fit, remaining, leaves_noise })
    }

    /// Returns the fit of a new search with changed records, and the fraction of the residual power
    /// that remains; `None` if the fit fails.
    pub(super) fn after(
        &self,
        change: impl Fn(&FrequencyData) -> FrequencyData,
    ) -> Option<(OutputErrorFit, f64)> {
        let changed: Vec<FrequencyData> = self.records.iter().map(change).collect();
        let fit =
            output_error_pooling(&joined(&changed).ok()?, self.unknowns, self.pooling).ok()?;
        let remaining = self.remaining(&fit, &changed)?;
        Some((fit, remaining))
    }

    /// Returns the residual power of a fit to `records`, relative to that with the band-limited
    /// force.
    fn remaining(&self, fit: &OutputErrorFit, records: &[FrequencyData]) -> Option<f64> {
        Some((level(fit, records)? - self.level).exp())
    }
}

/// Returns the records without the transients of a fit.
fn closed(fit: &OutputErrorFit, records: &[FrequencyData]) -> Option<Vec<FrequencyData>> {
    fit.ends.as_ref()?.without_transients(records).ok()
}

/// Returns the mean over the channels of the logarithms of the residual powers of a fit.
fn level(fit: &OutputErrorFit, records: &[FrequencyData]) -> Option<f64> {
    log_residual_power(&closed(fit, records)?, &fit.estimate)
}

/// Returns the largest change of a parameter between two estimates, in standard errors.
fn largest_change(before: &Estimate, after: &Estimate) -> f64 {
    let pairs = before.parameters().zip(after.parameters());
    pairs.map(|(a, b)| (a.value - b.value).abs() / b.standard_error).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coupled_channel_is_written_out() {
        let coupled = AcCoupling { channel: "a=1".into(), corner_hz: 0.5 };
        assert_eq!("a=1=0.5".parse(), Ok(coupled));
        for text in ["", "a", "a=", "=0.5", "a=0", "a=-1", "a=NaN", "a=inf", "a=1 Hz"] {
            assert!(text.parse::<AcCoupling>().is_err(), "{text}");
        }
    }
}
