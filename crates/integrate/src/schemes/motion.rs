//! The motion `[x, ẋ, ẍ]` at the head of a state, and its consistent start.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::stepping::effective_matrix::EffectiveMatrix;

/// Writes `[x, ẋ, ẍ]` at t = 0 with the consistent acceleration, M ẍ = F − C ẋ − K x − g, into
/// `state`.
pub(crate) fn start_consistently(
    mass: &mut EffectiveMatrix,
    initial: &InitialState,
    force: &[f64],
    state: &mut [f64],
) -> Result<(), IntegrateError> {
    let (x, v, a) = motion_mut(state, force.len());
    x.copy_from_slice(initial.displacement().as_slice());
    v.copy_from_slice(initial.velocity().as_slice());
    a.copy_from_slice(force);
    mass.solve(0.0, v, x, a)
}

/// Returns the three parts x, ẋ, ẍ of a motion in `n` degrees of freedom.
pub(crate) fn motion(state: &[f64], n: usize) -> (&[f64], &[f64], &[f64]) {
    (&state[..n], &state[n..2 * n], &state[2 * n..3 * n])
}

/// Returns the three parts x, ẋ, ẍ of a motion in `n` degrees of freedom, for writing.
pub(crate) fn motion_mut(state: &mut [f64], n: usize) -> (&mut [f64], &mut [f64], &mut [f64]) {
    let (x, rest) = state.split_at_mut(n);
    let (v, rest) = rest.split_at_mut(n);
    (x, v, &mut rest[..n])
}
