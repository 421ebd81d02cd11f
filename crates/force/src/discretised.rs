//! The discretised equation of motion, solved for the force of each step.

use mechid_model::{Discretisation, Response, SecondOrderSystem, StateTransition};
use mechid_numerics::linear_algebra::singular_values;
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, Dyn, LU};

use crate::continuous::check_dof;
use crate::error::ForceError;
use crate::identified::IdentifiedForce;
use crate::limits;
use crate::state_space::exact_transition;

/// Computes the force that takes the response from each sample to the next.
///
/// The state z = [x; ẋ] obeys the discretised equation z(k+1) = Φ z(k) + Γ F(k), and the velocity
/// rows are solved for F(k); Euler's Γ is zero in the displacement rows. A held force of an open
/// record has one sample less than the response. For a linear force, z(k+1) = Φ z(k) + Γ₀ F(k) + Γ₁
/// (F(k+1) − F(k)), and all 2n rows together give F at both ends of each step. An inner sample
/// belongs to two steps; its force is the mean of the two values. There is no recursion along the
/// record, so that no error grows along it.
///
/// The result amplifies noise in the velocity by M/Δt (held), and in the displacement by 6M/Δt²
/// (linear). Euler's rule is not exact for any motion: at a line ω it returns the force times the
/// ratio of M(e^{iωΔt} − 1)/Δt + C + K/(iω) to M iω + C + K/(iω); see the book, `theory/force.md`.
///
/// Cost: one exponential of order 4n, then one product of samples × 2n by 2n × n.
///
/// # Errors
/// [`ForceError::Dof`], [`ForceError::TooShort`] for a response shorter than one step,
/// [`ForceError::StepTooLong`] if the step is so long that the state at the end of the step does
/// not depend on the force during the step, and [`ForceError::Unstable`] if the free response
/// overflows within a step.
///
/// # Source
/// Dissertation eqs. (4.7.1)–(4.7.3), read as their velocity rows with the minus sign between the
/// two bracketed terms; the exact forms are the standard zero- and first-order hold.
pub fn discretised(
    system: &SecondOrderSystem,
    response: &Response,
    discretisation: Discretisation,
    extent: Extent,
) -> Result<IdentifiedForce, ForceError> {
    let solution = |dt| Solution::from_rule(system, dt, discretisation);
    force_of_steps(system, response, extent, solution)
}

/// Computes the same as [`discretised`], with the exponential series truncated after the term of
/// this `order`, 1 … 8, and the force held over a step; order 1 is Euler's rule.
///
/// # Errors
/// The errors of [`discretised`]; [`ForceError::TaylorOrder`].
///
/// # Source
/// The source of [`discretised`].
pub fn discretised_by_taylor(
    system: &SecondOrderSystem,
    response: &Response,
    order: usize,
    extent: Extent,
) -> Result<IdentifiedForce, ForceError> {
    let solution = |dt| match order {
        1..=8 => Solution::new(StateTransition::taylor(system, dt, order), dt, true),
        _ => Err(ForceError::TaylorOrder { order }),
    };
    force_of_steps(system, response, extent, solution)
}

fn force_of_steps(
    system: &SecondOrderSystem,
    response: &Response,
    extent: Extent,
    solution: impl FnOnce(f64) -> Result<Solution, ForceError>,
) -> Result<IdentifiedForce, ForceError> {
    check_dof(system, response)?;
    let (sampling, dt) = (response.sampling(), response.sampling().dt());
    let needed = if extent == Extent::Open { 2 } else { 1 };
    if sampling.len() < needed {
        return Err(ForceError::TooShort { samples: sampling.len(), needed });
    }
    let input = solution(dt)?.input(response, extent);
    let force = (system.mass() * input).transpose() / (dt * dt);
    let sampling = sampling.with_len(force.nrows())?;
    Ok(IdentifiedForce::from_record(Record::new(sampling, force)?))
}

/// Solver for the input q of a step, from the change z(k+1) − Φ z(k) of the state z = (x, Δt·ẋ).
pub(crate) struct Solution {
    /// Transition matrix Φ, 2n×2n.
    pub state: DMatrix<f64>,
    /// LU factors of the input matrix: of order n if the input is held over a step, of order 2n if
    /// it is linear.
    input: LU<f64, Dyn, Dyn>,
}

