//! Residuals and sensitivities in units of the noise.

use mechid_model::{Parameter, SecondOrderSystem};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector};

use super::line::{Line, noisy_forces, solve_lower};
use crate::Unknowns;
use crate::relations::Relations;

type ComplexMatrix = DMatrix<Complex<f64>>;

/// Residual of a system for given spectra, and the sensitivity of the residual to the free
/// parameters. Both are multiplied by √2·L⁻¹, where L Lᴴ is the covariance of the residual due to
/// the noise on displacement and force.
///
/// Real and imaginary parts are separate: row 2(n·line + channel) is the real part of a line and
/// channel, the next row its imaginary part.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
/// maximum likelihood in errors-in-variables.
pub struct Whitened {
    /// Residual √2·L⁻¹(X − G F), with one entry for the real and one for the imaginary part of each
    /// line and channel. If system and noise are correct, the entries are independent and have unit
    /// variance.
    pub residual: DVector<f64>,
    /// Derivative of −`residual` with respect to the free parameters (for related entries, the
    /// independent unknowns) at the most likely force: residuals × parameters, in inverse SI units.
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

    /// Computes the residual without the sensitivity, which would need a matrix of residuals ×
    /// parameters in memory.
    pub fn residual_of(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        covariance: impl Fn(usize) -> ComplexMatrix,
    ) -> Option<Self> {
        Self::sensitive_to(&[], data, unknowns, values, covariance)
    }

    /// Returns the displacement G F̂ (rows × n, in m) under the most likely force F̂, which follows
    /// from the noise of the force and the measured displacement; `None` as for [`Whitened::new`].
    pub(super) fn likely_displacement<'a>(
        data: &FrequencyData,
        system: &SecondOrderSystem,
        covariance: impl Fn(usize) -> &'a ComplexMatrix,
    ) -> Option<ComplexMatrix> {
        let mut likely = ComplexMatrix::zeros(data.len(), data.dof());
        let matrices = [system.mass(), system.damping(), system.stiffness()].map(Clone::clone);
        let mut line = Line::new(data.dof());
        for row in 0..data.len() {
            whiten(&mut line, &matrices, data, row, covariance(row))?;
            likely.row_mut(row).tr_copy_from(line.likely_displacement());
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
        let matrices = unknowns.assemble(values.as_slice());
        let [mass, damping, stiffness] = matrices.clone();
        // A system without mass, such as an oil film, has no sensitivities; its noise spectrum is
        // estimated without leverages.
        SecondOrderSystem::new(mass, damping, stiffness).ok()?;
        let mut residual = DVector::zeros(2 * n * data.len());
        let mut sensitivity = DMatrix::zeros(residual.len(), parameters.len());
        let mut line = Line::new(n);
        for (row, &omega) in data.omega().iter().enumerate() {
            whiten(&mut line, &matrices, data, row, &covariance(row))?;
            let at = 2 * n * row..2 * n * (row + 1);
            write_real(line.white().iter().copied(), &mut residual.as_mut_slice()[at.clone()]);
            for (parameter, mut column) in parameters.iter().zip(sensitivity.column_iter_mut()) {
                let derivative = derivative(&line, parameter, omega);
                write_real(derivative, &mut column.as_mut_slice()[at.clone()]);
            }
        }
        let finite = residual.iter().chain(sensitivity.iter()).all(|value| value.is_finite());
        finite.then_some(Self { residual, sensitivity })
    }
}

/// Weights L⁻¹ and weighted receptances L⁻¹G of one system on all lines, for the residuals of many
/// forces and displacements.
pub(super) struct WeightedLines {
    /// L in the lower triangle, and L⁻¹G (each n × n) of each line.
    lines: Vec<(ComplexMatrix, ComplexMatrix)>,
}

