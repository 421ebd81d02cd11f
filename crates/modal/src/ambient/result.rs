//! Modes of an ambient record with their uncertainty, harmonics and rejected candidates.

use nalgebra::{Complex, DMatrix, DVector};

use super::SpectrumMisfit;
use super::harmonics::Harmonic;
use super::limits::{MAX_BIAS, MIN_DECAY_TIMES};
use super::parameters::{Parameters, Span};
use super::search::Fit;
use crate::compare::{ComparedMode, Measured};
use crate::indicators::{Indicator, ShapeWithCovariance, mac_standard_errors, mpc_with_error};
use crate::stabilisation::Stabilisation;

/// Standard normal quantile of a two-sided interval of 95 %.
const QUANTILE: f64 = 1.959_963_984_540_054;

/// Uncertainty of a frequency or damping ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Uncertainty {
    /// Standard error and interval of 95 %, symmetric in the logarithm of the value.
    Known {
        /// Standard error, in the unit of the value.
        standard_error: f64,
        /// Lower and upper end of the interval, in the unit of the value.
        interval: [f64; 2],
    },
    /// The record is too short: the distribution of the estimate is too uncertain for an interval.
    RecordTooShort {
        /// ζωT, the length of the record in decay times of the mode.
        decay_times: f64,
        /// Smallest ζωT for an interval.
        needed: f64,
    },
}

/// Frequency or damping ratio with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalValue {
    /// Estimate.
    pub value: f64,
    /// Uncertainty of the value.
    pub uncertainty: Uncertainty,
}

impl ModalValue {
    /// Creates a value whose logarithm has the standard error `relative`.
    fn new(value: f64, relative: f64, decay_times: f64) -> Self {
        let uncertainty = if decay_times < MIN_DECAY_TIMES {
            Uncertainty::RecordTooShort { decay_times, needed: MIN_DECAY_TIMES }
        } else {
            let end = |side: f64| value * (side * QUANTILE * relative).exp();
            let interval = [end(-1.0), end(1.0)];
            Uncertainty::Known { standard_error: value * relative, interval }
        };
        Self { value, uncertainty }
    }

    /// Returns the standard error; `None` if the record is too short for one.
    pub fn standard_error(&self) -> Option<f64> {
        match self.uncertainty {
            Uncertainty::Known { standard_error, .. } => Some(standard_error),
            Uncertainty::RecordTooShort { .. } => None,
        }
    }

    /// Returns the value with its standard error multiplied by `scale`.
    fn with_error_scale(mut self, scale: f64) -> Self {
        if let Uncertainty::Known { standard_error, interval } = &mut self.uncertainty {
            *standard_error *= scale;
            *interval = interval.map(|end| self.value * (end / self.value).powf(scale));
        }
        self
    }

    /// Returns the value for a comparison; a value without a known standard error counts as exact.
    fn measured(&self) -> Measured {
        Measured::new(self.value, self.standard_error().unwrap_or(0.0))
    }

    /// Returns the interval of 95 %; `None` if the record is too short for one.
    pub fn interval(&self) -> Option<[f64; 2]> {
        match self.uncertainty {
            Uncertainty::Known { interval, .. } => Some(interval),
            Uncertainty::RecordTooShort { .. } => None,
        }
    }
}

/// Mode of an ambient record.
#[derive(Debug, Clone, PartialEq)]
pub struct AmbientMode {
    /// Natural frequency |λ|/2π, in Hz.
    pub natural_frequency_hz: ModalValue,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: ModalValue,
    /// Shape, relative to its largest entry, which is 1. Each entry has the unit of its channel
    /// divided by the unit of the channel with the largest entry.
    pub shape: ShapeWithCovariance,
    /// Power density of the force on the mode, in u² (rad/s)²/Hz, where u is the unit of the output
    /// with the largest entry. Near the resonance, the one-sided power density of this output is
    /// `force_power`/|jω − λ|².
    pub force_power: f64,
    /// Modal phase collinearity of the shape.
    pub mpc: Indicator,
    /// ζωT, the length of the record in decay times.
    pub decay_times: f64,
    /// Index of the harmonic at the frequency of the mode, if there is such a harmonic: the mode
    /// may be this harmonic.
    pub harmonic: Option<usize>,
}

