//! `mechid multisine`: design of an excitation for a test, with its quality.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use mechid::excitation::{
    DesignedInput, ExcitationDesign, ExcitationLevel, ExcitationSummary, Separation,
    excitation_figure,
};
use mechid::io::{BegunFile, CsvFile, LineSpec};
use mechid::signal::multi_input::Mixing;
use mechid::signal::{Phases, Sampling};

use crate::args::{PlotArgs, ReportArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Make a multisine excitation, write its record and report its properties
///
/// A multisine is a sum of cosines on chosen lines of a period. The phases decide how its power is
/// spread over time: with a low crest factor the shaker gives the most power for a given peak
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
    /// Rule for the phases
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
    /// Peak force, including values between samples, in N
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
    /// Number of starting points of the search for a low crest factor
    #[arg(long, value_name = "COUNT", default_value_t = 16, value_parser = at_least_one)]
    starts: usize,
    /// Number of inputs of the test, one column each
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Several inputs")]
    inputs: usize,
    /// Separation of the inputs
    #[arg(long, value_name = "HOW", value_enum, default_value_t, help_heading = "Several inputs")]
    uncorrelated: Uncorrelated,
    /// Number of periods in the written record
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Output")]
    periods: usize,
    /// File for the record (-: standard output): columns time, in s, and force, in N; with
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
    /// Schroeder's law for the given spectrum: a crest factor of about 1.7
    #[default]
    Schroeder,
    /// Schroeder's two-valued law, phases 0 or π
    SchroederBinary,
    /// Random: a crest factor of 3 to 4
    Random,
    /// All zero: one peak per period
    Zero,
    /// Optimised for a low crest factor: about 1.4 for a flat spectrum
    LowCrest,
}

/// Ways to separate several inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Uncorrelated {
    /// Interleaved lines, each excited by one input: one experiment
    #[default]
    Interleaved,
    /// All inputs excite all lines and are made orthogonal by a DFT matrix: as many experiments as
    /// inputs
    Dft,
    /// All inputs excite all lines and are made orthogonal by a Hadamard matrix (signs only): 2, 4,
    /// 8 … inputs
    Hadamard,
}

/// Maximum number of values in a written record: about 2 GB of text.
const LARGEST: usize = 100_000_000;

impl MultisineArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().writes(&self.output).writes(&self.plot.plot)
    }

    /// Designs the excitation, samples it and measures it.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let columns = match self.uncorrelated {
            Uncorrelated::Interleaved => self.inputs,
            Uncorrelated::Dft | Uncorrelated::Hadamard => self.inputs.saturating_mul(self.inputs),
        };
        let length = self.samples.saturating_mul(self.periods);
        let numbers = length.saturating_mul(columns);
        if numbers > LARGEST {
            return Err(CliError::RecordSize { numbers, largest: LARGEST });
        }
        let sampling = Sampling::from_rate_hz(self.rate, self.samples)?;
        let inputs = self.design(sampling)?.inputs(sampling)?;
        let summary = ExcitationSummary::new(&inputs)?;
        let mut outcome = Outcome::new(summary.to_string(), &summary)?;
        if let Some(path) = &self.output {
            outcome = outcome.with_begun(self.record(path, &inputs)?);
        }
        outcome.with_plot(&self.plot, words, || Ok(excitation_figure(&inputs)?))
    }

    fn design(&self, sampling: Sampling) -> Result<ExcitationDesign, CliError> {
        Ok(ExcitationDesign {
            lines: self.lines.lines(sampling)?,
            amplitude: self.amplitude.unwrap_or(1.0),
            slope_db: self.slope,
            phases: match self.phases {
                PhaseLaw::Schroeder | PhaseLaw::LowCrest => Phases::Schroeder,
                PhaseLaw::SchroederBinary => Phases::SchroederBinary,
                PhaseLaw::Random => Phases::Random { seed: self.seed },
                PhaseLaw::Zero => Phases::Zero,
            },
            starts: if self.phases == PhaseLaw::LowCrest { self.starts } else { 0 },
            seed: self.seed,
            inputs: self.inputs,
            separation: match self.uncorrelated {
                Uncorrelated::Interleaved => Separation::Interleaved,
                Uncorrelated::Dft => Separation::Orthogonal(Mixing::Dft),
                Uncorrelated::Hadamard => Separation::Orthogonal(Mixing::Hadamard),
            },
            level: match (self.rms, self.peak) {
                (Some(rms), _) => Some(ExcitationLevel::Rms(rms)),
                (None, peak) => peak.map(ExcitationLevel::Peak),
            },
        })
    }

    /// Writes the record, period after period.
    fn record(&self, path: &Path, inputs: &[DesignedInput]) -> Result<BegunFile, CliError> {
        let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
        let period: Vec<&[f64]> = inputs.iter().map(|input| input.period.channel(0)).collect();
        let sampling = inputs[0].period.sampling().with_len(self.samples * self.periods)?;
        let mut file = CsvFile::begin(path, sampling, &names)?;
        for _ in 0..self.periods {
            file.append(&period)?;
        }
        Ok(file.finish()?)
    }
}
