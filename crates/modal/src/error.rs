//! Errors of the identification of modes.

use thiserror::Error;

use crate::DroppedCandidate;

/// Reason why no modes can be identified.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ModalError {
    /// There is no output.
    #[error("no output was given: modes need at least one response")]
    NoOutput,
    /// There is neither an input nor an open record.
    #[error(
        "the data have no excitation of the modes: neither an input nor an open record was given"
    )]
    NoExcitation,
    /// The number of lines is smaller than the number of unknowns of one mode.
    #[error(
        "the band has {lines} lines, but one mode of these data needs at least {required}: widen the band, or \
         use a longer record"
    )]
    TooFewLines {
        /// Number of lines.
        lines: usize,
        /// Least number of lines.
        required: usize,
    },
    /// Outputs without any power in the band.
    #[error(
        "outputs {outputs:?} (counted from 0) are constant or zero in the band: leave them out"
    )]
    DeadOutputs {
        /// Indices of the outputs.
        outputs: Vec<usize>,
    },
    /// Inputs without any power in the band.
    #[error("inputs {inputs:?} (counted from 0) are constant or zero in the band: leave them out")]
    DeadInputs {
        /// Indices of the inputs.
        inputs: Vec<usize>,
    },
    /// An input is a combination of the other inputs on every line.
    #[error(
        "input {input} is a combination of the other inputs (independent share {own_share:.1e}): their responses \
         cannot be separated; record a test in which this input varies independently, or leave this input out"
    )]
    DependentInputs {
        /// Index of the input.
        input: usize,
        /// RMS value of the part of the input that the preceding inputs do not explain, relative to
        /// the RMS value of the input.
        own_share: f64,
    },
    /// No mode is significant.
    #[error("no mode between {from_hz:.6} and {to_hz:.6} Hz: none of {} candidates is significant", dropped.len())]
    NoMode {
        /// Lowest frequency, in Hz.
        from_hz: f64,
        /// Highest frequency, in Hz.
        to_hz: f64,
        /// Candidates that were tried, with the reasons for their rejection.
        dropped: Vec<DroppedCandidate>,
    },
    /// A stated frequency is not in the band.
    #[error("{value} Hz is not between {from_hz:.6} and {to_hz:.6} Hz, the band of the data")]
    OutsideBand {
        /// The stated frequency, in Hz.
        value: f64,
        /// Lowest frequency, in Hz.
        from_hz: f64,
        /// Highest frequency, in Hz.
        to_hz: f64,
    },
    /// A setting is out of its range.
    #[error("`{setting}`: expected {required}, got {value}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value that was given.
        value: f64,
        /// Allowed values of the setting.
        required: &'static str,
    },
    /// A decomposition of the numerical kernel failed.
    #[error("the decomposition of {what} ({size} × {size}) did not converge")]
    Decomposition {
        /// Matrix that was decomposed.
        what: &'static str,
        /// Number of rows of the matrix.
        size: usize,
    },
    /// The numbers of channels of line data and estimate differ.
    #[error(
        "the data have {inputs} inputs and {outputs} outputs, but the modes have {model_inputs} inputs \
         and {model_outputs} outputs"
    )]
    Size {
        /// Inputs of the data.
        inputs: usize,
        /// Outputs of the data.
        outputs: usize,
        /// Inputs of the modes.
        model_inputs: usize,
        /// Outputs of the modes.
        model_outputs: usize,
    },
}
