//! Least squares on M ẍ + C ẋ + K x = F, row by row: the common core of the linear estimators.

use mechid_model::{Matrix, Parameter};
use mechid_numerics::least_squares::{Solution, solve_compressed};
use mechid_numerics::triangular::TriangularFactor;
use mechid_numerics::{NumericsError, check_finite, check_size};
use nalgebra::{DMatrix, DMatrixView, DVector};

use crate::covariance::{Covariance, Product};
use crate::estimate::EstimateParts;
use crate::related_equations::RelatedEquations;
use crate::unknowns::only_ratios;
use crate::{Estimate, EstimateError, Undetermined, Unknowns};

/// Rows of M ẍ + C ẋ + K x = F, gathered block by block from any number of records.
///
/// A row is one instant, or the real or imaginary part of one spectral line (in a spectral row the
/// "acceleration" is −ω²X and the "velocity" iωX). All motions and forces are reduced to one small
/// triangular factor: memory does not grow with the data, and the same rows can be solved for
/// several sets of [`Unknowns`].
///
/// ```
/// use mechid_estimate::{EquationOfMotion, Unknowns};
/// use nalgebra::{DMatrix, dmatrix};
///
/// // 2 ẍ + 0.3 ẋ + 8 x = F at three instants.
/// let (a, v, x) = (dmatrix![1.0; 0.0; 2.0], dmatrix![0.0; 1.0; 1.0], dmatrix![1.0; -1.0; 0.5]);
/// let force: DMatrix<f64> = 2.0 * &a + 0.3 * &v + 8.0 * &x;
/// let mut rows = EquationOfMotion::new(1);
/// rows.push_rows(a.as_view(), v.as_view(), x.as_view(), force.as_view())?;
/// let estimate = rows.solve(&Unknowns::unknown_mass(1)?)?;
/// assert!((estimate.stiffness()[(0, 0)] - 8.0).abs() < 1e-12);
/// # Ok::<(), mechid_estimate::EstimateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct EquationOfMotion {
    dof: usize,
    /// Triangular factor of the columns \[ẍ | ẋ | x | F\].
    factor: TriangularFactor,
}

/// Unknown columns of an equation of motion; each is given by its matrix and its degree of freedom.
pub(crate) type Columns = Vec<(Matrix, usize)>;

/// Equations of motion (rows of M, C, K) that have the same unknown columns.
struct Group {
    equations: Vec<usize>,
    columns: Columns,
    solution: Solution,
}

impl EquationOfMotion {
    /// Creates equations of `dof` degrees of freedom without any row.
    pub fn new(dof: usize) -> Self {
        Self { dof, factor: TriangularFactor::new(dof.saturating_mul(4)) }
    }

    /// Number of rows so far.
    pub fn rows(&self) -> usize {
        self.factor.rows()
    }

    /// Adds rows: accelerations (m/s²), velocities (m/s), displacements (m) and forces (N),
    /// each rows × degrees of freedom.
    ///
    /// # Errors
    /// [`NumericsError::Size`], [`NumericsError::NotFinite`] and [`NumericsError::Overflow`]; if
    /// there is an error, no row is added.
    pub fn push_rows(
        &mut self,
        acceleration: DMatrixView<'_, f64>,
        velocity: DMatrixView<'_, f64>,
        displacement: DMatrixView<'_, f64>,
        force: DMatrixView<'_, f64>,
    ) -> Result<(), EstimateError> {
        let parts = [
            ("channels of the acceleration", "acceleration", acceleration),
            ("channels of the velocity", "velocity", velocity),
            ("channels of the displacement", "displacement", displacement),
            ("channels of the force", "force", force),
        ];
        for (channels, _, part) in parts {
            check_size(channels, self.dof, part.ncols())?;
            check_size("rows", displacement.nrows(), part.nrows())?;
        }
        if !self.factor.push(&[acceleration, velocity, displacement, force]) {
            parts.into_iter().try_for_each(|(_, what, part)| check_finite(what, part))?;
            return Err(NumericsError::Overflow.into());
        }
        Ok(())
    }

    /// Adds the rows of `other`, such as those of another record.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if `other` has another number of degrees of freedom,
    /// [`NumericsError::Overflow`].
    pub fn merge(&mut self, other: &Self) -> Result<(), EstimateError> {
        check_size("degrees of freedom", self.dof, other.dof)?;
        if self.factor.merge(&other.factor) { Ok(()) } else { Err(NumericsError::Overflow.into()) }
    }

