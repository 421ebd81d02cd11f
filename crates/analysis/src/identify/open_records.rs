//! Fits of the spectral lines of open records, such as those of random tests.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use mechid_checks::limits::DELAY_REMAINING;
use mechid_checks::{
    AfterSpectralFit, Alternative, Cause, Finding, Quantity, RowParts, SpectralResidual,
    after_spectral_fit, before_spectral_fit, delay_of_failed_search, delay_of_lines,
    delay_of_open_records, fault_of_acquisition, fault_of_hits, fitted_band,
    forces_between_samples, is_noise, linearity_of_open_record,
};
use mechid_estimate::frequency_domain::{
    EndLoads, OutputErrorFit, PartsOfFit, Refit, SampledRows, Split, equivalent_force,
    force_noise_factor, force_noise_of_residual, output_error_from, output_error_pooling,
    with_noise_of,
};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::{Discretisation, ResponseQuantity};
use mechid_numerics::time_limit;
use mechid_signal::Extent;
use mechid_spectra::{FrequencyData, Lines, Pooling};
use nalgebra::DMatrix;

use super::CONSPICUOUS;
use super::acquisition::{Acquisition, BandLimitedFit, BetweenSamples, Explanation};
use super::compared::{Compared, rows_of};
use super::disagreement::Disagreement;
use super::fitted::{Fitted, Residual, unexplained_motion};
use super::force_noise::{ForceNoise, ForceNoiseSource};
use super::keywords::Domain;
use super::left_out::LineRule;
use super::lines::LineChoice;
use super::options::OpenNoise;
use super::prediction::Prediction;
use super::quantity::{other_quantity, quantity_of_failed_search};
use super::remarks::{noise_remark, one_motion_of};
use super::sinusoids::SinusoidRow;
use super::spectra::LIKELIHOOD_PARAMETERS;
use crate::AnalysisError;
use crate::hits::HitNoise;
use crate::limits::CAUSE_OPERATIONS;
use crate::measurement::{Block, Windowed};

/// Significance level of the test for transients; a record of whole periods is mistaken for an open
/// record with this probability.
const LEVEL: f64 = 1e-3;
/// Ratio of transient power to force power that counts as rounding; a larger ratio shows a
/// transient.
const ROUNDING: f64 = 1e-20;

/// Maximum number of changes of the noise of the forces.
const FORCE_NOISE_ROUNDS: usize = 8;
/// Relative change of the variance of the noise of the forces that ends the changes.
const FORCE_NOISE_SETTLED: f64 = 0.05;

/// Maximum number of lines for which a record without settings is tried as an open record. As an
/// example of the time: a fit with two forces takes ten seconds on one processor if its product of
/// lines and parameters is an eighth of [`SENSITIVITIES`].
const LINES: usize = 1 << 19;
/// Maximum product of lines and unknown parameters for which a record without settings is tried as
/// an open record.
const SENSITIVITIES: usize = 100 << 17;

/// Ratio of sampling rate to the highest frequency that an anti-aliasing filter passes: the upper
/// end of the band of an open record if no band is given.
///
/// # Source
/// The custom of analysers; the aliases of the transient grow above this frequency.
const RATE_OVER_BAND: f64 = 2.56;

/// Force of open records.
#[derive(Debug, Clone, Copy)]
pub(super) enum Excitation<'a> {
    /// Force during the whole record; the test for nonlinearity uses powers of the response.
    Lasting,
    /// A hit in each record, with the noise of its force.
    Hits(&'a [HitNoise]),
}

/// Settings of a fit of open records.
#[derive(Debug, Clone, Copy)]
pub(super) struct How<'a> {
    /// Lines to fit.
    pub(super) rule: LineRule<'a>,
    pub(super) noise: &'a OpenNoise,
    pub(super) acquisition: &'a Acquisition,
    pub(super) excitation: Excitation<'a>,
}

/// Fit of open records.
pub(super) struct OpenFit {
    pub(super) fitted: Fitted,
    /// `true` if the fit shows a transient at the ends of the records, or that the responses are
    /// those of another quantity than stated: then a fit of whole periods is not needed.
    pub(super) decides: bool,
}

