//! Measured against modelled displacement, in units of the noise.

use nalgebra::{Complex, DMatrix, DVector};

use super::{FrequencyData, NoiseSpectrum, levenberg_marquardt::SumOfSquares};
use crate::{EstimateError, Parameter, Unknowns};
use mechid_model::Matrix;

type ComplexMatrix = DMatrix<Complex<f64>>;

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
}

/// One row at one set of parameters.
struct Row {
    /// G = (K + iωC − ω²M)⁻¹.
    receptance: ComplexMatrix,
    /// G F.
    displacement: DVector<Complex<f64>>,
    /// L⁻¹ G.
    white_receptance: ComplexMatrix,
    /// L⁻¹ e.
    white: DVector<Complex<f64>>,
    /// With a noisy force: how the covariance depends on the parameters.
    spread: Option<Spread>,
}

/// Parts of a covariance that depends on the parameters.
struct Spread {
    /// L.
    lower: ComplexMatrix,
    /// Q = E[ΔF ΔXᴴ] − E[ΔF ΔFᴴ] Gᴴ.
    cross: ComplexMatrix,
    /// G Q L⁻ᴴ.
    white_cross: ComplexMatrix,
}

impl<'a> Misfit<'a> {
    pub(super) fn new(data: &'a FrequencyData, unknowns: &'a Unknowns, noise: Noise<'a>) -> Self {
        Self { data, unknowns, free: unknowns.free(), noise }
    }

    /// X − G F, rows × n, at `theta`.
    pub(super) fn errors(&self, theta: &DVector<f64>) -> Option<ComplexMatrix> {
        let matrices = self.unknowns.assemble(theta.as_slice());
        let mut errors = self.data.displacement().clone();
        for row in 0..self.data.len() {
            let receptance = self.receptance(&matrices, row)?;
            let modelled = receptance * self.data.force().row(row).transpose();
            let mut error = errors.row_mut(row);
            error -= modelled.transpose();
        }
        Some(errors)
    }

    /// Sensitivities of the whitened displacement at the most likely force: the Fisher
    /// information is their Gram matrix.
    pub(super) fn sensitivity(&self, theta: &DVector<f64>) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.residuals(), self.free.len());
        self.differentiate(theta, &mut jacobian, true);
        jacobian
    }

    fn receptance(&self, matrices: &[DMatrix<f64>; 3], row: usize) -> Option<ComplexMatrix> {
        let (n, s) = (self.data.dof(), Complex::new(0.0, self.data.omega()[row]));
        let [m, c, k] = matrices;
        let dynamic = DMatrix::from_fn(n, n, |i, j| k[(i, j)] + s * (c[(i, j)] + s * m[(i, j)]));
        let mut receptance = DMatrix::identity(n, n);
        (dynamic.lu().solve_mut(&mut receptance)
            && receptance.iter().all(|z: &Complex<f64>| z.is_finite()))
        .then_some(receptance)
    }

    fn row(&self, matrices: &[DMatrix<f64>; 3], row: usize) -> Option<Row> {
        let receptance = self.receptance(matrices, row)?;
        let displacement = &receptance * self.data.force().row(row).transpose();
        let mut white = self.data.displacement().row(row).transpose() - &displacement;
        let mut white_receptance = receptance.clone();
        let spread = match &self.noise {
            Noise::Output(lower) => {
                let solved = lower[row].solve_lower_triangular_mut(&mut white)
                    && lower[row].solve_lower_triangular_mut(&mut white_receptance);
                solved.then_some(())?;
                None
            }
            Noise::Both(noise) => {
                let spread = Spread::new(noise.covariance(row), &receptance)?;
                let solved = spread.lower.solve_lower_triangular_mut(&mut white)
                    && spread.lower.solve_lower_triangular_mut(&mut white_receptance);
                solved.then_some(())?;
                Some(spread)
            }
        };
        Some(Row { receptance, displacement, white_receptance, white, spread })
    }

    fn differentiate(&self, theta: &DVector<f64>, jacobian: &mut DMatrix<f64>, fisher: bool) {
        let matrices = self.unknowns.assemble(theta.as_slice());
        let n = self.data.dof();
        let mut white = DVector::zeros(n);
        for at in 0..self.data.len() {
            let row = self.row(&matrices, at).expect("the residual exists here");
            let s = Complex::new(0.0, self.data.omega()[at]);
            let displacement = if fisher {
                row.most_likely_displacement(&self.data.force().row(at).transpose())
            } else {
                row.displacement.clone()
            };
            for (parameter, mut column) in self.free.iter().zip(jacobian.column_iter_mut()) {
                let power = match parameter.matrix() {
                    Matrix::Mass => s * s,
                    Matrix::Damping => s,
                    Matrix::Stiffness => Complex::new(1.0, 0.0),
                };
                white.copy_from(&row.white_receptance.column(parameter.row()));
                white *= power * displacement[parameter.column()];
                if !fisher {
                    row.subtract_change_of_spread(parameter, power, &mut white);
                }
                write_real(&white, &mut column.as_mut_slice()[2 * n * at..2 * n * (at + 1)]);
            }
        }
    }
}

