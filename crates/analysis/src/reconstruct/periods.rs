//! Comparison of the periods of a window.

use mechid_force::Unexplained;

use super::motion::{Held, Recorded};
use crate::text::significant;

/// Maximum scatter of the periods about their mean, divided by the RMS of the mean period; above
/// it, the periods count as different.
const MAX_SCATTER: f64 = 0.1;

/// Minimum correlation between successive samples that indicates a response rather than noise:
/// white noise does not reach it, the response of a machine with at least five samples per period
/// does.
const NOT_WHITE: f64 = 0.3;

/// Returns a remark on the channel whose periods differ most from their mean; `None` if the
/// differences are small or white noise.
pub fn remark(recorded: &Recorded, held: &Held) -> Option<String> {
    let record = held.motion.record();
    let samples = record.len();
    let size = |channel: usize| record.column(channel).norm() / (samples as f64).sqrt();
    let scatter = held.scatter.iter().flatten().enumerate();
    let correlated = scatter.filter(|(_, scatter)| scatter.correlation.abs() > NOT_WHITE);
    let shares = correlated.map(|(channel, scatter)| (channel, scatter.deviation / size(channel)));
    let far = shares.filter(|(_, share)| *share > MAX_SCATTER);
    let (channel, share) = far.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(format!(
        "the periods of {samples} samples differ from their mean by {} % of its RMS ({}), and the \
         differences are not white noise: the motion has another period, or is not steady",
        significant(100.0 * share, 2),
        recorded.columns()[channel],
    ))
}

/// Uses the scatter of the periods as the noise of every channel without a known level: the scatter
/// determines the expected residual of the mean of the periods.
pub fn add_scatter(unexplained: Option<&mut Vec<Unexplained>>, recorded: &Recorded, held: &Held) {
    let (Some(channels), Some(scatter)) = (unexplained, &held.scatter) else { return };
    for (channel, scatter) in channels.iter_mut().zip(scatter) {
        let level = scatter.deviation / (recorded.periods as f64).sqrt();
        channel.noise = channel.noise.or(Some(level));
    }
}
