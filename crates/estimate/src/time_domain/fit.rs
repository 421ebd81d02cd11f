//! Time-domain estimate: M, C, K and the state equations.

use mechid_model::{Discretisation, Matrix, Parameter};
use mechid_numerics::check_size;
use mechid_numerics::least_squares::{Solution, solve_compressed};
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, RowDVector};

use super::Transitions;
use super::continuous::Continuous;
use crate::covariance::Product;
use crate::estimate::EstimateParts;
use crate::{EquationOfMotion, Estimate, EstimateError, Undetermined, Unknowns};

/// M̂, Ĉ, K̂ and their sampled and continuous state equations.
///
/// The residual ratios of the [`Estimate`] refer to the velocity increments ẋ⁺ − ẋ.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeDomainFit {
    estimate: Estimate,
    discretisation: Discretisation,
    /// \[Φ − I, Γ\] or, with coefficients for the force at the next sample, \[Φ − I, Γ, Γ⁺\]; zeros
    /// for omitted forces.
    change: DMatrix<f64>,
    state_matrix: DMatrix<f64>,
    dt: f64,
}

/// Least-squares fit of the transitions, with the state equations that follow from it.
struct Fitted<'a> {
    rows: &'a Transitions,
    regression: Regression,
    continuous: Continuous,
}

/// Sensitivity of a parameter to \[A₂₁ A₂₂ B₂\]: dp = −Σ_j M_ij weight · d(row j), where i is
/// `equation` and row j is a row of \[A₂₁ A₂₂ B₂\].
struct Sensitivity {
    equation: usize,
    weight: RowDVector<f64>,
}

impl TimeDomainFit {
    pub(super) fn new(
        rows: &Transitions,
        discretisation: Discretisation,
        unknowns: &Unknowns,
    ) -> Result<Self, EstimateError> {
        let regression = regression(rows, discretisation)?;
        let change = regression.change(rows.dof());
        let continuous = Continuous::new(&change, rows.dt(), discretisation)?;
        let fitted = Fitted { rows, regression, continuous };
        let (mut findings, sensitivities) = fitted.parameters(unknowns)?;
        let [mass, _, _] = unknowns.assemble(&findings.values);
        findings.covariance = fitted.covariance(&mass, &sensitivities)?.into();
        let n = rows.dof();
        findings.residual_nrmse = fitted.regression.solution.residual_nrmse[n..].to_vec();
        findings.degrees_of_freedom = fitted.regression.solution.degrees_of_freedom;
        findings.condition = fitted.regression.solution.condition;
        Ok(Self {
            estimate: Estimate::new(findings)?,
            discretisation,
            change: fitted.regression.all_forces(n),
            state_matrix: fitted.continuous.value.columns(0, 2 * n).into_owned(),
            dt: rows.dt(),
        })
    }

    /// M̂, Ĉ, K̂ with their covariance.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Returns M̂, Ĉ, K̂ with their covariance, without the state equations.
    pub fn into_estimate(self) -> Estimate {
        self.estimate
    }

    /// Assumption about the force between samples.
    pub fn discretisation(&self) -> Discretisation {
        self.discretisation
    }

    /// Φ of z⁺ = Φ z + Γ F with z = (x, ẋ) in m and m/s: 2n × 2n.
    pub fn transition(&self) -> DMatrix<f64> {
        let states = self.change.nrows();
        self.change.columns(0, states) + DMatrix::identity(states, states)
    }

    /// A of ż = A z + B F with z = (x, ẋ) in m and m/s: 2n × 2n. For exact data its upper half is
    /// \[0 I\].
    pub fn state_matrix(&self) -> &DMatrix<f64> {
        &self.state_matrix
    }

    /// Inconsistency of the identified dx/dt with the measured velocity: the largest deviation of
    /// the upper half of A from \[0 I\] for the state (x, Δt ẋ), a pure number.
    ///
    /// A large value shows a wrong scale of the velocity or a wrong discretisation.
    ///
    /// # Source
    /// Ours.
    pub fn kinematic_error(&self) -> f64 {
        let n = self.state_matrix.nrows() / 2;
        let of_velocity = self.state_matrix.view((0, n), (n, n)) - DMatrix::identity(n, n);
        let of_displacement = self.state_matrix.view((0, 0), (n, n)) * self.dt;
        of_velocity.amax().max(of_displacement.amax())
    }

