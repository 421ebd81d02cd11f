//! Errors of the reconstruction of a force.

use mechid_model::ModelError;
use mechid_signal::{SignalError, message};

/// A force that cannot be reconstructed; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForceError {
    /// System and response differ in size.
    #[error(
        "the system has {}, the response has {}: \
         give one channel per degree of freedom, or name the measured degrees of freedom in a `Measurement`", message::count(*system, "degree of freedom"), message::count(*response, "channel")
    )]
    Dof {
        /// Degrees of freedom of the system.
        system: usize,
        /// Channels of the response.
        response: usize,
    },
    /// The response is shorter than the method needs.
    #[error("a response of {} is too short: this method needs {needed}", message::count(*samples, "sample"))]
    TooShort {
        /// Samples given.
        samples: usize,
        /// Minimum number of samples.
        needed: usize,
    },
    /// A record and its list of channels differ in size.
    #[error(
        "the record has {}, but {described} are described: describe each channel",
        message::count(*record, "channel")
    )]
    ChannelCount {
        /// Channels of the record.
        record: usize,
        /// Channels described.
        described: usize,
    },
    /// A degree of freedom that the system does not have.
    #[error("degree of freedom {} (counted from 1) does not exist in a system of {dofs}", dof.saturating_add(1))]
    NoSuchDof {
        /// Degree of freedom requested, counted from 0.
        dof: usize,
        /// Number of degrees of freedom.
        dofs: usize,
    },
    /// The same spectral line was named twice.
    #[error("line {line} is named twice")]
    RepeatedLine {
        /// Number of the line, 0 for the mean.
        line: usize,
    },
    /// The same degree of freedom was named twice.
    #[error("forced degree of freedom {} (counted from 1) is named twice", dof.saturating_add(1))]
    RepeatedDof {
        /// Degree of freedom, counted from 0.
        dof: usize,
    },
    /// No degree of freedom is forced, so there is no unknown.
    #[error("no degree of freedom with an unknown force was named")]
    NoForcedDof,
    /// More unknown forces than measured channels.
    #[error(
        "{forces} unknown forces cannot be separated with {}: \
         measure more degrees of freedom, or name fewer forced degrees of freedom",
        message::count(*measurements, "measured channel")
    )]
    MoreForcesThanMeasurements {
        /// Unknown forces.
        forces: usize,
        /// Measured channels.
        measurements: usize,
    },
    /// A Taylor order outside 1 … 8.
    #[error("the Taylor order {order} is not possible: choose 1 (Euler) to 8, or the exact form")]
    TaylorOrder {
        /// Order given.
        order: usize,
    },
    /// The time step is so long that the motion at the end of a step does not depend on the force
    /// during the step.
    #[error(
        "the time step {dt} s is too long for the machine: the motion at the end of a step does not depend on the \
         force during the step (reciprocal condition {reciprocal_condition:.1e}); sample faster"
    )]
    StepTooLong {
        /// The time step, in seconds.
        dt: f64,
        /// Smallest over largest singular value of the input matrix.
        reciprocal_condition: f64,
    },
    /// The free response of an unstable system exceeds the range of double precision.
    #[error(
        "the machine is unstable: its free response grows e-fold every {} s, by a factor of \
         10^{:.0} within {} s, too much to compute the force in double precision; use whole periods in steady \
         state, the Kalman smoother, a shorter record or a shorter time step",
        message::number_to(rate.recip(), 3),
        rate * duration / std::f64::consts::LN_10,
        message::number_to(*duration, 6)
    )]
    Unstable {
        /// Largest real part of an eigenvalue, in 1/s.
        rate: f64,
        /// Duration in which the free response grows, in s: that of the record, or one time step.
        duration: f64,
    },
    /// No line was chosen.
    #[error("no spectral line was chosen")]
    NoLines,
    /// A line outside the spectrum.
    #[error("line {line} was requested, but the spectrum ends at line {last}")]
    NoSuchLine {
        /// Line requested.
        line: usize,
        /// Last line.
        last: usize,
    },
    /// The measured channels do not show a force at this line.
    #[error(
        "at line {line} (ω = {} rad/s) the measured channels do not determine the force on \
         degree of freedom {} (counted from 1; reciprocal condition {reciprocal_condition:.1e}): \
         leave the line out, measure another degree of \
         freedom or quantity, or name fewer forces",
        message::number_to(*omega, 6),
        dof + 1
    )]
    NotTransmitted {
        /// The line.
        line: usize,
        /// Angular frequency, in rad/s.
        omega: f64,
        /// The forced degree of freedom most affected, counted from 0.
        dof: usize,
        /// Smallest over largest singular value of the transfer matrix at this line.
        reciprocal_condition: f64,
    },
    /// The dynamic stiffness is singular: no periodic response exists at this line.
    #[error(
        "at line {line} (ω = {} rad/s) the dynamic stiffness is singular: an undamped \
         resonance has no periodic response; leave the line out",
        message::number_to(*omega, 6)
    )]
    Resonance {
        /// The line.
        line: usize,
        /// Angular frequency, in rad/s.
        omega: f64,
    },
    /// Too few lines remain outside the chosen lines to estimate the noise.
    #[error(
        "the noise level is estimated from the lines that are not chosen, but only {outside} such lines remain, \
         and {needed} are needed: choose fewer lines, give a longer period, or state the level (`noise`)"
    )]
    TooFewOutsideLines {
        /// Lines not chosen.
        outside: usize,
        /// Minimum number of lines.
        needed: usize,
    },
    /// A channel is zero or not finite on the lines that determine its noise.
    #[error(
        "channel {channel} (counted from 1) is zero or not finite on the lines that are not chosen, \
         which determine its noise: the sensor may be dead; leave it out, or state the noise level (`noise`)"
    )]
    NoNoise {
        /// The channel, counted from 1.
        channel: usize,
    },
    /// A number must be positive and finite, but is zero, negative, infinite or NaN.
    #[error("{what} must be positive and finite, got {value}")]
    NotPositive {
        /// Name of the number.
        what: &'static str,
        /// Invalid value of the number, in the unit of that number.
        value: f64,
    },
    /// An open record has more unknowns than the limit.
    #[error(
        "the open record has {unknowns} unknowns (samples × forces), but at most {limit} are \
         possible: take whole periods, a shorter window, or the Kalman smoother"
    )]
    TooLarge {
        /// Samples × forces.
        unknowns: usize,
        /// Maximum number.
        limit: usize,
    },
    /// The measured channels cannot show a force, at any frequency.
    #[error(
        "the measured channels cannot separate the force on degree of freedom {} (counted from 1) from the \
         other forces at any frequency: measure elsewhere, or name fewer forces",
        dof + 1
    )]
    Unseen {
        /// The forced degree of freedom, counted from 0.
        dof: usize,
    },
    /// A force model has RMS values for another number of forces.
    #[error(
        "the model of the forces has {models} RMS values for {}: give one value for each force",
        message::count(*forces, "force")
    )]
    ModelCount {
        /// RMS values given.
        models: usize,
        /// Number of forces.
        forces: usize,
    },
    /// A force model has an impossible order.
    #[error(
        "a force model of order {order} is not possible: choose 1 (first-order low-pass) to {most} (steep edge)"
    )]
    ModelOrder {
        /// The order given.
        order: usize,
        /// Highest order.
        most: usize,
    },
    /// A band of frequencies with impossible ends.
    #[error(
        "the band from {low_hz} to {high_hz} Hz is empty: give a lower end of at least 0 Hz and an upper \
         end above it"
    )]
    NoBand {
        /// Lower end, in Hz.
        low_hz: f64,
        /// Upper end, in Hz.
        high_hz: f64,
    },
    /// A band of frequencies without a spectral line.
    #[error(
        "no spectral line lies between {low_hz} and {high_hz} Hz: the lines of this record are \
         {} Hz apart and end at {} Hz",
        message::number_to(*spacing_hz, 6),
        message::number_to(*last_hz, 6)
    )]
    EmptyBand {
        /// Lower end, in Hz.
        low_hz: f64,
        /// Upper end, in Hz.
        high_hz: f64,
        /// Spacing of the lines, in Hz.
        spacing_hz: f64,
        /// Frequency of the last line, in Hz.
        last_hz: f64,
    },
    /// The Kalman filter overflows with every tuning that is tried, or with the given tuning.
    #[error(
        "the Kalman filter of this measurement overflows: use units that keep the values \
         of data and system between 1e-50 and 1e50; for an unstable machine, shorten the time step \
         or take the initial state as unknown"
    )]
    NoLikelihood,
    /// No force reaches the measured channels, or all channels are zero.
    #[error("no force reaches the measured channels, or all channels are zero: measure elsewhere")]
    Silent,
    /// Two force records have different numbers of channels.
    #[error(
        "the two forces to compare need the same number of channels, got {estimate} and {truth}"
    )]
    Compared {
        /// Channels of the estimate.
        estimate: usize,
        /// Number of channels of the reference force.
        truth: usize,
    },
    /// The reference force of a ratio is zero at the line.
    #[error("the reference force is zero at line {line}: leave the line out")]
    NoForceAtLine {
        /// The line.
        line: usize,
    },
    /// The reference force of a ratio is zero.
    #[error("the reference force is zero on every channel")]
    NoForce,
    /// The model is not usable.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A signal is not usable.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// A decomposition fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
}
