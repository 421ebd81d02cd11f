//! Whether a channel was cut off at the end of its range, or is dead.

use mechid_signal::{Record, clipping, told};

use super::{Check, Subject, Verdict, six_digits};

/// Every channel of a record (any unit; called `name` and its number) that was cut off by an amplifier
/// or a converter, found by [`clipping`]. The value is the number of samples cut off.
///
/// # Source
/// That of [`clipping`].
pub fn range(name: &str, record: &Record) -> Vec<Check> {
    let of = |channel: usize| {
        let cut = clipping(record.channel(channel))?;
        let text = format!(
            "{name} {} is cut off at {}: {} samples stand there, three or more in a row; choose \
             a wider range of the amplifier or converter, and measure again",
            channel + 1,
            six_digits(cut.level),
            cut.samples,
        );
        let value = cut.samples as f64;
        Some(Check { subject: Subject::Range, verdict: Verdict::Bad, value, text })
    };
    (0..record.channels()).filter_map(of).collect()
}

/// Every channel of a motion (any unit; called `name` and its number) that is the same in all samples:
/// what depends on it is not determined, or by rounding only. The value is that of the channel.
///
/// # Source
/// Ours.
pub fn still(name: &str, motion: &Record) -> Vec<Check> {
    let of = |channel: usize| {
        let (x, number) = (motion.channel(channel), channel + 1);
        let (first, count) = (*x.first()?, x.len());
        let text = format!(
            "{name} {number} is {} in all of {count} samples: nothing moves there, or the channel is \
             dead",
            told(first)
        );
        let (subject, verdict) = (Subject::Range, Verdict::Bad);
        let still = x.iter().all(|value| *value == first);
        still.then_some(Check { subject, verdict, value: first, text })
    };
    (0..motion.channels()).filter_map(of).collect()
}