    /// Returns the one-step prediction errors on this or another record: rows × 2n, first the
    /// errors of x⁺ (m), then the errors of ẋ⁺ (m/s).
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size), [`EstimateError::Signal`],
    /// [`EstimateError::Step`] if the channels, the sampling or the time step of the record do not
    /// agree with those of the fit.
    ///
    /// # Source
    /// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), chapter 3 (prediction).
    pub fn one_step_errors(
        &self,
        displacement: &Record,
        velocity: &Record,
        force: &Record,
        extent: Extent,
    ) -> Result<DMatrix<f64>, EstimateError> {
        let n = self.estimate.dof();
        for record in [displacement, velocity, force] {
            check_size("channels of a record", n, record.channels())?;
            displacement.check_same_sampling(record)?;
        }
        let got = displacement.sampling().dt();
        if (got - self.dt).abs() > 1e-9 * self.dt {
            return Err(EstimateError::Step { expected: self.dt, got });
        }
        let samples = displacement.len();
        let pairs = if extent == Extent::Open { samples - 1 } else { samples };
        let [x, v, f] = [displacement, velocity, force].map(Record::data);
        let column = |at: usize, k: usize| match at / n {
            0 => x[(k, at)],
            1 => v[(k, at - n)],
            2 => f[(k, at - 2 * n)],
            _ => f[((k + 1) % samples, at - 3 * n)],
        };
        let regressors = DMatrix::from_fn(pairs, self.change.ncols(), |k, at| column(at, k));
        let increments =
            DMatrix::from_fn(pairs, 2 * n, |k, at| column(at, (k + 1) % samples) - column(at, k));
        Ok(increments - regressors * self.change.transpose())
    }
}

/// Regression of the state increments z⁺ − z on states and forces.
pub(super) struct Regression {
    /// Indices of the forces that are not identically zero.
    forces: Vec<usize>,
    /// True if the regression has coefficients for the force at the next sample in addition to
    /// those for the force at the present sample.
    two_forces: bool,
    pub(super) solution: Solution,
    /// Coefficients, regressors × 2n; if several sets fit equally well, the set with the smallest
    /// norm.
    coefficients: DMatrix<f64>,
}

pub(super) fn regression(
    rows: &Transitions,
    discretisation: Discretisation,
) -> Result<Regression, EstimateError> {
    rows.check_size()?;
    let n = rows.dof();
    let column = |kind: usize, at: usize| rows.columns(kind).column(at).into_owned();
    let state = |kind: usize| (0..2 * n).map(move |at| column(kind + at / n, at % n));
    let forces: Vec<usize> = (0..n).filter(|j| rows.columns(2).column(*j).norm() > 0.0).collect();
    let two_forces = discretisation == Discretisation::FirstOrderHold;
    let mut regressors: Vec<_> = state(0).collect();
    for kind in 2..if two_forces { 4 } else { 3 } {
        regressors.extend(forces.iter().map(|j| column(kind, *j)));
    }
    let regressors = DMatrix::from_columns(&regressors);
    let targets = DMatrix::from_columns(&state(4).collect::<Vec<_>>());
    let solution = solve_compressed(regressors.as_view(), targets.as_view(), rows.rows())?;
    let coefficients = &solution.inverse * targets;
    Ok(Regression { forces, two_forces, solution, coefficients })
}

impl Regression {
    /// Returns \[Φ − I, Γ₀ + Γ₁\].
    pub(super) fn change(&self, dof: usize) -> DMatrix<f64> {
        let (states, forces) = (2 * dof, self.forces.len());
        let mut change = self.coefficients.rows(0, states + forces).transpose();
        if self.two_forces {
            let next = self.coefficients.rows(states + forces, forces).transpose();
            let mut total = change.columns_mut(states, forces);
            total += next;
        }
        change
    }

    /// Returns \[Φ − I, Γ\] or, with coefficients for the force at the next sample, \[Φ − I, Γ,
    /// Γ⁺\], with zeros for omitted forces.
    fn all_forces(&self, n: usize) -> DMatrix<f64> {
        let groups = if self.two_forces { 2 } else { 1 };
        let mut change = DMatrix::zeros(2 * n, (2 + groups) * n);
        change.columns_mut(0, 2 * n).copy_from(&self.coefficients.rows(0, 2 * n).transpose());
        for group in 0..groups {
            for (at, force) in self.forces.iter().enumerate() {
                let row = self.coefficients.row(2 * n + group * self.forces.len() + at);
                change.set_column((2 + group) * n + force, &row.transpose());
            }
        }
        change
    }
}

