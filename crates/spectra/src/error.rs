//! Errors of this crate.

use mechid_signal::{SignalError, message};
use thiserror::Error;

/// Error of spectral lines or of their noise.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// Two arguments that must have the same size differ in size.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Name of the items counted.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number given.
        got: usize,
    },
    /// No spectral line is in the band.
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
    #[error("line {row}: {value} is neither a finite amplitude nor a positive frequency")]
    NotFinite {
        /// Row of the line, counted from 0.
        row: usize,
        /// The refused frequency or amplitude, in its unit.
        value: f64,
    },
    /// The step between segments is zero, or larger than a segment.
    #[error("segments of {} cannot start at intervals of {}: the interval must be from 1 to {len}", message::count(*len, "sample"), message::count(*hop, "sample"))]
    Hop {
        /// Number of samples in a segment.
        len: usize,
        /// Number of samples from the start of one segment to the start of the next.
        hop: usize,
    },
    /// No spectral line was chosen, or none of them has force.
    #[error("no spectral line has force: choose lines that the excitation drives")]
    NoExcitedLine,
    /// A chosen line does not exist or has no phase.
    #[error(
        "line {line} cannot be used: only lines 1 to {last} of this record have an amplitude and a phase"
    )]
    LineOutOfRange {
        /// Chosen line.
        line: usize,
        /// Last usable line, just below half the sampling rate.
        last: usize,
    },
    /// A frequency is not positive and finite.
    #[error("a frequency of {value} rad/s cannot be used: it must be positive and finite")]
    Frequency {
        /// The frequency, in rad/s.
        value: f64,
    },
    /// Two experiments measured different quantities.
    #[error("all experiments need the same quantity, but one measured {left}, the other {right}")]
    MixedQuantities {
        /// Quantity of the first.
        left: mechid_model::ResponseQuantity,
        /// Quantity of the second.
        right: mechid_model::ResponseQuantity,
    },
    /// Two sets of frequencies that must be equal differ.
    #[error(
        "row {row}: {left} rad/s against {right} rad/s; both data sets must have the same frequencies"
    )]
    FrequencyMismatch {
        /// First row that differs, counted from 0.
        row: usize,
        /// Frequency in the first set, in rad/s.
        left: f64,
        /// Frequency in the second, in rad/s.
        right: f64,
    },
    /// Too few averages for a ratio or covariance.
    #[error(
        "signal and noise cannot be separated: at least {needed} averages are needed, got {got}"
    )]
    TooFewAverages {
        /// Number of averages.
        got: usize,
        /// Number of averages needed.
        needed: usize,
    },
    /// The forces do not determine a frequency response at a line.
    #[error(
        "the forces at {frequency_hz} Hz do not act independently (reciprocal condition {reciprocal_condition:.1e}): \
         leave the line out, or make experiments with different forces"
    )]
    DependentForces {
        /// Frequency, in Hz.
        frequency_hz: f64,
        /// Ratio of the smallest to the largest eigenvalue of the scaled force cross-spectrum.
        reciprocal_condition: f64,
    },
    /// A noise variance is negative or not finite.
    #[error("noise variance {column} of row {row} is {value}: it must be finite and not negative")]
    NoiseVariance {
        /// Row, counted from 0.
        row: usize,
        /// Channel, counted from 0, displacements first, then forces.
        column: usize,
        /// The given value, in m² or N².
        value: f64,
    },
    /// A coherence is outside (0, 1].
    #[error("a coherence must be above 0 and at most 1, got {value}")]
    Coherence {
        /// The given value, a pure number.
        value: f64,
    },
    /// The response is not coherent with the force.
    #[error(
        "the motion at {frequency_hz} Hz is not coherent with the force: H2 does not exist at this frequency"
    )]
    IncoherentMotion {
        /// Frequency, in Hz.
        frequency_hz: f64,
    },
    /// A numerical method fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
    /// A system cannot be used.
    #[error(transparent)]
    Model(#[from] mechid_model::ModelError),
    /// A record cannot be used.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
