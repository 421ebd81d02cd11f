//! `mechid predict`: the response of a known machine to a measured force.

use std::path::PathBuf;

use clap::Args;
use mechid::analysis::{Machine, ModalSystem, predict_with_modes};
use mechid::io::CsvFile;
use mechid::{Predict, predict};

use crate::args::{ChannelArgs, RecordArgs, ReportArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Predict the response of an identified machine, linear or not, to a measured force
///
/// The model may also be the result of `mechid modes --json`: the forces and responses are then
/// those of the modal test, by name or in order, and the prediction is limited to the band of the
/// test.
///
/// With --period the prediction is the steady-state response to the mean period of the force.
/// Otherwise it covers the whole window from its first sample on, from rest or from the initial
/// state that --settle fits. Between the samples the force is band-limited. Response columns are
/// compared with the prediction. The window is held in memory.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify rig.csv --force f --displacement x --period 1024 --nonlinear 'k3: x1^3' --json \\
      > machine.json
  mechid predict machine.json run.csv --force f --displacement x --settle 500 --output run-predicted.csv
  mechid modes frame.csv --force f1,f2 --acceleration a1,a2 --json > modes.json
  mechid predict modes.json run.csv --force f1,f2 --acceleration a1,a2 --output run-predicted.csv")]
pub struct PredictArgs {
    /// The machine: a report of `mechid identify --json`, a description with a system, or a result
    /// of `mechid modes --json`
    #[arg(value_name = "MODEL.json")]
    model: PathBuf,
    #[command(flatten)]
    input: RecordArgs,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Fit the initial state to this number of samples at the beginning of the response; the errors
    /// exclude these samples [default: at rest]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one)]
    settle: Option<usize>,
    /// File for the predicted response: time in s, then every measured kind of response
    /// (displacements if none was measured), in SI units
    #[arg(long, short, value_name = "RESPONSE.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl PredictArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads([&self.model, &self.input.record]).writes(&self.output)
    }

    /// Reads, predicts, and reports.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let modes = ModalSystem::read(&self.model)?;
        let how = Predict { settle: self.settle };
        let predicted = match &modes {
            Some(modes) => {
                let record = self.input.open(&self.channels.channels())?;
                predict_with_modes(&record, modes, &how)?
            }
            None => {
                let machine = Machine::read(&self.model)?;
                let record = self.input.open(&self.channels.channels())?;
                predict(&record, &machine, &how)?
            }
        };
        let outcome = Outcome::new(predicted.to_string(), &predicted)?;
        let Some(path) = &self.output else { return Ok(outcome) };
        let columns = predicted.columns();
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let values: Vec<&[f64]> = columns.iter().map(|(_, values)| *values).collect();
        let mut rows = CsvFile::begin(path, predicted.sampling(), &names)?;
        rows.append(&values)?;
        Ok(outcome.with_begun(rows.finish()?))
    }
}
