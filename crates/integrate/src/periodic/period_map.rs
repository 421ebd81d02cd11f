//! The map of a scheme over a whole period, and its periodic state.

use mechid_signal::Sampling;
use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::error::IntegrateError;
use crate::stepping::transition::Transition;

/// I − Φ, factored in balanced coordinates, for the independent part y of the state.
///
/// The change of the state in a step is D times the state, with the blocks D_yy and D_ya for y and
/// the accelerations ẍ. After a free step most schemes satisfy M ẍ + C ẋ + K x = 0, so that ẍ = G y
/// follows from y, and the next y is y + (D_yy + D_ya G) y. If forces act, ẍ is G y + e; the vector
/// e depends only on the forces of the last step and is the same at both ends of the period.
pub(crate) struct PeriodMap {
    /// Factors of I − Φ for the independent part y of the state, or for the whole state.
    factored: LU<f64, Dyn, Dyn>,
    /// Matrix G of ẍ = G y, if the accelerations follow from the independent part y of the state.
    following: Option<DMatrix<f64>>,
    /// Scales s of z = s ∘ (balanced z), which make the numbers comparable in any units.
    scales: DVector<f64>,
}

impl PeriodMap {
    /// Creates the map of a scheme in `dof` degrees of freedom, over as many steps as `sampling`
    /// has samples.
    pub(crate) fn new(
        transition: &Transition,
        dof: usize,
        sampling: Sampling,
    ) -> Result<Self, IntegrateError> {
        let mut change = transition.change.clone();
        let scales = Transition::balance(&mut change).ok_or(IntegrateError::NoPeriodicState {
            period: sampling.duration(),
            reciprocal_condition: 0.0,
            rounding: f64::EPSILON,
        })?;
        let parts = Blocks::new(&change, dof);
        let following = parts.following();
        let change = match &following {
            Some(following) => parts.rest_rest + parts.rest_acceleration * following,
            None => change,
        };
        let steps = sampling.len();
        let over_period = -power_less_identity(&change, steps);
        // The rounding error has two parts: ε times the norm of the change in each step, and ε
        // times the norm of the result in each product of matrices.
        let rounding = f64::EPSILON
            * (steps as f64 * change.norm() + f64::from(steps.ilog2() + 1) * over_period.norm());
        let size = over_period.norm().max(1.0);
        let factored = over_period.lu();
        let smallest = smallest_singular_value(&factored);
        if !(smallest > 4.0 * rounding && rounding.is_finite()) {
            return Err(IntegrateError::NoPeriodicState {
                period: sampling.duration(),
                reciprocal_condition: smallest / size,
                rounding: 4.0 * rounding / size,
            });
        }
        Ok(Self { factored, following, scales })
    }

    /// Returns `state` with the independent part y = 0 and with the accelerations that the forces
    /// alone cause.
    pub(crate) fn at_rest(&self, state: &[f64]) -> Vec<f64> {
        self.map(state, |rest| rest.fill(0.0))
    }

    /// Returns the periodic state; `state` is the state at the end of a period that begins at rest,
    /// under the same forces.
    pub(crate) fn repeat(&self, state: &[f64]) -> Vec<f64> {
        self.map(state, |rest| {
            self.factored.solve_mut(rest);
        })
    }

    /// Returns `state` after the function `change` is applied to its independent part y. If the
    /// accelerations ẍ follow from y, they are updated, too.
    fn map(&self, state: &[f64], change: impl FnOnce(&mut DVector<f64>)) -> Vec<f64> {
        let mut balanced = DVector::from_column_slice(state).component_div(&self.scales);
        match &self.following {
            None => change(&mut balanced),
            Some(following) => {
                let dof = following.nrows();
                let mut independent = balanced.clone().remove_rows(2 * dof, dof);
                let before = independent.clone();
                change(&mut independent);
                let mut acceleration = balanced.rows_mut(2 * dof, dof);
                acceleration.gemv(1.0, following, &(&independent - before), 1.0);
                balanced.rows_mut(0, 2 * dof).copy_from(&independent.rows(0, 2 * dof));
                let more = independent.len() - 2 * dof;
                balanced.rows_mut(3 * dof, more).copy_from(&independent.rows(2 * dof, more));
            }
        }
        balanced.component_mul(&self.scales).as_slice().to_vec()
    }