/// Returns whether the records are short enough to be tried as open records.
pub(super) fn suit(records: &[Windowed], unknowns: &Unknowns) -> bool {
    let whole = records.iter().all(|record| record.held.held_to().is_none());
    let lines: usize = records.iter().map(|record| record.held.force.len() / 2).sum();
    let parameters = unknowns.free().len();
    let is_short = lines <= LINES && lines.saturating_mul(parameters) <= SENSITIVITIES;
    whole && is_short && unknowns.independent() <= LIKELIHOOD_PARAMETERS
}

/// Spectra of open records, with the noise of their forces.
struct OpenSpectra {
    data: Vec<FrequencyData>,
    lines: Vec<Lines>,
    force_noise: Vec<ForceNoise>,
}

impl OpenSpectra {
    fn read(
        records: &[Windowed],
        How { rule, noise, acquisition, excitation }: How<'_>,
    ) -> Result<Self, AnalysisError> {
        let force = noise.force.as_deref();
        let (mut spectra, mut of_force) = (Vec::new(), Vec::new());
        for (at, Windowed { held, .. }) in records.iter().enumerate() {
            let lines = Lines::new(held.force.sampling(), band(held, rule)?)?;
            let (motion, kind) = held.response();
            let hit = match excitation {
                Excitation::Lasting => None,
                Excitation::Hits(noise) => noise.get(at),
            };
            let force_noise = ForceNoise::from_record(held, &held.driven, force, hit)?;
            let data = FrequencyData::read(&lines, &held.force, motion, kind)?
                .as_open_record(held.force.sampling());
            let data = acquisition.uncoupled(force_noise.known_to(data, held)?, held)?;
            of_force.push(force_noise);
            spectra.push((data, lines));
        }
        let (data, lines) = spectra.into_iter().unzip();
        Ok(Self { data, lines, force_noise: of_force })
    }

    /// Estimates the noise level of the forces from the residual: one fraction of the RMS for all
    /// forces. Returns the last fit; it is the given fit if the residual shows no noise of the
    /// forces or the search fails.
    fn with_unknown_force_noise(
        &mut self,
        records: &[Windowed],
        mut fit: OutputErrorFit,
        unknowns: &Unknowns,
        noise: &OpenNoise,
    ) -> Result<OutputErrorFit, AnalysisError> {
        let whole = joined(&self.with_force_noise(records, 1.0)?.0)?;
        let mut last = 0.0;
        for _ in 0..FORCE_NOISE_ROUNDS {
            let joint = whole.without_sinusoids(&fit.sinusoids);
            let Some(ratio) = force_noise_of_residual(&joint, unknowns, &fit) else { break };
            let (data, force_noise) = self.with_force_noise(records, ratio.sqrt())?;
            let Ok(next) = output_error_from(&joined(&data)?, unknowns, &fit, noise.response)
            else {
                break;
            };
            if time_limit::is_over() {
                break;
            }
            (fit, self.data, self.force_noise) = (next, data, force_noise);
            if (ratio - last).abs() <= FORCE_NOISE_SETTLED * ratio {
                break;
            }
            last = ratio;
        }
        Ok(fit)
    }

    /// Returns the data with noise of the forces, whose level is this fraction of the RMS of each
    /// force, and this noise.
    fn with_force_noise(
        &self,
        records: &[Windowed],
        fraction: f64,
    ) -> Result<(Vec<FrequencyData>, Vec<ForceNoise>), AnalysisError> {
        let noisy = |((record, data), noise): ((&Windowed, &FrequencyData), &ForceNoise)| {
            let noise = noise.with_fraction(fraction);
            Ok((noise.known_to(data.clone(), &record.held)?, noise))
        };
        records.iter().zip(&self.data).zip(&self.force_noise).map(noisy).collect()
    }

