//! `mechid multisine`: an excitation to drive a test with, and how good it is.

mod design;
mod report;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use mechid::io::{BegunFile, CsvFile, LineSpec};
use mechid::plot::{Axis, Curve, Figure, Panel};
use mechid::signal::resample::refine;
use mechid::signal::{Interpolation, Sampling};

use crate::args::{PlotArgs, ReportArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use design::Channel;
use report::Report;

/// Make a multisine excitation, write its record and judge it
///
/// A multisine is a sum of cosines on chosen lines of a period. The phases decide how its power is
/// spread over time: with phases of low crest factor the shaker gives most power for its largest
/// force.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    mechid multisine --samples 256 --rate 50 --amplitude 50 --phases schroeder-binary \\\n      \
      --output force.csv --plot force.svg\n  \
    mechid multisine --samples 4096 --rate 1000 --lines 1:2:801 --phases low-crest --peak 200 \\\n      \
      --periods 8 --output force.csv\n  \
    mechid multisine --samples 1024 --rate 512 --inputs 2 --uncorrelated hadamard --phases random \\\n      \
      --rms 10 --output forces.csv")]
pub struct MultisineArgs {
    /// Samples in one period
    #[arg(long, value_name = "SAMPLES")]
    samples: usize,
    /// Samples per second, in Hz
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: f64,
    /// Lines of the period to excite: all, odd, even, or numbers and ranges first:step:last,
    /// separated by commas
    #[arg(long, value_name = "LINES", default_value = "all")]
    lines: LineSpec,
    /// How the phases are chosen
    #[arg(long, value_name = "LAW", value_enum, default_value_t)]
    phases: PhaseLaw,
    /// Amplitude of every line, in N [default: 1]
    #[arg(long, value_name = "N", conflicts_with_all = ["rms", "peak"],
          allow_negative_numbers = true, help_heading = "Level")]
    amplitude: Option<f64>,
    /// RMS value, in N
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "peak",
        allow_negative_numbers = true,
        help_heading = "Level"
    )]
    rms: Option<f64>,
    /// Largest force, between samples too, in N
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Level")]
    peak: Option<f64>,
    /// Slope of the amplitudes from the first line on, in dB per decade
    #[arg(
        long,
        value_name = "DB",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        help_heading = "Level"
    )]
    slope: f64,
    /// Seed of random phases and of the search for a low crest factor
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Starting points of the search for a low crest factor
    #[arg(long, value_name = "COUNT", default_value_t = 16, value_parser = at_least_one)]
    starts: usize,
    /// Inputs of the test, each with a column of its own
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Several inputs")]
    inputs: usize,
    /// How the inputs are kept apart
    #[arg(long, value_name = "HOW", value_enum, default_value_t, help_heading = "Several inputs")]
    uncorrelated: Separation,
    /// Periods in the record written
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Output")]
    periods: usize,
    /// Where the record goes (-: to standard output): columns time, in s, and force, in N; with
    /// several inputs force_1, force_2, …
    #[arg(long, short, value_name = "RECORD.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Phase laws by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum PhaseLaw {
    /// Schroeder's law for the spectrum at hand: a crest factor of about 1.7
    #[default]
    Schroeder,
    /// Schroeder's two-valued law, phases 0 or π
    SchroederBinary,
    /// Random: a crest factor of 3 to 4
    Random,
    /// All zero: one peak per period
    Zero,
    /// Searched for a low crest factor: about 1.4 for a flat spectrum
    LowCrest,
}

/// Ways to tell several inputs apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Separation {
    /// Each input has lines of its own, dealt out in turn: one experiment
    #[default]
    Interleaved,
    /// All inputs share all lines, orthogonal by a DFT matrix: as many experiments as inputs
    Dft,
    /// The same with a Hadamard matrix, signs only: 2, 4, 8 … inputs
    Hadamard,
}

/// Numbers in the largest record that is written: about 2 GB of text.
const LARGEST: usize = 100_000_000;

impl MultisineArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().writes(&self.output).writes(&self.plot.plot)
    }

    /// Designs the excitation, samples it and measures it.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let columns = match self.uncorrelated {
            Separation::Interleaved => self.inputs,
            Separation::Dft | Separation::Hadamard => self.inputs.saturating_mul(self.inputs),
        };
        let length = self.samples.saturating_mul(self.periods);
        let numbers = length.saturating_mul(columns);
        if numbers > LARGEST {
            return Err(CliError::RecordSize { numbers, largest: LARGEST });
        }
        let sampling = Sampling::from_rate_hz(self.rate, self.samples)?;
        let channels = self.channels(sampling)?;
        let report = Report::of(sampling, &channels)?;
        let mut outcome = Outcome::new(report.text(), &report)?;
        if let Some(path) = &self.output {
            outcome = outcome.with_begun(self.record(path, &channels)?);
        }
        outcome.with_plot(&self.plot, || figure(&channels))
    }

    /// The record, period after period.
    fn record(&self, path: &Path, channels: &[Channel]) -> Result<BegunFile, CliError> {
        let names: Vec<&str> = channels.iter().map(|c| c.name.as_str()).collect();
        let period: Vec<&[f64]> = channels.iter().map(|c| c.period.channel(0)).collect();
        let sampling = channels[0].period.sampling().with_len(self.samples * self.periods)?;
        let mut file = CsvFile::begin(path, sampling, &names)?;
        for _ in 0..self.periods {
            file.append(&period)?;
        }
        Ok(file.finish()?)
    }
}

/// Points a drawn period has at least: enough to see what it does between its samples.
const DRAWN_POINTS: usize = 4096;

/// One period of each input against time above the amplitudes of the lines.
fn figure(channels: &[Channel]) -> Result<Figure, CliError> {
    let mut figure = Figure::new("Multisine");
    let mut lines = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Amplitude", "N"));
    for Channel { name, multisine, period } in channels {
        // A single curve needs no name.
        let name = if channels.len() == 1 { "" } else { name.as_str() };
        let fine = refine(period, DRAWN_POINTS.div_ceil(period.len()), Interpolation::BandLimited)?;
        let instants: Vec<f64> = fine.sampling().times().collect();
        let time = Panel::new(Axis::linear("Time", "s"), Axis::linear("Force", "N")).title(name);
        figure = figure.panel(time.curve(Curve::line("", &instants, fine.channel(0)).width(1.0)));
        let spacing_hz = period.sampling().line_spacing_hz();
        let f: Vec<f64> = multisine.lines().iter().map(|n| *n as f64 * spacing_hz).collect();
        lines = lines.curve(Curve::stems(name, &f, multisine.amplitudes()));
    }
    Ok(figure.panel(lines))
}
