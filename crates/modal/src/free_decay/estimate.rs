//! Modes of a free decay, with the standard errors of maximum likelihood.

use std::f64::consts::TAU;

use mechid_estimate::IdentifiedMode;
use mechid_model::Mode;
use mechid_numerics::Uncertain;
use mechid_signal::Record;
use mechid_signal::correlation::{Correlation, whiteness};
use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::FreeDecayError;
use super::backbone::{Backbone, backbone};
use super::fit::{Data, Fit};
use super::limits::{ESTIMATE_LAGS, LEAST_ONSET, ONSET_SHARE};
use super::poles::{Pole, linear_columns};

/// Mode of a free response.
#[derive(Debug, Clone, PartialEq)]
pub struct DecayMode {
    /// Pole and shape with their standard errors. The shape is that of the measured quantity; its
    /// largest entry is 1.
    pub mode: IdentifiedMode,
    /// Amplitude at the first sample, in the unit of the record, in the channel with the largest
    /// entry of the shape.
    pub amplitude: Uncertain,
    /// Phase φ at the first sample, in rad, in the channel with the largest entry of the shape: the
    /// response is A e^{σt} cos(ωt + φ).
    pub phase: f64,
    /// Ratio of the sum of squares of this mode to the sum over all modes; each sum is over all
    /// samples and channels.
    pub energy_share: f64,
}

impl DecayMode {
    /// Returns whether the response of the mode decays: the 95 % interval of its growth rate is
    /// below zero.
    pub fn decays(&self) -> bool {
        self.mode.growth_rate.interval(0.95).is_ok_and(|[_, high]| high < 0.0)
    }
}

/// Fit of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct DecayChannel {
    /// Constant, in the unit of the record; 0 if none was fitted.
    pub offset: f64,
    /// Standard deviation of the residual, in the unit of the record.
    pub noise: f64,
    /// Order of the autoregression of the noise: 0 for white noise.
    pub noise_order: usize,
    /// Share of the variance of the channel that the modes explain, a ratio.
    pub explained: f64,
    /// Autocorrelation of the residual after whitening by the autoregression.
    pub whiteness: Correlation,
    /// Residual of the first samples, where a force may still act.
    pub onset: Onset,
}

/// Comparison of the residual in the first samples with the residual in the other samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onset {
    /// Number of samples of the onset.
    pub samples: usize,
    /// Ratio of the mean square of the residual in the onset to that in the other samples.
    pub ratio: f64,
    /// Probability that noise has a larger ratio, a pure number.
    pub p_value: f64,
}

impl Onset {
    /// Tests the first samples of a residual that should be white.
    fn new(residual: &[f64]) -> Self {
        let samples = (residual.len() / ONSET_SHARE).max(LEAST_ONSET).min(residual.len() / 2);
        let (first, others) = residual.split_at(samples);
        let mean_square = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64;
        let ratio = mean_square(first) / mean_square(others);
        let distribution = FisherSnedecor::new(first.len() as f64, others.len() as f64);
        let p_value = distribution.map_or(1.0, |f| f.sf(ratio));
        Self { samples, ratio, p_value }
    }
}

/// Modes identified from a free response.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeDecayEstimate {
    modes: Vec<DecayMode>,
    channels: Vec<DecayChannel>,
    fitted: Record,
    backbone: Option<Backbone>,
    restart: Option<usize>,
    degrees_of_freedom: usize,
}

impl FreeDecayEstimate {
    /// Returns frequency and damping of the strongest mode as functions of amplitude; `None` if
    /// linear modes describe the response better.
    pub fn backbone(&self) -> Option<&Backbone> {
        self.backbone.as_ref()
    }

    /// Returns the sample, counted from 0, of a second excitation; `None` if there is no second
    /// excitation.
    pub fn restart(&self) -> Option<usize> {
        self.restart
    }

