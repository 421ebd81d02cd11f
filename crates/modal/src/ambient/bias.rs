//! First-order bias of the maximum of Whittle's likelihood.

use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::likelihood::{TASK, gradient, noise};
use super::limits::DETERMINED_SHARE;
use super::lines::PooledLines;
use super::parameters::Span;
use super::search::{Fit, full_step, scaled};
use super::spectrum::{Coefficients, hermitian_sum};
use super::transient::TransientResponse;
use crate::decomposition::hermitian_eigen;

/// Step of the second differences of the spectrum, in standard errors of a combination of
/// parameters. Parameters have unit scale. If the step would change a parameter by more than 0.05,
/// a shorter step is used.
const ERROR_STEP: f64 = 0.05;

/// Parts of the mean excess of the fitted spectrum over the true spectrum, M = ½ Σ C_ab
/// ∂²S/∂θ_a∂θ_b, with the covariance C of the parameters θ.
///
/// C = F Fᵀ with a lower-triangular F, so that M is half the sum of the second derivatives of S
/// along the columns of F. The poles are the first parameters: only the first 2·modes columns
/// change them.
pub(super) struct Excess {
    centre: Coefficients,
    /// Coefficients after a step to either side of the fit, along each column of F that changes
    /// poles. The number beside the coefficients is the weight of their spectrum in M.
    moved: Vec<(Coefficients, f64)>,
    /// Contribution to M of the columns of F that do not change poles. An entry of `residues` is
    /// half the sum of the second derivatives of ψγᵀ of one mode; `direct_power` is that of D Q Dᵀ.
    residues: Vec<DMatrix<Complex<f64>>>,
    direct_power: DMatrix<f64>,
    /// Covariance of the noise parameters of each output.
    noise: Vec<DMatrix<f64>>,
}

impl Fit {
    /// Returns the expected difference between the estimates and the true parameters, for lines
    /// without their transient. `None` if the information matrix of the fit cannot be decomposed or
    /// does not determine any parameter.
    ///
    /// Averaged over the estimation errors, the fitted spectrum exceeds S by M ([`Excess`]). The
    /// expected periodogram of the open record without its transient also differs a little from S,
    /// the spectrum of an endless record. The bias is one scoring step from S to the expected
    /// periodogram minus M. The bias is proportional to 1/T, the standard errors to 1/√T.
    ///
    /// # Source
    /// Cox & Snell (1968), Journal of the Royal Statistical Society B 30, 248–265; Box (1971),
    /// Journal of the Royal Statistical Society B 33, 171–190.
    pub fn bias(&self, lines: &[PooledLines], span: Span) -> Option<DVector<f64>> {
        let endless = Span { duration: f64::INFINITY, ..span };
        let excess = self.excess()?;
        let centre = &excess.centre;
        let response = TransientResponse::new(centre.clone(), span)?;
        let prior = response.prior.map(Complex::from);
        let one = |line: &PooledLines| {
            let variances = noise(&self.parameters, &line.terms);
            let gains = response.gains(line.omega);
            let transient = &gains * &prior * gains.adjoint();
            let whole = centre.spectrum(&centre.kernels(line.omega, span), &variances);
            let periodogram = whole - transient - excess.at(line, &variances, endless);
            PooledLines { periodogram, ..line.clone() }
        };
        let expected: Vec<PooledLines> =
            lines.par_chunks(TASK).flat_map_iter(|chunk| chunk.iter().map(one)).collect();
        full_step(&self.information, &gradient(&self.parameters, &expected, endless)?)
    }

