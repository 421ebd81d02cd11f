//! Errors of signals.

use crate::message;
use crate::sampling::Sampling;

/// A signal that cannot be made or used; every variant carries the offending numbers.
///
/// Fields count from 0, as indices; messages count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// The time step is not a positive finite number of seconds.
    #[error("time step must be positive and finite, got {dt} s", dt = message::number(*dt))]
    TimeStep {
        /// The step given, in seconds.
        dt: f64,
    },
    /// A record or period needs at least one sample.
    #[error("a record needs at least one sample")]
    Empty,
    /// The data have another number of samples than the sampling.
    #[error("channel {} has {}, but the time axis has {expected}", channel.saturating_add(1), message::count(*got, "sample"))]
    Length {
        /// Channel, counted from 0.
        channel: usize,
        /// Number of samples given.
        got: usize,
        /// Number of samples expected.
        expected: usize,
    },
    /// A sample is NaN or infinite.
    #[error(
        "sample {} of channel {} is {value}, not a finite number",
        sample.saturating_add(1), channel.saturating_add(1),
        value = message::number(*value)
    )]
    NotFinite {
        /// Sample, counted from 0.
        sample: usize,
        /// Channel, counted from 0.
        channel: usize,
        /// The value found, in the unit of the record.
        value: f64,
    },
    /// A record is too short for the computation.
    #[error("the record has {}, but at least {needed} are needed", message::count(*samples, "sample"))]
    TooShort {
        /// Number of samples of the record.
        samples: usize,
        /// Number of samples needed.
        needed: usize,
    },
    /// Two series that belong together differ in length.
    #[error("two series need the same length, but one has {}, the other {right}", message::count(*left, "sample"))]
    PairLength {
        /// Number of samples of the first.
        left: usize,
        /// Number of samples of the second.
        right: usize,
    },
    /// A record does not fit in memory.
    #[error("{} of {} do not fit in memory", message::count(*channels, "channel"), message::count(*samples, "sample"))]
    Memory {
        /// Samples of a channel.
        samples: usize,
        /// Channels.
        channels: usize,
    },
    /// Channel that the record does not have.
    #[error("channel {} was requested, but there {} {channels}", channel.saturating_add(1), if *channels == 1 { "is" } else { "are" })]
    NoSuchChannel {
        /// Channel, counted from 0.
        channel: usize,
        /// Number of channels.
        channels: usize,
    },
    /// The spectrum has another number of lines than its sampling.
    #[error("the spectrum has {}, but its sampling has {expected}", message::count(*got, "line"))]
    SpectrumLength {
        /// Lines given.
        got: usize,
        /// Lines expected.
        expected: usize,
    },
    /// A complex amplitude is NaN or infinite.
    #[error("line {line} of channel {} is not a finite number", channel.saturating_add(1))]
    LineNotFinite {
        /// The line, counted from 0 (DC).
        line: usize,
        /// Channel, counted from 0.
        channel: usize,
    },
    /// A window extends beyond the record.
    #[error("samples {} to {end} were requested, but the record has {len}", start.saturating_add(1))]
    Window {
        /// First sample requested, counted from 0.
        start: usize,
        /// Index after the last sample requested.
        end: usize,
        /// Number of samples in the record.
        len: usize,
    },
    /// Two records have different time axes.
    #[error(
        "time axes differ: {} with steps of {left_dt} s against {right_len} with steps of {right_dt} s", message::count(*left_len, "sample"),
        left_dt = message::number(*left_dt), right_dt = message::number(*right_dt)
    )]
    SamplingMismatch {
        /// Number of samples of the first record.
        left_len: usize,
        /// Step of the first record, in seconds.
        left_dt: f64,
        /// Number of samples of the second record.
        right_len: usize,
        /// Step of the second record, in seconds.
        right_dt: f64,
    },
    /// A multisine without lines.
    #[error("a multisine needs at least one line")]
    NoLines,
    /// A line that is impossible for a multisine: DC, or above the highest line supported.
    #[error("line {line} is not between 1 and {highest}")]
    Line {
        /// The line given.
        line: usize,
        /// The highest line allowed.
        highest: usize,
    },
    /// Lines are not in ascending order, or repeated.
    #[error("line {line} follows line {previous}: lines must be in rising order, each given once")]
    LineOrder {
        /// The line before.
        previous: usize,
        /// The line that follows `previous`.
        line: usize,
    },
    /// A list does not have one entry per line.
    #[error("{}, but {got} {what}: give one for each line", message::count(*lines, "line"))]
    PerLine {
        /// Name of the entries.
        what: &'static str,
        /// Number of lines.
        lines: usize,
        /// Number of entries given.
        got: usize,
    },
    /// A line at or above half the sampling rate cannot be sampled.
    #[error("line {line} needs more than {} samples per period, but there are {len}", 2 * line)]
    Nyquist {
        /// The line.
        line: usize,
        /// Number of samples per period.
        len: usize,
    },
    /// A quantity that must be finite and at least zero is negative, NaN or infinite.
    #[error("{what} must be finite and not negative, got {value}", value = message::number(*value))]
    Negative {
        /// The quantity.
        what: &'static str,
        /// The value given, in the unit of the quantity.
        value: f64,
    },
    /// A quantity that must be finite is NaN or infinite.
    #[error("{what} must be finite, got {value}", value = message::number(*value))]
    Infinite {
        /// The quantity.
        what: &'static str,
        /// The value given, in the unit of the quantity.
        value: f64,
    },
    /// A quantity that must be finite and greater than zero is zero, negative, NaN or infinite.
    #[error("{what} must be finite and positive, got {value}", value = message::number(*value))]
    NotPositive {
        /// The quantity.
        what: &'static str,
        /// The value given, in the unit of the quantity.
        value: f64,
    },
    /// A frequency at or above half the sampling rate cannot be sampled.
    #[error(
        "{frequency_hz} Hz is not below half the sampling rate, {nyquist_hz} Hz",
        frequency_hz = message::number(*frequency_hz), nyquist_hz = message::number(*nyquist_hz)
    )]
    AboveNyquist {
        /// The frequency, in Hz.
        frequency_hz: f64,
        /// Half the sampling rate, in Hz.
        nyquist_hz: f64,
    },
    /// A band must have its lower end at or above zero and below its upper end.
    #[error(
        "the band from {low_hz} Hz to {high_hz} Hz is empty: its lower end must be at least 0 and below \
         its upper end",
        low_hz = message::number(*low_hz), high_hz = message::number(*high_hz)
    )]
    Band {
        /// Lower end, in Hz.
        low_hz: f64,
        /// Upper end, in Hz.
        high_hz: f64,
    },
    /// No spectral line lies in the band.
    #[error(
        "no spectral line lies between {low_hz} Hz and {high_hz} Hz: the lines are {spacing_hz} Hz apart",
        low_hz = message::number(*low_hz), high_hz = message::number(*high_hz), spacing_hz = message::number(*spacing_hz)
    )]
    EmptyBand {
        /// Lower end, in Hz.
        low_hz: f64,
        /// Upper end, in Hz.
        high_hz: f64,
        /// Spacing of the lines, in Hz.
        spacing_hz: f64,
    },
    /// A quantity is out of range.
    #[error(
        "{what} must be between {low} and {high}, got {value}",
        value = message::number(*value), low = message::number(*low), high = message::number(*high)
    )]
    Range {
        /// The quantity.
        what: &'static str,
        /// The value given, in the unit of the quantity.
        value: f64,
        /// Minimum allowed, in the same unit.
        low: f64,
        /// Maximum allowed, in the same unit.
        high: f64,
    },
    /// Too few samples or lines for the task.
    #[error("{what}: expected at least {least}, got {got}")]
    TooFew {
        /// Name of the items counted.
        what: &'static str,
        /// Number needed.
        least: usize,
        /// Number given.
        got: usize,
    },
    /// Several inputs must excite the same lines.
    #[error("input {} excites other lines than input 1: all inputs must excite the same lines", input.saturating_add(1))]
    DifferentLines {
        /// The input, counted from 0.
        input: usize,
    },
    /// A Hadamard matrix of this order is not available.
    #[error(
        "there is no Hadamard matrix of order {order}: choose a power of two, or the DFT matrix"
    )]
    HadamardOrder {
        /// The order asked for.
        order: usize,
    },
    /// A signal of zeros has no crest factor, no signal-to-noise ratio, no band.
    #[error("channel {} is zero throughout", channel.saturating_add(1))]
    Silent {
        /// Channel, counted from 0.
        channel: usize,
    },
}

