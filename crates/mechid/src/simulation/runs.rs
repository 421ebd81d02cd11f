//! The records of many runs of an experiment, in one file.

use std::fmt;
use std::path::Path;

use mechid_io::{BegunFile, ExperimentStudy, ParquetRecordWriter};
use mechid_signal::message;
use serde::Serialize;

use super::{SimulateError, simulate};

/// Name of the column with the number of the run.
const RUN: &str = "run";

/// Summary of the records of a study; `Display` writes the summary as text, `Serialize` writes the
/// same content as data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RunsSummary {
    /// Number of runs.
    pub runs: usize,
    /// Number of samples of all runs together.
    pub samples: usize,
    /// Name of the column that contains the number of the run of each row, counted from 1.
    pub record_column: &'static str,
    /// Channels of each run.
    pub channels: Vec<String>,
    /// Fields of the description that change; each is a column with the value of the field in every
    /// run.
    pub fields: Vec<String>,
}

/// Simulates the runs of a study into one Parquet file, which gets its name in
/// [`write_all`](mechid_io::write_all); `progress` is called after each run with the number of
/// completed runs.
///
/// # Errors
/// As [`simulate`], and [`SimulateError::Io`] for a file that cannot be written.
pub fn simulate_runs(
    study: &ExperimentStudy,
    path: impl AsRef<Path>,
    progress: &mut dyn FnMut(usize),
) -> Result<(BegunFile, RunsSummary), SimulateError> {
    let fields: Vec<String> = study.fields().iter().map(|field| field.name.clone()).collect();
    let mut channels: Vec<String> = Vec::new();
    let mut file: Option<ParquetRecordWriter> = None;
    let mut samples = 0;
    for run in 1..=study.runs() {
        let simulation = simulate(&study.experiment(run)?)?;
        let sampling = simulation.force.sampling();
        let (names, mut columns): (Vec<String>, Vec<&[f64]>) =
            simulation.columns().into_iter().unzip();
        let constants: Vec<Vec<f64>> = study
            .fields()
            .iter()
            .map(|field| vec![field.values[run - 1]; sampling.len()])
            .collect();
        columns.extend(constants.iter().map(Vec::as_slice));
        let file = match &mut file {
            Some(file) => file,
            none => {
                let columns: Vec<&String> = names.iter().chain(&fields).collect();
                none.insert(ParquetRecordWriter::begin(&path, RUN, &columns)?)
            }
        };
        file.append(&run.to_string(), sampling, &columns)?;
        samples += sampling.len();
        channels = names;
        progress(run);
    }
    let file = file.expect("a study needs at least one run").finish()?;
    let runs = study.runs();
    Ok((file, RunsSummary { runs, samples, record_column: RUN, channels, fields }))
}

impl fmt::Display for RunsSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (runs, samples) =
            (message::count(self.runs, "run"), message::count(self.samples, "sample"));
        writeln!(f, "{runs}, {samples} in all")?;
        writeln!(f, "column of the runs: {}", self.record_column)?;
        writeln!(f, "channels: {}", self.channels.join(", "))?;
        write!(f, "changed from run to run: {}", self.fields.join(", "))
    }
}
