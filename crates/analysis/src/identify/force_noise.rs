//! Noise of the forces of a record without repeated periods.

use std::ops::Range;

use mechid_signal::noise_above_band;
use mechid_spectra::FrequencyData;
use mechid_spectra::noise::pulse::PulseNoise;
use serde::Serialize;

use crate::AnalysisError;
use crate::hits::HitNoise;
use crate::measurement::Block;
use crate::text::significant;

/// Smallest ratio of noise to force (RMS) that counts as noise; below it the noise changes no
/// parameter.
const ROUNDING: f64 = 1e-5;

/// Noise of the forces of one record, as used by a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ForceNoise {
    /// Standard deviation of the noise on the samples of each force, one per degree of freedom, in
    /// N; `None` if it is unknown and assumed zero.
    pub levels_n: Vec<Option<f64>>,
    /// Source of the levels.
    pub source: ForceNoiseSource,
    /// RMS of each force about its mean, in N; `None` for a force that does not act.
    #[serde(skip)]
    rms: Vec<Option<f64>>,
    /// Samples of the pulses of hits, counted from 0; only these contain the force noise.
    #[serde(skip)]
    pulses: Option<Vec<Range<usize>>>,
}

/// Source of the noise level of a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceNoiseSource {
    /// A setting.
    Stated,
    /// Lines above the band that the force drives.
    AboveBand,
    /// Samples between the hits of a hammer.
    BetweenHits,
    /// Residual of the fit: the lines above the driven band show no level, or a higher one than the
    /// residual.
    Residual,
}

impl ForceNoise {
    /// Returns the noise of a record in which the forces on `driven` act: the `stated` level if
    /// given, otherwise estimated between the hits or above the band.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if the number of stated levels is neither 1 nor the number of
    /// forces.
    pub(crate) fn from_record(
        held: &Block,
        driven: &[usize],
        stated: Option<&[f64]>,
        hit: Option<&HitNoise>,
    ) -> Result<Self, AnalysisError> {
        let pulses = hit.map(|hit| hit.pulses.clone());
        let forces = held.force.channels();
        let rms_of = |force: usize| held.force.column(force).variance().sqrt();
        let acting = |force: usize| driven.contains(&force);
        let rms = (0..forces)
            .map(|force| acting(force).then(|| rms_of(force).max(f64::MIN_POSITIVE)))
            .collect();
        let if_acting = |level: &dyn Fn(usize) -> f64| -> Vec<Option<f64>> {
            (0..forces).map(|force| Some(if acting(force) { level(force) } else { 0.0 })).collect()
        };
        let (levels_n, source) = if let Some(stated) = stated {
            check_stated(stated, forces)?;
            let level = |force: usize| stated[if stated.len() == 1 { 0 } else { force }];
            (if_acting(&level), ForceNoiseSource::Stated)
        } else if let Some(hit) = hit {
            (if_acting(&|_| hit.deviation), ForceNoiseSource::BetweenHits)
        } else {
            let mut levels_n = noise_above_band(&held.force)?;
            for (force, level) in levels_n.iter_mut().enumerate() {
                if level.is_some_and(|level| level <= ROUNDING * rms_of(force)) {
                    *level = Some(0.0);
                }
            }
            (levels_n, ForceNoiseSource::AboveBand)
        };
        Ok(Self { levels_n, source, rms, pulses })
    }

    /// Returns whether the level of every acting force is unknown.
    pub(super) fn is_unknown(&self) -> bool {
        let mut acting = self.levels_n.iter().zip(&self.rms).filter(|(_, rms)| rms.is_some());
        self.pulses.is_none() && acting.all(|(level, _)| level.is_none())
    }

    /// Returns the same noise with levels of this fraction of the RMS of each force, which follows
    /// from the residual of a fit.
    pub(super) fn with_fraction(&self, fraction: f64) -> Self {
        let levels = self.rms.iter().map(|rms| Some(fraction * rms.unwrap_or(0.0)));
        Self { levels_n: levels.collect(), source: ForceNoiseSource::Residual, ..self.clone() }
    }

    /// Multiplies the levels by a factor that follows from the residual of a fit.
    pub(super) fn reduce(&mut self, factor: f64) {
        if self.levels_n.iter().flatten().any(|level| *level > 0.0) {
            self.levels_n.iter_mut().flatten().for_each(|level| *level *= factor);
            self.source = ForceNoiseSource::Residual;
        }
    }

