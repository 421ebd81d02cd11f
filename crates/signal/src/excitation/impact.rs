//! Hammer impacts.

use std::f64::consts::PI;

use crate::error::{SignalError, finite, fits_in_memory, not_negative, positive};
use crate::record::Record;
use crate::sampling::Sampling;

/// An ideal impact of given momentum, in the unit of the signal times seconds: N·s for a force.
///
/// The sampled impact is momentum / Δt at the sample nearest to its instant, and zero at all other
/// samples.
///
/// # Source
/// Clough & Penzien, *Dynamics of Structures*, the chapter on impulsive loading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impulse {
    momentum: f64,
    at: f64,
}

impl Impulse {
    /// An impact of `momentum` at `at` seconds.
    ///
    /// # Errors
    /// [`SignalError::Infinite`] for the momentum, [`SignalError::Negative`] for the instant.
    pub fn new(momentum: f64, at: f64) -> Result<Self, SignalError> {
        finite("momentum", momentum)?;
        not_negative("instant", at)?;
        Ok(Self { momentum, at })
    }

    /// The sampled impact.
    ///
    /// # Errors
    /// [`SignalError::Range`] if its instant lies beyond the last sample.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        let nearest = (self.at / sampling.dt()).round();
        let last = sampling.len() - 1;
        if nearest > last as f64 {
            let high = sampling.time(last);
            return Err(SignalError::Range { what: "instant", value: self.at, low: 0.0, high });
        }
        fits_in_memory(sampling.len(), 1)?;
        let mut force = vec![0.0; sampling.len()];
        force[nearest as usize] = self.momentum / sampling.dt();
        Record::from_channel(sampling, force)
    }
}

/// An impact in the shape of half a sine, such as that of an instrumented hammer: F(t) = F_max
/// sin(π (t − t_0) / d) for t_0 ≤ t ≤ t_0 + d, zero elsewhere.
///
/// # Source
/// Clough & Penzien, *Dynamics of Structures*, the chapter on impulsive loading (half-sine pulse).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSine {
    peak: f64,
    start: f64,
    duration: f64,
}

impl HalfSine {
    /// An impact of given peak (N), start and duration in seconds.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for the peak or the start, [`SignalError::NotPositive`] for the
    /// duration.
    pub fn new(peak: f64, start: f64, duration: f64) -> Result<Self, SignalError> {
        not_negative("peak", peak)?;
        not_negative("start", start)?;
        positive("duration", duration)?;
        Ok(Self { peak, start, duration })
    }

    /// Momentum ∫ F dt = 2 F_max d / π, in N·s.
    pub fn momentum(&self) -> f64 {
        2.0 * self.peak * self.duration / PI
    }

    /// The exact value, in N, at `t` seconds.
    pub fn value(&self, t: f64) -> f64 {
        let passed = (t - self.start) / self.duration;
        if (0.0..=1.0).contains(&passed) { self.peak * (PI * passed).sin() } else { 0.0 }
    }

    /// Samples the impact; a part beyond the last sample is omitted.
    ///
    /// # Errors
    /// None for a valid impact; the signature is the same for all excitations.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        Record::from_fn(sampling, |t| self.value(t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_keeps_its_momentum_at_any_rate() {
        for dt in [0.1, 0.01, 0.003] {
            let s = Sampling::new(dt, 400).unwrap();
            let r = Impulse::new(3.0, 0.5).unwrap().sample(s).unwrap();
            assert!((r.column(0).sum() * dt - 3.0).abs() < 1e-12);
            let at = r.column(0).argmax().0 as f64 * dt;
            assert!((at - 0.5).abs() <= 0.5 * dt);
        }
        let late = Impulse::new(3.0, 0.5).unwrap().sample(Sampling::new(0.1, 5).unwrap());
        assert!(matches!(late, Err(SignalError::Range { value: 0.5, .. })));
    }

    #[test]
    fn half_sine_by_hand() {
        let blow = HalfSine::new(10.0, 0.1, 0.2).unwrap();
        for (t, expected) in [(0.05, 0.0), (0.1, 0.0), (0.2, 10.0), (0.4, 0.0)] {
            assert!((blow.value(t) - expected).abs() < 1e-13, "t = {t}");
        }
        // The rectangle rule errs by (π/n)²/12 for n samples under the arch, n = 2000.
        let r = blow.sample(Sampling::new(1e-4, 5000).unwrap()).unwrap();
        assert!((r.column(0).sum() * 1e-4 / blow.momentum() - 1.0).abs() < 3e-7);
        assert!(HalfSine::new(-1.0, 0.0, 1.0).is_err());
        assert!(HalfSine::new(1.0, 0.0, 0.0).is_err());
    }
}
