//! `mechid force`: the force that drove a known machine.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use mechid::analysis::identify::Band;
use mechid::analysis::reconstruct::{
    ForceChunk, Method, ParameterRule, reconstruct_in_chunks, reconstruct_with,
    reconstruct_with_modes,
};
use mechid::analysis::{AnalysisError, Machine, ModalSystem};
use mechid::io::{BegunFile, CsvFile, LineSpec};
use mechid::report::{FigureStyle, spectrum_csv};
use mechid::{Reconstruct, Reconstructed};

use crate::args::word::{one_of, word};
use crate::args::{FigureArgs, RecordArgs, ReportArgs, ResponseArgs, TimeLimitArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Find the force that drove a known machine from its measured motion
///
/// The window is one or more whole periods if --period or --lines is given (they are averaged), an
/// open record otherwise. The uncertainty of a machine from `mechid identify --json` is included in
/// the standard error of the force. A machine with nonlinear terms needs displacement, velocity and
/// acceleration of every degree of freedom.
///
/// The system may also be the result of `mechid modes --json`. Forces and responses are then those
/// of the modal test, by name or in order, and --forced gives the numbers of its forces. The force
/// is found line by line in the band of the test; the record must contain whole periods, or begin
/// and end at rest (detected, or stated with --at-rest).
///
/// A long text is read in chunks. The methods continuous and discretised do not keep an open record
/// in memory; every other method, --spectrum and --plot keep the columns used. For whole periods
/// only their mean is kept.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify record.csv --force force --displacement displacement --json > machine.json
  mechid force run.csv --system machine.json --displacement displacement --output force.csv
  mechid force run.csv --system rotor.json --displacement x,0 --forced 2 --period 256 \\
      --lines 1:40 --output force.csv --spectrum lines.csv --plot force.svg
  mechid modes plate.csv --force hammer --acceleration a1,a2,a3 --json > modes.json
  mechid force impact.csv --system modes.json --acceleration a1,a2,a3 --at-rest --output force.csv")]
pub struct ForceArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// The machine: a report of `mechid identify --json`, a description with a system, or a result
    /// of `mechid modes --json`
    #[arg(long, value_name = "IDENTIFIED.json")]
    system: PathBuf,
    #[command(flatten)]
    responses: ResponseArgs,
    /// Degrees of freedom on which a force acts, counted from 1 [default: all]
    #[arg(long, value_name = "DOF,…", value_delimiter = ',', value_parser = at_least_one)]
    forced: Vec<usize>,
    /// Method: auto (the one that suits the record); continuous (equation of motion at the samples;
    /// needs displacement, velocity and acceleration of every degree of freedom); discretised
    /// (state transition from sample to sample, with a force that is linear between them; needs
    /// displacement and velocity); frequency-domain (dynamic stiffness; needs whole periods);
    /// shrinkage (posterior mean), tikhonov or truncated-svd (whole periods, or a short record);
    /// kalman (filter and smoother; an open record of any length)
    #[arg(long, value_name = "METHOD", value_parser = word::<Method>(), default_value = "auto")]
    method: Method,
    /// Spectral lines with force: all, odd, even, or numbers and ranges first:step:last
    #[arg(long, value_name = "LINES")]
    lines: Option<LineSpec>,
    /// Estimate the force and its standard error only between two frequencies, in Hz [default: all;
    /// without a displacement the frequencies at which the responses show a force]
    #[arg(long, value_name = "LOW:HIGH", conflicts_with = "lines")]
    band_hz: Option<Band>,
    /// Assume that an open record begins at rest (with the modes of a test, begins and ends at
    /// rest) [default: detected]
    #[arg(long)]
    at_rest: bool,
    /// Standard deviation of the noise in each measured column, in its unit, before periods are
    /// averaged [default: estimated]
    #[arg(long, value_name = "LEVEL,…", value_delimiter = ',', allow_negative_numbers = true)]
    noise: Vec<f64>,
    /// Rule that chooses the regularisation parameter: likelihood (force nearest to its posterior
    /// mean), gcv (generalised cross-validation) or l-curve (corner of the L-curve)
    #[arg(long, value_name = "RULE", value_parser = one_of::<ParameterRule>(&["likelihood", "gcv", "l-curve"]),
          default_value = "likelihood")]
    rule: ParameterRule,
    /// The regularisation parameter, instead of a rule
    #[arg(long, value_name = "LAMBDA", allow_negative_numbers = true, conflicts_with = "rule")]
    parameter: Option<f64>,
    /// File for the force: time, force and standard error, in s and N
    #[arg(long, short, value_name = "FORCE.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    /// File for the spectrum of the force, on the lines of --lines or on all: frequency in Hz,
    /// amplitude in N, phase in degrees
    #[arg(long, value_name = "SPECTRUM.csv", help_heading = "Output")]
    spectrum: Option<PathBuf>,
    #[command(flatten)]
    page: FigureArgs,
    #[command(flatten)]
    pub limit: TimeLimitArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl ForceArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let outputs = [&self.output, &self.spectrum].into_iter().flatten();
        let files = Files::default().reads([&self.input.record, &self.system]);
        self.page.add_files(files.writes(outputs))
    }

    /// Reads, reconstructs, and reports.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let modes = ModalSystem::read(&self.system)?;
        let how = self.settings();
        let mut rows = ForceRows { path: self.output.as_deref(), rows: None };
        let mut take = |chunk: &ForceChunk<'_>| rows.append(chunk);
        if let Some(modes) = &modes {
            let run = self.input.open(&self.responses.channels())?;
            let reconstructed = reconstruct_with_modes(&run, modes, &how, &mut take)?;
            return self.delivered(rows, &reconstructed, words);
        }
        let machine = Machine::read(&self.system)?;
        let run = self.input.open(&self.responses.channels())?;
        if self.spectrum.is_none() && self.page.plot.plot.is_none() {
            let summary = reconstruct_in_chunks(&run, &machine, &how, &mut take)?;
            return rows.deliver(Outcome::new(summary.to_string(), &summary)?);
        }
        let reconstructed = reconstruct_with(&run, &machine, &how, &mut take)?;
        self.delivered(rows, &reconstructed, words)
    }

    /// Reports a force, and adds the requested files.
    fn delivered(
        &self,
        rows: ForceRows<'_>,
        reconstructed: &Reconstructed,
        words: &[OsString],
    ) -> Result<Outcome, CliError> {
        let mut outcome = rows.deliver(Outcome::new(reconstructed.to_string(), reconstructed)?)?;
        if let Some(path) = &self.spectrum {
            let mut file = BegunFile::begin(path)?;
            for text in spectrum_csv(reconstructed.force(), reconstructed.lines()) {
                file.append(&text)?;
            }
            outcome = outcome.with_begun(file);
        }
        outcome.with_result_page(
            &self.page,
            (&self.input.record, words),
            reconstructed,
            FigureStyle::default(),
        )
    }

    /// Returns the settings of the reconstruction.
    fn settings(&self) -> Reconstruct {
        Reconstruct {
            method: self.method,
            forced: self.forced.clone(),
            lines: self.lines.clone(),
            band_hz: self.band_hz,
            at_rest: self.at_rest,
            noise: self.noise.clone(),
            rule: self.parameter.map_or(self.rule, ParameterRule::Given),
        }
    }
}

/// Table of the force, written while its samples are computed.
struct ForceRows<'a> {
    path: Option<&'a Path>,
    rows: Option<CsvFile>,
}

impl ForceRows<'_> {
    fn append(&mut self, chunk: &ForceChunk<'_>) -> Result<(), AnalysisError> {
        let Some(path) = self.path else { return Ok(()) };
        let columns = chunk.columns();
        let mut rows = match self.rows.take() {
            Some(rows) => rows,
            None => {
                let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
                CsvFile::begin(path, chunk.sampling, &names)?
            }
        };
        let values: Vec<&[f64]> = columns.iter().map(|(_, column)| *column).collect();
        rows.append(&values)?;
        self.rows = Some(rows);
        Ok(())
    }

    fn deliver(self, outcome: Outcome) -> Result<Outcome, CliError> {
        Ok(match self.rows {
            Some(rows) => outcome.with_begun(rows.finish()?),
            None => outcome,
        })
    }
}
