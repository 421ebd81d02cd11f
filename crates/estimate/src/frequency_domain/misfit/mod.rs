//! Measured against modelled displacement, in units of the noise.

mod row;
#[cfg(test)]
mod tests;

use mechid_model::{Matrix, Parameter};
use nalgebra::{Complex, DMatrix, DVector};

use super::levenberg_marquardt::SumOfSquares;
use super::{FrequencyData, NoiseSpectrum};
use crate::{EstimateError, Unknowns};
use row::Row;

type ComplexMatrix = DMatrix<Complex<f64>>;
type ComplexVector = DVector<Complex<f64>>;

/// What is known of the noise of each row.
pub(super) enum Noise<'a> {
    /// The force is exact; L of the displacement's covariance L Lᴴ.
    Output(Vec<ComplexMatrix>),
    /// Force and displacement are noisy.
    Both(&'a NoiseSpectrum),
}

/// e = X − G(ω) F for every row, G = (K + iωC − ω²M)⁻¹, divided by its own standard
/// deviation: √2·L⁻¹e with L Lᴴ = E[e eᴴ], real and imaginary parts apart, has unit variance
/// and no correlation.
///
/// With a noisy force the covariance [I −G] E[z zᴴ] [I −G]ᴴ depends on the parameters;
/// its sum of squares is what is left of the likelihood once the true force and
/// displacement of each row have been eliminated.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the
/// chapter on maximum likelihood in errors-in-variables.
pub(super) struct Misfit<'a> {
    data: &'a FrequencyData,
    unknowns: &'a Unknowns,
    free: Vec<Parameter>,
    noise: Noise<'a>,
    /// n × rows, so that the forces of one row are contiguous.
    force: ComplexMatrix,
    displacement: ComplexMatrix,
    /// All rows at the parameters of the last evaluation.
    rows: Vec<Row>,
}

impl<'a> Misfit<'a> {
    pub(super) fn new(data: &'a FrequencyData, unknowns: &'a Unknowns, noise: Noise<'a>) -> Self {
        Self {
            data,
            unknowns,
            free: unknowns.free(),
            noise,
            force: data.force().transpose(),
            displacement: data.displacement().transpose(),
            rows: (0..data.len()).map(|_| Row::new(data.dof())).collect(),
        }
    }

    /// X − G F, rows × n, at the parameters of the last evaluation.
    pub(super) fn errors(&self) -> ComplexMatrix {
        let mut errors = self.displacement.clone();
        for (mut error, row) in errors.column_iter_mut().zip(&self.rows) {
            error -= row.displacement();
        }
        errors.transpose()
    }

    /// Sensitivities of the whitened displacement at the most likely force: the Fisher
    /// information is their Gram matrix. At the parameters of the last evaluation.
    pub(super) fn sensitivity(&self) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.residuals(), self.free.len());
        let most_likely = |at: usize| self.rows[at].most_likely_displacement(self.force.column(at));
        self.differentiate(&mut jacobian, most_likely, |_, _, _, _| {});
        jacobian
    }

    /// Whitened G E_ij X s^p for every row and parameter, after `correct` has seen it.
    fn differentiate(
        &self,
        jacobian: &mut DMatrix<f64>,
        displacement: impl Fn(usize) -> ComplexVector,
        correct: impl Fn(&Row, &Parameter, Complex<f64>, &mut ComplexVector),
    ) {
        let n = self.data.dof();
        let mut white = DVector::zeros(n);
        for (at, row) in self.rows.iter().enumerate() {
            let s = Complex::new(0.0, self.data.omega()[at]);
            let displacement = displacement(at);
            for (parameter, mut column) in self.free.iter().zip(jacobian.column_iter_mut()) {
                let power = match parameter.matrix() {
                    Matrix::Mass => s * s,
                    Matrix::Damping => s,
                    Matrix::Stiffness => Complex::from(1.0),
                };
                white.copy_from(&row.white_receptance().column(parameter.row()));
                white *= power * displacement[parameter.column()];
                correct(row, parameter, power, &mut white);
                write_real(&white, &mut column.as_mut_slice()[2 * n * at..2 * n * (at + 1)]);
            }
        }
    }
}

impl SumOfSquares for Misfit<'_> {
    fn residuals(&self) -> usize {
        2 * self.data.dof() * self.data.len()
    }

    fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
        let matrices = self.unknowns.assemble(theta.as_slice());
        let n = self.data.dof();
        let parts = residual.as_mut_slice().chunks_exact_mut(2 * n);
        for (at, (row, part)) in self.rows.iter_mut().zip(parts).enumerate() {
            let (force, displacement) = (self.force.column(at), self.displacement.column(at));
            let exists = row.model(&matrices, self.data.omega()[at], force)
                && match &self.noise {
                    Noise::Output(lower) => row.whiten(displacement, &lower[at]),
                    Noise::Both(noise) => row.whiten_both(displacement, noise.covariance(at)),
                };
            if !exists {
                return false;
            }
            write_real(row.white(), part);
        }
        true
    }

    fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
        let modelled = |at: usize| self.rows[at].displacement().clone();
        self.differentiate(jacobian, modelled, Row::subtract_change_of_spread);
    }
}

/// L of a Hermitian positive definite matrix L Lᴴ, `None` for any other.
pub(super) fn cholesky(matrix: ComplexMatrix) -> Option<ComplexMatrix> {
    // nalgebra takes complex roots of negative pivots, so they have to be looked for.
    let lower = matrix.cholesky()?.unpack();
    let positive = |z: &Complex<f64>| z.re > 0.0 && z.im.abs() <= 1e-8 * z.re;
    lower.diagonal().iter().all(positive).then_some(lower)
}

/// L of the displacement part of every covariance.
///
/// # Errors
/// [`EstimateError::SingularNoise`] where a displacement has no noise at all, or two
/// of them the same.
pub(super) fn output_weights(noise: &NoiseSpectrum) -> Result<Vec<ComplexMatrix>, EstimateError> {
    let n = noise.dof();
    noise
        .omega()
        .iter()
        .enumerate()
        .map(|(row, &omega)| {
            let covariance = noise.covariance(row).view((0, 0), (n, n)).into_owned();
            cholesky(covariance)
                .ok_or(EstimateError::SingularNoise { frequency_hz: omega / std::f64::consts::TAU })
        })
        .collect()
}

fn write_real(white: &ComplexVector, part: &mut [f64]) {
    for (z, pair) in white.iter().zip(part.chunks_exact_mut(2)) {
        pair[0] = std::f64::consts::SQRT_2 * z.re;
        pair[1] = std::f64::consts::SQRT_2 * z.im;
    }
}
