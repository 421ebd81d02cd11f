//! Errors of free decays.

use mechid_signal::message;

/// Free decay that cannot be identified; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FreeDecayError {
    /// A record is longer than can be fitted.
    #[error(
        "the record has {samples} samples, but at most {most} can be fitted: use a part of it, or every n-th sample"
    )]
    TooLong {
        /// Number of samples of the record.
        samples: usize,
        /// Maximum number of samples that can be fitted.
        most: usize,
    },
    /// A channel is constant.
    #[error(
        "channel {} is constant at {}: a free decay needs channels that move",
        channel.saturating_add(1), message::number(*value)
    )]
    SilentChannel {
        /// Channel, counted from 0.
        channel: usize,
        /// Value of all samples of the channel, in the unit of the record.
        value: f64,
    },
    /// The requested number of modes is zero or too large.
    #[error("{} cannot be fitted: give a number from 1 to {most}", message::count(*modes, "mode"))]
    NumberOfModes {
        /// Modes asked for.
        modes: usize,
        /// Largest number.
        most: usize,
    },
    /// No oscillation was found in a free response.
    #[error(
        "no oscillation exceeds the noise in {}: the best one increases 2 × log likelihood by \
         {gained:.1}, but noise alone can increase it by {needed:.1}. Use the part of the record in which the \
         response decays",
        message::count(*samples, "sample")
    )]
    NoDecay {
        /// Number of samples of the record.
        samples: usize,
        /// Twice the gain in log-likelihood due to the best oscillation, a pure number.
        gained: f64,
        /// Minimum increase of twice the log-likelihood for the acceptance of a mode, a pure
        /// number.
        needed: f64,
    },
    /// A response is excited again, so that it is not one free decay.
    #[error(
        "the response is excited again at about {seconds:.3} s, for example by a second hit: it is not one free \
         decay. Use only the samples before this time (`to`) or after it (`from`)"
    )]
    ExcitedAgain {
        /// Time of the second excitation, in s from the first sample of the record.
        seconds: f64,
        /// Probability that a response without a second excitation has such a large prediction
        /// error, a pure number.
        p_value: f64,
    },
    /// A response returns to rest without oscillation.
    #[error(
        "the response does not oscillate: {} the response better than oscillations",
        describe_decays(rates)
    )]
    NoOscillation {
        /// One or two decay rates, in rising order, each with its standard error, in 1/s.
        rates: Vec<[f64; 2]>,
    },
    /// A free response grows.
    #[error(
        "the response at {frequency_hz:.4} Hz grows, at {growth_rate:.3e} ± {standard_error:.1e} 1/s: the \
         system is unstable, a force still acts, or the record begins before the release"
    )]
    Grows {
        /// Frequency, in Hz.
        frequency_hz: f64,
        /// Rate of the growth, in 1/s.
        growth_rate: f64,
        /// Standard error of the rate, in 1/s.
        standard_error: f64,
    },
    /// No search for the maximum-likelihood fit converged.
    #[error(
        "the search for the best fit failed: {} reached no minimum within {steps} \
         steps. The record may not determine this number of modes: give fewer (`modes`), or use a longer \
         part of the decay",
        if *searches == 1 { "one search".to_owned() } else { format!("{searches} searches") }
    )]
    NotConverged {
        /// Number of searches, each from a different initial estimate.
        searches: usize,
        /// Maximum number of steps of the first search.
        steps: usize,
    },
    /// A record is not usable.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
}

impl FreeDecayError {
    /// Returns the error with its times counted from an instant that is `seconds` (s) before the
    /// first sample of the record.
    #[must_use]
    pub fn from_earlier(self, seconds: f64) -> Self {
        match self {
            Self::ExcitedAgain { seconds: after, p_value } => {
                Self::ExcitedAgain { seconds: seconds + after, p_value }
            }
            other => other,
        }
    }
}

/// Describes decays without oscillation in words.
fn describe_decays(rates: &[[f64; 2]]) -> String {
    let rounded = |value: f64, digits: usize| {
        let rounded = format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
        message::number(rounded).to_string()
    };
    let texts =
        rates.iter().map(|[rate, error]| format!("{} ± {}", rounded(*rate, 4), rounded(*error, 2)));
    let list = message::list(texts, " and ", 2);
    match rates.len() {
        1 => format!("a decay of {list} 1/s describes"),
        _ => format!("decays of {list} 1/s describe"),
    }
}
