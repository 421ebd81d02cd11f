//! Schemes: parameters that a user chooses, and the work prepared once from them.

use std::fmt;

use mechid_model::InitialState;

use crate::{IntegrateError, System, stability};

/// A choice on which programs that share a formula still differ; printed with every result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Convention {
    /// Name of the choice.
    pub what: &'static str,
    /// The choice in force.
    pub choice: &'static str,
}

/// An integration scheme with its parameters and conventions: a value.
///
/// A table of results, a command line and a test suite are loops over `[&dyn Scheme]`.
pub trait Scheme: fmt::Debug + Send + Sync {
    /// The scheme and its parameters, such as `Newmark (β = 0.25, γ = 0.5)`.
    fn name(&self) -> String;

    /// The conventions in force.
    fn conventions(&self) -> Vec<Convention>;

    /// Instant within each step at which the force must be supplied, in parts of the step (a
    /// pure number); none if its values at the samples are enough.
    fn inner_instant(&self) -> Option<f64> {
        None
    }

    /// The steps at which the scheme is known to be stable.
    ///
    /// [`prepare`](Self::prepare) looks at the amplification matrix where this leaves it open.
    fn stable_steps(&self) -> StableSteps {
        StableSteps::Unknown
    }

    /// All the work that is done once for a system and a step of `dt` seconds, stable or not.
    ///
    /// # Errors
    /// [`IntegrateError::TimeStep`], [`IntegrateError::SingularMass`],
    /// [`IntegrateError::SingularEffectiveMass`], [`IntegrateError::FactorsTooLarge`], and
    /// [`IntegrateError::Components`] if starting values do not fit the system.
    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError>;

    /// Prepares as [`prepare_unchecked`](Self::prepare_unchecked) does, but refuses a step `dt` (s)
    /// that makes the motion of the system, without its nonlinear forces, grow. Wrap the scheme in
    /// [`AllowUnstable`] to go on all the same.
    ///
    /// # Errors
    /// Those of [`prepare_unchecked`](Self::prepare_unchecked), and
    /// [`IntegrateError::Unstable`] with the largest stable step.
    fn prepare(&self, system: &dyn System, dt: f64) -> Result<Box<dyn Stepper>, IntegrateError> {
        let mut stepper = self.prepare_unchecked(system, dt)?;
        let scheme = stability::Examined {
            name: &|| self.name(),
            prepare: &|system, dt| self.prepare_unchecked(system, dt),
            stable_steps: self.stable_steps(),
        };
        if system.nonlinear_forces().is_empty() {
            scheme.refuse_unstable(system, dt, stepper.as_mut())?;
        } else {
            let linear = system.matrices();
            let mut of_linear = self.prepare_unchecked(&linear, dt)?;
            scheme.refuse_unstable(&linear, dt, of_linear.as_mut())?;
        }
        Ok(stepper)
    }
}

/// The steps Δt at which a scheme is stable on every passive system: M symmetric and positive
/// definite, C and K symmetric and positive semidefinite.
///
/// If x is an eigenvector of the amplification and m, c, k are the (real) products x*Mx, x*Cx, x*Kx,
/// its eigenvalue is that of a single degree of freedom m, c, k, whose ω² = k/m and c/m do not
/// exceed the largest eigenvalues of M⁻¹K and M⁻¹C. So a limit for one degree of freedom is one for
/// all of them.
///
/// # Source
/// Hughes (1987), sections 9.1 and 9.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StableSteps {
    /// All steps.
    All,
    /// Steps with ωΔt ≤ this pure number for every natural frequency ω without damping.
    Frequencies(f64),
    /// Steps with |λ|Δt ≤ this pure number for every eigenvalue λ.
    Eigenvalues(f64),
    /// Limit that is not known in closed form.
    Unknown,
}

/// A scheme that also takes steps at which it is unstable.
///
/// ```
/// use mechid_integrate::{AllowUnstable, CentralDifference, IntegrateError, Scheme};
/// use mechid_model::Sdof;
///
/// let system = Sdof::new(1.0, 0.0, 1.0)?.system(); // ω = 1 rad/s: the limit is Δt = 2 s
/// let scheme = CentralDifference::default();
/// assert!(matches!(scheme.prepare(&system, 2.1), Err(IntegrateError::Unstable { .. })));
/// assert!(AllowUnstable(&scheme).prepare(&system, 2.1).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct AllowUnstable<'a>(pub &'a dyn Scheme);

impl Scheme for AllowUnstable<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn conventions(&self) -> Vec<Convention> {
        self.0.conventions()
    }

    fn inner_instant(&self) -> Option<f64> {
        self.0.inner_instant()
    }

    fn stable_steps(&self) -> StableSteps {
        self.0.stable_steps()
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        self.0.prepare_unchecked(system, dt)
    }

    fn prepare(&self, system: &dyn System, dt: f64) -> Result<Box<dyn Stepper>, IntegrateError> {
        self.0.prepare_unchecked(system, dt)
    }
}