    /// Solves for the free entries of M, C and K by least squares: one equation of motion after
    /// another, or all of them together if entries are related.
    ///
    /// Parameters that the data do not determine are listed in [`Estimate::undetermined`]; they do
    /// not affect the other estimates.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if `unknowns` has another number of degrees of freedom,
    /// [`NumericsError::NothingUnknown`], [`NumericsError::TooFewRows`],
    /// [`NumericsError::Underflow`], [`EstimateError::OnlyRatios`] if an equation has neither force
    /// nor known entry; [`EstimateError::NotConverged`] if no proportional damping is found.
    ///
    /// # Source
    /// Dissertation eqs. (4.4.1)–(4.4.6), (4.6.12), (4.6.31).
    pub fn solve(&self, unknowns: &Unknowns) -> Result<Estimate, EstimateError> {
        if !unknowns.is_related() {
            return Estimate::new(self.findings(unknowns)?.0);
        }
        self.check(unknowns, &unknowns.free())?;
        let targets: Vec<_> = (0..self.dof).map(|i| self.target(unknowns, i)).collect();
        let motions = self.factor.r().columns(0, 3 * self.dof).into_owned();
        let targets = DMatrix::from_columns(&targets);
        RelatedEquations { motions, targets, rows: self.rows(), unknowns }.solve()
    }

    /// Returns the parts of the estimate and the factors of its covariance. The factors are the
    /// residual covariance and one row for each parameter; the product of this row and the
    /// right-hand side of the equation is the parameter.
    pub(crate) fn findings(
        &self,
        unknowns: &Unknowns,
    ) -> Result<(EstimateParts, Product), EstimateError> {
        let free = unknowns.free();
        self.check(unknowns, &free)?;
        let groups = self.groups(unknowns, &free)?;
        let places: Vec<Place<'_>> =
            free.iter().map(|parameter| Place::new(parameter, &groups)).collect();
        let values = places.iter().map(|p| p.group.solution.coefficients[(p.row, p.target)]);
        let mut residual_nrmse = vec![0.0; self.dof];
        for group in &groups {
            for (equation, nrmse) in group.equations.iter().zip(&group.solution.residual_nrmse) {
                residual_nrmse[*equation] = *nrmse;
            }
        }
        let product = product(&groups, &places, self.dof);
        let findings = EstimateParts {
            values: values.collect(),
            covariance: Covariance::Product(product.clone()),
            degrees_of_freedom: minimum(&groups),
            residual_nrmse,
            condition: groups.iter().map(|g| g.solution.condition).fold(1.0, f64::max),
            undetermined: groups.iter().flat_map(|g| g.undetermined(&free)).collect(),
            unknowns: unknowns.clone(),
        };
        Ok((findings, product))
    }

    fn check(&self, unknowns: &Unknowns, free: &[Parameter]) -> Result<(), EstimateError> {
        check_size("degrees of freedom of the unknowns", self.dof, unknowns.dof())?;
        if free.is_empty() {
            return Err(NumericsError::NothingUnknown.into());
        }
        if self.rows() == 0 {
            return Err(NumericsError::TooFewRows { rows: 0, unknowns: free.len() }.into());
        }
        if let Some((at, norm)) = self.factor.too_small() {
            let what = ["acceleration", "velocity", "displacement", "force"][at / self.dof];
            return Err(NumericsError::Underflow { what, column: at % self.dof, norm }.into());
        }
        Ok(())
    }

    /// Creates equations from compressed rows \[ẍ | ẋ | x | F\], which have the same Gram matrix as
    /// the `rows` original rows.
    pub(crate) fn from_compressed(
        dof: usize,
        [acceleration, velocity, displacement, force]: [DMatrixView<'_, f64>; 4],
        rows: usize,
    ) -> Result<Self, EstimateError> {
        let mut equations = Self::new(dof);
        equations.push_rows(acceleration, velocity, displacement, force)?;
        equations.factor.stand_for(rows);
        Ok(equations)
    }

    /// Returns the compressed columns \[ẋ | x | F\], side by side.
    pub(crate) fn motion_and_force(&self) -> DMatrixView<'_, f64> {
        self.factor.r().columns(self.dof, 3 * self.dof)
    }

    fn groups(&self, unknowns: &Unknowns, free: &[Parameter]) -> Result<Vec<Group>, EstimateError> {
        let solve = |(columns, equations)| self.group(unknowns, columns, equations);
        equations_by_columns(unknowns, free).into_iter().map(solve).collect()
    }

