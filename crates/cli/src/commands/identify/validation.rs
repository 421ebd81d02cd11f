//! How much of a record that was not fitted the machine found predicts.

use mechid::signal::Extent;
use std::path::PathBuf;

use clap::Args;
use mechid::estimate::{StartFit, fit_percent, predict};
use mechid::model::{Discretisation, InitialState, ResponseQuantity, SecondOrderSystem};
use serde::Serialize;

use super::course::{Course, channels, failed};
use super::measurement::{ChannelArgs, Hold, Recorded, STRETCH};
use crate::error::CliError;
use crate::options::{RecordArgs, at_least_one};
use crate::text_table::{significant, text_table};

/// Which record to predict.
#[derive(Debug, Args)]
#[command(next_help_heading = "Validation")]
pub struct ValidationArgs {
    /// A record that is not fitted, with the same columns: tell how much of its motion the machine
    /// found predicts, in per cent
    #[arg(long, value_name = "RECORD")]
    validate: Option<PathBuf>,
    /// First sample to predict, counted from 1; without --validate, of the record itself
    /// [default: 1]
    #[arg(long, value_name = "SAMPLE", value_parser = at_least_one)]
    validate_start: Option<usize>,
    /// Samples to predict [default: all from --validate-start on]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one)]
    validate_samples: Option<usize>,
}

/// A record predicted.
#[derive(Debug, Serialize)]
pub struct Validation {
    pub file: String,
    /// Counted from 1.
    pub first_sample: usize,
    pub last_sample: usize,
    pub channels: Vec<Share>,
}

/// How much of one channel is predicted.
#[derive(Debug, Serialize)]
pub struct Share {
    pub quantity: String,
    /// Degree of freedom, counted from 1.
    pub degree_of_freedom: usize,
    /// 100 (1 − ‖measured − predicted‖ / ‖measured − mean‖): 100 is perfect, 0 no better than the
    /// mean, negative worse.
    pub fit_percent: f64,
}

impl ValidationArgs {
    /// The window to predict, if any was asked for. An open record is predicted in stretches, and
    /// held as far as is said; others are held whole.
    ///
    /// # Errors
    /// [`CliError::ValidationStart`] if only a number of samples was given, and
    /// [`CliError::ValidationPeriod`] if they are less than a period.
    pub fn record(
        &self,
        input: &RecordArgs,
        channels: &ChannelArgs,
        course: Course,
        hold: Hold,
    ) -> Result<Option<Recorded>, CliError> {
        let record = match (&self.validate, self.validate_start, self.validate_samples) {
            (None, None, None) => return Ok(None),
            (None, None, Some(samples)) => return Err(CliError::ValidationStart { samples }),
            (file, _, _) => file.as_ref().unwrap_or(&input.record).clone(),
        };
        let period = input.period.filter(|_| course == Course::Steady);
        let (period, periods) = match (period, self.validate_samples) {
            (Some(period), Some(samples)) if samples < period => {
                return Err(CliError::ValidationPeriod { samples, period });
            }
            (Some(period), samples) => (Some(period), samples.map(|samples| samples / period)),
            (None, samples) => (samples, Some(1)),
        };
        let start = self.validate_start.unwrap_or(1);
        let window = RecordArgs { record, start, period, periods, ..input.clone() };
        let hold = match (hold, course) {
            (Hold::Whole, _) => Hold::Whole,
            (_, Course::Sampled { extent: Extent::Open, .. }) => Hold::Samples(0),
            _ => Hold::Whole,
        };
        Ok(Some(channels.record(&window, hold)?))
    }
}

impl Validation {
    /// Holds the prediction against the record.
    pub fn of(
        recorded: &Recorded,
        system: &SecondOrderSystem,
        course: Course,
    ) -> Result<Self, CliError> {
        let measured = &recorded.held;
        let mut shares = Vec::new();
        let mut add = |kind: ResponseQuantity, fits: Vec<f64>| {
            for (at, fit_percent) in fits.into_iter().enumerate() {
                let quantity = kind.to_string();
                shares.push(Share { quantity, degree_of_freedom: at + 1, fit_percent });
            }
        };
        match course {
            Course::Sampled { discretisation, extent: Extent::Open } => {
                let found = in_stretches(recorded, system, discretisation)?;
                found.into_iter().for_each(|(kind, fits)| add(kind, fits));
            }
            _ => {
                for compared in course.predict(system, measured)? {
                    add(compared.kind, fit_percent(&compared.measured, &compared.predicted)?);
                }
            }
        }
        Ok(Self {
            file: measured.file.clone(),
            first_sample: measured.first_sample,
            last_sample: measured.last_sample(),
            channels: shares,
        })
    }

