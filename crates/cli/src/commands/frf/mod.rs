//! `mechid frf`: motion per unit force, frequency by frequency.

mod picture;
mod report;
pub(super) mod responses;

use std::path::PathBuf;

use clap::Args;
use mechid::io::LineSpec;

use self::report::Report;
use self::responses::{Estimator, Responses, SegmentArgs};
use super::identify::excited::{Band, choose_lines};
use super::identify::measurement::ChannelArgs;
use crate::error::CliError;
use crate::options::{PlotArgs, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Estimate frequency responses and coherence from measured forces and motions
///
/// With a periodic excitation the periods are the segments that are averaged (--period says how long
/// one is). With a random excitation say --segment: segments overlap under a window. A long text is
/// read a stretch at a time and not held.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid frf record.csv --force force --displacement displacement --period 256 --plot frf.svg
  mechid frf random.csv --force f --acceleration a --segment 1024 --segment-overlap 66 \\
      --estimator hv --band-hz 5:400 --output frf.csv
  mechid frf rotor.csv --force fx,fy --displacement x,y --period 512 --json")]
pub struct FrfArgs {
    #[command(flatten)]
    input: RecordArgs,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Which signal is believed where force and motion disagree
    #[arg(long, value_enum, default_value_t = Estimator::H1)]
    estimator: Estimator,
    /// Spectral lines of a segment: all, odd, even, or numbers and ranges first:step:last such as
    /// 1:2:335 [default: every line whose force stands out of its noise]
    #[arg(long, value_name = "LINES", conflicts_with = "band_hz")]
    lines: Option<LineSpec>,
    /// Use the lines with force between two frequencies, in Hz
    #[arg(long, value_name = "LOW:HIGH")]
    band_hz: Option<Band>,
    #[command(flatten)]
    segments: SegmentArgs,
    /// Write the responses into this file (-: to standard output), as a table with one row per
    /// frequency
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl FrfArgs {
    /// Reads, averages, and tells.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let recorded = self.channels.record(&self.input, self.segments.hold())?;
        let choose = |force: &_, period: usize| {
            choose_lines(force, period, self.lines.as_ref(), self.band_hz)
        };
        let found = Responses::of(&recorded, &self.segments, self.estimator, choose)?;
        let report = Report::new(&recorded.held, &found, self.estimator);
        let mut outcome = Outcome::new(report.text(), &report)?
            .with_plot(&self.plot, || Ok(picture::figure(&report)))?;
        if let Some(path) = &self.output {
            outcome = outcome.with_file(path, report.csv());
        }
        Ok(outcome)
    }
}
