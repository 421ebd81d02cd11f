//! What can be wrong with a signal.

/// A signal that cannot be made or used; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// The time step is not a positive finite number of seconds.
    #[error("time step must be positive and finite, got {dt} s")]
    TimeStep {
        /// The step given, in seconds.
        dt: f64,
    },
    /// A record or period needs at least one sample.
    #[error("a record needs at least one sample")]
    Empty,
    /// The data do not have as many samples as the sampling says.
    #[error("channel {channel} has {got} samples where the sampling has {expected}")]
    Length {
        /// Channel, counted from 0.
        channel: usize,
        /// Samples given.
        got: usize,
        /// Samples expected.
        expected: usize,
    },
    /// A sample is NaN or infinite.
    #[error("sample {sample} of channel {channel} is {value}, not a finite number")]
    NotFinite {
        /// Sample, counted from 0.
        sample: usize,
        /// Channel, counted from 0.
        channel: usize,
        /// The value found.
        value: f64,
    },
    /// A window does not lie inside the record.
    #[error("samples {start}..{end} were asked for, the record has {len}")]
    Window {
        /// First sample asked for, counted from 0.
        start: usize,
        /// One past the last sample asked for.
        end: usize,
        /// Samples in the record.
        len: usize,
    },
    /// Two records that must share a time axis do not.
    #[error(
        "time axes differ: {left_len} samples at {left_dt} s against {right_len} at {right_dt} s"
    )]
    SamplingMismatch {
        /// Samples of the first record.
        left_len: usize,
        /// Step of the first record, in seconds.
        left_dt: f64,
        /// Samples of the second record.
        right_len: usize,
        /// Step of the second record, in seconds.
        right_dt: f64,
    },
}
