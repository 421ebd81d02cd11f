//! Errors of numerical methods.

use thiserror::Error;

/// Error of a numerical method; every variant carries the numbers behind it.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NumericsError {
    /// A confidence level is outside (0, 1).
    #[error("a confidence level lies between 0 and 1, got {level}")]
    Level {
        /// The level given, a probability.
        level: f64,
    },
}