    fn group(
        &self,
        unknowns: &Unknowns,
        columns: Columns,
        equations: Vec<usize>,
    ) -> Result<Group, EstimateError> {
        let r = self.factor.r();
        let regressors: Vec<_> = columns
            .iter()
            .map(|(matrix, column)| r.column(self.column(*matrix, *column)))
            .collect();
        let mut targets = Vec::new();
        for equation in &equations {
            let target = self.target(unknowns, *equation);
            if target.norm() == 0.0 {
                return Err(only_ratios(unknowns, *equation));
            }
            targets.push(target);
        }
        let (regressors, targets) =
            (DMatrix::from_columns(&regressors), DMatrix::from_columns(&targets));
        let solution = solve_compressed(regressors.as_view(), targets.as_view(), self.rows())?;
        Ok(Group { equations, columns, solution })
    }

    /// Returns the force of one equation minus the forces of its known entries.
    fn target(&self, unknowns: &Unknowns, equation: usize) -> DVector<f64> {
        let r = self.factor.r();
        let mut target = r.column(3 * self.dof + equation).into_owned();
        for matrix in Matrix::ALL {
            for column in 0..self.dof {
                if let Some(value) = unknowns.fixed(matrix, equation, column) {
                    target.axpy(-value, &r.column(self.column(matrix, column)), 1.0);
                }
            }
        }
        target
    }

    fn column(&self, matrix: Matrix, dof: usize) -> usize {
        matrix as usize * self.dof + dof
    }
}

/// Groups the equations of motion (counted from 0) by their unknown columns; each entry has the
/// columns and the equations that share these columns.
pub(crate) fn equations_by_columns(
    unknowns: &Unknowns,
    free: &[Parameter],
) -> Vec<(Columns, Vec<usize>)> {
    let mut shared: Vec<(Columns, Vec<usize>)> = Vec::new();
    for equation in 0..unknowns.dof() {
        let parameters = free.iter().filter(|p| p.row() == equation);
        let columns: Columns = parameters.map(|p| (p.matrix(), p.column())).collect();
        match shared.iter_mut().find(|(same, _)| *same == columns) {
            _ if columns.is_empty() => {}
            Some((_, equations)) => equations.push(equation),
            None => shared.push((columns, vec![equation])),
        }
    }
    shared
}

/// Position of a free parameter in the solutions of the groups of equations.
struct Place<'a> {
    group: &'a Group,
    /// Number of unknowns in the preceding groups.
    first: usize,
    row: usize,
    equation: usize,
    target: usize,
}

impl<'a> Place<'a> {
    fn new(parameter: &Parameter, groups: &'a [Group]) -> Self {
        let equation = parameter.row();
        let mut first = 0;
        let at = |group: &'a Group| {
            let before = first;
            first += group.columns.len();
            let target = group.equations.iter().position(|e| *e == equation)?;
            let column = (parameter.matrix(), parameter.column());
            let row = group.columns.iter().position(|c| *c == column)?;
            Some(Self { group, first: before, row, equation, target })
        };
        groups.iter().find_map(at).expect("every free parameter is in a group")
    }
}

/// Returns the factors of the covariance.
fn product(groups: &[Group], places: &[Place<'_>], dof: usize) -> Product {
    let mut residual = DMatrix::zeros(dof, dof);
    let solved = || {
        groups.iter().flat_map(|group| {
            let solution = &group.solution;
            let residuals = solution.residuals.column_iter();
            let freedom = solution.degrees_of_freedom as f64;
            group.equations.iter().zip(residuals).map(move |(i, residual)| (*i, residual, freedom))
        })
    };
    for (i, left, spare) in solved() {
        for (j, right, other) in solved() {
            let spare = spare * other;
            residual[(i, j)] =
                if spare > 0.0 { left.dot(&right) / spare.sqrt() } else { f64::INFINITY };
        }
    }
    let inverses: Vec<_> =
        groups.iter().flat_map(|group| group.solution.inverse.row_iter()).collect();
    Product {
        residual,
        rows: DMatrix::from_rows(&inverses),
        places: places.iter().map(|place| (place.equation, place.first + place.row)).collect(),
        open: vec![false; places.len()],
    }
}

fn minimum(groups: &[Group]) -> usize {
    groups.iter().map(|g| g.solution.degrees_of_freedom).min().unwrap_or(0)
}

impl Group {
    fn undetermined(&self, free: &[Parameter]) -> Vec<Undetermined> {
        let mut undetermined = Vec::new();
        for direction in &self.solution.undetermined {
            for equation in &self.equations {
                let parameters: Vec<&Parameter> =
                    free.iter().filter(|p| p.row() == *equation).collect();
                let involved = direction.involved.iter().enumerate().filter(|(_, i)| **i);
                undetermined.push(Undetermined {
                    relative_singular_value: direction.relative_singular_value,
                    terms: involved
                        .map(|(at, _)| (*parameters[at], direction.combination[at]))
                        .collect(),
                });
            }
        }
        undetermined
    }
}
