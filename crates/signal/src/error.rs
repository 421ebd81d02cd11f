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
    /// A multisine without lines.
    #[error("a multisine needs at least one line")]
    NoLines,
    /// A line no multisine can have: DC, or beyond the highest line supported.
    #[error("line {line} is not between 1 and {highest}")]
    Line {
        /// The line given.
        line: usize,
        /// The highest line allowed.
        highest: usize,
    },
    /// Lines must be given in rising order, each once.
    #[error("line {line} follows line {previous}: lines must rise, each given once")]
    LineOrder {
        /// The line before.
        previous: usize,
        /// The line given after it.
        line: usize,
    },
    /// A list that must have one entry per line has another length.
    #[error("{lines} lines but {got} {what}")]
    PerLine {
        /// What the list holds.
        what: &'static str,
        /// Number of lines.
        lines: usize,
        /// Entries given.
        got: usize,
    },
    /// A line at or above half the sampling rate cannot be sampled.
    #[error("line {line} needs more than {} samples per period, the sampling has {len}", 2 * line)]
    Nyquist {
        /// The line.
        line: usize,
        /// Samples per period.
        len: usize,
    },
    /// A quantity that must be finite and not negative is not.
    #[error("{what} must be finite and not negative, got {value}")]
    Negative {
        /// The quantity.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A quantity that must be finite is not.
    #[error("{what} must be finite, got {value}")]
    Infinite {
        /// The quantity.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A quantity that must be finite and greater than zero is not.
    #[error("{what} must be finite and positive, got {value}")]
    NotPositive {
        /// The quantity.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// A signal that is zero throughout has no crest factor, no signal-to-noise ratio, no band.
    #[error("channel {channel} is zero throughout")]
    Silent {
        /// Channel, counted from 0.
        channel: usize,
    },
}

/// `value`, if it is finite and not negative.
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::Negative { what, value })
}

/// `value`, if it is finite and positive.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::NotPositive { what, value })
}

/// `value`, if it is finite.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::Infinite { what, value })
}