    /// Sets the sample of a second excitation. The sample is ignored if the strongest mode is
    /// nonlinear, because the nonlinearity explains the same residual.
    pub(super) fn with_restart(self, restart: Option<usize>) -> Self {
        Self { restart: restart.filter(|_| self.backbone.is_none()), ..self }
    }

    /// Returns the modes by rising frequency.
    pub fn modes(&self) -> &[DecayMode] {
        &self.modes
    }

    /// Returns the fit of each channel.
    pub fn channels(&self) -> &[DecayChannel] {
        &self.channels
    }

    /// Returns the response of all modes with the constants, samples × channels in the unit of the
    /// record.
    pub fn fitted(&self) -> &Record {
        &self.fitted
    }

    /// Returns the number of samples of all channels minus the number of unknowns.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }
}

/// Covariance of the unknowns of a fit.
struct Spread<'a> {
    fit: &'a Fit,
    /// Covariance of N·`growth` and N·`turn` of all poles, for N samples.
    poles: DMatrix<f64>,
    /// Derivatives of the linear unknowns of each channel with respect to the poles.
    slopes: Vec<DMatrix<f64>>,
    /// Covariance (R⁻¹R⁻ᵀ) s² of the linear unknowns of each channel for known poles, where R is
    /// the triangular factor of their columns and s² is the noise variance.
    linear: Vec<DMatrix<f64>>,
    degrees_of_freedom: usize,
}

impl<'a> Spread<'a> {
    fn new(data: &Data, fit: &'a Fit) -> Option<Self> {
        let nonlinear = 2 * fit.poles.len();
        let linear = linear_columns(&fit.poles, data.constant);
        let (mut freedom, mut stacked) = (0.0, DMatrix::zeros(0, nonlinear));
        let (mut slopes, mut known_poles) = (Vec::new(), Vec::new());
        for (of, noise) in fit.channels.iter().zip(&fit.noise) {
            let used = (linear + noise.order()) as f64 + nonlinear as f64 / data.channels() as f64;
            let degrees = data.len() as f64 - used;
            if degrees < 1.0 {
                return None;
            }
            freedom += degrees;
            let deviation = (of.square / degrees).sqrt();
            let rows = stacked.nrows();
            stacked = stacked.resize_vertically(rows + nonlinear, 0.0);
            stacked.rows_mut(rows, nonlinear).copy_from(&(&of.orthogonal / deviation));
            slopes.push(-of.factor.solve_upper_triangular(&of.parallel)?);
            let inverse = of.factor.solve_upper_triangular(&DMatrix::identity(linear, linear))?;
            known_poles.push(&inverse * inverse.transpose() * (deviation * deviation));
        }
        let upper = stacked.qr().unpack_r();
        let inverse = upper.solve_upper_triangular(&DMatrix::identity(nonlinear, nonlinear))?;
        let poles = &inverse * inverse.transpose();
        let finite = poles.iter().all(|v| v.is_finite());
        finite.then_some(Self {
            fit,
            poles,
            slopes,
            linear: known_poles,
            degrees_of_freedom: freedom as usize,
        })
    }

    fn uncertain(&self, value: f64, variance: f64) -> Uncertain {
        let (standard_error, degrees_of_freedom) =
            (variance.max(0.0).sqrt(), self.degrees_of_freedom);
        Uncertain { value, standard_error, degrees_of_freedom }
    }

    /// Returns the variance of Re Σ w_c A_c, where A_c is the complex amplitude of a mode in
    /// channel c at the sample [`Pole::origin`].
    fn variance(&self, mode: usize, weights: &[(usize, Complex<f64>)]) -> f64 {
        let mut through_poles = DVector::zeros(self.poles.nrows());
        let mut variance = 0.0;
        for (channel, weight) in weights {
            // The complex amplitude is A = a − i b, where a and b are the amplitudes of cosine and
            // sine.
            let (cos, sin) = (weight.re, weight.im);
            let slopes = &self.slopes[*channel];
            through_poles += slopes.row(2 * mode).transpose() * cos;
            through_poles += slopes.row(2 * mode + 1).transpose() * sin;
            let c = self.linear[*channel].view((2 * mode, 2 * mode), (2, 2));
            variance += cos * cos * c[(0, 0)] + 2.0 * cos * sin * c[(0, 1)] + sin * sin * c[(1, 1)];
        }
        variance + through_poles.dot(&(&self.poles * &through_poles))
    }