    /// Returns the largest balanced entry of a state.
    pub(crate) fn norm(&self, state: &[f64]) -> f64 {
        state.iter().zip(&self.scales).fold(0.0, |most, (z, s)| f64::max(most, (z / s).abs()))
    }
}

/// Blocks of the matrix D; D times the state is the change of the state in a step. The
/// accelerations and the other entries of the state have separate blocks.
struct Blocks {
    rest_rest: DMatrix<f64>,
    rest_acceleration: DMatrix<f64>,
    acceleration_rest: DMatrix<f64>,
    acceleration_acceleration: DMatrix<f64>,
}

impl Blocks {
    fn new(change: &DMatrix<f64>, dof: usize) -> Self {
        let rows = change.rows(2 * dof, dof);
        let other_rows = change.clone().remove_rows(2 * dof, dof);
        Self {
            rest_acceleration: other_rows.columns(2 * dof, dof).into_owned(),
            rest_rest: other_rows.remove_columns(2 * dof, dof),
            acceleration_acceleration: rows.columns(2 * dof, dof).into_owned(),
            acceleration_rest: rows.into_owned().remove_columns(2 * dof, dof),
        }
    }

    /// Returns the matrix G for which the rows of A = I + D at the accelerations are G times all
    /// other rows of A, if such a G exists to rounding.
    fn following(&self) -> Option<DMatrix<f64>> {
        let states = self.rest_rest.nrows();
        let amplification = &self.rest_rest + DMatrix::identity(states, states);
        let following =
            amplification.transpose().lu().solve(&self.acceleration_rest.transpose())?.transpose();
        let n = self.acceleration_acceleration.nrows();
        // The diagonal block of A at the accelerations is I plus the same block of D.
        let acceleration = &self.acceleration_acceleration + DMatrix::identity(n, n);
        let missed = &acceleration - &following * &self.rest_acceleration;
        let size = 1.0 + following.norm() * self.rest_acceleration.norm();
        (missed.norm() <= 16.0 * states as f64 * f64::EPSILON * size).then_some(following)
    }
}

/// Returns (I + D)^`exponent` − I by repeated squaring; forming I + D would lose digits.
fn power_less_identity(change: &DMatrix<f64>, exponent: usize) -> DMatrix<f64> {
    let mut power = DMatrix::zeros(change.nrows(), change.ncols());
    let mut square = change.clone();
    let mut product = power.clone();
    let mut remaining = exponent;
    loop {
        if remaining & 1 == 1 {
            product.copy_from(&power);
            product += &square;
            product.gemm(1.0, &power, &square, 1.0);
            std::mem::swap(&mut power, &mut product);
        }
        remaining >>= 1;
        if remaining == 0 {
            return power;
        }
        product.copy_from(&square);
        product.gemm(1.0, &square, &square, 2.0);
        std::mem::swap(&mut square, &mut product);
    }
}

/// Estimates the smallest singular value by inverse iteration on the normal matrix; 0 for a zero
/// pivot.
fn smallest_singular_value(factored: &LU<f64, Dyn, Dyn>) -> f64 {
    if !factored.is_invertible() {
        return 0.0;
    }
    let (lower, upper) = (factored.l(), factored.u());
    let mut direction = DVector::from_fn(lower.nrows(), |i, _| 1.0 + 0.37 * (i % 5) as f64);
    let mut smallest = f64::INFINITY;
    // Six iterations give the order of magnitude of the singular value, which is enough for its
    // comparison with the rounding error.
    for _ in 0..6 {
        direction.normalize_mut();
        // The transposed matrix is Uᵀ Lᵀ P.
        let solved = upper.tr_solve_upper_triangular_mut(&mut direction)
            && lower.tr_solve_lower_triangular_mut(&mut direction);
        if !solved {
            return 0.0;
        }
        factored.p().inv_permute_rows(&mut direction);
        factored.solve_mut(&mut direction);
        smallest = direction.norm().sqrt().recip();
    }
    smallest
}
