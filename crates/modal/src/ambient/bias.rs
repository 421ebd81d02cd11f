//! First-order bias of the maximum of Whittle's likelihood.

use nalgebra::{Complex, DVector};
use rayon::prelude::*;

use super::likelihood::{TASK, gradient, noise};
use super::limits::DETERMINED_SHARE;
use super::lines::PooledLines;
use super::parameters::{Parameters, Span};
use super::search::{Fit, full_step, scaled};
use super::spectrum::Coefficients;
use crate::decomposition::hermitian_eigen;

/// Step of the second differences of the spectrum, in standard errors of a combination of
/// parameters, and largest change of a parameter; the parameters have unit scale.
const ERROR_STEP: f64 = 0.05;

/// Parameters beside those of a fit.
struct Moved {
    parameters: Parameters,
    coefficients: Coefficients,
    /// Factor of the spectrum in half the sum of the second differences over all standard errors.
    weight: f64,
}

impl Fit {
    /// Returns the expected difference between the estimates and the true parameters for lines
    /// without their transient; `None` if the information of the fit cannot be decomposed.
    ///
    /// Averaged over the estimation errors, the fitted spectrum exceeds S by
    /// M = ½ Σ C_ab ∂²S/∂θ_a∂θ_b, with the covariance C. The expected periodogram of the open
    /// record without its transient is also not quite S, the spectrum of an endless record. The
    /// bias is one scoring step from S to the expected periodogram minus M. It is proportional to
    /// 1/T, the standard errors to 1/√T.
    ///
    /// # Source
    /// Cox & Snell (1968), Journal of the Royal Statistical Society B 30, 248–265; Box (1971),
    /// Journal of the Royal Statistical Society B 33, 171–190.
    pub fn bias(&self, lines: &[PooledLines], span: Span) -> Option<DVector<f64>> {
        let endless = Span { duration: f64::INFINITY, ..span };
        let moved = self.moved_by_errors()?;
        let centre = Coefficients::new(&self.parameters);
        let prior = centre.transient_covariance(span).map(Complex::from);
        let one = |line: &PooledLines| {
            let at = |parameters: &Parameters, coefficients: &Coefficients, span: Span| {
                let variances = noise(parameters, &line.terms);
                coefficients.spectrum(&coefficients.kernels(line.omega, span), &variances)
            };
            let gains = centre.transient_gains(line.omega, span);
            let transient = &gains * &prior * gains.adjoint();
            let mut periodogram = at(&self.parameters, &centre, span) - transient;
            let spectrum = at(&self.parameters, &centre, endless);
            for Moved { parameters, coefficients, weight } in &moved {
                let change = at(parameters, coefficients, endless) - &spectrum;
                periodogram -= change * Complex::from(*weight);
            }
            PooledLines { periodogram, ..line.clone() }
        };
        let expected: Vec<PooledLines> =
            lines.par_chunks(TASK).flat_map_iter(|chunk| chunk.iter().map(one)).collect();
        full_step(&self.information, &gradient(&self.parameters, &expected, endless)?)
    }

    /// Returns the parameters on both sides of the fit along each principal direction of the
    /// covariance.
    fn moved_by_errors(&self) -> Option<Vec<Moved>> {
        let (scaled, scale) = scaled(&self.information, 0.0);
        let eigen = hermitian_eigen(scaled)?;
        let mut moved = Vec::with_capacity(2 * scale.len());
        let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        // The lines do not determine the phase of a mode far from all others; no result depends on
        // it.
        for (value, direction) in directions.filter(|(value, _)| **value > DETERMINED_SHARE) {
            let error = direction.component_mul(&scale) / value.sqrt();
            let step = ERROR_STEP / error.amax().max(1.0);
            for side in [step, -step] {
                let mut parameters = self.parameters.clone();
                parameters.values.axpy(side, &error, 1.0);
                let coefficients = Coefficients::new(&parameters);
                moved.push(Moved { parameters, coefficients, weight: 0.5 / (step * step) });
            }
        }
        Some(moved)
    }
}
