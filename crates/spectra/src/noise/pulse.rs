//! Noise of forces that act for a few samples only.

use std::ops::Range;

use mechid_signal::Sampling;
use nalgebra::Complex;

/// Noise on the samples of a pulse, and none on the others of its record.
#[derive(Debug, Clone, PartialEq)]
pub struct PulseNoise {
    /// Rows of the record.
    pub rows: Range<usize>,
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Degree of freedom that the force acts on, counted from 0.
    pub channel: usize,
    /// Standard deviation, in N.
    pub deviation: f64,
    /// Samples with noise.
    pub samples: Range<usize>,
}

impl PulseNoise {
    /// Returns the amplitude that a force of 1 N on a sample has on a line at `omega` (rad/s), in N.
    ///
    /// # Source
    /// The shift theorem of Fourier transforms.
    pub fn impulse(&self, sample: usize, omega: f64) -> Complex<f64> {
        let turn = -omega * sample as f64 * self.sampling.dt();
        Complex::from_polar(2.0 / self.sampling.len() as f64, turn)
    }
}
