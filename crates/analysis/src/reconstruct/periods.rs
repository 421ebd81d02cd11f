//! Comparison of the periods of a window.

use mechid_force::Unexplained;

use super::motion::{Held, Recorded};
use crate::text::significant;

/// Periods that differ less than this share of their mean count as alike.
const ALIKE: f64 = 0.1;

/// Correlation from one sample to the next that white noise does not reach, and the response of a
/// machine that is sampled five times a period or more is.
const NOT_WHITE: f64 = 0.3;

/// Returns a remark on the channel whose periods differ most from their mean, if they do.
pub fn remark(recorded: &Recorded, held: &Held) -> Option<String> {
    let record = held.motion.record();
    let samples = record.len();
    let size = |channel: usize| record.column(channel).norm() / (samples as f64).sqrt();
    let scatter = held.scatter.iter().flatten().enumerate();
    let other = scatter.filter(|(_, scatter)| scatter.correlation.abs() > NOT_WHITE);
    let shares = other.map(|(channel, scatter)| (channel, scatter.deviation / size(channel)));
    let far = shares.filter(|(_, share)| *share > ALIKE);
    let (channel, share) = far.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(format!(
        "the periods of {samples} samples differ from their mean by {} % of it ({}), and not as \
         white noise does: the motion has another period, or is not steady",
        significant(100.0 * share, 2),
        recorded.columns()[channel],
    ))
}

/// Adds the scatter of the periods as noise that no force and no machine explains: where none is
/// stated, it says what the mean of the periods may leave.
pub fn tell_noise(unexplained: Option<&mut Vec<Unexplained>>, recorded: &Recorded, held: &Held) {
    let (Some(channels), Some(scatter)) = (unexplained, &held.scatter) else { return };
    for (channel, scatter) in channels.iter_mut().zip(scatter) {
        let level = scatter.deviation / (recorded.periods as f64).sqrt();
        channel.noise = channel.noise.or(Some(level));
    }
}