    /// Returns the parts of the mean excess of the fitted spectrum over the true spectrum.
    pub(super) fn excess(&self) -> Option<Excess> {
        let layout = &self.parameters.layout;
        let (m, p) = (layout.modes, layout.outputs);
        let factor = self.covariance_factor()?;
        let noise = (0..p).map(|output| {
            let rows: Vec<usize> =
                (0..layout.noise_terms).map(|d| layout.noise(d, output)).collect();
            let rows = factor.select_rows(&rows);
            &rows * rows.transpose()
        });
        let mut excess = Excess {
            centre: Coefficients::new(&self.parameters),
            moved: Vec::with_capacity(4 * m),
            residues: vec![DMatrix::zeros(p, p); m],
            direct_power: DMatrix::zeros(p, p),
            noise: noise.collect(),
        };
        // The columns of F for the noise parameters change neither poles nor residues.
        for (index, error) in factor.column_iter().enumerate().take(layout.noise(0, 0)) {
            let step = ERROR_STEP / error.amax().max(1.0);
            let weight = 0.5 / (step * step);
            for side in [step, -step] {
                let mut parameters = self.parameters.clone();
                parameters.values.axpy(side, &error, 1.0);
                let coefficients = Coefficients::new(&parameters);
                if index < 2 * m {
                    excess.moved.push((coefficients, weight));
                } else {
                    excess.add_residues(&coefficients, weight);
                }
            }
        }
        Some(excess)
    }

    /// Returns a lower-triangular F with the covariance F Fᵀ of the determined combinations of
    /// parameters: parameters × combinations.
    fn covariance_factor(&self) -> Option<DMatrix<f64>> {
        let (scaled, scale) = scaled(&self.information, 0.0);
        let eigen = hermitian_eigen(scaled)?;
        let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        // The lines do not determine the phase of a mode that is far from all others; no result
        // depends on this phase.
        let errors: Vec<DVector<f64>> = directions
            .filter(|(value, _)| **value > DETERMINED_SHARE)
            .map(|(value, direction)| direction.component_mul(&scale) / value.sqrt())
            .collect();
        (!errors.is_empty())
            .then(|| DMatrix::from_columns(&errors).transpose().qr().r().transpose())
    }
}

impl Excess {
    /// Adds `weight` times the differences of ψγᵀ and D Q Dᵀ between `moved` and the centre;
    /// `moved` and the centre have the same poles.
    fn add_residues(&mut self, moved: &Coefficients, weight: f64) {
        for (r, sum) in self.residues.iter_mut().enumerate() {
            for (coefficients, sign) in [(moved, weight), (&self.centre, -weight)] {
                let shape = coefficients.shapes.column(r);
                sum.ger(sign.into(), &shape, &coefficients.covariances.column(r), 1.0.into());
            }
        }
        self.direct_power += (&moved.direct_power - &self.centre.direct_power) * weight;
    }

    /// Returns the mean excess M at a line, for the noise variances `variances`.
    pub(super) fn at(
        &self,
        line: &PooledLines,
        variances: &[f64],
        span: Span,
    ) -> DMatrix<Complex<f64>> {
        let terms = DVector::from_column_slice(&line.terms);
        // The second derivative of exp(tᵀn) along an error e of n is (tᵀe)² exp(tᵀn).
        let noise: Vec<f64> = variances
            .iter()
            .zip(&self.noise)
            .map(|(variance, covariance)| 0.5 * variance * terms.dot(&(covariance * &terms)))
            .collect();
        let kernels = self.centre.kernels(line.omega, span);
        let mut half = DMatrix::zeros(noise.len(), noise.len());
        for (residue, [value, mirrored]) in self.residues.iter().zip(&kernels.value) {
            half.zip_apply(residue, |sum, z| *sum += value * z + mirrored * z.conj());
        }
        let mut excess = hermitian_sum(&half, &self.direct_power);
        let none = vec![0.0; noise.len()];
        let centre = self.centre.spectrum(&kernels, &none);
        for (moved, weight) in &self.moved {
            let change = moved.spectrum(&moved.kernels(line.omega, span), &none) - &centre;
            excess += change * Complex::from(*weight);
        }
        for (i, noise) in noise.into_iter().enumerate() {
            excess[(i, i)] += Complex::from(noise);
        }
        excess
    }
}
