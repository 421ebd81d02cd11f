//! Errors of simulations that cannot be run.

use mechid_integrate::IntegrateError;
use mechid_io::IoError;
use mechid_model::{Instability, ModelError};
use mechid_signal::{SignalError, message};
use nalgebra::Complex;

/// Periods of the force from rest after which a steady state of a nonlinear machine is searched for.
pub(super) const SETTLING: usize = 50;

/// A simulation that cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The description is wrong.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The scheme refuses.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The system has no such response.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A record cannot be made.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The exact scheme has no time steps, and so no start.
    #[error(
        "the scheme \"exact\" gives the periodic response only: choose another one for a response that \
         starts from rest or from a given motion"
    )]
    ExactFromRest,
    /// The exact scheme is that of linear machines.
    #[error(
        "the scheme \"exact\" is for linear machines: choose another one for nonlinear terms, such as \
         newmark or runge-kutta-4, and steps that are short against the fastest motion"
    )]
    ExactNonlinear,
    /// A periodic response has no start.
    #[error(
        "a periodic response has no start: give displacements for Houbolt's first steps only with a \
         response from rest or from a given motion"
    )]
    GivenStartPeriodic,
    /// An unstable machine reaches no steady state.
    #[error(
        "the machine is unstable, {instability}: it reaches no periodic response; choose \
         \"response\": \"from-rest\" and a record of a few doublings"
    )]
    UnstablePeriodic {
        /// The growing free response.
        instability: Instability,
    },
    /// A periodic response that no run stays on, of a nonlinear machine or a large one.
    #[error(
        "the periodic response is unstable: each period multiplies a disturbance by {} (the largest \
         Floquet multiplier), so that no machine stays on it; choose \"response\": \"from-rest\" to see \
         where the response goes, or another amplitude or frequency",
        multiplier_text(*.multiplier)
    )]
    UnstableOrbit {
        /// The largest Floquet multiplier (pure number).
        multiplier: Complex<f64>,
    },
    /// The search for the periodic response of a nonlinear machine ends without one.
    #[error(
        "no response that repeats every {period} s was found from rest and {SETTLING} periods: the best \
         changes by {missed:.1e} of its size in a period. Choose \"response\": \"from-rest\" to see where \
         the response goes; where it repeats after several periods of the force only, describe these as \
         one (`samples`, `lines`)",
        period = message::number(*period)
    )]
    NoPeriodicOrbit {
        /// Period of the force, in seconds.
        period: f64,
        /// Change in a period, relative to the largest displacement, velocity or acceleration.
        missed: f64,
    },
    /// The response of an unstable machine overflows.
    #[error("the machine is unstable, {instability}: {error}; choose a shorter record")]
    UnstableOverflow {
        /// The growing free response.
        instability: Instability,
        /// Place of the overflow.
        #[source]
        error: IntegrateError,
    },
}

/// The number with four decimals, of a complex one its modulus too.
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
    /// Says of a failed search what the description of an experiment can change.
    pub(super) fn of_orbit(error: IntegrateError) -> Self {
        match error {
            IntegrateError::NoOrbit { period, missed } => Self::NoPeriodicOrbit { period, missed },
            error => Self::Integrate(error),
        }
    }

    /// Adds the reason to the overflow of a run.
    pub(super) fn of_unstable(self, instability: Option<Instability>) -> Self {
        match (self, instability) {
            (Self::Integrate(error @ IntegrateError::Overflow { .. }), Some(instability)) => {
                Self::UnstableOverflow { instability, error }
            }
            (error, _) => error,
        }
    }
}
