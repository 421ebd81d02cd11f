//! Clipped channels.

use std::fmt::{self, Formatter};

use mechid_signal::Record;
use mechid_signal::clipping;
use mechid_signal::message;

use super::digits::six_digits;
use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::{Subject, Verdict};

/// Channel that an amplifier or a converter has clipped.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Clipping {
    /// Clipped channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// Level of the clipping, in the unit of the channel.
    pub level: f64,
    /// Number of samples at the level of the clipping.
    pub samples: usize,
}

/// Finds clipped channels of a record (any unit) by [`clipping`] ([`Finding::Clipping`]).
///
/// # Source
/// As [`clipping`].
pub fn clipped_channels(quantity: Quantity, record: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let clipped = clipping(record.channel(index))?;
        let channel = Channel { quantity, index };
        Some(Finding::Clipping(Clipping {
            channel,
            level: clipped.level,
            samples: clipped.samples,
        }))
    };
    (0..record.channels()).filter_map(one).collect()
}

impl Check for Clipping {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.samples as f64
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is clipped at {}: {} have this value, always three or more in a row; choose a wider \
             range of the amplifier or converter and measure again",
            names.channel(self.channel),
            six_digits(self.level),
            message::count(self.samples, "sample")
        )
    }
}
