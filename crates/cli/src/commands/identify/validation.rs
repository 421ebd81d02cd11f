//! How much of a record that was not fitted the machine found predicts.

use std::path::PathBuf;

use clap::Args;
use mechid::estimate::fit_percent;
use mechid::model::SecondOrderSystem;
use serde::Serialize;

use super::course::Course;
use super::measurement::{ChannelArgs, Measurement};
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
    /// The window to predict, if any was asked for.
    ///
    /// # Errors
    /// [`CliError::ValidationStart`] if only a number of samples was given, and
    /// [`CliError::ValidationPeriod`] if they are less than a period.
    pub fn measure(
        &self,
        input: &RecordArgs,
        channels: &ChannelArgs,
        course: Course,
    ) -> Result<Option<Measurement>, CliError> {
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
        Ok(Some(channels.measure(&window)?))
    }
}

impl Validation {
    /// Holds the prediction against the record.
    pub fn of(
        measured: &Measurement,
        system: &SecondOrderSystem,
        course: Course,
    ) -> Result<Self, CliError> {
        let mut channels = Vec::new();
        for compared in course.predict(system, measured)? {
            let fits = fit_percent(&compared.measured, &compared.predicted)?;
            for (at, fit_percent) in fits.into_iter().enumerate() {
                let quantity = compared.kind.to_string();
                channels.push(Share { quantity, degree_of_freedom: at + 1, fit_percent });
            }
        }
        Ok(Self {
            file: measured.file.clone(),
            first_sample: measured.first_sample,
            last_sample: measured.first_sample + measured.force.len() - 1,
            channels,
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
