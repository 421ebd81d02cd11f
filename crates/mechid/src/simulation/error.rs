//! Errors of simulations that cannot be run.

use mechid_integrate::IntegrateError;
use mechid_io::IoError;
use mechid_model::{Instability, ModelError};
use mechid_signal::{SignalError, message};
use nalgebra::Complex;

/// Number of periods of the force, from rest, before the search for a steady state of a nonlinear
/// machine.
pub(super) const SETTLING: usize = 50;

/// Error of a simulation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The description is wrong.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The scheme does not apply.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The response of the system does not exist.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A record cannot be created.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The exact scheme has no time steps, and therefore no initial conditions.
    #[error(
        "the scheme \"exact\" gives the periodic response only: choose another one for a response that \
         starts from rest or from a given motion"
    )]
    ExactFromRest,
    /// The exact scheme is only for linear machines.
    #[error(
        "the scheme \"exact\" is for linear machines: for nonlinear terms, choose another scheme, such as \
         newmark or runge-kutta-4, with steps that are much shorter than the period of the fastest motion"
    )]
    ExactNonlinear,
    /// A periodic response has no initial conditions.
    #[error(
        "a periodic response has no initial state: give displacements for Houbolt's first steps only with a \
         response from rest or from a given motion"
    )]
    GivenStartPeriodic,
    /// An unstable machine does not reach a steady state.
    #[error(
        "the machine is unstable, {instability}: it reaches no periodic response; choose \
         \"response\": \"from-rest\" and a record of a few doubling times"
    )]
    UnstablePeriodic {
        /// The growing free response.
        instability: Instability,
    },
    /// The periodic response of a nonlinear or large machine is unstable, so a simulation departs
    /// from this response.
    #[error(
        "the periodic response is unstable: each period multiplies a disturbance by {} (the largest \
         Floquet multiplier), so the motion departs from it; choose \"response\": \"from-rest\" to see how \
         the response develops, or another amplitude or frequency",
        multiplier_text(*.multiplier)
    )]
    UnstableOrbit {
        /// The largest Floquet multiplier (pure number).
        multiplier: Complex<f64>,
    },
    /// The search for the periodic response of a nonlinear machine fails.
    #[error(
        "no response that repeats every {period} s was found by a search that begins after {SETTLING} periods \
         from rest: the best response changes by {missed:.1e} of its size in a period. Choose \
         \"response\": \"from-rest\" to see how the response develops; if the response repeats only after \
         several periods of the force, describe these as one period (`samples`, `lines`)",
        period = message::number(*period)
    )]
    NoPeriodicOrbit {
        /// Period of the force, in seconds.
        period: f64,
        /// Change of the state over a period, relative to the largest displacement, velocity or
        /// acceleration.
        missed: f64,
    },
    /// The response of an unstable machine overflows.
    #[error("the machine is unstable, {instability}: {error}; choose a shorter record")]
    UnstableOverflow {
        /// The growing free response.
        instability: Instability,
        /// Error that the time-stepping scheme returned; it states where the response overflows.
        #[source]
        error: IntegrateError,
    },
}

/// Writes a multiplier with four decimals, and adds the modulus of a complex multiplier.
fn multiplier_text(multiplier: Complex<f64>) -> String {
    let number = |value: f64| message::number_to(value, 4);
    match multiplier.im {
        0.0 => format!("{}", number(multiplier.re)),
        im => format!(
            "{} ± {}i, of modulus {}",
            number(multiplier.re),
            number(im.abs()),
            number(multiplier.norm())
        ),
    }
}

impl SimulateError {
    /// Converts the error of a search, so that the message refers to the description of the
    /// experiment.
    pub(super) fn from_orbit(error: IntegrateError) -> Self {
        match error {
            IntegrateError::NoOrbit { period, missed } => Self::NoPeriodicOrbit { period, missed },
            error => Self::Integrate(error),
        }
    }

    /// Adds the instability as the reason for an overflow.
    pub(super) fn with_instability(self, instability: Option<Instability>) -> Self {
        match (self, instability) {
            (Self::Integrate(error @ IntegrateError::Overflow { .. }), Some(instability)) => {
                Self::UnstableOverflow { instability, error }
            }
            (error, _) => error,
        }
    }
}