    /// Reduces the noise level of the forces if it was estimated above the driven band in every
    /// record. This estimate is too high if, for example, a force has a signal above the band. The
    /// reductions end when the residual of the fit no longer shows a lower noise level. The machine
    /// is fitted again after each reduction. If no record shows a level above the driven band, the
    /// residual gives the level. Returns the last fit.
    fn with_likely_force_noise(
        &mut self,
        records: &[Windowed],
        mut fit: OutputErrorFit,
        unknowns: &Unknowns,
        noise: &OpenNoise,
    ) -> Result<OutputErrorFit, AnalysisError> {
        if self.force_noise.iter().all(ForceNoise::is_unknown) {
            return self.with_unknown_force_noise(records, fit, unknowns, noise);
        }
        let is_above_band = |noise: &ForceNoise| noise.source == ForceNoiseSource::AboveBand;
        if !self.force_noise.iter().all(is_above_band) {
            return Ok(fit);
        }
        for _ in 0..FORCE_NOISE_ROUNDS {
            let joint = joined(&self.data)?.without_sinusoids(&fit.sinusoids);
            let Some(factor) = force_noise_factor(&joint, unknowns, &fit) else { break };
            let reduced: Vec<FrequencyData> =
                self.data.iter().map(|data| data.with_reduced_force_noise(factor)).collect();
            // The noise of the last fit remains if the search fails.
            let Ok(next) = output_error_from(&joined(&reduced)?, unknowns, &fit, noise.response)
            else {
                break;
            };
            // If the time limit ended the fit, its noise estimate may be incomplete; the previous
            // fit is returned.
            if time_limit::is_over() {
                break;
            }
            (fit, self.data) = (next, reduced);
            self.force_noise.iter_mut().for_each(|noise| noise.reduce(factor.sqrt()));
        }
        Ok(fit)
    }

    /// Subtracts the estimated sinusoids.
    fn without_sinusoids(&mut self, fit: &OutputErrorFit) {
        if fit.sinusoids.is_empty() {
            return;
        }
        let pairs = self.data.iter().zip(&fit.sinusoids);
        self.data = pairs
            .map(|(data, sinusoids)| data.without_sinusoids(std::slice::from_ref(sinusoids)))
            .collect();
    }
}

/// Fits all lines of the excited band by maximum likelihood, together with the transient of every
/// record.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: How<'_>,
) -> Result<OpenFit, AnalysisError> {
    let How { noise, acquisition, excitation, .. } = how;
    let mut spectra = OpenSpectra::read(records, how)?;
    let dt = records[0].held.force.sampling().dt();
    let joint = joined(&spectra.data)?;
    let fit = output_error_pooling(&joint, unknowns, noise.response)
        .map_err(|error| with_cause(error, &spectra.data, dt, unknowns, noise.response))?;
    let fit = spectra.with_likely_force_noise(records, fit, unknowns, noise)?;
    let (fit, data) = acquisition.refitted(fit, &spectra.data, dt, unknowns, noise.response)?;
    spectra.data = data;
    spectra.without_sinusoids(&fit);
    let OpenSpectra { data: with_pulses, lines, force_noise } = spectra;
    let data = fit.without_pulse_errors(&with_pulses)?;
    let (closed, alone) = without_transients(&fit, &data)?;
    let AfterSpectralFit { records: residuals, bias } =
        after_spectral_fit(&closed, &fit.estimate, Extent::Open)?;
    let tested =
        Tested { records: &with_pulses, closed: &closed, fit: &fit, residuals: &residuals };
    // The comparisons count no operations, but `join` leaves half of them to each of both parts.
    let (better_explanation, compared) = time_limit::apart(2.0 * CAUSE_OPERATIONS, || {
        time_limit::join(
            || tested.cause(dt, unknowns, noise.response, excitation),
            || agreement(&data, &fit, &residuals, excitation),
        )
    });
    let (better_explanation, explained) = better_explanation?.unzip();
    let names_quantity = better_explanation.as_ref().is_some_and(is_of_quantity);
    let Compared { parts, omitted } =
        compared?.without_unlikely_term(better_explanation.as_ref().map(remaining));
    let sinusoids = sinusoid_rows(records, &fit);
    let joint = joined(&closed)?;
    let between = acquisition.between_samples.unwrap_or(Discretisation::FirstOrderHold);
    let prediction = Prediction::Sampled { discretisation: between, extent: Extent::Open };
    let fitted = Fitted {
        equations: 2 * joint.len(),
        before_all: before_spectral_fit(&joint, unknowns)?,
        before: vec![Vec::new(); records.len()],
        after: after(records, &lines, &closed, &fit.estimate, excitation)?,
        frequency: lines.into_iter().next().map(|lines| (lines, joint)),
        after_all: bias.into_iter().chain(better_explanation).chain(parts).collect(),
        disagreement: Disagreement::new(omitted, explained.flatten()),
        residuals: Residual::from_lines(residuals),
        remarks: remarks(records, &fit, &force_noise, &sinusoids, excitation),
        noise: fit.noise,
        force_noise,
        sinusoids,
        drawn: Some(joined(&alone)?),
        ..Fitted::new(
            Domain::Frequency,
            "maximum likelihood on open records, in the frequency domain",
            prediction,
            fit.estimate,
        )
    };
    Ok(OpenFit { fitted, decides: names_quantity || fit.ends.as_ref().is_some_and(show) })
}

