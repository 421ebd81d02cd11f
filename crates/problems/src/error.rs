//! What a judge cannot answer.

use mechid_model::ModelError;
use mechid_signal::SignalError;

/// A problem that cannot be posed or has no answer; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// No motion of the period of the force exists, or it is not the only one.
    #[error(
        "no unique periodic motion over {period} s \
         (reciprocal condition of I − Φᴺ about {reciprocal_condition:.1e}): \
         an eigenvalue stands undamped on a line of the period, or grows beyond double precision"
    )]
    NoPeriodicMotion {
        /// Period of the force, in seconds.
        period: f64,
        /// Smallest singular value of I − Φᴺ relative to 1 + ‖Φᴺ‖.
        reciprocal_condition: f64,
    },
    /// The step holds so many radians that no digit of the motion would be left.
    #[error("a step of {dt} s is too long for this system: (ω dt)² is about {scale:.1e}")]
    StepTooLong {
        /// Time step, in seconds.
        dt: f64,
        /// Largest entry of M⁻¹K dt² and M⁻¹C dt.
        scale: f64,
    },
    /// The system or its frequency response cannot be evaluated.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The response is not finite: an unstable system outgrew double precision.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
