//! `mechid sweep`: how an estimator does over a range of sampling steps.

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use mechid::estimate::frequency_domain::{
    Lines, Motion, RepeatedPeriods, equation_error, output_error,
};
use mechid::estimate::time_domain::{Discretisation, Extent, TimeDomain, equation_of_motion};
use mechid::estimate::{Estimate, Sweep, SweepPoint, Unknowns, sweep};
use mechid::io::{Experiment, ResponseKind};
use mechid::model::SecondOrderSystem;
use mechid::plot::charts::{self, Quantity, Series};
use mechid::plot::{Axis, Figure};
use serde::Serialize;

use crate::error::CliError;
use crate::options::{PlotArgs, ReportArgs};
use crate::outcome::Outcome;
use crate::text_table::{compact, significant, text_table};

/// Confidence level of every interval told.
const CONFIDENCE: f64 = 0.95;

/// A line is used if it carries at least this part of the strongest line of its force.
const EXCITED: f64 = 1e-3;

/// Settings in the longest sweep.
const LONGEST: usize = 100_000;

/// Simulate an experiment at many sampling steps, identify the machine from each record, and find
/// the step that suits the estimator best
///
/// The description is that of "mechid simulate"; its sampling rate is replaced by the one that NPI
/// says: a period holds NPI cycles of the natural frequency, so that the step is
/// 2π NPI / (samples · ωn). The number of samples in a period stays. The machine described is the
/// truth that errors are measured against.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid sweep examples/machine.json --npi 2,4,8 --estimator euler
  mechid sweep examples/machine.json --npi 1:0.5:16 --estimator linear --plot sweep.svg")]
pub struct SweepArgs {
    /// The description of the experiment
    #[arg(value_name = "SYSTEM.json")]
    experiment: PathBuf,
    /// Settings: numbers and ranges first:step:last, such as 1:0.5:16
    #[arg(long, value_name = "NPI,…")]
    npi: Settings,
    /// Natural frequency that NPI counts, in Hz [default: the lowest of the machine]
    #[arg(long, value_name = "HZ")]
    natural_frequency_hz: Option<f64>,
    /// How the machine is found
    #[arg(long, value_name = "ESTIMATOR", value_enum, default_value_t = Estimator::Linear)]
    estimator: Estimator,
    /// Find the mass, too; without this it is taken from the description
    #[arg(long)]
    unknown_mass: bool,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// How a machine is found from a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Estimator {
    /// From sample to sample by Euler's rule, the dissertation's; biased in proportion to the step
    Euler,
    /// From sample to sample, the force held between them
    Held,
    /// From sample to sample, the force linear between them
    Linear,
    /// The equation of motion at the samples, with the acceleration
    EquationOfMotion,
    /// Least squares on the spectra of force and displacement
    LeastSquares,
    /// Maximum likelihood on the spectra of force and displacement
    MaximumLikelihood,
}

/// The settings of a sweep, each positive.
#[derive(Debug, Clone, PartialEq)]
struct Settings(Vec<f64>);

impl FromStr for Settings {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut all = Vec::new();
        for part in text.split(',') {
            let numbers: Vec<f64> = part
                .split(':')
                .map(|n| n.trim().parse().map_err(|_| format!("\"{n}\" is not a number")))
                .collect::<Result<_, _>>()?;
            let [first, step, last] = match numbers[..] {
                [one] => [one, 1.0, one],
                [first, step, last] => [first, step, last],
                _ => return Err("a range is written first:step:last, such as 1:0.5:16".into()),
            };
            // The last setting survives the rounding of the steps towards it.
            let steps = ((last - first) / step + 1e-9).floor();
            let positive = |v: f64| v > 0.0 && v.is_finite();
            if !(positive(first) && positive(step) && positive(last) && steps >= 0.0) {
                return Err(format!("settings are positive and ranges go upwards, got {part}"));
            }
            if steps >= (LONGEST - all.len().min(LONGEST)) as f64 {
                return Err(format!("more than {LONGEST} settings"));
            }
            all.extend((0..=steps as usize).map(|k| first + k as f64 * step));
        }
        Ok(Self(all))
    }
}

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    estimator: String,
    samples_per_period: usize,
    natural_frequency_hz: f64,
    confidence: f64,
    points: Vec<Point>,
    /// The NPI with the smallest error.
    best_npi: f64,
}

