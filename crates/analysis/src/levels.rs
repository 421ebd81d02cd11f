//! Levels of a channel whose samples come a block at a time.

use mechid_signal::{SignalError, measures};

/// Running statistics of the samples so far.
#[derive(Debug, Clone, Copy)]
pub struct Levels {
    samples: usize,
    sum: f64,
    /// Sum of squares of the samples over the peak: squares of large or small values leave the range of numbers.
    squares: f64,
    pub peak: f64,
    pub minimum: f64,
    pub maximum: f64,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            samples: 0,
            // What a sum of nothing is.
            sum: -0.0,
            squares: 0.0,
            peak: 0.0,
            minimum: f64::INFINITY,
            maximum: f64::NEG_INFINITY,
        }
    }
}

impl Levels {
    /// The next samples.
    pub fn push(&mut self, values: &[f64]) -> Result<(), SignalError> {
        for (sample, value) in (self.samples..).zip(values) {
            self.sum += value;
            if !self.sum.is_finite() {
                return Err(SignalError::NotFinite { sample, channel: 0, value: self.sum });
            }
        }
        self.samples += values.len();
        self.minimum = values.iter().copied().fold(self.minimum, f64::min);
        self.maximum = values.iter().copied().fold(self.maximum, f64::max);
        let peak = self.peak.max(measures::peak(values));
        if peak > 0.0 {
            let before = self.squares * (self.peak / peak).powi(2);
            self.squares = values.iter().fold(before, |sum, x| sum + (x / peak).powi(2));
        }
        self.peak = peak;
        Ok(())
    }

    pub fn rms(&self) -> f64 {
        if self.peak == 0.0 {
            return 0.0;
        }
        self.peak * (self.squares / self.samples as f64).sqrt()
    }

    /// The mean, or zero where it is nothing but the rounding of the samples.
    pub fn mean(&self) -> f64 {
        let mean = self.sum / self.samples as f64;
        if mean.abs() < 4.0 * f64::EPSILON * self.rms() { 0.0 } else { mean }
    }
}