impl Fitted<'_> {
    /// Returns the parameters and their sensitivities to the state equations.
    fn parameters(
        &self,
        unknowns: &Unknowns,
    ) -> Result<(EstimateParts, Vec<Sensitivity>), EstimateError> {
        let n = self.rows.dof();
        let free = unknowns.free();
        match unknowns.mass() {
            Some(mass) if free.len() == 2 * n * n => {
                Ok(self.with_known_mass(unknowns, &free, &mass))
            }
            _ => self.by_equation_of_motion(unknowns, &free),
        }
    }

    /// Computes K̂ = −M A₂₁ and Ĉ = −M A₂₂.
    fn with_known_mass(
        &self,
        unknowns: &Unknowns,
        free: &[Parameter],
        mass: &DMatrix<f64>,
    ) -> (EstimateParts, Vec<Sensitivity>) {
        let n = self.rows.dof();
        let lower = self.continuous.value.rows(n, n);
        let force = -(mass * lower);
        let column = |p: &Parameter| p.column() + if p.matrix() == Matrix::Damping { n } else { 0 };
        let sensitivity = |p: &Parameter| {
            let mut weight = RowDVector::zeros(lower.ncols());
            weight[column(p)] = 1.0;
            Sensitivity { equation: p.row(), weight }
        };
        let findings = EstimateParts {
            unknowns: unknowns.clone(),
            values: free.iter().map(|p| force[(p.row(), column(p))]).collect(),
            covariance: DMatrix::zeros(0, 0).into(),
            degrees_of_freedom: 0,
            residual_nrmse: Vec::new(),
            condition: 1.0,
            undetermined: self.undetermined(free, column),
        };
        (findings, free.iter().map(sensitivity).collect())
    }

    /// Returns, for every equation of motion, the combinations of free entries that the data do not
    /// determine.
    fn undetermined(
        &self,
        free: &[Parameter],
        column: impl Fn(&Parameter) -> usize,
    ) -> Vec<Undetermined> {
        let mut undetermined = Vec::new();
        for direction in &self.regression.solution.undetermined {
            for equation in 0..self.rows.dof() {
                let parameters = free.iter().filter(|p| p.row() == equation);
                let terms: Vec<_> = parameters
                    .filter(|p| direction.involved[column(p)])
                    .map(|p| (*p, direction.combination[column(p)]))
                    .collect();
                // A combination that contains only coefficients of forces has no entry of C or K.
                if !terms.is_empty() {
                    let relative_singular_value = direction.relative_singular_value;
                    undetermined.push(Undetermined { relative_singular_value, terms });
                }
            }
        }
        undetermined
    }

    /// Fits M ẍ + C ẋ + K x = F with the accelerations A₂₁x + A₂₂ẋ + B₂F at the samples.
    fn by_equation_of_motion(
        &self,
        unknowns: &Unknowns,
        free: &[Parameter],
    ) -> Result<(EstimateParts, Vec<Sensitivity>), EstimateError> {
        let (n, rows) = (self.rows.dof(), self.rows);
        let (x, v, f) = (rows.columns(0), rows.columns(1), rows.columns(2));
        let lower = self.continuous.value.rows(n, n);
        let mut acceleration =
            x * lower.columns(0, n).transpose() + v * lower.columns(n, n).transpose();
        for (at, force) in self.regression.forces.iter().enumerate() {
            acceleration += f.column(*force) * lower.column(2 * n + at).transpose();
        }
        let parts = [acceleration.as_view(), v, x, f];
        let equations = EquationOfMotion::from_compressed(n, parts, rows.rows())?;
        let (findings, Product { rows: inverse, places, .. }) = equations.findings(unknowns)?;
        let motion = equations.motion_and_force();
        let sensitivity = |(at, p): (usize, &Parameter)| {
            // The columns of `motion` are ẋ, x, F; the sensitivity has the order x, ẋ, nonzero
            // forces.
            let by_column = inverse.row(places[at].1) * motion;
            let order =
                (n..2 * n).chain(0..n).chain(self.regression.forces.iter().map(|j| 2 * n + j));
            let weight: Vec<f64> = order.map(|column| by_column[column]).collect();
            Sensitivity { equation: p.row(), weight: RowDVector::from_vec(weight) }
        };
        let sensitivities = free.iter().enumerate().map(sensitivity).collect();
        Ok((findings, sensitivities))
    }

    /// Returns the covariance by the delta method: Cov(p, q) = ⟨W G_p S, G_q⟩ with the derivative
    /// G_p of parameter p with respect to the coefficients (regressors × 2n), W = (ZᵀZ)⁻¹ and the
    /// residual covariance S.
    fn covariance(
        &self,
        mass: &DMatrix<f64>,
        sensitivities: &[Sensitivity],
    ) -> Result<DMatrix<f64>, EstimateError> {
        let n = self.rows.dof();
        let (states, forces) = (2 * n, self.regression.forces.len());
        let regressors = self.regression.solution.inverse.nrows();
        let mut gradients = vec![DMatrix::zeros(regressors, states); sensitivities.len()];
        for row in 0..states {
            for column in 0..states + forces {
                let mut change = DMatrix::zeros(states, states + forces);
                change[(row, column)] = 1.0;
                let moved = self.continuous.derivative(&change)?;
                let by_equation = mass * moved.rows(n, n);
                for (gradient, s) in gradients.iter_mut().zip(sensitivities) {
                    let value = -by_equation.row(s.equation).dot(&s.weight);
                    gradient[(column, row)] = value;
                    if self.regression.two_forces && column >= states {
                        gradient[(column + forces, row)] = value;
                    }
                }
            }
        }
        let weighted: Vec<_> = gradients
            .iter()
            .map(|g| {
                &self.regression.solution.unscaled_covariance
                    * g
                    * &self.regression.solution.residual_covariance
            })
            .collect();
        let count = sensitivities.len();
        Ok(DMatrix::from_fn(count, count, |p, q| {
            // The same product for (p, q) and (q, p) makes the matrix exactly symmetric.
            let (p, q) = (p.min(q), p.max(q));
            weighted[p].dot(&gradients[q])
        }))
    }
}
