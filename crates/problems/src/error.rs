//! Errors of problems without an answer.

use mechid_model::ModelError;
use mechid_signal::SignalError;

/// A problem that cannot be posed or has no answer; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// No periodic response exists, or it is not unique.
    #[error(
        "there is no unique response with the period {period} s: an undamped mode lies on a spectral line of the \
         period, or the response overflows. With the transition matrix Φᴺ over the period, I − Φᴺ has a reciprocal \
         condition of about {reciprocal_condition:.1e}"
    )]
    NoPeriodicMotion {
        /// Period of the force, in seconds.
        period: f64,
        /// Smallest singular value of I − Φᴺ relative to 1 + ‖Φᴺ‖, where Φᴺ is the transition
        /// matrix over the period.
        reciprocal_condition: f64,
    },
    /// The step is so long that rounding leaves no correct digit of the response.
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
    /// The record is not valid; for example, the response of an unstable system overflowed, or a
    /// noise level is out of range.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// A decomposition fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
}
