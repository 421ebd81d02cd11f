//! Channels with few equally spaced values.

use std::fmt::{self, Formatter};

use mechid_signal::Record;

use super::digits::six_digits;
use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::limits::{LEVEL_ROUNDING, QUANTISATION_LEVELS, REPEATED_SAMPLES, SAMPLES_PER_LEVEL};
use super::{Subject, Verdict};

/// Channel with only a few equally spaced values.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Quantisation {
    /// Affected channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// Number of distinct values.
    pub levels: usize,
    /// Step between neighbouring values, in the unit of the channel.
    pub step: f64,
}

/// Finds the channels of a response (any unit) with only a few equally spaced values
/// ([`Finding::Quantisation`]): a converter whose range is far too wide, or with too few bits.
///
/// # Source
/// Ours.
pub fn quantised_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let (levels, step) = quantisation(response.channel(index))?;
        let channel = Channel { quantity, index };
        Some(Finding::Quantisation(Quantisation { channel, levels, step }))
    };
    (0..response.channels()).filter_map(one).collect()
}

/// Returns the number of levels of a coarsely quantised channel, and the step between them.
fn quantisation(x: &[f64]) -> Option<(usize, f64)> {
    let mut levels: Vec<f64> = Vec::new();
    for value in x {
        // Adding zero removes the sign of −0.
        let value = value + 0.0;
        if let Err(at) = levels.binary_search_by(|level| level.total_cmp(&value)) {
            if levels.len() == QUANTISATION_LEVELS {
                return None;
            }
            levels.insert(at, value);
        }
    }
    let steps = || levels.windows(2).map(|pair| pair[1] - pair[0]);
    let step = steps().fold(f64::INFINITY, f64::min);
    let multiple =
        |gap: f64| (gap / step - (gap / step).round()).abs() <= LEVEL_ROUNDING * gap / step;
    let repeated = x.windows(2).filter(|pair| pair[0] == pair[1]).count();
    // A channel that is at rest before it moves, or that has a short period, violates at least one
    // of the conditions below.
    let coarse = levels.len() > 2
        && x.len() >= SAMPLES_PER_LEVEL * levels.len()
        && repeated as f64 >= REPEATED_SAMPLES * x.len() as f64
        && steps().all(multiple);
    coarse.then_some((levels.len(), step))
}

impl Check for Quantisation {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.levels as f64
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} has only {} different values, in steps of {}: the range of the converter is far too wide, or the \
             converter has too few bits; choose a narrower range and measure again",
            names.channel(self.channel),
            self.levels,
            six_digits(self.step)
        )
    }
}