/// Returns two sets of data. The first set is without the transients of forces and responses. The
/// second set has the measured forces, and only the responses to these forces.
fn without_transients(
    fit: &OutputErrorFit,
    data: &[FrequencyData],
) -> Result<(Vec<FrequencyData>, Vec<FrequencyData>), AnalysisError> {
    let Some(ends) = &fit.ends else { return Ok((data.to_vec(), data.to_vec())) };
    let alone = ends.without_transient_responses(data, &fit.estimate.system()?)?;
    Ok((ends.without_transients(data)?, alone))
}

/// Returns the sinusoids of all records.
fn sinusoid_rows(records: &[Windowed], fit: &OutputErrorFit) -> Vec<SinusoidRow> {
    let pairs = records.iter().zip(&fit.sinusoids).enumerate();
    pairs.flat_map(|(at, (record, found))| SinusoidRow::all(at, &record.held, found)).collect()
}

/// Compares the records and the bands of lines with each other, and the fit with larger models.
/// Makes no comparison if a residual is only rounding. A single record under a lasting force is
/// divided into sections of time.
fn agreement(
    data: &[FrequencyData],
    fit: &OutputErrorFit,
    residuals: &[SpectralResidual],
    excitation: Excitation<'_>,
) -> Result<Compared, AnalysisError> {
    if residuals.iter().any(SpectralResidual::is_rounding) {
        return Ok(Compared::default());
    }
    let joint = joined(data)?;
    let parts = PartsOfFit::new(&joint, &fit.estimate, fit.ends.as_ref(), Some(&fit.spectrum));
    let first = match (data, excitation) {
        ([_], Excitation::Lasting) => Some(Split::Time),
        ([_], Excitation::Hits(_)) => None,
        _ => Some(Split::Rows(rows_of(data))),
    };
    let splits: Vec<(Split, RowParts)> =
        first.into_iter().chain([Split::Bands]).map(|split| (split, RowParts::Records)).collect();
    let sampled: Vec<SampledRows> = rows_of(data)
        .into_iter()
        .flatten()
        .zip(data)
        .filter_map(|(rows, data)| {
            Some(SampledRows { rows, sampling: data.open_record(0)?.sampling })
        })
        .collect();
    Ok(parts.map_or_else(Compared::default, |of| {
        Compared::new(&of, &splits, Some(&sampled), &fit.estimate)
    }))
}

/// Open records with their fit.
struct Tested<'a> {
    records: &'a [FrequencyData],
    /// The records after subtraction of their transients and of the estimated errors of their force
    /// pulses.
    closed: &'a [FrequencyData],
    fit: &'a OutputErrorFit,
    residuals: &'a [SpectralResidual],
}

/// Cause of a residual, and the outer product Δ Δᵀ of the vector Δ of the parameter changes by this
/// cause (parameters × parameters), in the product of the units of two parameters.
type CauseWithChange = (Finding, Option<DMatrix<f64>>);

/// Function that returns a record with changed channels.
type RecordChange = Box<dyn Fn(&FrequencyData) -> FrequencyData>;