/// Returns `value` if it is finite and not negative.
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::Negative { what, value })
}

/// Returns `value` if it is finite and positive.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::NotPositive { what, value })
}

/// Returns `value` if it lies between `low` and `high`, ends included.
pub(crate) fn within(
    what: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<f64, SignalError> {
    if value >= low && value <= high {
        return Ok(value);
    }
    Err(SignalError::Range { what, value, low, high })
}

/// Returns a frequency in Hz if it lies below half the sampling rate.
pub(crate) fn below_nyquist(frequency_hz: f64, sampling: Sampling) -> Result<f64, SignalError> {
    let nyquist_hz = sampling.nyquist_hz();
    if frequency_hz < nyquist_hz {
        return Ok(frequency_hz);
    }
    Err(SignalError::AboveNyquist { frequency_hz, nyquist_hz })
}

/// Returns a band in Hz if 0 ≤ low < high, both finite.
pub(crate) fn band(low_hz: f64, high_hz: f64) -> Result<(f64, f64), SignalError> {
    if low_hz >= 0.0 && low_hz < high_hz && high_hz.is_finite() {
        return Ok((low_hz, high_hz));
    }
    Err(SignalError::Band { low_hz, high_hz })
}

/// Returns `value` if it is finite.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64, SignalError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(SignalError::Infinite { what, value })
}

/// Returns an error if `channels` channels of `samples` samples cannot be allocated.
pub(crate) fn fits_in_memory(samples: usize, channels: usize) -> Result<(), SignalError> {
    let reserve = |len: usize| Vec::<f64>::new().try_reserve_exact(len).ok();
    // Without channels, the instants alone must fit in memory.
    samples
        .checked_mul(channels.max(1))
        .and_then(reserve)
        .ok_or(SignalError::Memory { samples, channels })
}

/// Returns an error unless `channel` is one of `channels`.
pub(crate) fn has_channel(channel: usize, channels: usize) -> Result<(), SignalError> {
    if channel < channels { Ok(()) } else { Err(SignalError::NoSuchChannel { channel, channels }) }
}
