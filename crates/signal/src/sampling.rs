//! The uniform time axis.

use crate::error::{SignalError, positive};

/// A uniform time axis: `len` samples, `dt` seconds apart, the first at t = 0.
///
/// If the samples are one period of a periodic signal, the period is `len · dt` (the sample at t =
/// `len · dt` is again the first sample), and the spectral lines are multiples of
/// [`omega0`](Self::omega0).
///
/// # Source
/// Dissertation eqs. (5.2.3)–(5.2.4): T = Nt·Dt, ω0 = 2π/(Nt·Dt).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    dt: f64,
    len: usize,
}

impl Sampling {
    /// Creates a time axis of `len` samples, `dt` seconds apart.
    ///
    /// # Errors
    /// [`SignalError::TimeStep`] if `dt` is not positive and finite,
    /// [`SignalError::Empty`] if `len` is 0.
    pub fn new(dt: f64, len: usize) -> Result<Self, SignalError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(SignalError::TimeStep { dt });
        }
        if len == 0 {
            return Err(SignalError::Empty);
        }
        Ok(Self { dt, len })
    }

    /// Creates a time axis of `len` samples at `rate_hz` samples per second.
    ///
    /// # Errors
    /// [`SignalError::NotPositive`] if the rate is not positive and finite,
    /// [`SignalError::Empty`] if `len` is 0.
    pub fn from_rate_hz(rate_hz: f64, len: usize) -> Result<Self, SignalError> {
        Self::new(1.0 / positive("sampling rate in Hz", rate_hz)?, len)
    }

    /// Time step, in seconds.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of samples.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns a time axis with the same step and another number of samples.
    ///
    /// # Errors
    /// [`SignalError::Empty`] if `len` is 0.
    pub fn with_len(&self, len: usize) -> Result<Self, SignalError> {
        Self::new(self.dt, len)
    }

    /// Sampling rate, in Hz.
    pub fn rate_hz(&self) -> f64 {
        1.0 / self.dt
    }

    /// `len · dt`, in seconds: the period when the record is one period.
    pub fn duration(&self) -> f64 {
        self.len as f64 * self.dt
    }

    /// Spacing of the spectral lines 2π / (len · dt), in rad/s.
    pub fn omega0(&self) -> f64 {
        std::f64::consts::TAU / self.duration()
    }

    /// Spacing of the spectral lines 1 / (len · dt), in Hz.
    pub fn line_spacing_hz(&self) -> f64 {
        1.0 / self.duration()
    }

    /// Half the sampling rate, in Hz.
    pub fn nyquist_hz(&self) -> f64 {
        0.5 / self.dt
    }

    /// Number of one-sided spectral lines, `len / 2 + 1`, including DC.
    pub fn lines(&self) -> usize {
        self.len / 2 + 1
    }

    /// Instant of sample `k`, in seconds.
    pub fn time(&self, k: usize) -> f64 {
        k as f64 * self.dt
    }

    /// All instants, in seconds.
    pub fn times(&self) -> impl ExactSizeIterator<Item = f64> + use<> {
        let dt = self.dt;
        (0..self.len).map(move |k| k as f64 * dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_quantities_follow_from_step_and_length() {
        let s = Sampling::new(0.25, 8).unwrap();
        assert_eq!(s.duration(), 2.0);
        assert_eq!(s.rate_hz(), 4.0);
        assert_eq!(s.nyquist_hz(), 2.0);
        assert_eq!(s.line_spacing_hz(), 0.5);
        assert_eq!(s.omega0(), std::f64::consts::PI);
        assert_eq!(s.lines(), 5);
        assert_eq!(s.times().last(), Some(1.75));
        assert_eq!(Sampling::from_rate_hz(4.0, 8), Ok(s));
    }

    #[test]
    fn impossible_axes_are_refused() {
        for dt in [0.0, -1.0, f64::INFINITY] {
            assert_eq!(Sampling::new(dt, 4), Err(SignalError::TimeStep { dt }));
        }
        assert!(Sampling::new(f64::NAN, 4).is_err());
        let rate = Sampling::from_rate_hz(-50.0, 4);
        assert_eq!(
            rate,
            Err(SignalError::NotPositive { what: "sampling rate in Hz", value: -50.0 })
        );
        assert_eq!(Sampling::new(1.0, 0), Err(SignalError::Empty));
    }
}
