//! `mechid identify`: the machine behind a record.

mod excited;
pub(super) mod fit;
mod mass;
pub(super) mod measurement;
mod picture;
pub(super) mod report;

use clap::{Args, ValueEnum};
use mechid::estimate::{Estimate, Parameter, Unknowns};
use mechid::io::{LineSpec, ParameterCovariance, SystemMatrices};
use mechid::plot::Figure;

use self::excited::Band;
use self::excited::choose_lines;
use self::fit::{BetweenSamples, Fitted, Method};
use self::mass::KnownMass;
use self::measurement::{ChannelArgs, Measurement};
use self::report::{CONFIDENCE, Fit, Lines, ModeRow, ParameterRow, Report, Uncertain, Window};
use crate::error::CliError;
use crate::options::{PlotArgs, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Find mass, damping and stiffness from a measured force and response
///
/// In the frequency domain (the default) the window must hold whole periods of a periodic
/// excitation, and one kind of motion is enough; the periods are averaged. In the time domain any
/// record will do: displacement, velocity and acceleration for the equation of motion itself, or
/// displacement and velocity with an assumption on the force between the samples.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify record.csv --force force --displacement displacement
  mechid identify rig.csv --sample-rate 610.35 --force V1 --displacement V2 \\
      --start 10585 --period 1024 --periods 1 --lines 1:2:335 --detrend mean --plot receptance.svg
  mechid identify rotor.csv --force fx,fy --displacement x,y --mass 14.8,14.8 --band-hz 20:90 --json")]
pub struct IdentifyArgs {
    #[command(flatten)]
    identification: Identification,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Which record, what in it, and how to find the machine.
#[derive(Debug, Args)]
pub struct Identification {
    #[command(flatten)]
    pub input: RecordArgs,
    #[command(flatten)]
    pub channels: ChannelArgs,
    /// Where to look
    #[arg(long, value_name = "DOMAIN", value_enum, default_value_t = Domain::Frequency)]
    domain: Domain,
    /// Spectral lines: all, odd, even, or numbers and ranges first:step:last such as 1:2:335
    /// [default: every line that carries force]
    #[arg(long, value_name = "LINES", conflicts_with = "band_hz")]
    lines: Option<LineSpec>,
    /// Use the lines with force between two frequencies, in Hz
    #[arg(long, value_name = "LOW:HIGH")]
    band_hz: Option<Band>,
    /// How to find the parameters from the spectra
    #[arg(long, value_name = "METHOD", value_enum, default_value_t = Method::LeastSquares)]
    method: Method,
    /// What is assumed of the force between samples, in the time domain [default: the equation of
    /// motion at the samples if the acceleration is measured, else linear]
    #[arg(long, value_name = "ASSUMPTION", value_enum)]
    pub between_samples: Option<BetweenSamples>,
    /// Masses, in kg, one per degree of freedom (or all n×n entries row by row); or unknown
    #[arg(
        long,
        value_name = "unknown|KG,…",
        default_value = "unknown",
        allow_hyphen_values = true
    )]
    mass: KnownMass,
}

/// A machine found, and what it was found from.
#[derive(Debug)]
pub struct Identified {
    pub measured: Measurement,
    pub fitted: Fitted,
    pub report: Report,
}

/// Where to look for the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Domain {
    /// Spectral lines of whole periods
    Frequency,
    /// Sample by sample, any record
    Time,
}

/// Unexplained motion above which the user is warned.
const CONSPICUOUS: f64 = 0.05;

impl IdentifyArgs {
    /// Reads, identifies, and tells.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let found = self.identification.identify()?;
        let report = &found.report;
        Outcome::new(report.text(), report)?
            .with_plot(&self.plot, || found.picture(&report.title()))
    }
}

impl Identification {
    /// Reads and identifies.
    pub fn identify(&self) -> Result<Identified, CliError> {
        let measured = self.channels.measure(&self.input)?;
        let unknowns = self.mass.unknowns(measured.force.channels())?;
        let fitted = match self.domain {
            Domain::Frequency => {
                let force = measured.force.period_mean(measured.period)?;
                let lines = choose_lines(&force, self.lines.as_ref(), self.band_hz)?;
                fit::frequency_domain(&measured, &unknowns, lines, self.method)?
            }
            Domain::Time => fit::time_domain(&measured, &unknowns, self.between_samples)?,
        };
        let report = report(&measured, &fitted)?;
        Ok(Identified { measured, fitted, report })
    }
}