    /// Returns the complex amplitude of a mode in a channel, at the sample [`Pole::origin`].
    fn amplitude(&self, mode: usize, channel: usize) -> Complex<f64> {
        let linear = &self.fit.channels[channel].linear;
        Complex::new(linear[2 * mode], -linear[2 * mode + 1])
    }
}

/// Returns the modes and channels of a fit; `None` if the fit does not determine all unknowns. The
/// record is the scaled data times `scale`, channel by channel.
pub(super) fn estimate(
    record: &Record,
    data: &Data,
    fit: &Fit,
    scale: &[f64],
) -> Option<Result<FreeDecayEstimate, FreeDecayError>> {
    let spread = Spread::new(data, fit)?;
    // The scales are divided by the largest scale, because the square of a large scale may
    // overflow.
    let unit = scale.iter().copied().fold(0.0, f64::max);
    let relative: Vec<f64> = scale.iter().map(|scale| scale / unit).collect();
    let energies = energies(data, fit, &relative);
    let total: f64 = energies.iter().sum();
    let backbone = backbone(data, fit, &energies, scale, record.sampling().dt());
    let mut modes = Vec::new();
    for (at, energy) in energies.iter().enumerate() {
        let mut mode = mode(&spread, record, at, &relative, energy / total)?;
        mode.amplitude.value *= unit;
        mode.amplitude.standard_error *= unit;
        modes.push(mode);
    }
    let frequency = |of: &DecayMode| of.mode.natural_frequency_hz.value;
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|a, b| frequency(&modes[*a]).total_cmp(&frequency(&modes[*b])));
    modes.sort_by(|a: &DecayMode, b| frequency(a).total_cmp(&frequency(b)));
    let backbone = backbone.map(|backbone| {
        let replaced = |place: &usize| backbone.modes.contains(&order[*place]);
        Backbone { modes: (0..order.len()).filter(replaced).collect(), ..backbone }
    });
    let residual = data.residual(fit);
    let channels = (0..data.channels())
        .map(|at| channel(data, fit, scale[at], at, residual.column(at).as_slice()));
    Some(channels.collect::<Result<Vec<_>, _>>().and_then(|channels| {
        let fitted = |k: usize, c: usize| scale[c] * (data.samples[(k, c)] - residual[(k, c)]);
        let fitted = DMatrix::from_fn(data.len(), data.channels(), fitted);
        Ok(FreeDecayEstimate {
            modes,
            channels,
            fitted: Record::new(record.sampling(), fitted)?,
            backbone,
            restart: None,
            degrees_of_freedom: spread.degrees_of_freedom,
        })
    }))
}

/// Returns the sum of squares of each mode over samples and channels.
fn energies(data: &Data, fit: &Fit, scale: &[f64]) -> Vec<f64> {
    let mut energies = vec![0.0; fit.poles.len()];
    for basis in data.chunks(&fit.poles) {
        for (mode, energy) in energies.iter_mut().enumerate() {
            for (channel, scale) in fit.channels.iter().zip(scale) {
                let [cos, sin] = [0, 1].map(|part| channel.linear[2 * mode + part]);
                let response = basis.column(2 * mode) * cos + basis.column(2 * mode + 1) * sin;
                *energy += response.norm_squared() * scale.powi(2);
            }
        }
    }
    energies
}