impl WeightedLines {
    /// Computes the weights of the system with the matrices of `values`; `None` as for
    /// [`Whitened::new`].
    pub(super) fn new<'a>(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        covariance: impl Fn(usize) -> &'a ComplexMatrix,
    ) -> Option<Self> {
        let matrices = unknowns.assemble(values.as_slice());
        let mut line = Line::new(data.dof());
        let weights = (0..data.len()).map(|row| {
            whiten(&mut line, &matrices, data, row, covariance(row))?;
            Some((line.lower().clone(), line.white_receptance().clone()))
        });
        weights.collect::<Option<_>>().map(|lines| Self { lines })
    }

    /// Returns the residual √2·L⁻¹(X − G F) for the forces F and the displacements X (rows × n), in
    /// the order of [`Whitened::residual`]; `None` if it is not finite.
    pub(super) fn residual(
        &self,
        force: &ComplexMatrix,
        displacement: &ComplexMatrix,
    ) -> Option<DVector<f64>> {
        let n = force.ncols();
        let mut residual = DVector::zeros(2 * n * self.lines.len());
        let mut white = DVector::zeros(n);
        let parts = residual.as_mut_slice().chunks_exact_mut(2 * n);
        for (row, ((lower, receptance), part)) in self.lines.iter().zip(parts).enumerate() {
            white.tr_copy_from(&displacement.row(row));
            if !solve_lower(lower, &mut white) {
                return None;
            }
            for (column, force) in receptance.column_iter().zip(force.row(row).iter()) {
                white.axpy(-force, &column, Complex::ONE);
            }
            write_real(white.iter().copied(), part);
        }
        residual.iter().all(|value| value.is_finite()).then_some(residual)
    }
}

/// Returns Q and R⁻¹ of the sensitivities J = Q R; `None` if the columns of J are linearly
/// dependent.
pub(crate) fn orthonormal(mut sensitivity: DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let lengths: Vec<f64> = sensitivity.column_iter().map(|column| column.norm()).collect();
    for (mut column, length) in sensitivity.column_iter_mut().zip(&lengths) {
        if *length > 0.0 {
            column.unscale_mut(*length);
        }
    }
    let (q, r) = sensitivity.qr().unpack();
    let mut root = DMatrix::identity(r.nrows(), r.ncols());
    r.solve_upper_triangular_mut(&mut root).then_some(())?;
    root.row_iter_mut().zip(&lengths).for_each(|(mut row, length)| row.unscale_mut(*length));
    Some((q, root))
}

/// Computes the weighted residual and receptance of one line; `None` if one of the two does not
/// exist.
fn whiten(
    line: &mut Line,
    matrices: &[DMatrix<f64>; 3],
    data: &FrequencyData,
    row: usize,
    covariance: &ComplexMatrix,
) -> Option<()> {
    let noisy: Vec<usize> = noisy_forces(covariance).collect();
    let (force, displacement) = (data.force().row(row), data.displacement().row(row));
    let exists = line.model(matrices, data.omega()[row], force.iter())
        && line.whiten_both(displacement.iter(), covariance, &noisy);
    exists.then_some(())
}

/// Returns the derivative −L⁻¹G E_ij X̂ (iω)^p of −L⁻¹(X − G F̂) with respect to an entry (i, j).
fn derivative(
    line: &Line,
    parameter: &Parameter,
    omega: f64,
) -> impl Iterator<Item = Complex<f64>> {
    let power = -Complex::new(0.0, omega).powu(2 - parameter.matrix() as u32);
    let factor = power * line.likely_displacement()[parameter.column()];
    line.white_receptance().column(parameter.row()).into_iter().map(move |g| g * factor)
}

fn write_real(white: impl Iterator<Item = Complex<f64>>, part: &mut [f64]) {
    for (z, pair) in white.zip(part.chunks_exact_mut(2)) {
        pair[0] = std::f64::consts::SQRT_2 * z.re;
        pair[1] = std::f64::consts::SQRT_2 * z.im;
    }
}
