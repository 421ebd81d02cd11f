//! Swept sine.

use std::f64::consts::{PI, TAU};

use crate::error::{SignalError, below_nyquist, not_negative, positive, within};
use crate::record::Record;
use crate::sampling::Sampling;

/// Law of the frequency of a sweep between its two ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepLaw {
    /// f(t) = f_0 + (f_1 − f_0) t/T: the same time per Hz.
    Linear,
    /// f(t) = f_0 (f_1/f_0)^(t/T): the same time per octave.
    Logarithmic,
}

/// F(t) = A w(t) sin 2π ∫ f dt over 0 ≤ t ≤ T, zero elsewhere; upwards or downwards.
///
/// w(t) rises and falls as half a cosine at the two ends ([`with_ramps`](Self::with_ramps)), so
/// that the sweep begins and ends without a shock.
///
/// # Source
/// Farina (2000), *Simultaneous measurement of impulse response and distortion with a swept-sine
/// technique*, 108th AES Convention (the logarithmic law).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    amplitude: f64,
    start_hz: f64,
    end_hz: f64,
    duration: f64,
    law: SweepLaw,
    ramp: f64,
}

impl Sweep {
    /// A sweep of `duration` seconds between two frequencies in Hz, without ramps.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for the amplitude, [`SignalError::NotPositive`] for the duration
    /// or a frequency.
    pub fn new(
        amplitude: f64,
        start_hz: f64,
        end_hz: f64,
        duration: f64,
        law: SweepLaw,
    ) -> Result<Self, SignalError> {
        not_negative("amplitude", amplitude)?;
        positive("start frequency in Hz", start_hz)?;
        positive("end frequency in Hz", end_hz)?;
        positive("duration", duration)?;
        Ok(Self { amplitude, start_hz, end_hz, duration, law, ramp: 0.0 })
    }

    /// Returns the same sweep with ramps from and to zero over `ramp` seconds at each end.
    ///
    /// # Errors
    /// [`SignalError::Range`] unless 0 ≤ `ramp` ≤ half the duration.
    pub fn with_ramps(self, ramp: f64) -> Result<Self, SignalError> {
        Ok(Self { ramp: within("ramp", ramp, 0.0, 0.5 * self.duration)?, ..self })
    }

    /// The frequency in Hz at `t` seconds.
    pub fn frequency_hz(&self, t: f64) -> f64 {
        let passed = t / self.duration;
        match self.law {
            SweepLaw::Linear => self.start_hz + (self.end_hz - self.start_hz) * passed,
            SweepLaw::Logarithmic => self.start_hz * (self.end_hz / self.start_hz).powf(passed),
        }
    }

    /// Number of cycles since the start, ∫ f dt.
    fn cycles(&self, t: f64) -> f64 {
        let rate = (self.end_hz / self.start_hz).ln() / self.duration;
        match self.law {
            // A logarithmic sweep between equal ends is also a sine.
            SweepLaw::Logarithmic if rate != 0.0 => self.start_hz * (rate * t).exp_m1() / rate,
            _ => t * (self.start_hz + 0.5 * (self.end_hz - self.start_hz) * t / self.duration),
        }
    }

    /// The ramps at the two ends.
    fn window(&self, t: f64) -> f64 {
        let to_end = t.min(self.duration - t);
        if to_end < 0.0 {
            return 0.0;
        }
        if to_end >= self.ramp { 1.0 } else { 0.5 - 0.5 * (PI * to_end / self.ramp).cos() }
    }

    /// The exact value, in N, at `t` seconds.
    pub fn value(&self, t: f64) -> f64 {
        match self.window(t) {
            0.0 => 0.0,
            w => self.amplitude * w * (TAU * self.cycles(t).fract()).sin(),
        }
    }

    /// Samples the sweep; a part beyond the last sample is omitted.
    ///
    /// # Errors
    /// [`SignalError::AboveNyquist`] if either end is at or above half the sampling rate.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        below_nyquist(self.start_hz.max(self.end_hz), sampling)?;
        Record::from_fn(sampling, |t| self.value(t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_are_the_integral_of_the_frequency() {
        for law in [SweepLaw::Linear, SweepLaw::Logarithmic] {
            for (from, to) in [(2.0, 50.0), (50.0, 2.0), (7.0, 7.0)] {
                let s = Sweep::new(1.0, from, to, 4.0, law).unwrap();
                assert!((s.frequency_hz(0.0) - from).abs() < 1e-12);
                assert!((s.frequency_hz(4.0) - to).abs() < 1e-12);
                // Simpson's rule with 400 intervals of 0.01 s: error about h⁴ f'''' T / 180.
                let h = 0.01;
                let weight = |k: i32| [2.0, 4.0][k as usize % 2];
                let f = |k: i32| s.frequency_hz(h * f64::from(k));
                let inner: f64 = (1..400).map(|k| weight(k) * f(k)).sum();
                let integral = h / 3.0 * (f(0) + inner + f(400));
                assert!((s.cycles(4.0) - integral).abs() < 1e-8, "{law:?} {from} {to}");
            }
        }
    }

    #[test]
    fn ends_are_ramped() {
        let plain = Sweep::new(3.0, 1.0, 9.0, 2.0, SweepLaw::Linear).unwrap();
        let ramped = plain.with_ramps(0.2).unwrap();
        assert_eq!(ramped.value(1.0), plain.value(1.0));
        assert!((ramped.value(0.1) - 0.5 * plain.value(0.1)).abs() < 1e-14);
        assert!((ramped.value(1.9) - 0.5 * plain.value(1.9)).abs() < 1e-13);
        assert_eq!((ramped.value(-0.1), ramped.value(2.1)), (0.0, 0.0));
    }

    #[test]
    fn impossible_sweeps_are_refused() {
        let sweep = |a, from, to, d| Sweep::new(a, from, to, d, SweepLaw::Logarithmic);
        assert!(sweep(-1.0, 1.0, 2.0, 1.0).is_err());
        assert!(sweep(1.0, 0.0, 2.0, 1.0).is_err());
        assert!(sweep(1.0, 1.0, f64::INFINITY, 1.0).is_err());
        assert!(sweep(1.0, 1.0, 2.0, -1.0).is_err());
        let good = sweep(1.0, 1.0, 2.0, 1.0).unwrap();
        assert!(good.with_ramps(0.6).is_err());
        assert!(matches!(
            good.sample(Sampling::new(0.25, 10).unwrap()),
            Err(SignalError::AboveNyquist { frequency_hz: 2.0, .. })
        ));
    }
}
