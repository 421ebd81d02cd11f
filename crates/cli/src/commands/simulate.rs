//! `mechid simulate`: simulated record of a described experiment.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::io::{
    CsvFile, Experiment, ExperimentStudy, StudyRuns, Table, output_name, refuse_replaced_inputs,
};
use mechid::{RunsSummary, SimulationSummary};
use serde::Serialize;

use crate::args::{PlotArgs, ReportArgs, at_least_one, positive};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Simulate the experiment described in a file and write its record
///
/// The description is a JSON file with
///
///   system      mass, damping, stiffness (numbers, matrices as lists of rows, or names of Matrix
///               Market files), or mass, natural_frequency_hz, damping_ratio
///
///   nonlinear   terms in addition to the system, such as "k3: x1^3, c2: |v1| v1", and their
///               coefficients, a list, as identify --json prints them
///
///   sampling    samples in one period, rate_hz
///
///   excitation  a list of forces, each with dof (counted from 1) and a kind (default:
///               multisine):
///                 multisine  lines (all, odd, 1:2:99 …), amplitude of each line in N, phases
///                            (schroeder, schroeder-binary, random with seed, zero)
///                 harmonic   amplitude in N, frequency_hz, phase_rad
///                 sweep      amplitude in N, start_hz, end_hz, duration_s, law (linear,
///                            logarithmic), ramp_s
///                 prbs       order, amplitude in N, hold_samples
///                 random     standard_deviation in N, band_hz [low, high], burst (part of the
///                            period), seed
///                 impulse    momentum in N·s, at_s
///                 half-sine  peak in N, start_s, duration_s
///
///   scheme      name (exact, newmark, central-difference, houbolt, wilson-theta,
///               generalised-alpha, hht-alpha, wbz-alpha, bathe, rho-infinity-bathe,
///               matrix-exponential, runge-kutta-4)
///               and its parameters: newmark: beta, gamma; central-difference: start (taylor,
///               rest); houbolt: start (average-acceleration, central-difference,
///               {"given": {"at_dt": …, "at_2dt": …}} in m); wilson-theta: theta, load (projected,
///               interpolated); generalised-alpha, hht-alpha and wbz-alpha: rho_infinity,
///               acceleration (equation-of-motion, carried); bathe: load (linear, exact);
///               rho-infinity-bathe: rho_infinity, load (linear, exact); matrix-exponential: load
///               (held, linear); runge-kutta-4: load (held, linear, exact, band-limited, spline)
///
///   response    periodic (the steady state), from-rest, or {"from": {"displacement": …,
///               "velocity": …}} in m and m/s
///
///   periods     number of periods in the record
///
///   outputs     degrees of freedom whose response is recorded, counted from 1; default: all; if
///               there are more than 64 in sparse matrices, only those on which a force acts
///
///   noise       on force, displacement, velocity, acceleration: snr_db, standard_deviation or
///               fraction_of_rms; and a seed
///
/// The picture shows the record over time, with its noise, for up to four degrees of freedom.
///
/// Many runs, by --runs or --study, go into one Parquet file: its column run names the run of each
/// row. mechid fleet identifies them all, and mechid trends shows the results.
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples:\n  mechid simulate examples/machine.json --output record.csv\n  \
                  mechid simulate examples/machine.json --output record.csv --plot run.svg\n  \
                  mechid simulate examples/machine.json --runs 1000 --output runs.parquet\n  \
                  mechid identify record.csv --force force --displacement displacement"
)]
pub struct SimulateArgs {
    /// The description of the experiment (-: on standard input)
    #[arg(value_name = "SYSTEM.json")]
    experiment: PathBuf,
    /// File for the record (-: standard output): columns time, force, displacement, velocity,
    /// acceleration in SI units; with several degrees of freedom force_1, force_2, …; for many runs
    /// a Parquet file, its name ending in .parquet
    #[arg(long, short, value_name = "RECORD.csv", help_heading = "Output")]
    output: PathBuf,
    /// Number of runs with different noise: the first run has the seed of the description, and the
    /// seed increases by 1 from run to run
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, conflicts_with = "plot",
          help_heading = "Many runs")]
    runs: Option<usize>,
    /// Table of the runs, one row per run; its columns are the fields that change, named by their
    /// paths in the description, such as noise.seed, system.damping, excitation.2.amplitude
    #[arg(long, value_name = "RUNS.csv", conflicts_with_all = ["plot", "runs"],
          help_heading = "Many runs")]
    study: Option<PathBuf>,
    /// Maximum memory of a simulation, in GB [default: 1.07]
    #[arg(long, value_name = "GB", value_parser = positive)]
    memory_gb: Option<f64>,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report<S> {
    record: String,
    #[serde(flatten)]
    summary: S,
}

impl SimulateArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let files = Files::default().reads([&self.experiment]).reads(&self.study);
        files.writes([&self.output]).writes(&self.plot.plot)
    }

    /// Simulates one record, or the records of all runs.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        match (self.runs, &self.study) {
            (None, None) => self.one(words),
            (Some(runs), _) => self.many("--runs", &StudyRuns::Seeds(runs)),
            (None, Some(table)) => {
                self.many("--study", &StudyRuns::Table(Box::new(Table::read(table)?)))
            }
        }
    }

    fn one(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let simulation = mechid::simulate(&self.experiment()?)?;
        let (names, columns): (Vec<String>, Vec<&[f64]>) = simulation.columns().into_iter().unzip();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut file = CsvFile::begin(&self.output, simulation.force.sampling(), &names)?;
        file.append(&columns)?;
        let report: Report<SimulationSummary> = self.report(simulation.summary()?);
        Outcome::new(format!("{}: {}", report.record, report.summary), &report)?
            .with_begun(file.finish()?)
            .with_plot(&self.plot, words, || Ok(simulation.figure(&report.record)))
    }

    /// Reads the experiment; refuses an output that would replace a file named in the experiment.
    fn experiment(&self) -> Result<Experiment, CliError> {
        let experiment = Experiment::read(&self.experiment)?.with_memory_gb(self.memory_gb);
        let outputs: Vec<_> = std::iter::once(&self.output).chain(&self.plot.plot).collect();
        refuse_replaced_inputs(experiment.files(), &outputs)?;
        Ok(experiment)
    }

    fn many(&self, option: &'static str, runs: &StudyRuns) -> Result<Outcome, CliError> {
        let ending = self.output.extension().and_then(|ending| ending.to_str());
        if !ending.is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
            let why = "writes a Parquet file: the name of --output must end in .parquet";
            return Err(CliError::MisplacedOption { option, why });
        }
        self.experiment()?;
        let study = ExperimentStudy::read(&self.experiment, runs)?;
        let study = study.with_memory_gb(self.memory_gb);
        let mut progress = |done| log::trace!(target: "mechid", "run {done} of {}", study.runs());
        let (file, summary) = mechid::simulate_runs(&study, &self.output, &mut progress)?;
        let report: Report<RunsSummary> = self.report(summary);
        let text = format!("{}: {}", report.record, report.summary);
        Ok(Outcome::new(text, &report)?.with_begun(file))
    }

    fn report<S>(&self, summary: S) -> Report<S> {
        Report { record: output_name(&self.output), summary }
    }
}