/// Instant within a step from t to t + Δt at which a scheme reads the force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Instant {
    /// t
    Now,
    /// t + Δt/2, or another instant within the step: [`Scheme::inner_instant`]
    Middle,
    /// t + Δt
    Next,
    /// t + 2Δt
    Beyond,
}

/// The forces of one step from t to t + Δt, in N, one entry per degree of freedom.
///
/// A scheme reads those of [`Stepper::instants`] only; the others may be anything.
#[derive(Debug, Clone, Copy)]
pub struct Loads<'a> {
    /// t, in s, which nonlinear forces may depend on.
    pub time: f64,
    /// F(t), in N, one entry per degree of freedom.
    pub now: &'a [f64],
    /// F(t + Δt/2), or at another instant within the step, likewise in N per degree of freedom.
    pub middle: &'a [f64],
    /// F(t + Δt), likewise in N per degree of freedom.
    pub next: &'a [f64],
    /// F(t + 2Δt), likewise in N per degree of freedom.
    pub beyond: &'a [f64],
}

impl<'a> Loads<'a> {
    /// No force, with `zeros` for it, at t = 0.
    pub(crate) fn none(zeros: &'a [f64]) -> Self {
        Self { time: 0.0, now: zeros, middle: zeros, next: zeros, beyond: zeros }
    }
}

/// A scheme prepared for one system and one step: the map from one state to the next, which is
/// linear if the system is.
///
/// The state at t begins with the motion at t, `[x, ẋ, ẍ]`, 3·n numbers at one and the same
/// instant; what a scheme has to remember beyond that follows. Stepping does not allocate, and fails
/// only where a nonlinear equation cannot be solved.
pub trait Stepper: Send {
    /// Degrees of freedom n.
    fn dof(&self) -> usize;

    /// Length of the state, at least 3·n.
    fn state_len(&self) -> usize;

    /// Returns the instants of a step at which the force is read.
    fn instants(&self) -> &'static [Instant];

    /// Writes what the step adds to `state` into `change`: z(t + Δt) − z(t).
    ///
    /// The difference, and not the new state, is what can be computed to full relative precision
    /// however small the step: near Δt = 0 the amplification matrix is I + O(Δt). The state is the
    /// scheme's own, in the units its documentation gives; loads are in N.
    ///
    /// # Errors
    /// [`IntegrateError::NotSolved`] if the system has nonlinear forces and Newton's method does not
    /// converge; of a linear system a step does not fail.
    ///
    /// # Panics
    /// If `state` or `change` is shorter than [`state_len`](Self::state_len), or a load that is
    /// read shorter than [`dof`](Self::dof).
    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError>;

    /// Takes the step: adds to `state` what [`change`](Self::change) writes into `change`, and to each sum the
    /// rounding error of the sum before, which `owed` keeps, in the units of the state. What a small step adds to a
    /// large state keeps its digits.
    ///
    /// # Errors
    /// Those of [`change`](Self::change).
    ///
    /// # Panics
    /// If `owed` is shorter than [`state_len`](Self::state_len), and where [`change`](Self::change) does.
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

    /// The sample at which the scheme's own recurrence takes over from its starting procedure.
    fn first(&self) -> usize {
        0
    }

    /// Starts the motion from `initial`, the forces at samples 0 ..= [`first`](Self::first) being
    /// `early` (N): writes the motion `[x, ẋ, ẍ]` (m, m/s, m/s², one entry per degree of freedom)
    /// at each of these samples into `motions` and the state at the last of them into `state`.
    ///
    /// # Errors
    /// [`IntegrateError::NotAtRest`] if the starting procedure chosen cannot take the velocity;
    /// [`IntegrateError::NotSolved`].
    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError>;
}

/// Adds `dz` and what is `owed` to `z`, and owes the rounding error of the sum.
#[inline(always)]
pub(crate) fn add(z: &mut f64, owed: &mut f64, dz: f64) {
    let more = dz + *owed;
    let sum = *z + more;
    *owed = more - (sum - *z);
    *z = sum;
}

/// `dt`, if it is positive and finite.
pub(crate) fn check_step(dt: f64) -> Result<f64, IntegrateError> {
    if dt > 0.0 && dt.is_finite() {
        return Ok(dt);
    }
    Err(IntegrateError::TimeStep { dt })
}

/// `value`, if it is finite and between `least` and `most`.
pub(crate) fn check_parameter(
    scheme: &'static str,
    parameter: &'static str,
    value: f64,
    least: f64,
    most: f64,
) -> Result<f64, IntegrateError> {
    if value.is_finite() && (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(IntegrateError::Parameter { scheme, parameter, least, most, value })
}

/// An error at the first entry of `values` that is not finite.
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
