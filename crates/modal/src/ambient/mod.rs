//! Modes from responses alone, for structures that are excited by wind, traffic or their machinery.
//!
//! A subspace method ([`ssi_cov`]) gives initial poles and shapes. The unknowns are the poles, the
//! shapes, correlated white forces on the modes and smooth sensor noise. Their estimates first
//! maximise Whittle's likelihood with the expected periodogram, then a likelihood in which the
//! transient of the open record is a random effect. No window, no averaging and no choice of a
//! model order are needed.

mod bias;
mod error;
pub mod harmonics;
mod information;
mod initial;
mod likelihood;
mod limits;
mod lines;
mod misfit;
mod noise_order;
mod order;
mod parameters;
mod prepare;
mod result;
mod search;
mod shape_basis;
mod spectrum;
mod subspace;
mod transient;

#[cfg(test)]
mod tests;

pub use error::AmbientError;
pub use harmonics::Harmonic;
pub use limits::MIN_DECAY_TIMES;
pub use misfit::SpectrumMisfit;
pub use result::{
    AmbientEstimate, AmbientMode, DropReason, DroppedCandidate, ModalValue, Uncertainty,
};
pub use subspace::ssi_cov;

use std::f64::consts::TAU;

use mechid_signal::Record;
use nalgebra::DVector;

use limits::{DEFAULT_MAX_MODES, MAX_DAMPING, MIN_SHARE, POOLING};
use lines::BandLines;
use order::{Chosen, Wanted, choose};
use prepare::{band_lines, checked_band, subspace_models};
use result::{FittedSpectrum, RecordScale, Statistics};
use search::{Effort, Fit, search_pooled};
use transient::{FitWithTransient, search_with_transient};

use crate::stabilisation::Pole;

/// Settings of the identification from responses alone.
#[derive(Debug, Clone, PartialEq)]
pub struct AmbientSettings {
    /// Band, in Hz; by default from the fourth line to 80 % of half the sampling rate.
    pub band_hz: Option<[f64; 2]>,
    /// Number of modes; by default the likelihood decides.
    pub modes: Option<usize>,
    /// Largest number of modes if the likelihood decides.
    pub max_modes: usize,
    /// Frequencies of sinusoids to exclude, in Hz.
    pub without_hz: Vec<f64>,
    /// If true, harmonics detected in the record are excluded, too.
    pub exclude_harmonics: bool,
}

impl Default for AmbientSettings {
    fn default() -> Self {
        Self {
            band_hz: None,
            modes: None,
            max_modes: DEFAULT_MAX_MODES,
            without_hz: Vec::new(),
            exclude_harmonics: false,
        }
    }
}

/// Identifies the modes of a structure from its responses (samples × sensors, displacements,
/// velocities or accelerations, in any units) to unmeasured forces that are white over the band.
///
/// # Errors
/// [`AmbientError::ConstantChannel`], [`AmbientError::DeadChannel`],
/// [`AmbientError::CopiedChannel`], [`AmbientError::Band`], [`AmbientError::TooFewLines`],
/// [`AmbientError::TooShort`], [`AmbientError::NoModesAsked`], [`AmbientError::NoMode`],
/// [`AmbientError::FewerModes`], [`AmbientError::Numerics`].
///
/// # Source
/// Whittle (1953), Arkiv för Matematik 2, 423–434; Sykulski et al. (2019), Biometrika 106, 251–266
/// (expected periodogram in Whittle's likelihood); Au (2017), *Operational Modal Analysis*; Peeters
/// & De Roeck (1999), Mechanical Systems and Signal Processing 13, 855–878 (initial estimates).
pub fn identify_ambient(
    record: &Record,
    settings: &AmbientSettings,
) -> Result<AmbientEstimate, AmbientError> {
    if settings.modes == Some(0) || settings.max_modes == 0 {
        return Err(AmbientError::NoModesAsked);
    }
    let band_hz = checked_band(record, settings.band_hz)?;
    let sinusoids = harmonics::harmonics(record, band_hz)?;
    let mut excluded_hz = settings.without_hz.clone();
    if settings.exclude_harmonics {
        excluded_hz.extend(sinusoids.iter().map(|harmonic| harmonic.frequency_hz));
    }
    let record = harmonics::subtracted(record, &excluded_hz)?;
    let band = band_lines(&record, band_hz, &excluded_hz)?;
    let most = settings.modes.unwrap_or(settings.max_modes);
    let stabilisation = subspace_models(&record, band_hz, &band.scale, most)?;
    let candidates = candidates(&stabilisation.clusters(MAX_DAMPING, MIN_SHARE), band_hz);
    let requested = Wanted { exactly: settings.modes, most: settings.max_modes };
    let (chosen, dropped) = choose(&candidates, &band, requested);
    let [from_hz, to_hz] = band_hz;
    let none = AmbientError::NoMode { candidates: dropped.len(), from_hz, to_hz };
    let Chosen { fitted, accepted } = chosen.ok_or(none)?;
    let identified = accepted.len();
    if let Some(asked) = settings.modes.filter(|asked| *asked > identified) {
        return Err(AmbientError::FewerModes { asked, found: identified, from_hz, to_hz });
    }
    let modes = fitted_modes(&fitted, &band, &accepted, &sinusoids)?;
    // The leakage of a record that is too short for intervals is not known well enough to test the
    // fitted spectrum.
    let is_long = modes.iter().all(AmbientMode::has_interval);
    let misfit = if is_long { fitted.misfit() } else { None };
    let parameters = fitted.fit.parameters;
    let factor = parameters.factor().select_rows(&accepted);
    Ok(AmbientEstimate {
        modes,
        harmonics: sinusoids,
        dropped,
        stabilisation,
        band_hz,
        lines: band.omega.len(),
        log_likelihood: -fitted.cost,
        misfit,
        force_correlation: &factor * factor.transpose(),
        spectrum: FittedSpectrum { parameters, scale: band.scale, accepted, excluded_hz },
    })
}