#[derive(Debug, Serialize)]
struct Point {
    npi: f64,
    step_s: f64,
    /// Samples in one cycle of the natural frequency.
    samples_per_cycle: f64,
    /// Largest error of an entry relative to the largest entry of its matrix.
    error: Option<f64>,
    parameters: Vec<Parameter>,
    /// Why there is no estimate.
    failure: Option<String>,
}

#[derive(Debug, Serialize)]
struct Parameter {
    name: String,
    unit: &'static str,
    value: f64,
    standard_error: f64,
    interval: [f64; 2],
    true_value: f64,
}

impl SweepArgs {
    /// Runs all settings and tells which was best.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let experiment = Experiment::read(&self.experiment)?;
        let system = experiment.system()?;
        let natural_frequency_hz = match self.natural_frequency_hz {
            Some(hz) => hz,
            None => {
                let modes = system.modes()?;
                let lowest =
                    modes.iter().map(|m| m.natural_frequency()).fold(f64::INFINITY, f64::min);
                lowest / TAU
            }
        };
        let unknowns = match self.unknown_mass {
            true => Unknowns::unknown_mass(system.dof())?,
            false => Unknowns::known_mass(system.mass())?,
        };
        let samples = experiment.samples();
        let rate_hz = |npi: f64| samples as f64 * natural_frequency_hz / npi;
        let Settings(settings) = &self.npi;
        let bar = match self.report.quiet {
            true => ProgressBar::hidden(),
            // Hides itself where nobody watches.
            false => ProgressBar::new(settings.len() as u64),
        };
        let run =
            |npi: &f64| self.identify(experiment.clone().with_rate_hz(rate_hz(*npi)), &unknowns);
        let found = sweep(settings, Some(&system), run, |_| bar.inc(1));
        bar.finish_and_clear();
        let points = found
            .points()
            .iter()
            .map(|point| {
                Point::new(point, &system, 1.0 / rate_hz(point.setting), natural_frequency_hz)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let Some(best_npi) = found.best().map(|best| best.setting) else {
            return Err(nothing_found(&found));
        };
        let report = Report {
            file: experiment.file().into(),
            estimator: self.estimator.name().into(),
            samples_per_period: samples,
            natural_frequency_hz,
            confidence: CONFIDENCE,
            points,
            best_npi,
        };
        Outcome::new(report.text(), &report)?.with_plot(&self.plot, || Ok(report.figure()))
    }

    fn identify(&self, experiment: Experiment, unknowns: &Unknowns) -> Result<Estimate, CliError> {
        let simulation = mechid::simulate(&experiment)?;
        let (force, motion) = (&simulation.measured_force, &simulation.measured_response);
        let extent = match experiment.response {
            ResponseKind::Periodic => Extent::WholePeriod,
            ResponseKind::FromRest => Extent::Open,
        };
        let discretisation = match self.estimator {
            Estimator::Euler => Discretisation::Euler,
            Estimator::Held => Discretisation::ZeroOrderHold,
            Estimator::Linear => Discretisation::FirstOrderHold,
            Estimator::EquationOfMotion => return Ok(equation_of_motion(motion, force, unknowns)?),
            Estimator::LeastSquares | Estimator::MaximumLikelihood => {
                let period = simulation.force.period_mean(experiment.samples())?;
                let lines = Lines::excited(&period, EXCITED)?;
                let x = motion.displacement();
                let data = RepeatedPeriods::new(&lines, force, x, Motion::Displacement)?.mean()?;
                return Ok(match self.estimator {
                    Estimator::LeastSquares => equation_error(&data, unknowns)?,
                    _ => output_error(&data, unknowns)?.estimate,
                });
            }
        };
        let method = TimeDomain::new(discretisation, extent);
        Ok(method.fit(motion.displacement(), motion.velocity(), force, unknowns)?.into_estimate())
    }
}

impl Estimator {
    fn name(self) -> &'static str {
        match self {
            Estimator::Euler => "Euler's rule",
            Estimator::Held => "force held between samples",
            Estimator::Linear => "force linear between samples",
            Estimator::EquationOfMotion => "equation of motion at the samples",
            Estimator::LeastSquares => "least squares on the spectra",
            Estimator::MaximumLikelihood => "maximum likelihood on the spectra",
        }
    }
}