/// Reason why a candidate is not among the modes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DropReason {
    /// The increase of 2 ln L is less than the penalty of the parameters of the mode.
    SmallGain {
        /// Increase of 2 ln L due to the mode. If the model without the mode has more polynomials
        /// of the noise, the penalty of these polynomials is added.
        gain: f64,
        /// Increase that was needed.
        needed: f64,
    },
    /// The damping ratio is not significantly larger than zero, as with a harmonic or a chance
    /// peak.
    DampingUndetermined {
        /// Ratio of the damping ratio to its standard error.
        ratio: f64,
    },
    /// The frequency is outside the band.
    OutsideBand,
    /// The damping is too large for a mode.
    OverDamped {
        /// Damping ratio.
        damping_ratio: f64,
    },
    /// The requested or maximum number of modes was reached.
    NumberReached {
        /// Number of modes (`modes` or `max_modes`).
        number: usize,
    },
    /// The likelihood has no maximum with this candidate.
    NoMaximum,
}

/// Candidate that is not among the modes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DroppedCandidate {
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Reason for the rejection.
    pub reason: DropReason,
}

/// Modes identified from responses alone.
#[derive(Debug, Clone, PartialEq)]
pub struct AmbientEstimate {
    /// Modes by rising frequency.
    pub modes: Vec<AmbientMode>,
    /// Sinusoids in the band.
    pub harmonics: Vec<Harmonic>,
    /// Candidates that are not among the modes.
    pub dropped: Vec<DroppedCandidate>,
    /// Poles of the subspace models of all orders.
    pub stabilisation: Stabilisation,
    /// Band, in Hz.
    pub band_hz: [f64; 2],
    /// Number of spectral lines used.
    pub lines: usize,
    /// Logarithm ln L of the likelihood of the lines, with each output divided by its RMS value in
    /// the band.
    pub log_likelihood: f64,
    /// Power of the record relative to the fitted spectrum; `None` if it cannot be computed, or if
    /// the record is too short for the intervals of a mode.
    pub misfit: Option<SpectrumMisfit>,
    /// Correlation coefficients of the forces on the modes, modes × modes.
    pub force_correlation: DMatrix<f64>,
    /// Whole fitted spectrum; it can be fitted again to a part of the record.
    pub(super) spectrum: FittedSpectrum,
}

/// Spectrum that was fitted to a record: its modes and the poles that are not modes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FittedSpectrum {
    pub parameters: Parameters,
    /// Unit of each output in the parameters.
    pub scale: Vec<f64>,
    /// Indices of the poles that are modes.
    pub accepted: Vec<usize>,
    /// Frequencies of the excluded sinusoids, in Hz.
    pub excluded_hz: Vec<f64>,
}

impl AmbientEstimate {
    /// Returns the standard error of the modal assurance criterion of each pair of modes, modes ×
    /// modes. Errors of different modes are assumed to be independent.
    ///
    /// # Source
    /// As [`mac_within_set`](crate::indicators::mac_within_set).
    pub fn mac_standard_errors(&self) -> DMatrix<f64> {
        let shapes: Vec<_> = self.modes.iter().map(|mode| Some(mode.shape.clone())).collect();
        mac_standard_errors(&shapes, |_, _| None)
    }

