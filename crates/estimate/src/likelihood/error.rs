//! Errors of the likelihood.

use mechid_model::elements::MachineError;
use mechid_signal::message;

/// Error of a fit of a model to line data; the variants have the values that cause the error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LikelihoodError {
    /// The description of the machine is not consistent.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Sizes of data, model or settings do not match.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Name of the quantity with the wrong size.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number found.
        got: usize,
    },
    /// A setting is out of range.
    #[error("`{name}` must be {requirement}, got {}", message::number(*value))]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Requirement that the setting does not meet.
        requirement: &'static str,
        /// Value given, in the unit of the setting.
        value: f64,
    },
    /// Every coefficient is known.
    #[error("every coefficient is known: at least one must be unknown")]
    NoParameter,
    /// The data have at most as many measured numbers as there are unknowns.
    #[error(
        "{} cannot determine {}: use more lines or sensors, or state coefficients",
        message::count(*numbers, "measured number"),
        message::count(*unknowns, "unknown")
    )]
    TooFewLines {
        /// Number of measured real numbers.
        numbers: usize,
        /// Number of unknowns, including transient loads.
        unknowns: usize,
    },
    /// The noise covariance of the outputs is singular: an output has no noise, or two outputs have
    /// the same noise.
    #[error(
        "the noise covariance of the outputs at {frequency_hz} Hz cannot be inverted: an output has no noise, \
         or two outputs have the same noise"
    )]
    SingularNoise {
        /// Frequency of the line with the singular covariance, in Hz.
        frequency_hz: f64,
    },
    /// A sample covariance has too few degrees of freedom for a weight.
    #[error(
        "covariances with {degrees_of_freedom} statistical degrees of freedom cannot weight {outputs} \
         outputs: more than {} degrees of freedom are needed, from more periods or averages",
        outputs + 1
    )]
    FewDegreesOfFreedom {
        /// Degrees of freedom of the covariances.
        degrees_of_freedom: f64,
        /// Number of outputs.
        outputs: usize,
    },
    /// The receptance does not exist.
    #[error("the response of the machine is not finite with these parameters: {at}")]
    NoResponse {
        /// Name of the parameter values at which the response is not finite.
        at: &'static str,
    },
    /// The initial and final states of open records need too many unknowns.
    #[error(
        "in this band the sensors respond to {got} independent state loads (differences between the initial and \
         the final state of an open record), but at most {most} are supported: choose a narrower band, or \
         whole periods"
    )]
    LargeOpen {
        /// Number of state loads.
        got: usize,
        /// Largest number supported.
        most: usize,
    },
    /// No search converged.
    #[error(
        "no search ended at a minimum ({searches} tried, at most {steps} steps each): give better initial \
         values, narrower bounds or priors"
    )]
    NotConverged {
        /// Number of searches.
        searches: usize,
        /// Maximum number of steps of each search.
        steps: usize,
    },
    /// A number exceeds the range of double precision.
    #[error("the computation of {what} exceeds the range of double precision")]
    Overflow {
        /// Quantity that was computed.
        what: &'static str,
    },
}