/// What went wrong at the first setting, in its own words.
fn nothing_found(found: &Sweep<f64, CliError>) -> CliError {
    let describe = |point: &SweepPoint<f64, CliError>| CliError::EmptySweep {
        setting: point.setting,
        reason: failure(point).unwrap_or_default(),
    };
    found.points().first().map_or(CliError::NothingToDraw, describe)
}

fn failure(point: &SweepPoint<f64, CliError>) -> Option<String> {
    match &point.outcome {
        Ok(found) => found.system().err().map(|reason| reason.to_string()),
        Err(reason) => Some(reason.to_string()),
    }
}

impl Point {
    fn new(
        point: &SweepPoint<f64, CliError>,
        system: &SecondOrderSystem,
        step_s: f64,
        natural_frequency_hz: f64,
    ) -> Result<Self, CliError> {
        let mut parameters = Vec::new();
        for p in point.outcome.iter().flat_map(Estimate::parameters).filter(|p| p.value.is_finite())
        {
            let which = p.parameter;
            parameters.push(Parameter {
                name: which.to_string(),
                unit: which.matrix().unit(),
                value: p.value,
                standard_error: p.standard_error,
                interval: p.interval(CONFIDENCE)?,
                true_value: system.matrix(which.matrix())[(which.row(), which.column())],
            });
        }
        Ok(Self {
            npi: point.setting,
            step_s,
            samples_per_cycle: 1.0 / (natural_frequency_hz * step_s),
            error: point.error,
            parameters,
            failure: failure(point),
        })
    }
}

impl Report {
    fn text(&self) -> String {
        let mut text = format!(
            "{}: {}, {} samples in a period, natural frequency {} Hz\n\n",
            self.file,
            self.estimator,
            self.samples_per_period,
            significant(self.natural_frequency_hz, 6),
        );
        let names: Vec<&Parameter> = self
            .points
            .iter()
            .map(|p| &p.parameters)
            .max_by_key(|p| p.len())
            .into_iter()
            .flatten()
            .collect();
        let mut header: Vec<String> =
            ["NPI", "step (s)", "samples per cycle", "error (%)"].map(String::from).to_vec();
        header.extend(names.iter().map(|p| format!("{} ({})", p.name, p.unit)));
        let mut rows = vec![header];
        for point in &self.points {
            let mut row = vec![
                compact(point.npi, 6),
                significant(point.step_s, 4),
                significant(point.samples_per_cycle, 4),
                point.error.map_or("none".into(), |e| significant(100.0 * e, 3)),
            ];
            row.extend(point.parameters.iter().map(|p| {
                format!("{} ± {}", significant(p.value, 6), significant(p.standard_error, 2))
            }));
            rows.push(row);
        }
        let mut truth = vec!["true".into(), String::new(), String::new(), String::new()];
        truth.extend(names.iter().map(|p| compact(p.true_value, 6)));
        rows.push(truth);
        text += &text_table(&rows);
        for point in &self.points {
            if let Some(failure) = &point.failure {
                text += &format!("NPI {}: {failure}\n", compact(point.npi, 6));
            }
        }
        text + &format!(
            "\nThe error is that of the worst entry, relative to the largest of its matrix; ± is one \
             standard error.\nBest: NPI {}\n",
            compact(self.best_npi, 6)
        )
    }

    fn figure(&self) -> Figure {
        let found = || self.points.iter().filter_map(|p| Some((p.npi, 100.0 * p.error?)));
        let (x, y): (Vec<f64>, Vec<f64>) = found().unzip();
        charts::sweep(
            &format!("Error over NPI: {}", self.estimator),
            Axis::linear("NPI", ""),
            Quantity::new("Worst error", "%"),
            &[Series::new(&self.estimator, &x, &y)],
            None,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_numbers_and_ranges() {
        let settings = |text: &str| text.parse::<Settings>().map(|Settings(all)| all);
        assert_eq!(settings("1:0.5:3"), Ok(vec![1.0, 1.5, 2.0, 2.5, 3.0]));
        assert_eq!(settings("8, 2:2:4"), Ok(vec![8.0, 2.0, 4.0]));
        // 0.1 is not a binary fraction: the last setting must not fall to rounding.
        assert_eq!(settings("0.1:0.1:0.3").map(|s| s.len()), Ok(3));
        for text in ["", "a", "0", "-1", "1:2", "3:1:1", "1:0:2", "1:1:inf", "1:1e-9:2", "NaN"] {
            assert!(settings(text).is_err(), "{text}");
        }
    }
}
