//! Transforms between the lines of a period and a time grid, planned once.

use std::sync::Arc;

use mechid_signal::transform::{self, ComplexToReal, RealToComplex};
use nalgebra::Complex;

/// Period of `samples` samples and its lines 0 to `lines` − 1, scaled as in
/// [`mechid_signal::spectrum`].
#[derive(Clone)]
pub(super) struct Grid {
    lines: usize,
    samples: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Grid {
    /// Creates the grid for lines 0 to `lines` − 1, all below half of `samples`.
    pub(super) fn new(lines: usize, samples: usize) -> Self {
        let (forward, inverse) = (transform::forward(samples), transform::inverse(samples));
        Self { lines, samples, forward, inverse }
    }

    /// Returns the samples of a period from its lines; higher lines are zero.
    pub(super) fn to_samples(&self, lines: impl Iterator<Item = Complex<f64>>) -> Vec<f64> {
        let mut input = self.inverse.make_input_vec();
        for (n, (slot, line)) in input.iter_mut().zip(lines).enumerate() {
            *slot = if n == 0 { Complex::from(line.re) } else { line * 0.5 };
        }
        let mut output = vec![0.0; self.samples];
        self.inverse.process(&mut input, &mut output).expect("DC is real, Nyquist is zero");
        output
    }

    /// Returns lines 0 to `lines` − 1 of a period.
    pub(super) fn to_lines(&self, mut samples: Vec<f64>) -> Vec<Complex<f64>> {
        let mut output = self.forward.make_output_vec();
        self.forward.process(&mut samples, &mut output).expect("buffers come from the plan");
        output.truncate(self.lines);
        let scale = 1.0 / self.samples as f64;
        for (n, line) in output.iter_mut().enumerate() {
            *line *= if n == 0 { scale } else { 2.0 * scale };
        }
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_has_the_lines_of_the_addition_theorem() {
        // For x = 1 + cos τ, the cube is x³ = 5/2 + 15/4 cos τ + 3/2 cos 2τ + 1/4 cos 3τ.
        let grid = Grid::new(4, 32);
        let one = Complex::from(1.0);
        let x = grid.to_samples([one, one].into_iter());
        let cube = grid.to_lines(x.iter().map(|x| x * x * x).collect());
        for (line, expected) in cube.iter().zip([2.5, 3.75, 1.5, 0.25]) {
            assert!((line - expected).norm() < 1e-14);
        }
    }
}