impl Solution {
    /// Creates the solver for the steps of a system with the given discretisation.
    pub fn from_rule(
        system: &SecondOrderSystem,
        dt: f64,
        discretisation: Discretisation,
    ) -> Result<Self, ForceError> {
        let exact = || exact_transition(system, dt);
        match discretisation {
            Discretisation::Euler => Self::new(StateTransition::taylor(system, dt, 1), dt, true),
            Discretisation::ZeroOrderHold => Self::new(exact()?, dt, true),
            Discretisation::FirstOrderHold => Self::new(exact()?, dt, false),
        }
    }

    fn new(transition: StateTransition, dt: f64, is_held: bool) -> Result<Self, ForceError> {
        let StateTransition { state, held, ramp } = transition;
        let n = held.ncols();
        let input = if is_held {
            // The equation of the velocity rows is Γ₀ᵥ q = (z(k+1) − Φ z(k))ᵥ.
            held.rows(n, n).into_owned()
        } else {
            // The equation of all rows is (Γ₀ − Γ₁) q(k) + Γ₁ q(k+1) = z(k+1) − Φ z(k).
            let mut both = DMatrix::zeros(2 * n, 2 * n);
            both.columns_mut(0, n).copy_from(&(held - &ramp));
            both.columns_mut(n, n).copy_from(&ramp);
            both
        };
        Ok(Self { state, input: invertible(input, dt)? })
    }

    /// Returns the input at the start of each step, n × steps, and for a linear input also the
    /// input at the end of each step, n × steps. The matrix `change` is 2n × steps.
    pub fn inputs(&self, mut change: DMatrix<f64>) -> (DMatrix<f64>, Option<DMatrix<f64>>) {
        let n = self.state.nrows() / 2;
        if self.input.lu_internal().nrows() == n {
            let mut velocity = change.rows(n, n).into_owned();
            self.input.solve_mut(&mut velocity);
            return (velocity, None);
        }
        self.input.solve_mut(&mut change);
        (change.rows(0, n).into_owned(), Some(change.rows(n, n).into_owned()))
    }

    /// Returns the input q: n × steps if the input is held over a step, n × samples if it is
    /// linear.
    fn input(&self, response: &Response, extent: Extent) -> DMatrix<f64> {
        let len = response.sampling().len();
        let (start, end) = self.inputs(changes(&self.state, response, extent));
        let Some(end) = end else { return start };
        let mut input = DMatrix::zeros(response.dof(), len);
        for (k, (start, end)) in start.column_iter().zip(end.column_iter()).enumerate() {
            let (first, last) =
                (extent == Extent::Open && k == 0, extent == Extent::Open && k + 2 == len);
            let mut at = input.column_mut(k);
            at.axpy(if first { 1.0 } else { 0.5 }, &start, 1.0);
            let mut at = input.column_mut((k + 1) % len);
            at.axpy(if last { 1.0 } else { 0.5 }, &end, 1.0);
        }
        input
    }
}

/// Returns z(k+1) − Φ z(k), 2n × steps, for the state z = (x, Δt·ẋ).
fn changes(state: &DMatrix<f64>, response: &Response, extent: Extent) -> DMatrix<f64> {
    let (n, len, dt) = (response.dof(), response.sampling().len(), response.sampling().dt());
    let (x, v) = (response.displacement().data(), response.velocity().data());
    let z = DMatrix::from_fn(2 * n, len, |i, k| if i < n { x[(k, i)] } else { dt * v[(k, i - n)] });
    let steps = if extent == Extent::WholePeriod { len } else { len - 1 };
    let mut change = DMatrix::from_fn(2 * n, steps, |i, k| z[(i, (k + 1) % len)]);
    change.gemm(-1.0, state, &z.columns(0, steps), 1.0);
    change
}

/// Returns the factors of the input matrix, or an error if the matrix is nearly singular: some
/// force then has almost no effect on the state at the end of the step.
fn invertible(input: DMatrix<f64>, dt: f64) -> Result<LU<f64, Dyn, Dyn>, ForceError> {
    let no_trace = ForceError::StepTooLong { dt, reciprocal_condition: 0.0 };
    let singular_values = singular_values(input.clone()).map_err(|_| no_trace)?;
    // For the state (x, Δt·ẋ), the input matrix of a short step is about I. The smallest singular
    // value is divided by the largest one or by 1, whichever is larger. With a single force,
    // smallest and largest are equal, and their ratio would always be 1.
    let reciprocal_condition = singular_values.min() / singular_values.max().max(1.0);
    if reciprocal_condition.is_nan() || reciprocal_condition < limits::NOT_TRANSMITTED {
        return Err(ForceError::StepTooLong { dt, reciprocal_condition });
    }
    Ok(input.lu())
}
