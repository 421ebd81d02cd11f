//! The map of a scheme over a whole period, and the state that repeats under it.

use mechid_signal::Sampling;
use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::IntegrateError;
use crate::transition::Transition;

/// I − Φ, factored in balanced coordinates, with as few of them as the free motion needs.
///
/// After a free step most schemes hold M ẍ + C ẋ + K x = 0, so that ẍ = G y follows from the rest
/// of the state, y, and y' = y + (D_yy + D_ya G) y. With forces ẍ = G y + e, where e comes from the
/// last step's forces alone and so is the same at both ends of the period.
pub(crate) struct Period {
    /// I − Φ on y, or on the whole state.
    factored: LU<f64, Dyn, Dyn>,
    /// G, if the accelerations follow.
    following: Option<DMatrix<f64>>,
    /// z = `scales` ∘ (balanced z): makes the numbers comparable, whatever the units.
    scales: DVector<f64>,
}

impl Period {
    /// Makes the map of a scheme in `dof` degrees of freedom, over as many steps as `sampling` has samples.
    pub(crate) fn of(
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
        let parts = Parts::of(&change, dof);
        let following = parts.following();
        let change = match &following {
            Some(following) => parts.rest_rest + parts.rest_acceleration * following,
            None => change,
        };
        let steps = sampling.len();
        let over_period = -power_less_identity(&change, steps);
        // Each step's matrix is known to ε of its change, each product to ε of its result.
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

    /// The state at rest with the accelerations that the forces alone leave in `state`.
    pub(crate) fn at_rest(&self, state: &[f64]) -> Vec<f64> {
        self.map(state, |rest| rest.fill(0.0))
    }

    /// The state that repeats, if one at rest with the same forces behind it ends in `state`.
    pub(crate) fn repeat(&self, state: &[f64]) -> Vec<f64> {
        self.map(state, |rest| {
            self.factored.solve_mut(rest);
        })
    }

    /// `state` with its y changed, and ẍ after it where it follows.
    fn map(&self, state: &[f64], change: impl FnOnce(&mut DVector<f64>)) -> Vec<f64> {
        let mut balanced = DVector::from_column_slice(state).component_div(&self.scales);
        match &self.following {
            None => change(&mut balanced),
            Some(following) => {
                let dof = following.nrows();
                let mut rest = balanced.clone().remove_rows(2 * dof, dof);
                let before = rest.clone();
                change(&mut rest);
                let mut acceleration = balanced.rows_mut(2 * dof, dof);
                acceleration.gemv(1.0, following, &(&rest - before), 1.0);
                balanced.rows_mut(0, 2 * dof).copy_from(&rest.rows(0, 2 * dof));
                let more = rest.len() - 2 * dof;
                balanced.rows_mut(3 * dof, more).copy_from(&rest.rows(2 * dof, more));
            }
        }
        balanced.component_mul(&self.scales).as_slice().to_vec()
    }

    /// Largest balanced entry.
    pub(crate) fn norm(&self, state: &[f64]) -> f64 {
        state.iter().zip(&self.scales).fold(0.0, |most, (z, s)| f64::max(most, (z / s).abs()))
    }
}

/// D in blocks: the accelerations, and the rest of the state.
struct Parts {
    rest_rest: DMatrix<f64>,
    rest_acceleration: DMatrix<f64>,
    acceleration_rest: DMatrix<f64>,
    acceleration_acceleration: DMatrix<f64>,
}

impl Parts {
    fn of(change: &DMatrix<f64>, dof: usize) -> Self {
        let rows = change.rows(2 * dof, dof);
        let rest = change.clone().remove_rows(2 * dof, dof);
        Self {
            rest_acceleration: rest.columns(2 * dof, dof).into_owned(),
            rest_rest: rest.remove_columns(2 * dof, dof),
            acceleration_acceleration: rows.columns(2 * dof, dof).into_owned(),
            acceleration_rest: rows.into_owned().remove_columns(2 * dof, dof),
        }
    }

    /// G with (rows of A at the accelerations) = G (rows of A at the rest), to rounding.
    fn following(&self) -> Option<DMatrix<f64>> {
        let states = self.rest_rest.nrows();
        let rest = &self.rest_rest + DMatrix::identity(states, states);
        let following =
            rest.transpose().lu().solve(&self.acceleration_rest.transpose())?.transpose();
        let n = self.acceleration_acceleration.nrows();
        // A at the accelerations, I + D, is what M ẍ + C ẋ + K x = 0 makes of an acceleration.
        let acceleration = &self.acceleration_acceleration + DMatrix::identity(n, n);
        let missed = &acceleration - &following * &self.rest_acceleration;
        let size = 1.0 + following.norm() * self.rest_acceleration.norm();
        (missed.norm() <= 16.0 * states as f64 * f64::EPSILON * size).then_some(following)
    }
}

/// (I + D)^`exponent` − I by repeated squaring, never forming I + D, which would lose digits.
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

/// Estimates it by inverse iteration on the normal matrix; 0 if the factorisation has a zero pivot.
fn smallest_singular_value(factored: &LU<f64, Dyn, Dyn>) -> f64 {
    if !factored.is_invertible() {
        return 0.0;
    }
    let (lower, upper) = (factored.l(), factored.u());
    let mut direction = DVector::from_fn(lower.nrows(), |i, _| 1.0 + 0.37 * (i % 5) as f64);
    let mut smallest = f64::INFINITY;
    // A handful settles the order of magnitude, which is all that is asked for.
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