impl Tested<'_> {
    /// Finds another quantity of the responses, a delay, or a fault of the acquisition that
    /// explains the residual. Also returns the outer product Δ Δᵀ of the vector Δ of the parameter
    /// changes by this cause, or `None` if a fit fails.
    ///
    /// # Source
    /// Schwarz (1978), Annals of Statistics 6, 461–464, for the choice.
    fn cause(
        &self,
        dt: f64,
        unknowns: &Unknowns,
        pooling: Pooling,
        excitation: Excitation<'_>,
    ) -> Result<Option<CauseWithChange>, AnalysisError> {
        let Self { records, closed, fit, residuals } = *self;
        let joint = joined(closed)?;
        let system = fit.estimate.system().ok();
        let unexplained = system.and_then(|system| unexplained_motion(&joint, &system).ok()?);
        let quantity = if !is_noise(residuals) || unexplained > Some(CONSPICUOUS) {
            let data = joined(&fit.without_pulse_errors(records)?)?;
            other_quantity(&data, &joint, &fit.estimate)
        } else {
            None
        };
        let band_limited = OnceLock::new();
        let compared = || {
            let new = || BandLimitedFit::new(records, fit, pooling);
            band_limited.get_or_init(new).as_ref()
        };
        let fault = self.fault(dt, excitation, compared)?;
        let without_fault = fault
            .as_ref()
            .and_then(|Explanation { finding, fit }| self.without(finding, fit.as_ref()?, dt));
        let without_fault = without_fault.as_ref();
        let delay = delay_of_open_records(records, dt, unknowns, fit, residuals, without_fault);
        let delay = delay.map(|finding| Explanation { finding, fit: None });
        // All explanations are fitted to all lines with the same noise.
        let refitted = |Explanation { finding, fit: explained }: Explanation| {
            let explained = explained.or_else(|| {
                let change = without_cause(&finding, closed[0].measured())?;
                Some(compared()?.after(change)?.0)
            });
            let refit = explained.and_then(|explained| {
                let changed = self.without(&finding, &explained, dt)?;
                with_noise_of(fit, &changed, unknowns, &explained).ok()
            });
            (finding, refit)
        };
        let causes = delay.into_iter().chain(fault).map(refitted);
        // A delay and a corner frequency are parameters more; a force between samples has none.
        let equations = (2 * joint.len() * joint.dof()) as f64;
        let criterion = |(finding, refit): &(Finding, Option<Refit>)| {
            let penalty = if between_samples(finding).is_some() { 0.0 } else { equations.ln() };
            refit.as_ref().map_or(f64::INFINITY, |refit| refit.cost + penalty)
        };
        let best = causes.min_by(|a, b| criterion(a).total_cmp(&criterion(b)));
        let square = |refit: Refit| &refit.change * refit.change.transpose();
        let best = best.map(|(finding, refit)| (finding, refit.map(square)));
        // Near a resonance, a delay may have a similar effect as another quantity.
        let causes = best.into_iter().chain(quantity.map(|finding| (finding, None)));
        Ok(causes.min_by(|(a, _), (b, _)| remaining(a).total_cmp(&remaining(b))))
    }

    /// Returns all lines of the records after the effect of a finding (delay, AC coupling or force
    /// between samples) is removed. `explained` is the fit whose estimate already includes this
    /// effect.
    fn without(
        &self,
        finding: &Finding,
        explained: &OutputErrorFit,
        dt: f64,
    ) -> Option<FrequencyData> {
        let Self { records, closed, fit, .. } = *self;
        let changed: Option<Vec<FrequencyData>> = match between_samples(finding) {
            Some(between) => {
                let system = explained.estimate.system().ok()?;
                let records = records.iter();
                records.map(|record| equivalent_force(record, &system, dt, between)).collect()
            }
            None => {
                let change = without_cause(finding, closed[0].measured())?;
                Some(records.iter().map(change).collect())
            }
        };
        joined(&fit.without_pulse_errors(&changed?).ok()?).ok()
    }

    /// Finds the cause that explains the residual: an assumption on the force between samples, or
    /// AC coupling.
    fn fault<'a>(
        &self,
        dt: f64,
        excitation: Excitation<'_>,
        compared: impl Fn() -> Option<&'a BandLimitedFit<'a>> + Sync,
    ) -> Result<Option<Explanation>, AnalysisError> {
        let Self { records, closed, fit, residuals } = *self;
        let coupling = || match excitation {
            Excitation::Hits(_) => Ok(fault_of_hits(records, closed, dt, fit, residuals)),
            Excitation::Lasting => {
                fault_of_acquisition(closed, residuals, dt, &fit.estimate, Extent::Open)
            }
        };
        let kinds = forces_between_samples(closed, dt, &fit.estimate, residuals);
        let (between, fault) = time_limit::join(
            || if kinds.is_empty() { None } else { compared()?.between_samples(&kinds, dt) },
            coupling,
        );
        let fault = fault?;
        let compared = if kinds.is_empty() { None } else { compared() };
        let Some(compared) = compared else {
            return Ok(fault.map(|finding| Explanation { finding, fit: None }));
        };
        let leaves_less = |fault: &Finding| {
            between.as_ref().is_none_or(|b| !b.leaves_noise || remaining(fault) < b.remaining)
        };
        // The fit may be at a wrong minimum, so each of the two possible causes needs a new search.
        // `compared.between_samples` made this search for the force between samples; this closure
        // makes it for AC coupling.
        let again = |finding: Finding| {
            let change = without_cause(&finding, closed[0].measured());
            match change.and_then(|change| compared.after(change)) {
                None => Explanation { finding, fit: None },
                Some((fit, remaining)) => {
                    let finding = with_remaining(finding, remaining);
                    Explanation { finding, fit: Some(fit) }
                }
            }
        };
        let fault = fault.filter(leaves_less).map(again);
        let fault = fault.filter(|fault| remaining(&fault.finding) < 1.0);
        let explains = |b: &BetweenSamples| b.leaves_noise || b.remaining < DELAY_REMAINING;
        let between = between.filter(explains);
        Ok(better_explanation(fault, between.map(BetweenSamples::explanation)))
    }
}

