//! Channels with one sample far outside its neighbours.

use std::fmt::{self, Formatter};

use mechid_signal::Record;

use super::digits::six_digits;
use super::finding::{Channel, Check, Finding, Names, Quantity};
use super::limits::{RETURN, SPIKE};
use super::{Subject, Verdict};

/// Channel with one sample far outside its neighbours.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Spike {
    /// Affected channel.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub channel: Channel,
    /// Sample of the spike, counted from 0 in the window.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub sample: usize,
    /// Ratio of the second difference at the spike to the largest second difference at other
    /// samples (pure number).
    pub ratio: f64,
}

/// Finds the channels of a response (any unit) with one sample far outside its neighbours
/// ([`Finding::Spike`]), if no force (N) has a spike at this sample: an error of the transmission,
/// not a motion.
///
/// # Source
/// Ours: the largest second difference compared with the next one that another sample causes.
pub fn spiked_channels(quantity: Quantity, response: &Record, force: &Record) -> Vec<Finding> {
    let blows: Vec<usize> = (0..force.channels())
        .filter_map(|index| spike(force.channel(index)).map(|(sample, _)| sample))
        .collect();
    let one = |index: usize| {
        let (sample, ratio) = spike(response.channel(index)).filter(|s| !blows.contains(&s.0))?;
        let channel = Channel { quantity, index };
        Some(Finding::Spike(Spike { channel, sample, ratio }))
    };
    (0..response.channels()).filter_map(one).collect()
}

/// Returns the sample of a spike, and the ratio of its second difference to the largest second
/// difference at other samples.
fn spike(x: &[f64]) -> Option<(usize, f64)> {
    let bend: Vec<f64> = x.windows(3).map(|x| (x[1] - 0.5 * (x[0] + x[2])).abs()).collect();
    let largest = (0..bend.len()).max_by(|a, b| bend[*a].total_cmp(&bend[*b]))?;
    let remaining = (0..bend.len()).filter(|at| at.abs_diff(largest) > 1).map(|at| bend[at]);
    let next = remaining.fold(0.0, f64::max);
    // A jump, for example of an acceleration under an impact, is not reversed at the next sample.
    let returns = (x[largest + 2] - x[largest]).abs() < RETURN * bend[largest];
    let is_spike = next > 0.0 && bend[largest] > SPIKE * next && returns;
    is_spike.then(|| (largest + 1, bend[largest] / next))
}

impl Check for Spike {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.ratio
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "sample {} of {} is a spike, {} times as sharp as any other: an error of the transmission; leave this \
             sample out of the window",
            self.sample + 1,
            names.channel(self.channel),
            six_digits(self.ratio)
        )
    }
}
