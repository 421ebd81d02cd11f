//! What is in the channels that were used.

use mechid::signal::{Record, measures};

use crate::commands::identify::measurement::{ChannelArgs, Measurement};
use crate::error::CliError;

/// One column of the record, over the window.
pub struct Channel {
    /// As the user called the column.
    pub column: String,
    pub quantity: &'static str,
    /// Counted from 1; nothing where there is one only.
    pub dof: Option<usize>,
    pub unit: &'static str,
    pub mean: f64,
    pub rms: f64,
    pub peak: f64,
    /// Nothing for a channel of zeros.
    pub crest_factor: Option<f64>,
    /// RMS of what differs from period to period over RMS of what repeats, both without their mean;
    /// nothing for one period.
    pub scatter: Option<f64>,
}

/// What is below this share of the level is what rounding leaves of zero.
const ROUNDING: f64 = 1e-12;

/// The columns in the order force, displacement, velocity, acceleration.
pub fn channels(measured: &Measurement, names: &ChannelArgs) -> Result<Vec<Channel>, CliError> {
    let groups = [
        ("force", "N", Some(&measured.force), &names.force),
        ("displacement", "m", measured.displacement.as_ref(), &names.displacement),
        ("velocity", "m/s", measured.velocity.as_ref(), &names.velocity),
        ("acceleration", "m/s²", measured.acceleration.as_ref(), &names.acceleration),
    ];
    let mut found = Vec::new();
    for (quantity, unit, record, columns) in groups {
        let Some(record) = record else { continue };
        let scatter = scatter(record, measured.period, measured.periods)?;
        for (at, column) in columns.iter().enumerate() {
            let values = record.channel(at);
            let (mean, peak) = (record.column(at).mean(), measures::peak(values));
            found.push(Channel {
                column: column.clone(),
                quantity,
                dof: (columns.len() > 1).then_some(at + 1),
                unit,
                mean: if mean.abs() > ROUNDING * peak { mean } else { 0.0 },
                rms: measures::rms(values),
                peak,
                crest_factor: measures::crest_factor(record, at).ok(),
                scatter: scatter[at],
            });
        }
    }
    Ok(found)
}

/// How much of each channel does not repeat.
fn scatter(record: &Record, period: usize, periods: usize) -> Result<Vec<Option<f64>>, CliError> {
    if periods < 2 {
        return Ok(vec![None; record.channels()]);
    }
    let mean = record.period_mean(period)?;
    let repeated = mean.repeated(periods)?;
    let varying = mean.without_mean();
    let of = |at: usize| {
        let apart: Vec<f64> =
            record.channel(at).iter().zip(repeated.channel(at)).map(|(x, m)| x - m).collect();
        let level = measures::rms(varying.channel(at));
        let share = measures::rms(&apart) / level;
        (level > 0.0).then_some(if share > ROUNDING { share } else { 0.0 })
    };
    Ok((0..record.channels()).map(of).collect())
}