/// Returns the explanation that reduces the power of a residual most.
fn better_explanation(one: Option<Explanation>, other: Option<Explanation>) -> Option<Explanation> {
    let power = |of: &Explanation| remaining(&of.finding);
    one.into_iter().chain(other).min_by(|a, b| power(a).total_cmp(&power(b)))
}

/// Returns the fraction of the residual power that remains if the model includes the cause that a
/// finding names; 1 if the finding is neither a delay nor an alternative model.
pub(super) fn remaining(finding: &Finding) -> f64 {
    match finding {
        Finding::Delay(delay) => delay.remaining,
        Finding::Alternative(alternative) => alternative.remaining,
        _ => 1.0,
    }
}

/// Returns the finding with the fraction of the residual power that remains after a new search.
fn with_remaining(finding: Finding, remaining: f64) -> Finding {
    match finding {
        Finding::Alternative(alternative) => {
            Finding::Alternative(Alternative { remaining, ..alternative })
        }
        finding => finding,
    }
}

/// Returns the kind of force between samples that a finding names.
fn between_samples(finding: &Finding) -> Option<Discretisation> {
    match finding {
        Finding::Alternative(Alternative {
            cause: Cause::BetweenSamples { between_samples },
            ..
        }) => Some(*between_samples),
        _ => None,
    }
}

/// Returns a function that removes the effect of a delay or of AC coupling from a record with
/// responses of the given `quantity`. If the responses are delayed, the function delays the forces
/// by the same time. If some channels are AC coupled, it gives all channels the same AC coupling.
/// `None` if the finding is neither of these two.
fn without_cause(finding: &Finding, quantity: ResponseQuantity) -> Option<RecordChange> {
    let cause = match finding {
        Finding::Delay(delay) => &Cause::Delay { seconds: delay.seconds },
        Finding::Alternative(alternative) => &alternative.cause,
        _ => return None,
    };
    match cause {
        Cause::Delay { seconds } => {
            let seconds = *seconds;
            Some(Box::new(move |data| data.with_later_force(seconds)))
        }
        Cause::AcCoupling { channels, corner_hz } => {
            let of = |wanted: Quantity| -> Vec<usize> {
                let channels = channels.iter().filter(|channel| channel.quantity == wanted);
                channels.map(|channel| channel.index).collect()
            };
            let (responses, forces) = (of(Quantity::Response(quantity)), of(Quantity::Force));
            let corner = TAU * corner_hz;
            Some(Box::new(move |data| data.with_high_pass_alike(&responses, &forces, corner)))
        }
        _ => None,
    }
}