    /// Returns the standard deviation of the noise of a force, in N; 0 if it is not known.
    pub(crate) fn level(&self, force: usize) -> f64 {
        self.levels_n[force].unwrap_or(0.0)
    }

    /// Returns the samples of the pulses of hits; `None` for a record of another kind.
    pub(crate) fn pulses(&self) -> Option<&[Range<usize>]> {
        self.pulses.as_deref()
    }

    /// Returns the data of a record with this noise of its forces included.
    pub(super) fn known_to(
        &self,
        data: FrequencyData,
        held: &Block,
    ) -> Result<FrequencyData, AnalysisError> {
        let levels: Vec<f64> = (0..self.levels_n.len()).map(|force| self.level(force)).collect();
        let sampling = held.force.sampling();
        Ok(match (self.pulses(), &held.driven[..]) {
            (Some(pulses), &[channel]) => {
                let (deviation, rows) = (levels[channel], data.len());
                let noise = pulses.iter().map(|samples| PulseNoise {
                    rows: 0..rows,
                    sampling,
                    channel,
                    deviation,
                    samples: samples.clone(),
                });
                data.with_pulse_noise(&noise.collect::<Vec<_>>())?
            }
            _ => data.with_force_noise(&levels, sampling.len())?,
        })
    }

    /// Returns the remark on the noise of all records.
    pub(crate) fn remark(records: &[Self]) -> String {
        let acting = |noise: &Self| -> Vec<(Option<f64>, f64)> {
            let forces = noise.levels_n.iter().zip(&noise.rms);
            forces.filter_map(|(level, rms)| Some((*level, (*rms)?))).collect()
        };
        let levels_and_rms: Vec<(Option<f64>, f64)> = records.iter().flat_map(acting).collect();
        let source = records.first().map(|noise| noise.source);
        let Some(levels) =
            levels_and_rms.iter().map(|(level, _)| *level).collect::<Option<Vec<f64>>>()
        else {
            return "the noise of the force is not known: the force spectrum has no flat floor above the excited band (it covers all lines or falls slowly, or the record is too short). The noise is assumed zero; if it is not, it biases the estimate: state it (`force_noise`)"
                .into();
        };
        let of = match source {
            Some(ForceNoiseSource::Stated) => "as stated",
            Some(ForceNoiseSource::BetweenHits) => "estimated between the hits",
            Some(ForceNoiseSource::Residual) => "estimated from the residual of the fit",
            Some(ForceNoiseSource::AboveBand) | None => "estimated above the excited band",
        };
        let low = levels.iter().copied().fold(f64::INFINITY, f64::min);
        let high = levels.iter().copied().fold(0.0, f64::max);
        if high == 0.0 {
            return match source {
                Some(ForceNoiseSource::Stated) => "the force was assumed exact, as stated".into(),
                Some(ForceNoiseSource::Residual) => {
                    "the force was assumed exact: the residual of the fit shows that the noise of the force is less than the level above the excited band"
                        .into()
                }
                _ => "the force shows no noise and was assumed exact".into(),
            };
        }
        let range = if significant(low, 3) == significant(high, 3) {
            significant(high, 3)
        } else {
            format!("{} to {}", significant(low, 3), significant(high, 3))
        };
        let parts = levels_and_rms.iter().filter_map(|(level, rms)| Some(100.0 * (*level)? / rms));
        let part = significant(parts.fold(0.0, f64::max), 2);
        let most = if levels.len() > 1 { "at most " } else { "" };
        format!("noise of the force: {range} N, {of} ({most}{part} % of the RMS force)")
    }
}

/// Checks stated levels of `forces` forces.
fn check_stated(stated: &[f64], forces: usize) -> Result<(), AnalysisError> {
    let wrong = |why| AnalysisError::Setting { setting: "force_noise", why };
    if let Some(value) = stated.iter().find(|value| !(**value >= 0.0 && value.is_finite())) {
        return Err(wrong(format!("a standard deviation is zero or positive, got {value}")));
    }
    if stated.len() != 1 && stated.len() != forces {
        let got = stated.len();
        return Err(wrong(format!(
            "give one level, or one for each of {forces} forces, not {got}"
        )));
    }
    Ok(())
}
