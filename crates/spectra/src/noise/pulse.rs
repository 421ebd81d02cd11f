//! Noise of forces that act only for a few samples.

use std::ops::Range;

use mechid_signal::Sampling;
use nalgebra::Complex;

/// Noise on the samples of a pulse; the other samples of its record have none.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseNoise {
    /// Rows of the record.
    pub rows: Range<usize>,
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Degree of freedom on which the force acts, counted from 0.
    pub channel: usize,
    /// Standard deviation, in N.
    pub deviation: f64,
    /// Samples with noise.
    pub samples: Range<usize>,
}

impl PulseNoise {
    /// Returns the amplitude, on a line at `omega` (rad/s), of a force of 1 N on one sample, in N.
    ///
    /// # Source
    /// The shift theorem of Fourier transforms.
    pub fn impulse(&self, sample: usize, omega: f64) -> Complex<f64> {
        let turn = -omega * sample as f64 * self.sampling.dt();
        Complex::from_polar(2.0 / self.sampling.len() as f64, turn)
    }
}