/// Returns the failure of a search. If the responses are those of another quantity, or if they are
/// delayed, this is added as a reason.
fn with_cause(
    error: EstimateError,
    records: &[FrequencyData],
    dt: f64,
    unknowns: &Unknowns,
    noise: Pooling,
) -> AnalysisError {
    if !matches!(error, EstimateError::NotConverged { .. }) && time_limit::ended().is_none() {
        return error.into();
    }
    let share = 0.5 * CAUSE_OPERATIONS;
    let delay = || delay_of_failed_search(records, dt, unknowns, noise);
    let delay = time_limit::apart(share, delay);
    let data = joined(records).ok();
    let quantity = || quantity_of_failed_search(data.as_ref()?, unknowns);
    let quantity = time_limit::apart(share, quantity);
    // Near a resonance, a delay may have a similar effect as another quantity.
    let causes = delay.into_iter().chain(quantity);
    let cause = causes.min_by(|a, b| remaining(a).total_cmp(&remaining(b)));
    let cause = cause.map(|cause| match cause {
        Finding::Delay(_) => format!("{cause}; the search without that delay succeeds"),
        _ => cause.to_string(),
    });
    let cause = cause.or_else(|| Some(delay_of_lines(&data?, dt, unknowns)?.to_string()));
    match cause {
        Some(reasons) => AnalysisError::Unfit { error, reasons },
        None => error.into(),
    }
}

/// Returns the findings on the band and the linearity of each record.
fn after(
    records: &[Windowed],
    lines: &[Lines],
    closed: &[FrequencyData],
    estimate: &Estimate,
    excitation: Excitation<'_>,
) -> Result<Vec<Vec<Finding>>, AnalysisError> {
    let mut after = Vec::new();
    for ((Windowed { held, .. }, lines), closed) in records.iter().zip(lines).zip(closed) {
        let mut checks = Vec::from_iter(fitted_band(estimate, lines)?);
        if matches!(excitation, Excitation::Lasting) {
            match linearity_of_open_record(estimate, &held.force, closed, lines) {
                // The displacement of a free machine cannot be computed, so there are no powers of
                // it to test.
                Err(EstimateError::Model(_)) => {}
                looked => checks.push(looked?),
            }
        }
        after.push(checks);
    }
    Ok(after)
}

fn remarks(
    records: &[Windowed],
    fit: &OutputErrorFit,
    force_noise: &[ForceNoise],
    sinusoids: &[SinusoidRow],
    excitation: Excitation<'_>,
) -> Vec<String> {
    let windows = match excitation {
        Excitation::Lasting => "the windows are not whole periods",
        Excitation::Hits(_) => "hits are not periods",
    };
    let of_ends = format!(
        "{windows}: their transients were estimated together with the system, on all lines of the band"
    );
    let is_noisy =
        force_noise.iter().any(|noise| noise.levels_n.iter().flatten().any(|n| *n > 0.0));
    let are_apart = matches!(excitation, Excitation::Hits(_)) && is_noisy;
    let of_pulses = (are_apart && fit.pulse_amplitudes.is_empty()).then(|| {
        "the noise of the force was taken as independent from line to line, because the pulses could not be fitted \
         (there may be too many): this noise may cause warnings of the checks of the residual"
            .into()
    });
    one_motion_of(&records[0].held)
        .into_iter()
        .chain(of_pulses)
        .chain([of_ends, noise_remark(1, false, &fit.noise), ForceNoise::remark(force_noise)])
        .chain(SinusoidRow::remark(sinusoids))
        .collect()
}

fn is_of_quantity(finding: &Finding) -> bool {
    let cause =
        |alternative: &Alternative| matches!(alternative.cause, Cause::RecordedQuantity { .. });
    matches!(finding, Finding::Alternative(alternative) if cause(alternative))
}

fn show(ends: &EndLoads) -> bool {
    ends.p_value() < LEVEL && ends.share > ROUNDING
}

/// Returns the lines to fit. Unless single lines are given, these are all lines from the first to
/// the last line that the rule chooses, because transients appear as differences between
/// neighbouring lines.
fn band(held: &Block, rule: LineRule<'_>) -> Result<Vec<usize>, AnalysisError> {
    let chosen = rule.lines(&held.force, held.force.len())?;
    let (Some(&first), Some(&last)) = (chosen.first(), chosen.last()) else { return Ok(chosen) };
    let last = match rule.choice {
        LineChoice::Lines(_) => return Ok(chosen),
        LineChoice::Band(_) => last,
        LineChoice::Driven => {
            last.min((held.force.len() as f64 / RATE_OVER_BAND) as usize).max(first)
        }
    };
    rule.without.keep((first..=last).collect(), held.force.sampling())
}

/// Returns the rows of all records.
pub(super) fn joined(records: &[FrequencyData]) -> Result<FrequencyData, AnalysisError> {
    let mut joint = records[0].clone();
    for record in &records[1..] {
        joint = joint.and(record)?;
    }
    Ok(joint)
}