    /// Returns the same estimate; the standard errors of each mode are multiplied by the entry of
    /// `scales` for this mode (a pure number). Use this method if the halves of a record give modes
    /// that differ by more than their standard errors.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    pub fn with_error_scales(mut self, scales: &[f64]) -> Self {
        for (mode, scale) in self.modes.iter_mut().zip(scales) {
            mode.natural_frequency_hz = mode.natural_frequency_hz.with_error_scale(*scale);
            mode.damping_ratio = mode.damping_ratio.with_error_scale(*scale);
            mode.shape = mode.shape.clone().with_error_scale(*scale);
            mode.mpc = mpc_with_error(&mode.shape);
        }
        self
    }
}

impl AmbientMode {
    /// Returns whether the intervals of frequency and damping are known.
    pub(crate) fn has_interval(&self) -> bool {
        self.natural_frequency_hz.interval().and(self.damping_ratio.interval()).is_some()
    }

    /// Returns the mode for a comparison.
    pub(crate) fn compared(&self) -> ComparedMode {
        ComparedMode {
            natural_frequency_hz: self.natural_frequency_hz.measured(),
            damping_ratio: Some(self.damping_ratio.measured()),
            shape: self.shape.clone(),
        }
    }

    /// Creates a mode from a fit; `None` if the shape of the mode is zero or not finite.
    pub(super) fn new(
        fit: &Fit,
        statistics: Statistics<'_>,
        mode: usize,
        record: RecordScale<'_>,
    ) -> Option<Self> {
        let parameters = &fit.parameters;
        let layout = &parameters.layout;
        let relative = |index: usize| statistics.standard_error(index);
        let omega = parameters.omega(mode) * (-statistics.bias(layout.frequency(mode))).exp();
        let zeta = parameters.zeta(mode) * (-statistics.bias(layout.damping(mode))).exp();
        let decay_times = zeta * omega * record.span.duration;
        let frequency_hz = omega / std::f64::consts::TAU;
        let shape = scaled_shape(parameters, statistics.covariance, mode, record.scale)?;
        let largest = shape.shape()[shape.largest_entry()].norm();
        let shape = shape.normalised();
        Some(Self {
            natural_frequency_hz: ModalValue::new(
                frequency_hz,
                relative(layout.frequency(mode)),
                decay_times,
            ),
            damping_ratio: ModalValue::new(zeta, relative(layout.damping(mode)), decay_times),
            force_power: 2.0 * record.span.sample_interval * largest * largest,
            mpc: mpc_with_error(&shape),
            shape,
            decay_times,
            harmonic: None,
        })
    }
}

/// Time axis and units of the record of a fit.
#[derive(Clone, Copy)]
pub(super) struct RecordScale<'a> {
    pub span: Span,
    /// Factor from each output of the fit to the unit of its channel.
    pub scale: &'a [f64],
}

/// Covariance and bias of the parameters of a fit.
#[derive(Clone, Copy)]
pub(super) struct Statistics<'a> {
    pub covariance: &'a DMatrix<f64>,
    pub bias: &'a DVector<f64>,
}

impl Statistics<'_> {
    fn standard_error(self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// Returns the bias of a parameter; 0 if the bias exceeds [`MAX_BIAS`] standard errors, because
    /// the bias formula is then unreliable.
    fn bias(self, index: usize) -> f64 {
        let bias = self.bias[index];
        if bias.abs() <= MAX_BIAS * self.standard_error(index) { bias } else { 0.0 }
    }
}

fn scaled_shape(
    parameters: &Parameters,
    covariance: &DMatrix<f64>,
    mode: usize,
    scale: &[f64],
) -> Option<ShapeWithCovariance> {
    let (first, p) = (parameters.layout.shape(mode), parameters.layout.outputs);
    let mut shape = parameters.shape(mode);
    for (z, unit) in shape.iter_mut().zip(scale) {
        *z *= Complex::from(*unit);
    }
    let block = covariance.view((first, first), (2 * p, 2 * p));
    let block = DMatrix::from_fn(2 * p, 2 * p, |i, j| block[(i, j)] * scale[i % p] * scale[j % p]);
    ShapeWithCovariance::new(shape, block).ok()
}
