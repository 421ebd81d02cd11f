//! A scheme prepared for one system and one step: its inputs and its outputs.

use mechid_model::InitialState;

use crate::error::IntegrateError;

/// Instant within a step from t to t + Δt at which a scheme reads the force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Instant {
    /// Beginning of the step, t.
    Now,
    /// Middle of the step, t + Δt/2, or another instant within the step, which
    /// [`Scheme::inner_instant`](crate::Scheme::inner_instant) returns.
    Middle,
    /// End of the step, t + Δt.
    Next,
    /// End of the next step, t + 2Δt.
    Beyond,
}

/// The forces of one step from t to t + Δt, in N, one entry per degree of freedom.
///
/// A scheme reads only the loads of [`Stepper::instants`]; the others may have any value.
#[derive(Debug, Clone, Copy)]
pub struct Loads<'a> {
    /// Instant t, in s, for nonlinear forces that depend on time.
    pub time: f64,
    /// F(t), in N, one entry per degree of freedom.
    pub now: &'a [f64],
    /// F(t + Δt/2), or the force at another instant within the step, in N, one entry per degree of
    /// freedom.
    pub middle: &'a [f64],
    /// F(t + Δt), in N, one entry per degree of freedom.
    pub next: &'a [f64],
    /// F(t + 2Δt), in N, one entry per degree of freedom.
    pub beyond: &'a [f64],
}

impl<'a> Loads<'a> {
    /// Returns loads of zero for a step that begins at t = 0; `zeros` has one zero per degree of
    /// freedom.
    pub(crate) fn none(zeros: &'a [f64]) -> Self {
        Self { time: 0.0, now: zeros, middle: zeros, next: zeros, beyond: zeros }
    }
}

/// A scheme prepared for one system and one step: the map from one state to the next. The map is
/// linear if the system is linear.
///
/// The state at t begins with the motion at t, `[x, ẋ, ẍ]`, 3·n numbers at the same instant; the
/// memory of the scheme follows. Stepping does not allocate, and fails only if a nonlinear equation
/// cannot be solved.
pub trait Stepper: Send {
    /// Degrees of freedom n.
    fn dof(&self) -> usize;

    /// Length of the state, at least 3·n.
    fn state_len(&self) -> usize;

    /// Returns the instants of a step at which the force is read.
    fn instants(&self) -> &'static [Instant];

    /// Writes the change of `state` in a step into `change`: z(t + Δt) − z(t).
    ///
    /// The change, unlike the new state, can be computed to full relative precision for any small
    /// step: near Δt = 0 the amplification matrix is I + O(Δt). The units of the state are in the
    /// documentation of the scheme; loads are in N.
    ///
    /// # Errors
    /// [`IntegrateError::NotSolved`] if the system has nonlinear forces and Newton's method does
    /// not converge; a step of a linear system does not fail.
    ///
    /// # Panics
    /// If `state` or `change` is shorter than [`state_len`](Self::state_len), or if a load that the
    /// scheme reads is shorter than [`dof`](Self::dof).
    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError>;

    /// Takes the step: adds the result of [`change`](Self::change) to `state` by compensated
    /// summation. `owed`, in the units of the state, has the rounding error of the last sum, so
    /// that small changes of a large state keep their digits.
    ///
    /// # Errors
    /// The errors of [`change`](Self::change).
    ///
    /// # Panics
    /// If `owed` is shorter than [`state_len`](Self::state_len), and in the cases of
    /// [`change`](Self::change).
    ///
    /// # Source
    /// Higham, *Accuracy and Stability of Numerical Algorithms* (2002), section 4.3.
    fn step(
        &mut self,
        state: &mut [f64],
        owed: &mut [f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        self.change(state, loads, change)?;
        for ((z, owed), dz) in state.iter_mut().zip(owed).zip(change) {
            add(z, owed, *dz);
        }
        Ok(())
    }

    /// Returns the sample at which the starting procedure ends and the recurrence of the scheme
    /// begins.
    fn first(&self) -> usize {
        0
    }

    /// Starts the motion from `initial`. The forces at samples 0 ..= [`first`](Self::first) are
    /// `early` (N). Writes the motion `[x, ẋ, ẍ]` (m, m/s, m/s², one entry per degree of freedom)
    /// at each of these samples into `motions`, and the state at the last of these samples into
    /// `state`.
    ///
    /// # Errors
    /// [`IntegrateError::NotAtRest`] if the starting procedure does not allow an initial velocity;
    /// [`IntegrateError::NotSolved`].
    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError>;
}

/// Adds `dz` and the rounding error `owed` of the previous sum to `z`, and stores the rounding
/// error of the new sum in `owed`.
#[inline(always)]
pub(crate) fn add(z: &mut f64, owed: &mut f64, dz: f64) {
    let more = dz + *owed;
    let sum = *z + more;
    *owed = more - (sum - *z);
    *z = sum;
}

/// Returns `dt` if it is positive and finite.
pub(crate) fn check_step(dt: f64) -> Result<f64, IntegrateError> {
    if dt > 0.0 && dt.is_finite() {
        return Ok(dt);
    }
    Err(IntegrateError::TimeStep { dt })
}

/// Returns an error at the first entry of `values` that is not finite.
pub(crate) fn check_finite(
    what: &'static str,
    values: &[f64],
    time: f64,
) -> Result<(), IntegrateError> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => {
            Err(IntegrateError::NotFinite { what, component: at + 1, time, value: values[at] })
        }
    }
}