impl SumOfSquares for Misfit<'_> {
    fn residuals(&self) -> usize {
        2 * self.data.dof() * self.data.len()
    }

    fn residual(&self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
        let matrices = self.unknowns.assemble(theta.as_slice());
        let n = self.data.dof();
        for (at, part) in residual.as_mut_slice().chunks_exact_mut(2 * n).enumerate() {
            match self.row(&matrices, at) {
                Some(row) => write_real(&row.white, part),
                None => return false,
            }
        }
        true
    }

    fn jacobian(&self, theta: &DVector<f64>, jacobian: &mut DMatrix<f64>) {
        self.differentiate(theta, jacobian, false);
    }
}

impl Row {
    /// G F̂ with the force F̂ = F − Q (L Lᴴ)⁻¹ e that, within its noise, agrees best with
    /// the displacement.
    fn most_likely_displacement(&self, force: &DVector<Complex<f64>>) -> DVector<Complex<f64>> {
        let Some(spread) = &self.spread else { return self.displacement.clone() };
        let mut whitened_twice = self.white.clone();
        spread.lower.ad_solve_lower_triangular_mut(&mut whitened_twice);
        &self.receptance * (force - &spread.cross * whitened_twice)
    }

    /// −Φ(S) L⁻¹e, with S = L⁻¹ dC L⁻ᴴ the relative change of the covariance and Φ its lower
    /// triangle with half the diagonal: the derivative of L⁻¹ applied to e.
    fn subtract_change_of_spread(
        &self,
        parameter: &Parameter,
        power: Complex<f64>,
        white: &mut DVector<Complex<f64>>,
    ) {
        let Some(spread) = &self.spread else { return };
        let u = self.white_receptance.column(parameter.row());
        let v = spread.white_cross.row(parameter.column());
        for i in 0..white.len() {
            for j in 0..=i {
                let change = power * u[i] * v[j] + (power * u[j] * v[i]).conj();
                let share = if i == j { 0.5 } else { 1.0 };
                white[i] -= change * share * self.white[j];
            }
        }
    }
}

impl Spread {
    fn new(covariance: &ComplexMatrix, receptance: &ComplexMatrix) -> Option<Self> {
        let n = receptance.nrows();
        let block = |i: usize, j: usize| covariance.view((i * n, j * n), (n, n));
        let cross = block(1, 0) - block(1, 1) * receptance.adjoint();
        let passed = receptance * &cross;
        let total = block(0, 0) - block(0, 1) * receptance.adjoint() - &passed;
        let lower = cholesky(total)?;
        let mut white = passed.adjoint();
        lower.solve_lower_triangular_mut(&mut white).then_some(())?;
        Some(Self { lower, cross, white_cross: white.adjoint() })
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

fn write_real(white: &DVector<Complex<f64>>, part: &mut [f64]) {
    for (z, pair) in white.iter().zip(part.chunks_exact_mut(2)) {
        pair[0] = std::f64::consts::SQRT_2 * z.re;
        pair[1] = std::f64::consts::SQRT_2 * z.im;
    }
}
