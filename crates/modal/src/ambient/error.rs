//! Errors of the identification of ambient records.

use mechid_signal::SignalError;
use mechid_spectra::SpectraError;
use thiserror::Error;

/// Error of the identification of modes from responses alone.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum AmbientError {
    /// A channel does not change.
    #[error(
        "channel {}: all {samples} samples are {value}: the sensor is dead or not connected",
        channel.saturating_add(1)
    )]
    ConstantChannel {
        /// Channel, counted from 0.
        channel: usize,
        /// Number of samples.
        samples: usize,
        /// Value of the samples, in the unit of the channel.
        value: f64,
    },
    /// A channel has almost no signal in the band.
    #[error(
        "channel {}: its RMS value in the band is {rms:.2e}, {:.0e} times that of the \
         strongest channel: the sensor is dead, or its unit differs from that of the other channels",
        channel.saturating_add(1), ratio
    )]
    DeadChannel {
        /// Channel, counted from 0.
        channel: usize,
        /// RMS value in the band, in the unit of the channel.
        rms: f64,
        /// Ratio of the RMS value of this channel to the RMS value of the strongest channel, both
        /// in the band.
        ratio: f64,
    },
    /// A channel is a multiple of another channel.
    #[error(
        "channels {} and {} are copies of one another: only a fraction of {unexplained:.0e} of their power \
         differs; leave one channel out",
        first.saturating_add(1), second.saturating_add(1)
    )]
    CopiedChannel {
        /// First channel, counted from 0.
        first: usize,
        /// Second channel, counted from 0.
        second: usize,
        /// Fraction of the power of one channel that the other channel does not explain.
        unexplained: f64,
    },
    /// The band has too few lines.
    #[error(
        "{lines} spectral lines lie between {from_hz} and {to_hz} Hz; one mode with {outputs} outputs \
         needs {needed}: make a longer record, or widen `band_hz`"
    )]
    TooFewLines {
        /// Number of lines in the band.
        lines: usize,
        /// Number of lines needed.
        needed: usize,
        /// Number of outputs.
        outputs: usize,
        /// Lower end of the band, in Hz.
        from_hz: f64,
        /// Upper end of the band, in Hz.
        to_hz: f64,
    },
    /// The record is too short for the subspace method.
    #[error(
        "{samples} samples after resampling to the band are too few for covariances over {lags} lags: \
         make a longer record"
    )]
    TooShort {
        /// Number of samples after resampling to the band.
        samples: usize,
        /// Number of lags needed.
        lags: usize,
    },
    /// The band is empty or not finite.
    #[error(
        "`band_hz` is {from_hz} to {to_hz} Hz, but its lower end must be at least 0 and below its upper end, which must be at most {nyquist_hz} Hz, half the sampling rate"
    )]
    Band {
        /// Requested lower end of the band, in Hz.
        from_hz: f64,
        /// Requested upper end of the band, in Hz.
        to_hz: f64,
        /// Half the sampling rate, in Hz.
        nyquist_hz: f64,
    },
    /// The requested number of modes is zero.
    #[error("`modes` and `max_modes` must be at least 1")]
    NoModesAsked,
    /// Fewer modes were found than requested.
    #[error(
        "only {found} of {asked} modes were found between {from_hz} and {to_hz} Hz: ask for fewer (`modes`), or \
         widen `band_hz`"
    )]
    FewerModes {
        /// Number of modes asked for (`modes`).
        asked: usize,
        /// Number of modes found.
        found: usize,
        /// Lower end of the band, in Hz.
        from_hz: f64,
        /// Upper end of the band, in Hz.
        to_hz: f64,
    },
    /// There is no mode in the band.
    #[error(
        "no mode between {from_hz} and {to_hz} Hz: none of {candidates} candidates exceeds \
         the noise"
    )]
    NoMode {
        /// Number of candidates examined.
        candidates: usize,
        /// Lower end of the band, in Hz.
        from_hz: f64,
        /// Upper end of the band, in Hz.
        to_hz: f64,
    },
    /// A decomposition or a search failed.
    #[error("{what} ({size} unknowns) failed: two channels of the record may be copies")]
    Numerics {
        /// Name of the decomposition or search that failed.
        what: &'static str,
        /// Number of unknowns.
        size: usize,
    },
    /// The lines of the record could not be computed.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// The record is unusable.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
