//! Levels of the columns that were used.

use mechid_signal::measures;

use super::whole::{Gathered, Whole};
use crate::measurement::{Block, Channels};

/// One column of the record, over the window.
pub struct Channel {
    /// Name of the column, as the user gave it.
    pub column: String,
    /// Quantity that was measured.
    pub quantity: &'static str,
    /// Degree of freedom, counted from 1; `None` if there is only one.
    pub dof: Option<usize>,
    /// SI unit.
    pub unit: &'static str,
    /// Mean, in the unit of the channel.
    pub mean: f64,
    /// RMS value, in the unit of the channel.
    pub rms: f64,
    /// Largest magnitude, in the unit of the channel.
    pub peak: f64,
    /// Peak over RMS, a ratio; `None` for a channel of zeros.
    pub crest_factor: Option<f64>,
    /// RMS of the part that differs from period to period over the RMS of the part that repeats,
    /// both without their mean; a ratio, `None` for one period.
    pub scatter: Option<f64>,
}

/// Minimum ratio of a mean to the peak, or of the scatter of the periods to the RMS of the mean
/// period; a smaller ratio is rounding.
const ROUNDING: f64 = 1e-12;

/// Returns the columns in the order force, displacement, velocity, acceleration.
pub fn channels(held: &Block, whole: &Whole, names: &Channels) -> Vec<Channel> {
    let period = whole.period(held);
    let force = ("force", "N", &period.force, &whole.force, &names.force);
    let motions = [
        ("displacement", "m", &period.displacement, &names.displacement),
        ("velocity", "m/s", &period.velocity, &names.velocity),
        ("acceleration", "m/s²", &period.acceleration, &names.acceleration),
    ];
    let measured = motions.into_iter().filter_map(|(quantity, unit, record, columns)| {
        record.as_ref().map(|record| (quantity, unit, record, columns))
    });
    let motions = measured
        .zip(&whole.motions)
        .map(|((quantity, unit, record, columns), all)| (quantity, unit, record, all, columns));
    let mut channels = Vec::new();
    for (quantity, unit, period, all, columns) in std::iter::once(force).chain(motions) {
        let varying = period.without_mean();
        for (at, column) in columns.iter().enumerate() {
            let levels = &all.levels[at];
            let (mean, rms, peak) = (levels.mean(), levels.rms(), levels.peak());
            channels.push(Channel {
                column: column.clone(),
                quantity,
                dof: (columns.len() > 1).then_some(at + 1),
                unit,
                mean: if mean.abs() > ROUNDING * peak { mean } else { 0.0 },
                rms,
                peak,
                crest_factor: levels.crest_factor(),
                scatter: scatter(all, at, measures::rms(varying.channel(at))),
            });
        }
    }
    channels
}

/// Returns the RMS of the part of a channel that differs from period to period, relative to
/// `level`, the RMS of the mean period.
fn scatter(all: &Gathered, channel: usize, level: f64) -> Option<f64> {
    let share = all.scatter(channel)? / level;
    (level > 0.0).then_some(if share > ROUNDING { share } else { 0.0 })
}
