//! `mechid simulate`: the record an experiment would give.

mod picture;

use std::path::PathBuf;

use clap::Args;
use mechid::Simulation;
use mechid::io::{CsvFile, Experiment, ResponseKind, SystemMatrices};
use mechid::signal::{Record, message};
use serde::Serialize;

use crate::args::{PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use mechid::analysis::text::{compact, significant, text_table};

/// Simulate the experiment described in a file and write its record
///
/// The description is a JSON file with
///
///   system      mass, damping, stiffness (numbers, or matrices as lists of rows), or mass,
///               natural_frequency_hz, damping_ratio
///
///   sampling    samples in one period, rate_hz
///
///   excitation  a list of forces, each with dof (counted from 1) and a kind; without a kind a
///               multisine:
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
///   scheme      name (exact, newmark, central-difference, houbolt, wilson-theta, generalised-alpha,
///               hht-alpha, wbz-alpha, bathe, rho-infinity-bathe, matrix-exponential, runge-kutta-4)
///               and its parameters (beta, gamma; start: taylor, rest; start: average-acceleration,
///               central-difference, {"given": {"at_dt": …, "at_2dt": …}} in m; theta, load:
///               projected, interpolated; rho_infinity, acceleration: equation-of-motion, carried;
///               rho_infinity, load: linear, exact; load: held, linear; load: held, linear, exact)
///
///   response    periodic (the steady state), from-rest, or {"from": {"displacement": …,
///               "velocity": …}} in m and m/s
///
///   periods     how many
///
///   noise       on force, displacement, velocity, acceleration: snr_db, standard_deviation or
///               fraction_of_rms; and a seed
///
/// The picture shows over time what the record holds, noise and all, of up to four degrees of freedom.
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples:\n  mechid simulate examples/machine.json --output record.csv\n  \
                  mechid simulate examples/machine.json --output record.csv --plot run.svg\n  \
                  mechid identify record.csv --force force --displacement displacement"
)]
pub struct SimulateArgs {
    /// The description of the experiment (-: on standard input)
    #[arg(value_name = "SYSTEM.json")]
    experiment: PathBuf,
    /// Where the record goes (-: to standard output): columns time, force, displacement, velocity,
    /// acceleration in SI units; with several degrees of freedom force_1, force_2, …
    #[arg(long, short, value_name = "RECORD.csv", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    record: String,
    scheme: String,
    conventions: Vec<Convention>,
    response: ResponseKind,
    samples: usize,
    periods: usize,
    sample_rate_hz: f64,
    modes: Vec<Mode>,
    channels: Vec<Channel>,
    #[serde(skip_serializing_if = "Option::is_none")]
    instability: Option<Growth>,
    system: SystemMatrices,
}

#[derive(Debug, Serialize)]
struct Convention {
    what: &'static str,
    choice: &'static str,
}

#[derive(Debug, Serialize)]
struct Mode {
    natural_frequency_hz: f64,
    damping_ratio: f64,
}

/// The fastest growing free response.
#[derive(Debug, Serialize)]
struct Growth {
    /// Real and imaginary part, in rad/s.
    pole: [f64; 2],
    growth_rate: f64,
    doubling_time_s: f64,
    text: String,
}

#[derive(Debug, Serialize)]
struct Channel {
    column: String,
    unit: &'static str,
    rms: f64,
    /// RMS value of the noise in it.
    noise_rms: f64,
}

