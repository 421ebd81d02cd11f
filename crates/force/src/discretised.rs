//! The discretised equation of motion, solved for the force of each step.

use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::Record;
use nalgebra::{DMatrix, Dyn, LU};

use crate::continuous::check_dof;
use crate::transition::Transition;
use crate::{ForceError, IdentifiedForce};

/// How the state equation is carried from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Discretisation {
    /// The dissertation's: ẋ(k+1) ≈ ẋ(k) + Δt ẍ(k). The same as `Taylor(1)`.
    Euler,
    /// The exponential series cut after the term of this order, 1 … 8; force held over a step.
    Taylor(usize),
    /// The matrix exponential; force held over a step.
    ExactHeld,
    /// The matrix exponential; force linear over a step.
    ExactLinear,
}

/// What comes after the last sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ends {
    /// The first sample again: the record is one whole period.
    Periodic,
    /// Nothing: the record ends there.
    Open,
}

/// The force that carries the response from each sample to the next.
///
/// With z = [x; ẋ] and the discretised equation z(k+1) = Φ z(k) + Γ F(k), the velocity rows are
/// solved for F(k); Euler's Γ has nothing in the displacement rows. A held force of an open record
/// has one sample less than the response. For a linear force,
/// z(k+1) = Φ z(k) + Γ₀ F(k) + Γ₁ (F(k+1) − F(k)), all 2n rows together give F at both ends of
/// each step and inner samples are the mean of their two values: no recursion runs along the
/// record, so no error grows along it.
///
/// The result amplifies noise in the velocity by M/Δt (held), and in the displacement by
/// 6M/Δt² (linear); Euler's rule is exact for no motion at all: at a line ω it returns the force
/// times M(e^{iωΔt} − 1)/Δt + C + K/(iω) over M iω + C + K/(iω), see the book, `choose/force.md`.
///
/// Cost: one exponential of order 4n, then one product of samples × 2n by 2n × n.
///
/// # Errors
/// [`ForceError::Dof`], [`ForceError::TooShort`] for a response shorter than one step,
/// [`ForceError::TaylorOrder`], and [`ForceError::StepTooLong`] where the step is so long that
/// its end does not show the force during it.
///
/// # Source
/// Dissertation eqs. (4.7.1)–(4.7.3), read as their velocity rows with the minus sign between the
/// two bracketed terms; the exact forms are the standard zero- and first-order hold.
pub fn discretised(
    system: &SecondOrderSystem,
    response: &Response,
    discretisation: Discretisation,
    ends: Ends,
) -> Result<IdentifiedForce, ForceError> {
    check_dof(system, response)?;
    let sampling = response.sampling();
    let needed = if ends == Ends::Open { 2 } else { 1 };
    if sampling.len() < needed {
        return Err(ForceError::TooShort { samples: sampling.len(), needed });
    }
    let dt = sampling.dt();
    let transition = match discretisation {
        Discretisation::Euler => Transition::taylor(system, dt, 1),
        Discretisation::Taylor(order @ 1..=8) => Transition::taylor(system, dt, order),
        Discretisation::Taylor(order) => return Err(ForceError::TaylorOrder { order }),
        Discretisation::ExactHeld | Discretisation::ExactLinear => Transition::exact(system, dt),
    };
    let input = if discretisation == Discretisation::ExactLinear {
        linear_input(&transition, response, ends)?
    } else {
        held_input(&transition, response, ends)?
    };
    let force = (system.mass() * input).transpose() / (dt * dt);
    let sampling = sampling.with_len(force.nrows())?;
    Ok(IdentifiedForce::of(Record::new(sampling, force)?))
}

/// Below this a sample of 16 digits leaves fewer than four for the force.
const NO_TRACE: f64 = 1e-12;

/// q of each step, n × steps: Γ₀ᵥ q = (z(k+1) − Φ z(k))ᵥ.
fn held_input(
    transition: &Transition,
    response: &Response,
    ends: Ends,
) -> Result<DMatrix<f64>, ForceError> {
    let n = response.dof();
    let input = invertible(transition.held.rows(n, n).into_owned(), response)?;
    let mut change = changes(&transition.state, response, ends).rows(n, n).into_owned();
    input.solve_mut(&mut change);
    Ok(change)
}

/// q at each sample, n × samples, from (Γ₀ − Γ₁) q(k) + Γ₁ q(k+1) = z(k+1) − Φ z(k).
fn linear_input(
    transition: &Transition,
    response: &Response,
    ends: Ends,
) -> Result<DMatrix<f64>, ForceError> {
    let (n, len) = (response.dof(), response.sampling().len());
    let mut both = DMatrix::zeros(2 * n, 2 * n);
    both.columns_mut(0, n).copy_from(&(&transition.held - &transition.ramp));
    both.columns_mut(n, n).copy_from(&transition.ramp);
    let mut steps = changes(&transition.state, response, ends);
    invertible(both, response)?.solve_mut(&mut steps);
    let mut input = DMatrix::zeros(n, len);
    for (k, step) in steps.column_iter().enumerate() {
        let (start, end) = (step.rows(0, n), step.rows(n, n));
        let (first, last) = (ends == Ends::Open && k == 0, ends == Ends::Open && k + 2 == len);
        let mut at = input.column_mut(k);
        at.axpy(if first { 1.0 } else { 0.5 }, &start, 1.0);
        let mut at = input.column_mut((k + 1) % len);
        at.axpy(if last { 1.0 } else { 0.5 }, &end, 1.0);
    }
    Ok(input)
}

/// z(k+1) − Φ z(k) in step units, 2n × steps.
fn changes(state: &DMatrix<f64>, response: &Response, ends: Ends) -> DMatrix<f64> {
    let (n, len, dt) = (response.dof(), response.sampling().len(), response.sampling().dt());
    let (x, v) = (response.displacement().data(), response.velocity().data());
    let z = DMatrix::from_fn(2 * n, len, |i, k| if i < n { x[(k, i)] } else { dt * v[(k, i - n)] });
    let steps = if ends == Ends::Periodic { len } else { len - 1 };
    let mut change = DMatrix::from_fn(2 * n, steps, |i, k| z[(i, (k + 1) % len)]);
    change.gemm(-1.0, state, &z.columns(0, steps), 1.0);
    change
}

/// The factorised input matrix, unless some force leaves no trace in its rows.
fn invertible(input: DMatrix<f64>, response: &Response) -> Result<LU<f64, Dyn, Dyn>, ForceError> {
    let singular_values = input.singular_values();
    // In step units the input matrix of a short step is about I: a single force is judged too.
    let reciprocal_condition = singular_values.min() / singular_values.max().max(1.0);
    if reciprocal_condition.is_nan() || reciprocal_condition < NO_TRACE {
        let dt = response.sampling().dt();
        return Err(ForceError::StepTooLong { dt, reciprocal_condition });
    }
    Ok(input.lu())
}
