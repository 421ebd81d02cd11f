//! Delay and phase of the measuring channels.

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;
use mechid_signal::{Record, Spectrum};
use nalgebra::Complex;

/// Delay between force and response, and the phase common to both channels.
///
/// A common phase, for example of equal anti-alias filters, does not affect the fit of a linear
/// system. It affects the fit of a nonlinear system, because the nonlinear forces depend on the
/// response before the filter. The measured lines at frequency f are the true lines times e^(−iφ),
/// with φ = p₃ z³ + p₅ z⁵ and z = f/(f_s/2). A common delay, the term in z, has no effect. The
/// force acts on the system later than its channel shows; the difference is `delay`.
///
/// # Source
/// Ours. The odd polynomial is the series of any filter's phase about zero frequency.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ChannelPhase {
    /// Delay of the force, in s.
    pub delay: f64,
    /// Coefficient p₃ of the phase, in rad.
    pub cubic: f64,
    /// Coefficient p₅ of the phase, in rad.
    pub quintic: f64,
}

impl ChannelPhase {
    /// Returns the factors that convert measured lines of force and response to true lines at
    /// `omega` (rad/s); `z` is this frequency divided by half the sampling rate.
    pub(super) fn corrections(&self, omega: f64, z: f64) -> [Complex<f64>; 2] {
        let common = z * z * z * (self.cubic + self.quintic * z * z);
        [Complex::cis(common - omega * self.delay), Complex::cis(common)]
    }

    /// Returns the true force and response, without the delay and the phase of the measuring
    /// channels, for records of one period (samples × channels; N, and m, m/s or m/s²).
    ///
    /// # Errors
    /// [`EstimateError::Signal`] if the time axes of the records differ, or values overflow.
    pub fn correct(
        &self,
        force: &Record,
        response: &Record,
    ) -> Result<(Record, Record), EstimateError> {
        force.check_same_sampling(response)?;
        Ok((self.turn(force, 0, false)?, self.turn(response, 1, false)?))
    }

    /// Returns the response that the channel would measure (samples × channels, in the unit of the
    /// response), given a `response` that was predicted from a corrected force.
    ///
    /// # Errors
    /// [`EstimateError::Signal`] if values overflow.
    pub fn as_measured(&self, response: &Record) -> Result<Record, EstimateError> {
        self.turn(response, 1, true)
    }

    fn turn(&self, record: &Record, which: usize, back: bool) -> Result<Record, EstimateError> {
        if *self == Self::default() {
            return Ok(record.clone());
        }
        let spectrum = Spectrum::from_record(record);
        let mut lines = spectrum.lines().clone();
        let half = record.sampling().nyquist_hz();
        for (n, mut row) in lines.row_iter_mut().enumerate() {
            let factor =
                self.corrections(spectrum.omega(n), spectrum.frequency_hz(n) / half)[which];
            let factor = if back { factor.conj() } else { factor };
            row.iter_mut().for_each(|line| *line *= factor);
        }
        Ok(Spectrum::from_lines(record.sampling(), lines)?.to_record()?)
    }
}

/// Converts the lines of a measured response to lines of the displacement, and returns those below
/// half the sampling rate. The mean is kept if the displacement was measured, and set to zero if
/// the velocity or the acceleration was measured.
pub(super) fn displacement_lines(
    response: &Spectrum,
    measured: ResponseQuantity,
) -> nalgebra::DMatrix<Complex<f64>> {
    let count = response.sampling().len().div_ceil(2);
    let mut lines = response.lines().rows(0, count).into_owned();
    for (n, mut row) in lines.row_iter_mut().enumerate() {
        let factor = match (n, measured) {
            (_, ResponseQuantity::Displacement) => continue,
            (0, _) => Complex::ZERO,
            _ => measured.per_displacement(response.omega(n)).inv(),
        };
        row.iter_mut().for_each(|line| *line *= factor);
    }
    lines
}
