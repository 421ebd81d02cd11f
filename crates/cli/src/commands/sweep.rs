//! `mechid sweep`: errors of an estimator over a range of sampling steps.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use mechid::analysis::identify::KnownMass;
use mechid::analysis::sweep::{
    Estimator, Kind, Settings, SweepSettings, SweepSummary, sweep_record,
};
use mechid::io::{Experiment, read_system};
use mechid::report::FigureStyle;

use crate::args::word::word;
use crate::args::{ChannelArgs, PlotArgs, RecordArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Identify a machine at many sampling steps, and find the step that suits the estimator best
///
/// With the description of an experiment (SYSTEM.json, as for "mechid simulate") each setting is
/// simulated: NPI or a rate replaces the sampling rate, and the number of samples in a period stays
/// the same. NPI is the number of cycles of the natural frequency ωn in a period, so that the step
/// is 2π NPI / (samples · ωn). Errors are differences from the machine in the description.
///
/// For a measured record, every n-th sample is used, without a filter; columns and window are
/// chosen as in "mechid identify". Without --reference the standard errors are compared; they do
/// not include bias. A long text is read once for all settings, in chunks; for spectra one long
/// period is kept in memory, and the excited lines are determined from the first 262144 samples.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid sweep examples/machine.json --npi 2,4,8 --estimator euler
  mechid sweep examples/machine.json --npi 1:0.5:16 --estimator linear --plot sweep.svg
  mechid sweep examples/machine.json --rate-hz 64,128,256 --estimator held --best
  mechid sweep examples/machine.csv --force force --displacement displacement --velocity velocity \\
      --decimate 1:1:4 --reference examples/machine.json")]
pub struct SweepArgs {
    #[command(flatten)]
    input: RecordArgs,
    #[command(flatten)]
    channels: ChannelArgs,
    #[command(flatten)]
    settings: SettingArgs,
    /// Natural frequency whose cycles NPI counts, in Hz [default: the lowest of the machine]
    #[arg(long, value_name = "HZ")]
    natural_frequency_hz: Option<f64>,
    /// Estimator: euler, held and linear fit the change of the state from sample to sample (euler:
    /// Euler's rule, whose bias is proportional to the step; held, linear: the force between
    /// samples); equation-of-motion fits the equation of motion at the samples (needs the
    /// acceleration); least-squares and maximum-likelihood fit the spectra
    #[arg(long, value_name = "ESTIMATOR", value_parser = word::<Estimator>(), default_value = "linear")]
    estimator: Estimator,
    /// Find the mass of a described machine, too; otherwise the mass of the description is used
    #[arg(long)]
    unknown_mass: bool,
    /// Masses, in kg, as for "mechid identify" [default: unknown for a record]
    #[arg(
        long,
        value_name = "KG|unknown,…",
        allow_hyphen_values = true,
        conflicts_with = "unknown_mass"
    )]
    mass: Option<KnownMass>,
    /// Reference machine: the errors of a record's estimates are differences from it
    #[arg(long, value_name = "SYSTEM.json")]
    reference: Option<PathBuf>,
    /// Print only the best setting and its intervals (--json always lists all)
    #[arg(long)]
    best: bool,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Quantity that is swept, and its values; exactly one option is given.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct SettingArgs {
    /// Cycles of the natural frequency in a period: numbers and ranges first:step:last, such as
    /// 1:0.5:16
    #[arg(long, value_name = "NPI,…")]
    npi: Option<Settings>,
    /// Sampling rates, in Hz; for a record, its own rate divided by whole numbers
    #[arg(long, value_name = "HZ,…")]
    rate_hz: Option<Settings>,
    /// Take every n-th sample; for an experiment, divide its sampling rate by n
    #[arg(long, value_name = "N,…")]
    decimate: Option<Settings>,
}

impl SettingArgs {
    /// Returns the given settings; the parser demands exactly one kind.
    fn chosen(&self) -> (Kind, Settings) {
        match (&self.npi, &self.rate_hz, &self.decimate) {
            (_, Some(rates), _) => (Kind::RateHz, rates.clone()),
            (_, _, Some(factors)) => (Kind::Decimation, factors.clone()),
            (npi, None, None) => (Kind::Npi, npi.clone().unwrap_or_default()),
        }
    }
}

impl SweepArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads([&self.input.record]).reads(&self.reference).writes(&self.plot.plot)
    }

    /// Runs all settings and reports which was best.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let described = |ending: &std::ffi::OsStr| ending.eq_ignore_ascii_case("json");
        let (kind, settings) = self.settings.chosen();
        let bar = if self.report.quiet {
            ProgressBar::hidden()
        } else {
            // The bar is hidden unless the error stream is a terminal.
            ProgressBar::new(settings.0.len() as u64)
        };
        let mass = if self.unknown_mass { Some(KnownMass::default()) } else { self.mass.clone() };
        let how = SweepSettings {
            kind,
            settings,
            estimator: self.estimator,
            mass,
            natural_frequency_hz: self.natural_frequency_hz,
        };
        let swept = if self.input.record.extension().is_some_and(described) {
            self.over_experiment(&how, &bar)
        } else {
            self.over_record(&how, &bar)
        };
        bar.finish_and_clear();
        let swept = swept?;
        Outcome::new(swept.text(self.best), &swept)?.with_result_plot(
            &self.plot,
            words,
            &swept,
            FigureStyle::default(),
        )
    }

    fn over_experiment(
        &self,
        how: &SweepSettings,
        bar: &ProgressBar,
    ) -> Result<SweepSummary, CliError> {
        let why = "belongs to a record; the description of the experiment states this itself";
        for (option, given) in [
            ("--force", !self.channels.force.is_empty()),
            ("--period", self.input.period.is_some()),
            ("--reference", self.reference.is_some()),
        ] {
            if given {
                return Err(CliError::MisplacedOption { option, why });
            }
        }
        let experiment = Experiment::read(&self.input.record)?;
        let experiment = experiment.with_memory_gb(self.input.memory_gb);
        Ok(mechid::sweep(&experiment, how, &|| bar.inc(1))?)
    }

    fn over_record(
        &self,
        how: &SweepSettings,
        bar: &ProgressBar,
    ) -> Result<SweepSummary, CliError> {
        let channels = self.channels.channels();
        channels.check_pairs()?;
        let record = self.input.open(&channels)?;
        let reference = self.reference.as_ref().map(read_system).transpose()?;
        Ok(sweep_record(&record, how, reference.as_ref(), &|| bar.inc(1))?)
    }
}