impl AmbientEstimate {
    /// Fits the spectrum again to `record`, a part of the original record, and returns the modes of
    /// this part.
    pub(crate) fn refitted(&self, record: &Record) -> Result<Vec<AmbientMode>, AmbientError> {
        let FittedSpectrum { parameters, scale, accepted, excluded_hz } = &self.spectrum;
        let record = harmonics::subtracted(record, excluded_hz)?;
        let band = band_lines(&record, self.band_hz, excluded_hz)?;
        let start = parameters.with_units(scale, &band.scale);
        let size = start.layout.len();
        let failed = AmbientError::Numerics { what: "the spectrum of a part", size };
        let fitted = search_pooled(start, &band, Effort::FULL)
            .and_then(|fit| search_with_transient(fit, &band))
            .ok_or(failed)?;
        fitted_modes(&fitted, &band, accepted, &[])
    }
}

/// Returns the poles of the clusters in the band; clusters that appear in more model orders come
/// first.
fn candidates(clusters: &[crate::stabilisation::PoleCluster], band_hz: [f64; 2]) -> Vec<Pole> {
    let inside = |pole: &Pole| {
        let frequency_hz = pole.natural_frequency_hz();
        frequency_hz > band_hz[0] && frequency_hz < band_hz[1]
    };
    let mut clusters: Vec<_> = clusters.iter().filter(|c| inside(&c.pole)).collect();
    clusters.sort_by(|a, b| b.share.total_cmp(&a.share));
    clusters.into_iter().map(|cluster| cluster.pole.clone()).collect()
}

fn fitted_modes(
    fitted: &FitWithTransient,
    band: &BandLines,
    accepted: &[usize],
    sinusoids: &[Harmonic],
) -> Result<Vec<AmbientMode>, AmbientError> {
    let FitWithTransient { fit, lines, .. } = fitted;
    let pooled = lines.pooled(&fit.poles(), POOLING, fit.parameters.layout.noise_terms);
    let size = fit.parameters.layout.len();
    let failed = AmbientError::Numerics { what: "the covariance of the modes", size };
    let covariance = fit.covariance().ok_or(failed)?;
    // A bias that cannot be computed is not subtracted.
    let bias = fit.bias(&pooled, band.span).unwrap_or_else(|| DVector::zeros(size));
    let statistics = Statistics { covariance: &covariance, bias: &bias };
    let scale = RecordScale { span: band.span, scale: &band.scale };
    ambient_modes(fit, statistics, accepted, scale, sinusoids)
}

fn ambient_modes(
    fit: &Fit,
    statistics: Statistics<'_>,
    accepted: &[usize],
    scale: RecordScale<'_>,
    sinusoids: &[Harmonic],
) -> Result<Vec<AmbientMode>, AmbientError> {
    let failed =
        AmbientError::Numerics { what: "the shape of a mode", size: fit.parameters.layout.len() };
    let spacing_hz = 1.0 / scale.span.duration;
    let mut modes = Vec::with_capacity(accepted.len());
    for &mode in accepted {
        let mut one = AmbientMode::new(fit, statistics, mode, scale).ok_or(failed.clone())?;
        let frequency_hz = fit.poles()[mode].im / TAU;
        let width_hz = -fit.poles()[mode].re / TAU + spacing_hz;
        let at = |h: &Harmonic| (h.frequency_hz - frequency_hz).abs() < width_hz;
        one.harmonic = sinusoids.iter().position(at);
        modes.push(one);
    }
    Ok(modes)
}
