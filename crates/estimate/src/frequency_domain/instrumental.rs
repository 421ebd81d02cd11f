//! Instrumental variables: a second measurement of the same motion removes the bias of least
//! squares.

use mechid_model::{Matrix, Parameter};
use mechid_numerics::NumericsError;
use mechid_numerics::linear_algebra::singular_values;
use mechid_spectra::FrequencyData;
use mechid_spectra::frequency_data::check_same_frequencies;
use nalgebra::{Complex, DMatrix, DVector};

use super::equation_error::{equation_rows, real_rows};
use crate::estimate::EstimateParts;
use crate::{Estimate, EstimateError, Unknowns};

/// Solves the equation of motion with two measurements of the same experiment, each the instrument
/// of the other.
///
/// The normal equations ΦᵀΦ θ = Φᵀy of least squares are biased because the noise of Φ is squared.
/// In ZᵀΦ θ = Zᵀy, Z has the same regressors from other periods, so the noise of Z and the noise of
/// Φ are independent. The estimate is consistent, but it has more scatter than that of
/// [`output_error`](super::output_error). Forces may be noisy, too.
///
/// `first` and `second` must come from different periods (see
/// [`RepeatedPeriods::halves`](mechid_spectra::RepeatedPeriods::halves)). The standard errors allow
/// for an equation error whose variance differs from line to line.
///
/// # Errors
/// [`SpectraError::FrequencyMismatch`](mechid_spectra::SpectraError::FrequencyMismatch) or
/// [`NumericsError::Size`] if the sizes or frequencies differ,
/// [`EstimateError::Undetermined`] if the data do not determine a parameter, and the errors of
/// [`equation_error`](super::equation_error).
///
/// # Source
/// Söderström & Stoica, *System Identification* (1989), chapter 8; White (1980), Econometrica 48,
/// 817–838, for the covariance; proposed in section 6.2 of the dissertation.
pub fn instrumental_variables(
    first: &FrequencyData,
    second: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<Estimate, EstimateError> {
    check_same_frequencies(first.omega(), second.omega())?;
    if first.dof() != second.dof() {
        let what = "channels of the second measurement";
        return Err(NumericsError::Size { what, expected: first.dof(), got: second.dof() }.into());
    }
    unknowns.check_unrelated("an estimator with instrumental variables")?;
    // Least squares checks that the data determine every parameter.
    let mut rows = equation_rows(first)?;
    rows.merge(&equation_rows(second)?)?;
    rows.solve(unknowns)?.check_determined()?;
    let both = [Terms::new(first), Terms::new(second)];
    let free = unknowns.free();
    let mut equations = Vec::new();
    for dof in 0..first.dof() {
        let parameters: Vec<Parameter> = free.iter().filter(|p| p.row() == dof).copied().collect();
        equations.push(Equation::solve(&both, unknowns, dof, &parameters)?);
    }
    assemble(&equations, unknowns, &free)
}

/// Acceleration, velocity, displacement and force of one measurement, real and imaginary rows.
struct Terms {
    motions: [DMatrix<f64>; 3],
    force: DMatrix<f64>,
}

impl Terms {
    fn new(data: &FrequencyData) -> Self {
        let s = |row: usize| Complex::new(0.0, data.omega()[row]);
        let x = data.displacement();
        Self {
            motions: [
                real_rows(x, |row, x| s(row) * s(row) * x),
                real_rows(x, |row, x| s(row) * x),
                real_rows(x, |_, x| x),
            ],
            force: real_rows(data.force(), |_, f| f),
        }
    }

    fn regressors(&self, parameters: &[Parameter]) -> DMatrix<f64> {
        let mut regressors = DMatrix::zeros(self.force.nrows(), parameters.len());
        for (mut column, p) in regressors.column_iter_mut().zip(parameters) {
            column.copy_from(&self.motions[p.matrix() as usize].column(p.column()));
        }
        regressors
    }

    /// Returns the force minus the forces of the known entries.
    fn target(&self, unknowns: &Unknowns, dof: usize) -> DVector<f64> {
        let mut target = self.force.column(dof).into_owned();
        for matrix in [Matrix::Mass, Matrix::Damping, Matrix::Stiffness] {
            for column in 0..self.force.ncols() {
                if let Some(value) = unknowns.fixed(matrix, dof, column) {
                    target.axpy(-value, &self.motions[matrix as usize].column(column), 1.0);
                }
            }
        }
        target
    }
}

/// Solution of one equation of motion.
struct Equation {
    parameters: Vec<Parameter>,
    values: DVector<f64>,
    /// Influence of the residuals on the values, with one column for each row of the equation: the
    /// derivative of the values with respect to the right-hand side of this row, times the residual
    /// of this row.
    scores: DMatrix<f64>,
    rows: usize,
    residual_nrmse: f64,
    condition: f64,
}

impl Equation {
    fn solve(
        [first, second]: &[Terms; 2],
        unknowns: &Unknowns,
        dof: usize,
        parameters: &[Parameter],
    ) -> Result<Self, EstimateError> {
        let regressors = stack(&first.regressors(parameters), &second.regressors(parameters));
        let instruments = stack(&second.regressors(parameters), &first.regressors(parameters));
        let (upper, lower) = (first.target(unknowns, dof), second.target(unknowns, dof));
        let target =
            DVector::from_iterator(regressors.nrows(), upper.iter().chain(lower.iter()).copied());
        let (influence, condition) =
            influence(&regressors, instruments).ok_or_else(|| open(parameters))?;
        let values = &influence * &target;
        if values.iter().any(|v| !v.is_finite()) {
            return Err(open(parameters));
        }
        let residual = &target - &regressors * &values;
        let mut scores = influence;
        scores.column_iter_mut().zip(residual.iter()).for_each(|(mut c, e)| c *= *e);
        Ok(Self {
            parameters: parameters.to_vec(),
            values,
            scores,
            rows: target.len(),
            residual_nrmse: residual.norm() / target.norm(),
            condition,
        })
    }

    /// Number of independent rows of both measurements minus the number of unknowns.
    fn degrees_of_freedom(&self) -> usize {
        self.rows.saturating_sub(self.parameters.len())
    }
}

/// Returns (ZᵀΦ)⁻¹Zᵀ, unknowns × rows, and the condition number of the scaled QᵀΦ with Z = QR.
fn influence(
    regressors: &DMatrix<f64>,
    mut instruments: DMatrix<f64>,
) -> Option<(DMatrix<f64>, f64)> {
    if regressors.ncols() == 0 {
        return Some((instruments.transpose(), 1.0));
    }
    let scale: Vec<f64> = regressors.column_iter().map(|c| c.norm()).collect();
    instruments.column_iter_mut().zip(&scale).for_each(|(mut column, s)| column /= *s);
    // With Z = QR, R cancels in ZᵀΦ θ = Zᵀy. The remaining equations QᵀΦ θ = Qᵀy avoid the product
    // of two ill-scaled matrices.
    let q = instruments.qr().q();
    let mut projected = q.tr_mul(regressors);
    projected.column_iter_mut().zip(&scale).for_each(|(mut column, s)| column /= *s);
    let singular_values = singular_values(projected.clone()).ok()?;
    let mut influence = projected.lu().solve(&q.transpose())?;
    influence.row_iter_mut().zip(&scale).for_each(|(mut row, s)| row /= *s);
    Some((influence, singular_values.max() / singular_values.min()))
}

fn open(parameters: &[Parameter]) -> EstimateError {
    let names: Vec<String> = parameters.iter().map(Parameter::to_string).collect();
    EstimateError::Undetermined {
        parameters: names.join(", "),
        directions: "the two measurements are not correlated".to_owned(),
    }
}

fn stack(upper: &DMatrix<f64>, lower: &DMatrix<f64>) -> DMatrix<f64> {
    let mut both = DMatrix::zeros(upper.nrows() + lower.nrows(), upper.ncols());
    both.rows_mut(0, upper.nrows()).copy_from(upper);
    both.rows_mut(upper.nrows(), lower.nrows()).copy_from(lower);
    both
}

fn assemble(
    equations: &[Equation],
    unknowns: &Unknowns,
    free: &[Parameter],
) -> Result<Estimate, EstimateError> {
    let places: Vec<(&Equation, usize)> = free
        .iter()
        .map(|p| {
            let equation = &equations[p.row()];
            let at = equation
                .parameters
                .iter()
                .position(|parameters| parameters == p)
                .expect("its own equation");
            (equation, at)
        })
        .collect();
    let covariance = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let ((left, p), (right, q)) = (places[i], places[j]);
        let spare = (left.degrees_of_freedom() * right.degrees_of_freedom()) as f64;
        let correction = left.rows as f64 / spare.sqrt();
        correction * left.scores.row(p).dot(&right.scores.row(q))
    });
    let solved = equations.iter().filter(|e| !e.parameters.is_empty());
    Estimate::new(EstimateParts {
        unknowns: unknowns.clone(),
        values: places.iter().map(|(equation, at)| equation.values[*at]).collect(),
        covariance: covariance.into(),
        degrees_of_freedom: solved.clone().map(Equation::degrees_of_freedom).min().unwrap_or(0),
        residual_nrmse: equations.iter().map(|e| e.residual_nrmse).collect(),
        condition: solved.map(|e| e.condition).fold(1.0, f64::max),
        undetermined: Vec::new(),
    })
}