impl SimulateArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads([&self.experiment]).writes([&self.output]).writes(&self.plot.plot)
    }

    /// Simulates and hands over the record.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let experiment = Experiment::read(&self.experiment)?;
        let simulation = mechid::simulate(&experiment)?;
        let groups = groups(&simulation);
        let channels: Vec<Channel> = groups.iter().flat_map(Channel::of).collect();
        let columns: Vec<&[f64]> = groups
            .iter()
            .flat_map(|g| (0..g.measured.channels()).map(|dof| g.measured.channel(dof)))
            .collect();
        let names: Vec<&str> = channels.iter().map(|c| c.column.as_str()).collect();
        let mut file = CsvFile::begin(&self.output, simulation.force.sampling(), &names)?;
        file.append(&columns)?;
        let report = self.describe(&experiment, &simulation, channels)?;
        Outcome::new(report.text(), &report)?
            .with_begun(file.finish()?)
            .with_plot(&self.plot, || Ok(picture::figure(&report.record, &groups)))
    }

    fn describe(
        &self,
        experiment: &Experiment,
        simulation: &Simulation,
        channels: Vec<Channel>,
    ) -> Result<Report, CliError> {
        let modes = simulation.system.modes()?;
        Ok(Report {
            record: mechid::io::output_name(&self.output),
            scheme: simulation.scheme.clone(),
            conventions: simulation
                .conventions
                .iter()
                .map(|c| Convention { what: c.what, choice: c.choice })
                .collect(),
            response: experiment.response.clone(),
            samples: simulation.force.len(),
            periods: experiment.periods,
            sample_rate_hz: simulation.force.sampling().rate_hz(),
            modes: modes
                .iter()
                .map(|mode| Mode {
                    natural_frequency_hz: mode.natural_frequency() / std::f64::consts::TAU,
                    damping_ratio: mode.damping_ratio(),
                })
                .collect(),
            channels,
            instability: simulation.instability.as_ref().map(|found| Growth {
                pole: [found.eigenvalue().re, found.eigenvalue().im],
                growth_rate: found.growth_rate(),
                doubling_time_s: found.doubling_time(),
                text: found.to_string(),
            }),
            system: SystemMatrices::from(&simulation.system),
        })
    }
}

/// One quantity of all degrees of freedom, before and after noise.
struct Group<'a> {
    name: &'static str,
    unit: &'static str,
    truth: &'a Record,
    measured: &'a Record,
}

fn groups(s: &Simulation) -> [Group<'_>; 4] {
    let (truth, measured) = (&s.response, &s.measured_response);
    [
        ("force", "N", &s.force, &s.measured_force),
        ("displacement", "m", truth.displacement(), measured.displacement()),
        ("velocity", "m/s", truth.velocity(), measured.velocity()),
        ("acceleration", "m/s²", truth.acceleration(), measured.acceleration()),
    ]
    .map(|(name, unit, truth, measured)| Group { name, unit, truth, measured })
}

impl Channel {
    /// One for each degree of freedom.
    fn of(group: &Group<'_>) -> Vec<Self> {
        let Group { name, unit, truth, measured } = *group;
        let channel = |dof: usize| {
            let column = match measured.channels() {
                1 => name.to_string(),
                _ => format!("{name}_{}", dof + 1),
            };
            let noise = measured.column(dof) - truth.column(dof);
            let per_sample = (measured.len() as f64).sqrt();
            Self {
                column,
                unit,
                rms: measured.column(dof).norm() / per_sample,
                noise_rms: noise.norm() / per_sample,
            }
        };
        (0..measured.channels()).map(channel).collect()
    }
}

impl Report {
    fn text(&self) -> String {
        let kind = match self.response {
            ResponseKind::Periodic => "the response that repeats",
            ResponseKind::FromRest => "from rest",
            ResponseKind::From(_) => "from a given motion",
        };
        let mut text = format!(
            "{}: {} at {} Hz, {}, {kind}\nscheme: {}\n",
            self.record,
            message::count(self.samples, "sample"),
            compact(self.sample_rate_hz, 8),
            message::count(self.periods, "period"),
            self.scheme,
        );
        for Convention { what, choice } in &self.conventions {
            text += &format!("  {what}: {choice}\n");
        }
        let header = |cells: [&str; 3]| cells.map(String::from).to_vec();
        let mut rows = vec![header(["mode", "natural frequency (Hz)", "damping ratio"])];
        for (number, mode) in (1..).zip(&self.modes) {
            let cells = [mode.natural_frequency_hz, mode.damping_ratio];
            let mut row = vec![format!("{number}")];
            row.extend(cells.map(|v| significant(v, 5)));
            rows.push(row);
        }
        text += &format!("\n{}\n", text_table(&rows));
        let mut rows = vec![header(["column", "RMS", "noise RMS"])];
        for c in &self.channels {
            let cells = [c.rms, c.noise_rms].map(|v| format!("{} {}", significant(v, 4), c.unit));
            let mut row = vec![c.column.clone()];
            row.extend(cells);
            rows.push(row);
        }
        text += &text_table(&rows);
        if let Some(growth) = &self.instability {
            text += &format!("\nwarning: the machine is unstable, {}\n", growth.text);
        }
        text
    }
}
