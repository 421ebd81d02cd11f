//! Errors of the likelihood.

use mechid_model::elements::MachineError;
use mechid_signal::message;

/// Line data and a model that do not lead to an estimate; every variant carries the offending
/// numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LikelihoodError {
    /// The description of the machine does not make sense.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Two things that belong together have different sizes.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Things that were counted.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number found.
        got: usize,
    },
    /// A choice is out of range.
    #[error("`{name}` must be {requirement}, got {}", message::number(*value))]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Requirement that it does not meet.
        requirement: &'static str,
        /// Value given, in the unit of the setting.
        value: f64,
    },
    /// Every coefficient is known.
    #[error("every coefficient is known: there is nothing to identify")]
    NoParameter,
    /// The measured numbers are not more than the unknowns.
    #[error(
        "{} cannot determine {}",
        message::count(*numbers, "measured number"),
        message::count(*unknowns, "unknown")
    )]
    TooFewLines {
        /// Real numbers measured.
        numbers: usize,
        /// Unknowns, those of transients included.
        unknowns: usize,
    },
    /// An output has no noise at all, or two have the same.
    #[error("the covariance of the outputs at {frequency_hz} Hz cannot be inverted")]
    SingularNoise {
        /// Frequency of the line.
        frequency_hz: f64,
    },
    /// A sample covariance has too few degrees of freedom to weight with.
    #[error(
        "covariances of {degrees_of_freedom} degrees of freedom cannot weight {outputs} outputs: \
         more than {} are needed",
        outputs + 1
    )]
    FewDegreesOfFreedom {
        /// Degrees of freedom of the covariances.
        degrees_of_freedom: f64,
        /// Number of outputs.
        outputs: usize,
    },
    /// The receptance does not exist.
    #[error("the machine has no finite response at {at}")]
    NoResponse {
        /// Place in the search.
        at: &'static str,
    },
    /// Open records need the motion of all degrees of freedom on every line.
    #[error("open records are supported up to {most} degrees of freedom; the machine has {dof}")]
    LargeOpen {
        /// Degrees of freedom of the machine.
        dof: usize,
        /// Largest number supported.
        most: usize,
    },
    /// No search ended at a minimum.
    #[error("no search ended at a minimum: {searches} made, {steps} steps each at most")]
    NotConverged {
        /// Number of searches.
        searches: usize,
        /// Steps of each at most.
        steps: usize,
    },
    /// A matrix decomposition failed.
    #[error("numbers overflow in {what}")]
    Overflow {
        /// Quantity that was computed.
        what: &'static str,
    },
}
