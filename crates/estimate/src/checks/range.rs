//! Channels that are clipped or constant.

use mechid_signal::{Record, clipping};

use super::finding::{Channel, Finding, Quantity};

/// Finds the channels of a record (any unit) that were cut off by an amplifier or a converter, by
/// [`clipping`] ([`Finding::Clipping`]).
///
/// # Source
/// That of [`clipping`].
pub fn clipped_channels(quantity: Quantity, record: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let found = clipping(record.channel(index))?;
        let channel = Channel { quantity, index };
        Some(Finding::Clipping { channel, level: found.level, samples: found.samples })
    };
    (0..record.channels()).filter_map(one).collect()
}

/// Finds the channels of a response (any unit) that have the same value in all samples
/// ([`Finding::ConstantChannel`]): what depends on them is not determined, or by rounding only.
///
/// # Source
/// Ours.
pub fn constant_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let x = response.channel(index);
        let (level, samples) = (*x.first()?, x.len());
        let channel = Channel { quantity, index };
        let constant = x.iter().all(|value| *value == level);
        constant.then_some(Finding::ConstantChannel { channel, level, samples })
    };
    (0..response.channels()).filter_map(one).collect()
}
