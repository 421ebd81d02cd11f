//! Excitation at one frequency.

use std::f64::consts::TAU;

use crate::error::{SignalError, below_nyquist, finite, not_negative, positive};
use crate::record::Record;
use crate::sampling::Sampling;

/// F(t) = A cos(2π f t + φ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    amplitude: f64,
    frequency_hz: f64,
    phase: f64,
}

impl Harmonic {
    /// A cosine of given amplitude, frequency in Hz and phase in rad.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for the amplitude, [`SignalError::NotPositive`] for the
    /// frequency, [`SignalError::Infinite`] for the phase.
    pub fn new(amplitude: f64, frequency_hz: f64, phase: f64) -> Result<Self, SignalError> {
        not_negative("amplitude", amplitude)?;
        positive("frequency in Hz", frequency_hz)?;
        finite("phase", phase)?;
        Ok(Self { amplitude, frequency_hz, phase })
    }

    /// The exact value, in N, at `t` seconds.
    pub fn value(&self, t: f64) -> f64 {
        self.amplitude * (TAU * (self.frequency_hz * t).fract() + self.phase).cos()
    }

    /// The sampled excitation.
    ///
    /// # Errors
    /// [`SignalError::AboveNyquist`].
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        below_nyquist(self.frequency_hz, sampling)?;
        Record::from_fn(sampling, |t| self.value(t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_periods_by_hand() {
        let h = Harmonic::new(2.0, 0.5, -std::f64::consts::FRAC_PI_2).unwrap();
        for (t, expected) in [(0.0, 0.0), (0.5, 2.0), (1.0, 0.0), (1.5, -2.0), (1e6 + 0.5, 2.0)] {
            assert!((h.value(t) - expected).abs() < 1e-14, "t = {t}");
        }
    }

    #[test]
    fn impossible_ones_are_refused() {
        assert!(Harmonic::new(-1.0, 1.0, 0.0).is_err());
        assert!(Harmonic::new(1.0, 0.0, 0.0).is_err());
        assert!(Harmonic::new(1.0, 1.0, f64::NAN).is_err());
        let sampled = Harmonic::new(1.0, 5.0, 0.0).unwrap().sample(Sampling::new(0.1, 8).unwrap());
        assert_eq!(sampled, Err(SignalError::AboveNyquist { frequency_hz: 5.0, nyquist_hz: 5.0 }));
    }
}