    /// As a person reads it.
    pub fn text(&self) -> String {
        let (first, last) = (self.first_sample, self.last_sample);
        let several = self.channels.iter().any(|share| share.degree_of_freedom > 1);
        let mut rows = vec![vec![
            format!("predicted of {}, samples {first} to {last}", self.file),
            "fit".into(),
        ]];
        for share in &self.channels {
            let number =
                if several { format!(" {}", share.degree_of_freedom) } else { String::new() };
            let fit = format!("{} %", significant(share.fit_percent, 4));
            rows.push(vec![format!("{}{number}", share.quantity), fit]);
        }
        text_table(&rows)
    }
}

/// How much of each motion of an open record is predicted, in per cent: one pass finds where it
/// started, another follows it from there.
fn in_stretches(
    recorded: &Recorded,
    system: &SecondOrderSystem,
    discretisation: Discretisation,
) -> Result<Vec<(ResponseQuantity, Vec<f64>)>, CliError> {
    let held = &recorded.held;
    let told = |reason| failed(reason, system, held);
    let mut start = StartFit::new(system, discretisation)?;
    recorded.stretches(STRETCH + 1, STRETCH, &mut |stretch| {
        start.push(&stretch.force, &stretch.motions()).map_err(told)
    })?;
    let mut state = start.start().map_err(told)?;
    let motions = held.motions();
    let mut levels: Vec<_> =
        motions.iter().map(|(kind, _)| (*kind, vec![Level::default(); system.dof()])).collect();
    recorded.stretches(STRETCH + 1, STRETCH, &mut |stretch| {
        let response = predict(system, &stretch.force, discretisation, Extent::Open, &state);
        let response = response.map_err(told)?;
        // The next stretch begins with the last sample of this one.
        let seen = usize::from(stretch.first_sample > held.first_sample);
        for ((kind, levels), (_, measured)) in levels.iter_mut().zip(stretch.motions()) {
            for (c, level) in levels.iter_mut().enumerate() {
                let predicted = channels(&response, *kind).channel(c);
                level.add(&measured.channel(c)[seen..], &predicted[seen..]);
            }
        }
        let row = |kind| channels(&response, kind).data().row(stretch.force.len() - 1).transpose();
        state = InitialState::new(
            row(ResponseQuantity::Displacement),
            row(ResponseQuantity::Velocity),
        )?;
        Ok(())
    })?;
    let fits = |levels: Vec<Level>| levels.iter().map(Level::fit_percent).collect();
    Ok(levels.into_iter().map(|(kind, levels)| (kind, fits(levels))).collect())
}

/// A channel measured, and what a prediction leaves of it.
#[derive(Debug, Clone, Default)]
struct Level {
    count: f64,
    mean: f64,
    /// Sum of the squares about the mean.
    squares: f64,
    /// Sum of the squares of what is left.
    left: f64,
}

impl Level {
    /// # Source
    /// Chan, Golub & LeVeque (1983), The American Statistician 37, 242–247: sums of squares about
    /// the mean, put together from parts.
    fn add(&mut self, measured: &[f64], predicted: &[f64]) {
        let count = measured.len() as f64;
        if measured.is_empty() {
            return;
        }
        let mean = measured.iter().sum::<f64>() / count;
        let squares: f64 = measured.iter().map(|x| (x - mean).powi(2)).sum();
        let apart = mean - self.mean;
        let all = self.count + count;
        self.squares += squares + apart * apart * self.count * count / all;
        self.mean += apart * count / all;
        self.count = all;
        self.left += measured.iter().zip(predicted).map(|(x, p)| (x - p).powi(2)).sum::<f64>();
    }

    fn fit_percent(&self) -> f64 {
        100.0 * (1.0 - self.left.sqrt() / self.squares.sqrt())
    }
}