/// Returns a mode with its amplitude in the unit of `scale`.
fn mode(
    spread: &Spread<'_>,
    record: &Record,
    at: usize,
    scale: &[f64],
    energy_share: f64,
) -> Option<DecayMode> {
    let Pole { growth, turn } = spread.fit.poles[at];
    let (dt, len) = (record.sampling().dt(), record.len());
    let amplitudes: Vec<Complex<f64>> =
        scale.iter().enumerate().map(|(c, scale)| spread.amplitude(at, c) * *scale).collect();
    let largest = |c: &usize| amplitudes[*c].norm();
    let reference = (0..scale.len()).max_by(|a, b| largest(a).total_cmp(&largest(b)))?;
    let whole = amplitudes[reference];
    let lambda = Complex::new(growth, turn) / dt;
    let shape = DVector::from_iterator(scale.len(), amplitudes.iter().map(|a| a / whole));
    let errors = shape.iter().enumerate().map(|(c, entry)| {
        let weights = [(c, scale[c] / whole), (reference, -entry * scale[reference] / whole)];
        if c == reference {
            return Complex::default();
        }
        let error = |turn: Complex<f64>| {
            spread.variance(at, &weights.map(|(c, weight)| (c, weight * turn))).max(0.0).sqrt()
        };
        Complex::new(error(Complex::from(1.0)), error(-Complex::i()))
    });
    let shape_standard_error = DVector::from_iterator(scale.len(), errors);

    let per_second = 1.0 / (dt * len as f64);
    let covariance = spread.poles.view((2 * at, 2 * at), (2, 2)) * (per_second * per_second);
    let (sigma, omega, size) = (lambda.re, lambda.im, lambda.norm());
    let uncertain = |value: f64, slope: [f64; 2]| {
        let slope = DVector::from_row_slice(&slope);
        spread.uncertain(value, slope.dot(&(&covariance * &slope)))
    };
    let cube = size * size * size;
    let weight = whole.conj() * (scale[reference] / whole.norm());
    // This factor refers the amplitude to the first sample.
    let back = (-growth * spread.fit.poles[at].origin(len) as f64).exp();
    let variance = spread.variance(at, &[(reference, weight)]) * back * back;
    let mode = IdentifiedMode {
        mode: Mode::new(lambda, &shape)?,
        growth_rate: uncertain(sigma, [1.0, 0.0]),
        damped_frequency_hz: uncertain(omega / TAU, [0.0, 1.0 / TAU]),
        natural_frequency_hz: uncertain(size / TAU, [sigma / size / TAU, omega / size / TAU]),
        damping_ratio: uncertain(-sigma / size, [-omega * omega / cube, sigma * omega / cube]),
        squared_frequency: uncertain(size * size, [2.0 * sigma, 2.0 * omega]),
        partner: None,
        is_rigid_body: false,
        shape_standard_error,
    };
    let amplitude = spread.uncertain(back * whole.norm(), variance);
    Some(DecayMode { mode, amplitude, phase: whole.arg(), energy_share })
}

fn channel(
    data: &Data,
    fit: &Fit,
    scale: f64,
    at: usize,
    residual: &[f64],
) -> Result<DecayChannel, FreeDecayError> {
    let (linear, noise) = (&fit.channels[at].linear, &fit.noise[at]);
    let square: f64 = residual.iter().map(|e| e * e).sum();
    let len = data.len() as f64;
    let lags = ESTIMATE_LAGS.min(data.len() / 4).max(1);
    let white = noise.whitened(residual, 0, 0);
    Ok(DecayChannel {
        offset: if data.constant { scale * linear[linear.len() - 1] } else { 0.0 },
        noise: scale * (square / len).sqrt(),
        noise_order: noise.order(),
        // Each channel has unit variance, so `square / len` is the unexplained fraction.
        explained: 1.0 - square / len,
        whiteness: whiteness(&white, lags)?,
        onset: Onset::new(&white),
    })
}
