//! Schemes: the parameters that a user chooses, and the preparation of a step.

use std::fmt;

use crate::error::IntegrateError;
use crate::stability::stable_steps::StableSteps;
use crate::stability::step_limit::Examined;
use crate::stepping::stepper::Stepper;
use crate::system::System;

/// A choice in which programs with the same formula may differ; it is printed with every result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Convention {
    /// Subject of the choice, such as “load” or “start”.
    pub what: &'static str,
    /// The choice that the scheme uses.
    pub choice: &'static str,
}

/// Integration scheme with its parameters and conventions.
///
/// The trait is object-safe: code that compares schemes loops over `[&dyn Scheme]`.
pub trait Scheme: fmt::Debug + Send + Sync {
    /// Returns the scheme and its parameters, such as `Newmark (β = 0.25, γ = 0.5)`.
    fn name(&self) -> String;

    /// Returns the conventions that the scheme uses.
    fn conventions(&self) -> Vec<Convention>;

    /// Returns the instant within each step at which the force must be supplied, as a fraction of
    /// the step (a pure number); `None` if the force at the samples is enough.
    fn inner_instant(&self) -> Option<f64> {
        None
    }

    /// Returns the steps at which the scheme is known to be stable.
    ///
    /// If this is unknown, [`prepare`](Self::prepare) examines the amplification matrix.
    fn stable_steps(&self) -> StableSteps {
        StableSteps::Unknown
    }

    /// Prepares a step of `dt` seconds for a system, even if the step is unstable. All work that is
    /// needed only once is done here.
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
    /// at which the motion of the linear part of the system grows. Wrap the scheme in
    /// [`AllowUnstable`] to proceed anyway.
    ///
    /// # Errors
    /// The errors of [`prepare_unchecked`](Self::prepare_unchecked), and
    /// [`IntegrateError::Unstable`] with the largest stable step.
    fn prepare(&self, system: &dyn System, dt: f64) -> Result<Box<dyn Stepper>, IntegrateError> {
        let mut stepper = self.prepare_unchecked(system, dt)?;
        let scheme = Examined {
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

/// Returns `value` if it is finite and between `least` and `most`.
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