impl Identified {
    /// Measured and identified receptance.
    ///
    /// # Errors
    /// [`CliError::PlotNeedsSpectra`] in the time domain, [`CliError::NothingToDraw`].
    pub fn picture(&self, title: &str) -> Result<Figure, CliError> {
        let (_, data) = self.fitted.frequency.as_ref().ok_or(CliError::PlotNeedsSpectra)?;
        picture::receptance(title, data, &self.fitted.estimate.system()?)
    }
}

fn report(measured: &Measurement, fitted: &Fitted) -> Result<Report, CliError> {
    let estimate = &fitted.estimate;
    let system = estimate.system()?;
    let samples = measured.period * measured.periods;
    let unexplained_motion = fitted.unexplained_motion(&system)?;
    let mut report = Report {
        file: measured.file.clone(),
        domain: fitted.domain,
        estimator: fitted.estimator,
        window: Window {
            first_sample: measured.first_sample,
            last_sample: measured.first_sample + samples - 1,
            period_samples: measured.period,
            periods: measured.periods,
            sample_rate_hz: measured.force.sampling().rate_hz(),
        },
        lines: fitted.frequency.as_ref().map(|(lines, _)| Lines::of(lines)),
        confidence: CONFIDENCE,
        parameters: parameters(fitted)?,
        modes: estimate.modes()?.iter().map(ModeRow::of).collect::<Result<_, _>>()?,
        fit: Fit {
            nrmse: fitted.nrmse(),
            unexplained_motion,
            condition_number: estimate.condition(),
            equations: fitted.equations,
            unknowns: estimate.parameters().len(),
        },
        remarks: Vec::new(),
        system: SystemMatrices::from(&system),
        covariance: covariance(estimate),
    };
    report.remarks = remarks(fitted, &report);
    Ok(report)
}

fn parameters(fitted: &Fitted) -> Result<Vec<ParameterRow>, CliError> {
    let (estimate, mut rows) = (&fitted.estimate, Vec::new());
    let found = |parameter: Parameter| {
        let at = estimate.parameters().position(|p| p.parameter == parameter);
        at.and_then(|at| estimate.parameters().nth(at))
    };
    for parameter in Unknowns::unknown_mass(estimate.dof())?.free() {
        let (matrix, row, column) = (parameter.matrix(), parameter.row(), parameter.column());
        let value = match found(parameter) {
            Some(p) => Uncertain::new(p.value, p.standard_error, p.interval(CONFIDENCE)?),
            None => {
                Uncertain::known(estimate.unknowns().fixed(matrix, row, column).unwrap_or_default())
            }
        };
        rows.push(ParameterRow {
            name: parameter.to_string(),
            matrix: matrix.to_string(),
            row: row + 1,
            column: column + 1,
            unit: matrix.unit(),
            known: value.standard_error.is_none(),
            estimate: value,
        });
    }
    Ok(rows)
}

fn covariance(estimate: &Estimate) -> ParameterCovariance {
    let names = estimate.parameters().map(|p| p.parameter.to_string()).collect();
    ParameterCovariance::new(names, estimate.covariance(), estimate.degrees_of_freedom())
}

fn remarks(fitted: &Fitted, report: &Report) -> Vec<String> {
    let mut remarks = fitted.remarks.clone();
    if let Some(part) = report.fit.unexplained_motion.filter(|part| *part > CONSPICUOUS) {
        remarks.push(format!(
            "the linear model leaves {:.1} % of the motion unexplained: noise, a nonlinearity, a \
             degree of freedom more, or a record that is not periodic",
            100.0 * part
        ));
    }
    for p in report.parameters.iter().filter(|p| p.row == p.column && p.estimate.value < 0.0) {
        remarks.push(format!("{} is negative: no passive machine has that", p.name));
    }
    remarks
}
