//! Channels that are recorded twice.

use std::fmt::{self, Formatter};

use mechid_signal::Record;

use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::{Subject, Verdict};

/// Channel that has the value of another channel in every sample.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct RepeatedChannel {
    /// The second of the two channels.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// The first of the two channels.
    pub original: Channel,
    /// Number of samples.
    pub samples: usize,
}

/// Finds the channels (any unit) that have the value of an earlier channel in every sample
/// ([`Finding::RepeatedChannel`]): two sensors never have the same noise. Constant channels are not
/// compared, nor forces with each other: one measured force may act at two points.
///
/// # Source
/// Ours.
pub fn repeated_channels(records: &[(Quantity, &Record)]) -> Vec<Finding> {
    let channels = records.iter().flat_map(|(quantity, record)| {
        let of_record = |index| (Channel { quantity: *quantity, index }, record.channel(index));
        (0..record.channels()).map(of_record)
    });
    let moves = |x: &[f64]| x.iter().any(|value| *value != x[0]);
    let channels: Vec<(Channel, &[f64])> = channels.filter(|(_, x)| moves(x)).collect();
    let repeated = |(at, (channel, x)): (usize, &(Channel, &[f64]))| {
        let is_force = |channel: &Channel| channel.quantity == Quantity::Force;
        let mut earlier = channels[..at].iter();
        let is_copied =
            |(other, y): &&(Channel, &[f64])| y == x && !(is_force(other) && is_force(channel));
        let original = earlier.find(is_copied)?.0;
        let (channel, samples) = (*channel, x.len());
        Some(Finding::RepeatedChannel(RepeatedChannel { channel, original, samples }))
    };
    channels.iter().enumerate().filter_map(repeated).collect()
}

impl Check for RepeatedChannel {
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
            "{} and {} are equal in all {} samples: one of them is a copy, or the record is simulated \
             without noise; leave one of them out",
            names.channel(self.original),
            names.channel(self.channel),
            self.samples
        )
    }
}
