//! Values between the samples of a record.
//!
//! | [`Interpolation`] | Exact for | Use |
//! |---|---|---|
//! | `Linear` | straight lines | never overshoots; damps high lines |
//! | `NaturalSpline` | straight lines | smooth; no bending at the ends |
//! | `NotAKnotSpline` | cubics | smooth; the best of the splines at the ends |
//! | `Pchip` | straight lines | monotone where the samples are; no overshoot at steps |
//! | `BandLimited` | one period of anything below Nyquist | multisines and their responses |
//!
//! ```
//! use mechid_signal::{Interpolation, Interpolator, Multisine, Phases, Sampling};
//!
//! let sampling = Sampling::new(0.01, 64)?;
//! let force = Multisine::flat(1..=31, 1.0, Phases::Schroeder)?;
//! let record = force.sample(sampling)?;
//! // Half-way between two samples, as a Runge-Kutta stage asks for it.
//! let exact = force.value(0.105, sampling.omega0());
//! let of = |method| Interpolator::new(&record, method)?.value(0.105, 0);
//! assert!((of(Interpolation::BandLimited)? - exact).abs() < 1e-12);
//! assert!((of(Interpolation::Linear)? - exact).abs() > 1e-3);
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```
//!
//! # Source
//! Dissertation section 6.2 and Appendix B.

mod fourier;
mod pchip;
mod spline;

use nalgebra::DMatrix;

use crate::error::{SignalError, fits_in_memory, has_channel};
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// Method of interpolation between samples; compared in the [module documentation](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Interpolation {
    /// Straight lines from sample to sample.
    Linear,
    /// Cubic spline with zero second derivative at the two ends.
    NaturalSpline,
    /// Cubic spline in which the two outermost intervals at each end share one cubic.
    NotAKnotSpline,
    /// Piecewise cubic Hermite interpolation with monotone pieces (Fritsch and Butland).
    Pchip,
    /// The Fourier series of the record as one whole period.
    BandLimited,
}

/// A record prepared for interpolation.
#[derive(Debug, Clone)]
pub struct Interpolator {
    sampling: Sampling,
    pieces: Pieces,
}

/// Data of the method.
#[derive(Debug, Clone)]
enum Pieces {
    Linear(DMatrix<f64>),
    /// Samples and slopes per sampling step.
    Hermite(DMatrix<f64>, DMatrix<f64>),
    Fourier(Spectrum),
}

impl Interpolator {
    /// Prepares a record: computes the slopes of a spline, or the spectrum, once.
    ///
    /// # Errors
    /// [`SignalError::TooFew`] for a record of a single sample, unless it is a period.
    pub fn new(record: &Record, method: Interpolation) -> Result<Self, SignalError> {
        let sampling = record.sampling();
        if method != Interpolation::BandLimited && record.len() < 2 {
            let got = record.len();
            return Err(SignalError::TooFew { what: "samples to interpolate", least: 2, got });
        }
        let hermite = |slopes: fn(&[f64]) -> Vec<f64>| {
            let columns = (0..record.channels()).flat_map(|c| slopes(record.channel(c)));
            let slopes = DMatrix::from_iterator(record.len(), record.channels(), columns);
            Pieces::Hermite(record.data().clone(), slopes)
        };
        let pieces = match method {
            Interpolation::Linear => Pieces::Linear(record.data().clone()),
            Interpolation::NaturalSpline => hermite(spline::natural),
            Interpolation::NotAKnotSpline => hermite(spline::not_a_knot),
            Interpolation::Pchip => hermite(pchip::slopes),
            Interpolation::BandLimited => Pieces::Fourier(Spectrum::from_record(record)),
        };
        Ok(Self { sampling, pieces })
    }

    /// Returns the value of a channel at `t` seconds.
    ///
    /// # Errors
    /// [`SignalError::Range`] if `t` is not between the first and the last sample; a period
    /// continues without end, so that [`Interpolation::BandLimited`] only needs a finite `t`;
    /// [`SignalError::NoSuchChannel`].
    pub fn value(&self, t: f64, channel: usize) -> Result<f64, SignalError> {
        has_channel(channel, self.channels())?;
        match &self.pieces {
            Pieces::Fourier(spectrum) => {
                crate::error::finite("time", t)?;
                Ok(fourier::value(spectrum, channel, t))
            }
            Pieces::Linear(y) => {
                let (k, u) = self.interval(t)?;
                Ok((1.0 - u) * y[(k, channel)] + u * y[(k + 1, channel)])
            }
            Pieces::Hermite(y, d) => {
                let (k, u) = self.interval(t)?;
                let at = |k| (y[(k, channel)], d[(k, channel)]);
                Ok(hermite(at(k), at(k + 1), u))
            }
        }
    }

    fn channels(&self) -> usize {
        match &self.pieces {
            Pieces::Fourier(spectrum) => spectrum.channels(),
            Pieces::Linear(y) | Pieces::Hermite(y, _) => y.ncols(),
        }
    }

    /// Returns the index of the interval between two samples that contains the instant `t`, and the
    /// position of `t` in this interval, from 0 to 1.
    fn interval(&self, t: f64) -> Result<(usize, f64), SignalError> {
        let last = self.sampling.len() - 1;
        let steps = t / self.sampling.dt();
        // Rounding must not exclude the instant of the last sample.
        let slack = 1e-9 * (1.0 + last as f64);
        if !(steps >= -slack && steps <= last as f64 + slack) {
            let high = self.sampling.time(last);
            return Err(SignalError::Range { what: "time", value: t, low: 0.0, high });
        }
        let k = (steps.max(0.0).floor() as usize).min(last - 1);
        Ok((k, steps - k as f64))
    }
}

/// Returns the cubic through two values with two slopes, at the fraction `u` of a unit interval.
fn hermite((y0, d0): (f64, f64), (y1, d1): (f64, f64), u: f64) -> f64 {
    let secant = y1 - y0;
    let (c2, c3) = (3.0 * secant - 2.0 * d0 - d1, d0 + d1 - 2.0 * secant);
    y0 + u * (d0 + u * (c2 + u * c3))
}

/// Returns the record at the instants of another time axis; both axes begin at t = 0.
///
/// There is no filter: with a longer step, frequencies above the new Nyquist frequency alias, as in
/// any sampling.
///
/// # Errors
/// The errors of [`Interpolator::new`] and [`Interpolator::value`]; [`SignalError::Memory`].
pub fn resample(
    record: &Record,
    sampling: Sampling,
    method: Interpolation,
) -> Result<Record, SignalError> {
    fits_in_memory(sampling.len(), record.channels())?;
    let interpolator = Interpolator::new(record, method)?;
    if let Pieces::Fourier(spectrum) = &interpolator.pieces
        && let Some(resampled) = fourier::same_period(spectrum, sampling)
    {
        return resampled;
    }
    let mut data = DMatrix::zeros(sampling.len(), record.channels());
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        for (x, t) in column.iter_mut().zip(sampling.times()) {
            *x = interpolator.value(t, channel)?;
        }
    }
    Record::new(sampling, data)
}

/// Returns the values within the steps, at t = (k + `part`) Δt for every sample k, with `part` a
/// pure number from 0 to 1: the force for a Runge-Kutta stage. After the last sample, the value of
/// this sample is used, except if the record is interpolated as a period.
///
/// ```
/// use mechid_signal::{Interpolation, Multisine, Phases, Sampling, resample::within_steps};
///
/// let sampling = Sampling::new(0.01, 64)?;
/// let force = Multisine::flat(1..=31, 1.0, Phases::Schroeder)?;
/// let middle = within_steps(&force.sample(sampling)?, 0.5, Interpolation::BandLimited)?;
/// let exact = force.value(0.105, sampling.omega0());
/// assert!((middle.channel(0)[10] - exact).abs() < 1e-12);
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Errors
/// [`SignalError::Range`] for a `part` out of range, and the errors of [`Interpolator::new`].
pub fn within_steps(
    record: &Record,
    part: f64,
    method: Interpolation,
) -> Result<Record, SignalError> {
    if !(0.0..=1.0).contains(&part) {
        return Err(SignalError::Range {
            what: "part of a step",
            value: part,
            low: 0.0,
            high: 1.0,
        });
    }
    let interpolator = Interpolator::new(record, method)?;
    if let Pieces::Fourier(spectrum) = &interpolator.pieces {
        return fourier::later(spectrum, part);
    }
    let (last, dt) = (record.len() - 1, record.sampling().dt());
    let mut data = DMatrix::zeros(record.len(), record.channels());
    for (channel, mut column) in data.column_iter_mut().enumerate() {
        for (k, value) in column.iter_mut().enumerate() {
            let steps = (k as f64 + part).min(last as f64);
            *value = interpolator.value(steps * dt, channel)?;
        }
    }
    Record::new(record.sampling(), data)
}

/// Returns the record with `factor − 1` further instants in every interval.
///
/// A period keeps its duration and has `factor` times as many samples; any other record ends with
/// its last sample.
///
/// # Errors
/// The errors of [`resample`], and [`SignalError::TooFew`] if `factor` is 0.
pub fn refine(
    record: &Record,
    factor: usize,
    method: Interpolation,
) -> Result<Record, SignalError> {
    if factor == 0 {
        let what = "steps per interval";
        return Err(SignalError::TooFew { what, least: 1, got: 0 });
    }
    let intervals = match method {
        Interpolation::BandLimited => record.len().saturating_mul(factor),
        _ => (record.len() - 1).saturating_mul(factor).saturating_add(1),
    };
    let sampling = Sampling::new(record.sampling().dt() / factor as f64, intervals)?;
    resample(record, sampling, method)
}
