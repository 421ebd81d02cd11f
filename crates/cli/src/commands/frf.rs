//! `mechid frf`: response per unit force, frequency by frequency.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::frf::Estimator;
use mechid::analysis::{Channels, FrfSettings};

use crate::args::fit::{LineArgs, SegmentArgs};
use crate::args::hits::HitArgs;
use crate::args::word::word;
use crate::args::{ChannelArgs, FigureArgs, RecordArgs, ReportArgs, StyleArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Estimate frequency responses and coherence from measured forces and motions
///
/// With a periodic excitation the periods are the segments that are averaged (--period is the
/// length of one). With a random excitation give --segment: the segments overlap, and a window
/// weights them. For a hammer test the good hits are averaged (--hits). A long text is read in
/// chunks and not kept in memory.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid frf record.csv --force force --displacement displacement --period 256 --plot frf.svg
  mechid frf random.csv --force f --acceleration a --segment 1024:66 \\
      --estimator hv --band-hz 5:400 --output frf.csv
  mechid frf a.csv b.csv --force f --acceleration a --segment 1024 --plot frf.svg
  mechid frf hammer.csv --force f --acceleration a --hits --exponential-percent 1
  mechid frf point1.csv point2.csv --force f --struck 1,2 --acceleration a1,a2 --hits
  mechid frf rotor.csv --force fx,fy --displacement x,y --period 512 --json")]
pub struct FrfArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// More records of the same machine, with the same columns and window: the segments of all are
    /// averaged together
    #[arg(value_name = "RECORD")]
    more: Vec<PathBuf>,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Frequency response estimator, chosen by the channels that have the noise: h1 for noise on
    /// the response, h2 on the force, hv on both
    #[arg(long, value_name = "ESTIMATOR", value_parser = word::<Estimator>(), default_value = "h1")]
    estimator: Estimator,
    #[command(flatten)]
    lines: LineArgs,
    #[command(flatten)]
    segments: SegmentArgs,
    #[command(flatten)]
    hits: HitArgs,
    /// Exponential window on force and response: its weight at the end of a hit, in per cent of
    /// that at the beginning [default: no window]
    #[arg(
        long,
        value_name = "PERCENT",
        requires = "hits",
        allow_negative_numbers = true,
        help_heading = "Hammer tests"
    )]
    exponential_percent: Option<f64>,
    /// Write the responses into this file (-: to standard output): a table with one row per
    /// frequency, or a universal file (.unv, .uff) of datasets 151, 164 and 58
    #[arg(long, value_name = "FILE.csv|FILE.unv", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Point and direction of each degree of freedom in a universal file [default: the names of the
    /// channels if all are points such as 12+Z, otherwise 1+X,2+X,…]
    #[arg(
        long,
        value_name = "POINT,…",
        value_delimiter = ',',
        requires = "output",
        help_heading = "Output"
    )]
    points: Vec<String>,
    #[command(flatten)]
    page: FigureArgs,
    #[command(flatten)]
    style: StyleArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl FrfArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let files = Files::default().reads([&self.input.record]).reads(&self.more);
        self.page.add_files(files.writes(&self.output))
    }

    /// Reads, averages, and reports.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let channels = self.channels.in_file(&self.input.record, &self.input)?;
        let channels = self.hits.channels_of(&channels, 1 + self.more.len())?;
        channels.iter().try_for_each(Channels::check_some)?;
        let how = FrfSettings {
            estimator: self.estimator,
            lines: self.lines.choice(),
            without: self.lines.without(),
            segments: self.segments.segmentation(),
            hits: self.hits.rule(),
            exponential_percent: self.exponential_percent,
        };
        let mut records = vec![self.input.open(&channels[0])?];
        for (record, channels) in self.more.iter().zip(&channels[1..]) {
            records.push(self.input.open_other(record, channels, self.input.window())?);
        }
        let table = mechid::frf_of_records(&records, &how)?;
        let mut outcome = Outcome::new(table.to_string(), &table)?.with_result_page(
            &self.page,
            (&self.input.record, words),
            &table,
            self.style.style(),
        )?;
        if let Some(path) = &self.output {
            let universal = path.extension().is_some_and(|ending| {
                ["unv", "uff"].iter().any(|known| ending.eq_ignore_ascii_case(known))
            });
            let content = if universal {
                table.to_responses(&self.points)?.to_universal_file()?
            } else {
                table.csv()
            };
            outcome = outcome.with_file(path, content);
        }
        Ok(outcome)
    }
}
