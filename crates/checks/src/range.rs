//! Channels that are clipped, constant, coarsely quantised, or hold a spike.

use mechid_signal::{Record, clipping};

use super::finding::{Channel, Finding, Quantity};
use super::thresholds::{QUANTISATION_LEVELS, SPIKE};

/// Fraction of samples that a coarsely quantised channel leaves at the level of the one before.
const REPEATED_SAMPLES: f64 = 0.2;

/// Minimum number of samples per level of a quantised channel.
const SAMPLES_PER_LEVEL: usize = 16;

/// Difference of the neighbours of a spike, over the spike.
const RETURN: f64 = 0.1;

/// Deviation of a level from a multiple of the step, over the step, that is rounding.
const LEVEL_ROUNDING: f64 = 1e-6;

/// Finds the channels of a record (any unit) that were cut off by an amplifier or a converter, by
/// [`clipping`] ([`Finding::Clipping`]).
///
/// # Source
/// That of [`clipping`].
pub fn clipped_channels(quantity: Quantity, record: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let clipped = clipping(record.channel(index))?;
        let channel = Channel { quantity, index };
        Some(Finding::Clipping { channel, level: clipped.level, samples: clipped.samples })
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

/// Finds the channels of a response (any unit) with a few equally spaced values only
/// ([`Finding::Quantisation`]): a converter whose range is far too wide, or with too few bits.
///
/// # Source
/// Ours.
pub fn quantised_channels(quantity: Quantity, response: &Record) -> Vec<Finding> {
    let one = |index: usize| {
        let (levels, step) = quantisation(response.channel(index))?;
        let channel = Channel { quantity, index };
        Some(Finding::Quantisation { channel, levels, step })
    };
    (0..response.channels()).filter_map(one).collect()
}

/// Number of levels of a coarsely quantised channel, and the step between them.
fn quantisation(x: &[f64]) -> Option<(usize, f64)> {
    let mut levels: Vec<f64> = Vec::new();
    for value in x {
        // Zero has one sign.
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
    // Of a channel at rest before it moves, or of a short period, this is not true.
    let coarse = levels.len() > 2
        && x.len() >= SAMPLES_PER_LEVEL * levels.len()
        && repeated as f64 >= REPEATED_SAMPLES * x.len() as f64
        && steps().all(multiple);
    coarse.then_some((levels.len(), step))
}

/// Finds the channels of a response (any unit) with one sample far outside its neighbours
/// ([`Finding::Spike`]) where no force (N) has one: an error of the transmission, not a motion.
///
/// # Source
/// Ours: the largest second difference against the next that the same sample does not cause.
pub fn spiked_channels(quantity: Quantity, response: &Record, force: &Record) -> Vec<Finding> {
    let blows: Vec<usize> = (0..force.channels())
        .filter_map(|index| spike(force.channel(index)).map(|(sample, _)| sample))
        .collect();
    let one = |index: usize| {
        let (sample, ratio) = spike(response.channel(index)).filter(|s| !blows.contains(&s.0))?;
        let channel = Channel { quantity, index };
        Some(Finding::Spike { channel, sample, ratio })
    };
    (0..response.channels()).filter_map(one).collect()
}

/// Sample of a spike, and its second difference over the largest of the others.
fn spike(x: &[f64]) -> Option<(usize, f64)> {
    let bend: Vec<f64> = x.windows(3).map(|x| (x[1] - 0.5 * (x[0] + x[2])).abs()).collect();
    let largest = (0..bend.len()).max_by(|a, b| bend[*a].total_cmp(&bend[*b]))?;
    let others = (0..bend.len()).filter(|at| at.abs_diff(largest) > 1).map(|at| bend[at]);
    let next = others.fold(0.0, f64::max);
    // After a jump, as of an acceleration under a blow, the channel does not return at once.
    let returns = (x[largest + 2] - x[largest]).abs() < RETURN * bend[largest];
    let is_spike = next > 0.0 && bend[largest] > SPIKE * next && returns;
    is_spike.then(|| (largest + 1, bend[largest] / next))
}
