//! Errors of this crate.

use mechid_signal::SignalError;
use thiserror::Error;

/// Error of spectral lines and their noise.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// Two things that belong together have different sizes.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// What was counted.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number found.
        got: usize,
    },
    /// There is no spectral line in the band.
    #[error(
        "no spectral line lies between {from_hz} and {to_hz} Hz: the record has lines every {spacing_hz} Hz up to {highest_hz} Hz"
    )]
    NoLine {
        /// Lower end of the band, in Hz.
        from_hz: f64,
        /// Upper end of the band, in Hz.
        to_hz: f64,
        /// Distance of two lines, in Hz.
        spacing_hz: f64,
        /// Highest line below half the sampling rate, in Hz.
        highest_hz: f64,
    },
    /// A frequency is not positive, or an amplitude is not finite.
    #[error("line {row}: {value} is not a finite amplitude or a positive frequency")]
    NotFinite {
        /// Row of the line, counted from 0.
        row: usize,
        /// The value.
        value: f64,
    },
    /// A record is unusable.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
