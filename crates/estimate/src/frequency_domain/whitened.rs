//! Residuals and sensitivities in units of the noise.

use mechid_model::{Parameter, SecondOrderSystem};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector};

use crate::Unknowns;
use crate::relations::Relations;

type ComplexMatrix = DMatrix<Complex<f64>>;

/// Residual of a system on spectra, with its sensitivity to the free parameters, both weighted by
/// the covariance L Lᴴ of the residual from the noise on displacement and force.
///
/// Real and imaginary parts are separate: row 2(n·line + channel) is the real part of a line and
/// channel, the next row its imaginary part.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
/// maximum likelihood in errors-in-variables.
pub struct Whitened {
    /// Residual √2·L⁻¹(X − G F): independent numbers of unit variance for the true system and
    /// noise. One entry for each real and imaginary part of each line and channel.
    pub residual: DVector<f64>,
    /// Derivative of −`residual` with respect to the free parameters (the independent ones if they
    /// are related) at the most likely force. Residuals × parameters, in inverse SI units.
    pub sensitivity: DMatrix<f64>,
}

impl Whitened {
    /// Computes residual and sensitivity; `covariance` returns the covariance of displacement and
    /// force (2n×2n) at each row of the data. `None` if the covariance of a residual is singular,
    /// or if the receptance does not exist at a line.
    pub fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        covariance: impl Fn(usize) -> ComplexMatrix,
    ) -> Option<Self> {
        let mut whitened =
            Self::sensitive_to(&unknowns.free(), data, unknowns, values, covariance)?;
        if let Some(relations) = Relations::from_unknowns(unknowns) {
            let independent = relations.unknowns(values.as_slice());
            whitened.sensitivity *= relations.tangent(independent.as_slice());
        }
        Some(whitened)
    }

    /// Computes the residual without its sensitivity, which needs memory for residuals × parameters
    /// numbers.
    pub fn residual_of(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        covariance: impl Fn(usize) -> ComplexMatrix,
    ) -> Option<Self> {
        Self::sensitive_to(&[], data, unknowns, values, covariance)
    }

    /// Returns the displacement G F̂ (rows × n, in m) under the most likely force, given its noise
    /// and the displacement; `None` as for [`Whitened::new`].
    pub(super) fn likely_displacement<'a>(
        data: &FrequencyData,
        system: &SecondOrderSystem,
        covariance: impl Fn(usize) -> &'a ComplexMatrix,
    ) -> Option<ComplexMatrix> {
        let mut likely = ComplexMatrix::zeros(data.len(), data.dof());
        for row in 0..data.len() {
            let line = Line::new(system, data, row, covariance(row))?;
            likely.row_mut(row).copy_from(&line.likely_displacement.transpose());
        }
        Some(likely)
    }

    fn sensitive_to(
        parameters: &[Parameter],
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        covariance: impl Fn(usize) -> ComplexMatrix,
    ) -> Option<Self> {
        let n = data.dof();
        let [mass, damping, stiffness] = unknowns.assemble(values.as_slice());
        let system = SecondOrderSystem::new(mass, damping, stiffness).ok()?;
        let mut residual = DVector::zeros(2 * n * data.len());
        let mut sensitivity = DMatrix::zeros(residual.len(), parameters.len());
        for (row, &omega) in data.omega().iter().enumerate() {
            let mut line = Line::new(&system, data, row, &covariance(row))?;
            let at = 2 * n * row..2 * n * (row + 1);
            write_real(&line.residual, &mut residual.as_mut_slice()[at.clone()]);
            if parameters.is_empty() {
                continue;
            }
            line.whiten_receptance()?;
            for (parameter, mut column) in parameters.iter().zip(sensitivity.column_iter_mut()) {
                let derivative = line.derivative(parameter, omega);
                write_real(&derivative, &mut column.as_mut_slice()[at.clone()]);
            }
        }
        let finite = residual.iter().chain(sensitivity.iter()).all(|value| value.is_finite());
        finite.then_some(Self { residual, sensitivity })
    }
}

/// Weighted residual and receptance of one line.
struct Line {
    /// Lower triangular factor L of the covariance.
    lower: ComplexMatrix,
    /// Weighted residual L⁻¹(X − G F).
    residual: DVector<Complex<f64>>,
    /// Receptance G or, after whitening, L⁻¹G.
    receptance: ComplexMatrix,
    /// Displacement G F̂ under the most likely force F̂, given its noise and the displacement.
    likely_displacement: DVector<Complex<f64>>,
}

impl Line {
    fn new(
        system: &SecondOrderSystem,
        data: &FrequencyData,
        row: usize,
        covariance: &ComplexMatrix,
    ) -> Option<Self> {
        let n = data.dof();
        let receptance = system.receptance(data.omega()[row]).ok()?;
        let block = |i: usize, j: usize| covariance.view((i * n, j * n), (n, n));
        let force = data.force().row(row).transpose();
        let modelled = &receptance * &force;
        let mut residual = data.displacement().row(row).transpose() - &modelled;
        // An exact force is the most likely one.
        let is_exact = covariance.columns(n, n).iter().all(|entry| *entry == Complex::ZERO);
        if is_exact {
            let lower = cholesky(block(0, 0).into_owned())?;
            lower.solve_lower_triangular_mut(&mut residual).then_some(())?;
            return Some(Self { lower, residual, receptance, likely_displacement: modelled });
        }
        let adjoint = receptance.adjoint();
        let cross = block(1, 0) - block(1, 1) * &adjoint;
        let total = block(0, 0) - block(0, 1) * &adjoint - &receptance * &cross;
        let lower = cholesky(total)?;
        lower.solve_lower_triangular_mut(&mut residual).then_some(())?;
        let mut twice = residual.clone();
        lower.ad_solve_lower_triangular_mut(&mut twice).then_some(())?;
        let likely_displacement = &receptance * (force - cross * twice);
        Some(Self { lower, residual, receptance, likely_displacement })
    }

    /// Replaces G by L⁻¹G.
    fn whiten_receptance(&mut self) -> Option<()> {
        self.lower.solve_lower_triangular_mut(&mut self.receptance).then_some(())
    }

    /// Returns the derivative −L⁻¹G E_ij X̂ (iω)^p of −L⁻¹(X − G F̂) with respect to an entry (i,
    /// j).
    fn derivative(&self, parameter: &Parameter, omega: f64) -> DVector<Complex<f64>> {
        let power = -Complex::new(0.0, omega).powu(2 - parameter.matrix() as u32);
        let factor = power * self.likely_displacement[parameter.column()];
        self.receptance.column(parameter.row()) * factor
    }
}

/// Returns L of a Hermitian positive definite matrix L Lᴴ, `None` for any other matrix.
fn cholesky(matrix: ComplexMatrix) -> Option<ComplexMatrix> {
    // nalgebra does not reject negative pivots but computes their complex roots.
    let lower = matrix.cholesky()?.unpack();
    let positive = |z: &Complex<f64>| z.re > 0.0 && z.im.abs() <= 1e-8 * z.re;
    lower.diagonal().iter().all(positive).then_some(lower)
}

fn write_real(white: &DVector<Complex<f64>>, part: &mut [f64]) {
    for (z, pair) in white.iter().zip(part.chunks_exact_mut(2)) {
        pair[0] = std::f64::consts::SQRT_2 * z.re;
        pair[1] = std::f64::consts::SQRT_2 * z.im;
    }
}
