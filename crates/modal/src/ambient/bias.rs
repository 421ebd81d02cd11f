//! First-order bias of the maximum of Whittle's likelihood.

use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::likelihood::{TASK, gradient, noise};
use super::limits::DETERMINED_SHARE;
use super::lines::PooledLines;
use super::parameters::{Parameters, Span};
use super::search::{Fit, full_step, scaled};
use super::spectrum::Coefficients;
use crate::decomposition::hermitian_eigen;

/// Step of the second differences of the spectrum, in standard errors of a combination of
/// parameters.
const STEP: f64 = 0.05;

impl Fit {
    /// Returns the expected difference between the estimates and the true parameters; `None` if
    /// the information of the fit cannot be decomposed.
    ///
    /// The estimates are those of a mean periodogram S; the mean of S over the distribution of the
    /// estimates differs from S by M = ½ Σ C_ab ∂²S/∂θ_a∂θ_b, with the covariance C. The bias is
    /// the step of scoring that takes a periodogram S − M for S. It falls with the length of the
    /// record as its inverse, the standard errors as its square root.
    ///
    /// # Source
    /// Cox & Snell (1968), Journal of the Royal Statistical Society B 30, 248–265; Box (1971),
    /// Journal of the Royal Statistical Society B 33, 171–190.
    pub fn bias(&self, lines: &[PooledLines], span: Span) -> Option<DVector<f64>> {
        let moved = self.moved_by_errors()?;
        let centre = Coefficients::new(&self.parameters);
        let one = |line: &PooledLines| {
            let variances = |parameters: &Parameters| noise(parameters, &line.terms);
            let spectrum =
                centre.spectrum(&centre.kernels(line.omega, span), &variances(&self.parameters));
            let mut change = DMatrix::<Complex<f64>>::zeros(spectrum.nrows(), spectrum.ncols());
            for (parameters, coefficients) in &moved {
                let kernels = coefficients.kernels(line.omega, span);
                change += coefficients.spectrum(&kernels, &variances(parameters)) - &spectrum;
            }
            // Both sides of each direction: the sum is its second difference.
            let mean_change = change * Complex::from(0.5 / (STEP * STEP));
            PooledLines { periodogram: spectrum - mean_change, ..line.clone() }
        };
        let expected: Vec<PooledLines> =
            lines.par_chunks(TASK).flat_map_iter(|chunk| chunk.iter().map(one)).collect();
        full_step(&self.information, &gradient(&self.parameters, &expected, span)?)
    }

    /// Returns the parameters and their coefficients on both sides of the fit along each principal
    /// direction of the covariance, at a distance of [`STEP`] standard errors.
    fn moved_by_errors(&self) -> Option<Vec<(Parameters, Coefficients)>> {
        let (scaled, scale) = scaled(&self.information, 0.0);
        let eigen = hermitian_eigen(scaled)?;
        let mut moved = Vec::with_capacity(2 * scale.len());
        let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        // The lines do not determine the phase of a mode far from all others; nothing depends on it.
        for (value, direction) in directions.filter(|(value, _)| **value > DETERMINED_SHARE) {
            let step = direction.component_mul(&scale) * (STEP / value.sqrt());
            for side in [1.0, -1.0] {
                let mut parameters = self.parameters.clone();
                parameters.values.axpy(side, &step, 1.0);
                let coefficients = Coefficients::new(&parameters);
                moved.push((parameters, coefficients));
            }
        }
        Some(moved)
    }
}
