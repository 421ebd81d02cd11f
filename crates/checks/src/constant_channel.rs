//! Channels with the same value in all samples.

use std::fmt::{self, Formatter};

use mechid_signal::Record;
use mechid_signal::message;

use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::{Subject, Verdict};

/// Channel with the same value in all samples.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ConstantChannel {
    /// Constant channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// Value of the samples, in the unit of the channel.
    pub level: f64,
    /// Number of samples.
    pub samples: usize,
}

/// Finds the channels of a response (any unit) that have the same value in all samples
/// ([`Finding::ConstantChannel`]): parameters that depend on them are undetermined, or determined
/// only by rounding.
///
/// # Source
/// Ours.
pub fn constant_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let x = response.channel(index);
        let (level, samples) = (*x.first()?, x.len());
        let channel = Channel { quantity, index };
        let constant = x.iter().all(|value| *value == level);
        constant.then_some(Finding::ConstantChannel(ConstantChannel { channel, level, samples }))
    };
    (0..response.channels()).filter_map(one).collect()
}

impl Check for ConstantChannel {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.level
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is {} in all {} samples: no response at this point, or a dead channel; check the sensor",
            names.channel(self.channel),
            message::number(self.level),
            self.samples
        )
    }
}
