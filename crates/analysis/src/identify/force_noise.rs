//! Noise of the forces of a record without repeated periods.

use std::ops::Range;

use mechid_signal::noise_above_band;
use mechid_spectra::FrequencyData;
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
    /// Samples of the pulse of a hit, counted from 0; only these contain the force noise.
    #[serde(skip)]
    pulse: Option<Range<usize>>,
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
}

impl ForceNoise {
    /// Returns the noise of a record: the `stated` level if given, otherwise estimated between the
    /// hits or above the band.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] unless one level is stated for all forces, or one for each.
    pub(super) fn from_record(
        held: &Block,
        stated: Option<&[f64]>,
        hit: Option<&HitNoise>,
    ) -> Result<Self, AnalysisError> {
        let pulse = hit.map(|hit| hit.pulse.clone());
        let dofs = held.force.channels();
        if let Some(stated) = stated {
            let levels_n = Self::stated(held, stated)?;
            return Ok(Self { levels_n, source: ForceNoiseSource::Stated, pulse });
        }
        let driven = |dof: &usize| held.driven.contains(dof);
        if let Some(hit) = hit {
            let level = |dof: usize| Some(if driven(&dof) { hit.deviation } else { 0.0 });
            let levels_n = (0..dofs).map(level).collect();
            return Ok(Self { levels_n, source: ForceNoiseSource::BetweenHits, pulse });
        }
        let mut levels_n = noise_above_band(&held.force)?;
        for (dof, level) in levels_n.iter_mut().enumerate() {
            if level.is_some_and(|level| level <= ROUNDING * rms(held, dof)) {
                *level = Some(0.0);
            }
        }
        Ok(Self { levels_n, source: ForceNoiseSource::AboveBand, pulse })
    }

    fn stated(held: &Block, stated: &[f64]) -> Result<Vec<Option<f64>>, AnalysisError> {
        let dofs = held.force.channels();
        let wrong = |why| AnalysisError::Setting { setting: "force_noise", why };
        if let Some(value) = stated.iter().find(|value| !(**value >= 0.0 && value.is_finite())) {
            return Err(wrong(format!("a standard deviation is zero or positive, got {value}")));
        }
        if stated.len() != 1 && stated.len() != dofs {
            let got = stated.len();
            return Err(wrong(format!(
                "give one level, or one for each of {dofs} forces, not {got}"
            )));
        }
        let level = |dof: usize| {
            if !held.driven.contains(&dof) {
                return 0.0;
            }
            stated[if stated.len() == 1 { 0 } else { dof }]
        };
        Ok((0..dofs).map(|dof| Some(level(dof))).collect())
    }

    /// Returns the data of a record with this noise of its forces included.
    pub(super) fn known_to(
        &self,
        data: FrequencyData,
        held: &Block,
    ) -> Result<FrequencyData, AnalysisError> {
        let levels: Vec<f64> = self.levels_n.iter().map(|level| level.unwrap_or(0.0)).collect();
        let sampling = held.force.sampling();
        Ok(match (&self.pulse, &held.driven[..]) {
            (Some(pulse), [struck]) => {
                data.with_pulse_noise(*struck, levels[*struck], pulse.clone(), sampling)?
            }
            _ => data.with_force_noise(&levels, sampling.len())?,
        })
    }

    /// Returns the remark on the noise of all records.
    pub(super) fn remark(records: &[(&Block, &Self)]) -> String {
        let driven = |(held, noise): &(&Block, &Self)| -> Vec<(Option<f64>, f64)> {
            held.driven.iter().map(|dof| (noise.levels_n[*dof], rms(held, *dof))).collect()
        };
        let levels_and_rms: Vec<(Option<f64>, f64)> = records.iter().flat_map(driven).collect();
        let source = records.first().map(|(_, noise)| noise.source);
        let Some(levels) =
            levels_and_rms.iter().map(|(level, _)| *level).collect::<Option<Vec<f64>>>()
        else {
            return "the noise of the force is not known, because the force spectrum has no flat floor above the excited band (it covers all lines or falls slowly, or the record is too short): it is assumed zero, and any noise biases the estimate; state it (`force_noise`)"
                .into();
        };
        let of = match source {
            Some(ForceNoiseSource::Stated) => "as stated",
            Some(ForceNoiseSource::BetweenHits) => "as between the hits",
            Some(ForceNoiseSource::AboveBand) | None => "as above the excited band",
        };
        let low = levels.iter().copied().fold(f64::INFINITY, f64::min);
        let high = levels.iter().copied().fold(0.0, f64::max);
        if high == 0.0 {
            return match source {
                Some(ForceNoiseSource::Stated) => "the force was assumed exact, as stated".into(),
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

/// Returns the RMS of a force about its mean, in N.
fn rms(held: &Block, dof: usize) -> f64 {
    held.force.column(dof).variance().sqrt().max(f64::MIN_POSITIVE)
}
