//! Velocity and acceleration when only one of displacement and acceleration was measured.
//!
//! Differentiation amplifies noise in proportion to the frequency, and to its square for the
//! acceleration. The caller chooses the method, because each one assumes something:
//!
//! | Function | Assumption | Loss |
//! |---|---|---|
//! | [`spectral_from_displacement`] | the record is whole periods | none; exact up to Nyquist |
//! | [`spectral_from_acceleration`] | the record is whole periods | static displacement |
//! | [`SavitzkyGolay::motion`] | the displacement is smooth | ends and highest frequencies |
//! | [`SavitzkyGolay::twice_differentiated`] | acceleration and force are smooth | ends, highest frequencies, noise times ω² |

use mechid_model::Response;
use mechid_signal::{Record, SignalError, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::EstimateError;

/// Returns x, ẋ and ẍ of a displacement (m) recorded over whole periods; each derivative multiplies
/// the lines by iω.
///
/// At the Nyquist frequency (records of even length) the velocity is zero at every sample.
///
/// # Errors
/// [`EstimateError::Signal`] if a derivative is too large for a record.
///
/// # Source
/// Dissertation eqs. (4.6.2)–(4.6.3).
pub fn spectral_from_displacement(displacement: &Record) -> Result<Response, EstimateError> {
    let spectrum = Spectrum::from_record(displacement);
    let velocity = times(&spectrum, |i_omega| i_omega)?;
    let acceleration = times(&spectrum, |i_omega| i_omega * i_omega)?;
    Ok(Response::new(displacement.clone(), velocity, acceleration)?)
}

/// Returns x, ẋ and ẍ of an acceleration (m/s²) recorded over whole periods.
///
/// The mean of a periodic acceleration is zero, so the mean of the displacement is lost. Before a
/// fit, subtract the mean of the force, too ([`Record::without_mean`]).
///
/// # Errors
/// [`EstimateError::Signal`] if an integral is too large for a record.
pub fn spectral_from_acceleration(acceleration: &Record) -> Result<Response, EstimateError> {
    let acceleration = acceleration.without_mean();
    let spectrum = Spectrum::from_record(&acceleration);
    let over = |power: i32| {
        times(&spectrum, |i_omega| match i_omega.im {
            0.0 => Complex::ZERO,
            _ => i_omega.powi(-power),
        })
    };
    Ok(Response::new(over(2)?, over(1)?, acceleration)?)
}

fn times(
    spectrum: &Spectrum,
    factor: impl Fn(Complex<f64>) -> Complex<f64>,
) -> Result<Record, SignalError> {
    let mut lines = spectrum.lines().clone();
    for (n, mut row) in lines.row_iter_mut().enumerate() {
        let factor = factor(Complex::new(0.0, spectrum.omega(n)));
        row.iter_mut().for_each(|line| *line *= factor);
    }
    Spectrum::from_lines(spectrum.sampling(), lines)?.to_record()
}

/// Fit of a sliding polynomial to windows of 2·half_width + 1 samples.
///
/// The fit is exact for polynomials up to its order. Near the ends of the record, the first and the
/// last window are evaluated off their centres; these samples have more noise.
///
/// # Source
/// Savitzky & Golay (1964), Analytical Chemistry 36, 1627–1639.
#[derive(Debug, Clone, PartialEq)]
pub struct SavitzkyGolay {
    half_width: usize,
    order: usize,
    /// Least-squares inverse of the powers (k/half_width)^p: (order + 1) × window.
    inverse: DMatrix<f64>,
}

impl SavitzkyGolay {
    /// Largest half-width, in samples; a polynomial over more samples cannot follow a vibration.
    pub const MOST_HALF_WIDTH: usize = 10_000;

    /// Maximum order of the polynomial; at higher orders the columns (powers of time) are linearly
    /// dependent up to rounding.
    pub const MOST_ORDER: usize = 20;

    /// Number of samples of a window, 2·half_width + 1.
    pub fn window(&self) -> usize {
        2 * self.half_width + 1
    }

    /// Creates the fit of a polynomial of `order` to `2 * half_width + 1` samples.
    ///
    /// # Errors
    /// [`EstimateError::Window`] unless order ≤ 2·half_width and half_width > 0,
    /// [`EstimateError::WindowTooLarge`] beyond [`MOST_HALF_WIDTH`](Self::MOST_HALF_WIDTH) or
    /// [`MOST_ORDER`](Self::MOST_ORDER).
    pub fn new(half_width: usize, order: usize) -> Result<Self, EstimateError> {
        if half_width > Self::MOST_HALF_WIDTH || order > Self::MOST_ORDER {
            return Err(EstimateError::WindowTooLarge { half_width, order });
        }
        if half_width == 0 || order > 2 * half_width {
            return Err(EstimateError::Window { samples: 2 * half_width + 1, order });
        }
        let h = half_width as f64;
        let powers = DMatrix::from_fn(2 * half_width + 1, order + 1, |k, p| {
            ((k as f64 - h) / h).powi(p as i32)
        });
        let (q, r) = powers.qr().unpack();
        let inverse = r
            .solve_upper_triangular(&q.transpose())
            .ok_or(EstimateError::Window { samples: 2 * half_width + 1, order })?;
        Ok(Self { half_width, order, inverse })
    }

    /// Returns the `times`-th derivative of every channel (0 smooths): samples × channels like the
    /// record, in the unit of the channel per s^`times`.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] if the record is shorter than the window,
    /// [`EstimateError::Window`] if the polynomial has no such derivative.
    pub fn differentiate(&self, record: &Record, times: usize) -> Result<Record, EstimateError> {
        let window = self.window();
        if record.len() < window {
            return Err(SignalError::TooShort { samples: record.len(), needed: window }.into());
        }
        if times > self.order {
            return Err(EstimateError::Window { samples: window, order: self.order });
        }
        let scale = (self.half_width as f64 * record.sampling().dt()).powi(-(times as i32));
        let (half, len) = (self.half_width, record.len());
        let centre = self.kernel(half, times, scale);
        let mut data = DMatrix::zeros(len, record.channels());
        for k in 0..len {
            let start = k.saturating_sub(half).min(len - window);
            // Near the ends each sample has a different kernel, computed when it is needed.
            let end = (k - start != half).then(|| self.kernel(k - start, times, scale));
            let kernel = end.as_ref().unwrap_or(&centre);
            for channel in 0..record.channels() {
                let values = &record.channel(channel)[start..start + window];
                data[(k, channel)] = values.iter().zip(kernel).map(|(v, w)| v * w).sum();
            }
        }
        Ok(Record::new(record.sampling(), data)?)
    }

    /// Returns the smoothed x, ẋ and ẍ of a displacement (m).
    ///
    /// # Errors
    /// As [`SavitzkyGolay::differentiate`]; the order must be at least 2.
    pub fn motion(&self, displacement: &Record) -> Result<Response, EstimateError> {
        let derivative = |times| self.differentiate(displacement, times);
        Ok(Response::new(derivative(0)?, derivative(1)?, derivative(2)?)?)
    }

    /// Differentiates acceleration and force twice: M ẍ″ + C ẍ′ + K ẍ = F″ has the same matrices as
    /// the equation of motion. The method needs no integration, so there is no drift.
    ///
    /// Returns (ẍ, ẍ′, ẍ″) as displacement, velocity and acceleration, and F″ as force, for
    /// [`crate::time_domain::equation_of_motion`].
    ///
    /// # Errors
    /// As [`SavitzkyGolay::motion`].
    pub fn twice_differentiated(
        &self,
        acceleration: &Record,
        force: &Record,
    ) -> Result<(Response, Record), EstimateError> {
        Ok((self.motion(acceleration)?, self.differentiate(force, 2)?))
    }

    /// Returns the weights of the samples of a window for a derivative at one sample of the window.
    fn kernel(&self, sample: usize, times: usize, scale: f64) -> Vec<f64> {
        let t = sample as f64 / self.half_width as f64 - 1.0;
        // The derivative of t^p is p (p − 1) … (p − times + 1) t^(p − times).
        let factor = |p: usize| (p + 1 - times..=p).map(|i| i as f64).product::<f64>();
        let weights = (times..=self.order)
            .map(|p| self.inverse.row(p) * (factor(p) * t.powi((p - times) as i32) * scale));
        let zero = self.inverse.row(0) * 0.0;
        weights.fold(zero, |sum, row| sum + row).iter().copied().collect()
    }
}
