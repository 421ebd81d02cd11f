//! `mechid identify`: the machine behind a record.

pub(super) mod checks;
pub(super) mod course;
mod derivatives;
pub(super) mod excited;
pub(super) mod fit;
pub(super) mod mass;
pub(super) mod measurement;
mod motion_picture;
pub(super) mod picture;
pub(super) mod report;
mod responses;
mod time;
pub(super) mod validation;

use mechid::model::Parameter;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mechid::estimate::{Estimate, Unknowns};
use mechid::io::{LineSpec, ParameterCovariance, SystemMatrices};
use mechid::plot::Figure;
use mechid::signal::Record;

use self::checks::{CheckRow, When};
use self::course::Course;
use self::excited::{Band, choose_lines};
use self::fit::{BetweenSamples, Fitted, Method};
use self::mass::KnownMass;
use self::measurement::{ChannelArgs, Hold, Measurement, Recorded};
use self::report::{
    CONFIDENCE, Fit, Lines, ModeRow, ParameterRow, RecordRow, Report, Uncertain, Window,
};
use self::time::TimeArgs;
use self::validation::{Validation, ValidationArgs};
use super::frf::responses::{Estimator, SegmentArgs};
use crate::error::CliError;
use crate::options::{PlotArgs, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Find mass, damping and stiffness from a measured force and response
///
/// In the frequency domain (the default) the window must hold whole periods of a periodic
/// excitation, and one kind of motion is enough; the periods are averaged. A random excitation is
/// cut into segments with --from-frf. In the time domain any record will do: displacement, velocity
/// and acceleration for the equation of motion itself, or displacement and velocity with an
/// assumption on the force between the samples; what was not measured, --derivatives finds.
///
/// A long text is read period by period, or a stretch at a time, and not held: the fit takes all of
/// it, the checks and a plot in the time domain look at the first 262144 samples at most. Held whole
/// are windows for spectral --derivatives, and for --interpolation by a spline or band-limited, one
/// long period, and what --validate predicts as a steady state.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify record.csv --force force --displacement displacement
  mechid identify rig.csv --sample-rate 610.35 --force V1 --displacement V2 \\
      --start 10585 --period 1024 --periods 1 --lines 1:2:335 --detrend mean --plot receptance.svg
  mechid identify rotor.csv --force fx,fy --displacement x,y --mass 14.8,unknown --band-hz 20:90 --json
  mechid identify a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv
  mechid identify random.csv --force f --acceleration a --from-frf h1 --segment 1024
  mechid identify t.csv --force f --displacement x --velocity v --domain time \\
      --between-samples euler --extent period --refine 8 --interpolation band-limited --plot t.svg
  mechid identify t.csv --force f --acceleration a --domain time --derivatives savitzky-golay:11:4")]
pub struct IdentifyArgs {
    #[command(flatten)]
    identification: Identification,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Which records, what in them, and how to find the machine.
#[derive(Debug, Args)]
pub struct Identification {
    #[command(flatten)]
    pub input: RecordArgs,
    /// More records of the same machine, with the same columns and window: all are fitted together
    #[arg(value_name = "RECORD")]
    pub more: Vec<PathBuf>,
    #[command(flatten)]
    pub channels: ChannelArgs,
    /// Where to look
    #[arg(long, value_name = "DOMAIN", value_enum, default_value_t = Domain::Frequency)]
    domain: Domain,
    /// Spectral lines: all, odd, even, or numbers and ranges first:step:last such as 1:2:335
    /// [default: every line whose force stands out of its noise]
    #[arg(long, value_name = "LINES", conflicts_with = "band_hz")]
    lines: Option<LineSpec>,
    /// Use the lines with force between two frequencies, in Hz
    #[arg(long, value_name = "LOW:HIGH")]
    band_hz: Option<Band>,
    /// How to find the parameters from the spectra [default: least-squares, or maximum-likelihood
    /// with --from-frf]
    #[arg(long, value_name = "METHOD", value_enum)]
    method: Option<Method>,
    /// What is assumed of the force between samples, in the time domain [default: the equation of
    /// motion at the samples if there is an acceleration, else linear]
    #[arg(long, value_name = "ASSUMPTION", value_enum)]
    pub between_samples: Option<BetweenSamples>,
    /// Masses, in kg, one per degree of freedom (or all n×n entries row by row), each a number or
    /// unknown
    #[arg(
        long,
        value_name = "KG|unknown,…",
        default_value = "unknown",
        allow_hyphen_values = true
    )]
    mass: KnownMass,
    #[command(flatten)]
    time: TimeArgs,
    /// Fit frequency responses, averaged over segments, with their coherence as weights
    #[arg(long, value_name = "ESTIMATOR", value_enum, help_heading = "Frequency responses")]
    from_frf: Option<Estimator>,
    #[command(flatten)]
    segments: SegmentArgs,
    #[command(flatten)]
    validation: ValidationArgs,
}

/// A machine found, and what it was found from.
#[derive(Debug)]
pub struct Identified {
    /// The records fitted, at least one.
    pub records: Vec<Recorded>,
    /// The record predicted, if one was given.
    pub validated: Option<Measurement>,
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
        let found = self.identification.identify(self.identification.hold())?;
        let report = &found.report;
        Outcome::new(report.text(), report)?
            .with_plot(&self.plot, || found.picture(&report.title()))
    }
}

impl Identification {
    /// How much of a record must be held to fit it.
    pub fn hold(&self) -> Hold {
        match self.domain {
            Domain::Time => self.time.hold(),
            Domain::Frequency => self.segments.hold(),
        }
    }

    /// Reads and identifies.
    pub fn identify(&self, hold: Hold) -> Result<Identified, CliError> {
        self.check_options()?;
        let mut records = vec![self.channels.record(&self.input, hold)?];
        for record in &self.more {
            let input = RecordArgs { record: record.clone(), ..self.input.clone() };
            records.push(self.channels.record(&input, hold)?);
        }
        let unknowns = self.mass.unknowns(records[0].held.force.channels())?;
        let fitted = self.fit(&records, &unknowns).map_err(|error| explained(error, &records))?;
        let mut report = report(&records, &fitted)?;
        let validated = self.validation.record(&self.input, &self.channels, fitted.course, hold)?;
        if let Some(recorded) = &validated {
            let (other, system) = (&recorded.held, fitted.estimate.system()?);
            report.validation = Some(Validation::of(recorded, &system, fitted.course)?);
            let of_units = other.of_units.iter().filter(|_| other.file != report.file);
            report.remarks.extend(of_units.cloned());
        }
        let validated = validated.map(Recorded::into_held);
        Ok(Identified { records, validated, fitted, report })
    }

    fn fit(&self, records: &[Recorded], unknowns: &Unknowns) -> Result<Fitted, CliError> {
        let choose = |force: &Record, period: usize| self.choose(force, period);
        match (self.domain, self.from_frf) {
            (Domain::Time, _) => self.time.fit(records, unknowns, self.between_samples),
            (Domain::Frequency, Some(estimator)) => {
                let how = (estimator, &self.segments);
                responses::fit(records, unknowns, choose, how, self.method)
            }
            (Domain::Frequency, None) => {
                let method = self.method.unwrap_or(Method::LeastSquares);
                fit::frequency_domain(records, unknowns, choose, method)
            }
        }
    }

    /// The lines of one period, of so many samples, of a force that are fitted.
    pub fn choose(&self, force: &Record, period: usize) -> Result<Vec<usize>, CliError> {
        choose_lines(force, period, self.lines.as_ref(), self.band_hz)
    }

    /// Refuses what the domain chosen would leave unheard.
    fn check_options(&self) -> Result<(), CliError> {
        let of_time = [self.between_samples.map(|_| "--between-samples"), self.time.given()];
        let of_frequency = [
            self.lines.as_ref().map(|_| "--lines"),
            self.band_hz.map(|_| "--band-hz"),
            self.method.map(|_| "--method"),
            self.from_frf.map(|_| "--from-frf"),
        ];
        let first = |options: &[Option<&'static str>]| options.iter().flatten().next().copied();
        let (misplaced, why) = match self.domain {
            Domain::Frequency => (first(&of_time), "belongs to --domain time"),
            Domain::Time => (first(&of_frequency), "belongs to --domain frequency"),
        };
        let alone =
            (self.from_frf.is_none() && !self.segments.are_periods()).then_some("--segment");
        match misplaced.map(|o| (o, why)).or(alone.map(|o| (o, "belongs to --from-frf"))) {
            Some((option, why)) => Err(CliError::MisplacedOption { option, why }),
            None => Ok(()),
        }
    }
}

impl Identified {
    /// Measured and identified receptance; in the time domain measured and predicted motion of the
    /// first record.
    ///
    /// # Errors
    /// [`CliError::NothingToDraw`] if no receptance can be read off, those of a prediction.
    pub fn picture(&self, title: &str) -> Result<Figure, CliError> {
        if self.fitted.frequency.is_some() {
            return self.receptance(title);
        }
        let system = self.fitted.estimate.system()?;
        let compared = self.fitted.course.predict(&system, &self.records[0].held)?;
        Ok(motion_picture::motion(title, &compared[0]))
    }

    /// Measured and identified receptance.
    ///
    /// # Errors
    /// [`CliError::NoSpectra`] in the time domain, [`CliError::NothingToDraw`].
    pub fn receptance(&self, title: &str) -> Result<Figure, CliError> {
        let (_, data) = self.fitted.frequency.as_ref().ok_or(CliError::NoSpectra)?;
        picture::receptance(title, data, &self.fitted.estimate.system()?)
    }
}

/// Why a fit failed, as far as the channels themselves tell.
fn explained(error: CliError, records: &[Recorded]) -> CliError {
    let CliError::Estimate(error) = error else { return error };
    let seen = records.iter().filter_map(|r| checks::of_channels(&r.held).ok()).flatten();
    let reasons: Vec<String> = seen.map(|finding| finding.to_string()).collect();
    match reasons.is_empty() {
        true => CliError::Estimate(error),
        false => CliError::Unfit { error, reasons: reasons.join("; ") },
    }
}

fn report(records: &[Recorded], fitted: &Fitted) -> Result<Report, CliError> {
    let records: Vec<&Measurement> = records.iter().map(|r| &r.held).collect();
    let estimate = &fitted.estimate;
    let system = estimate.system()?;
    let unexplained_motion = fitted.unexplained_motion(&system)?;
    let row = |r: &&Measurement| RecordRow { file: r.file.clone(), window: Window::of(r) };
    let mut report = Report {
        file: records[0].file.clone(),
        domain: fitted.domain,
        estimator: fitted.estimator,
        window: Window::of(records[0]),
        repeats: fitted.course == Course::Steady,
        lines: fitted.frequency.as_ref().map(|(lines, _)| Lines::of(lines)),
        confidence: CONFIDENCE,
        parameters: parameters(fitted)?,
        modes: estimate.modes()?.iter().map(ModeRow::of).collect::<Result<_, _>>()?,
        fit: Fit {
            nrmse: fitted.nrmse(),
            unexplained_motion,
            misfit_ratio: fitted.misfit.map(|misfit| misfit.ratio),
            condition_number: estimate.condition(),
            equations: fitted.equations,
            unknowns: estimate.parameters().len(),
        },
        records: records.iter().map(row).collect(),
        checks: checks::rows(fitted, &records)?,
        validation: None,
        remarks: Vec::new(),
        system: SystemMatrices::from(&system),
        covariance: covariance(estimate),
    };
    let looked_at = records.iter().filter_map(|record| {
        let (first, last) = (record.first_sample, record.held_to()?);
        let file = &record.file;
        Some(format!("checks of single samples looked at samples {first} to {last} of {file} only"))
    });
    let of_method = of_least_squares(fitted, &report.checks);
    let of_units = records.iter().flat_map(|record| record.of_units.iter().cloned());
    let remarks = of_units.chain(fitted.remarks.iter().cloned()).chain(looked_at);
    report.remarks = remarks.chain(doubts(&report)).chain(of_method).collect();
    Ok(report)
}

/// What a residual that is no noise can come from, where another method would leave less.
pub fn of_least_squares(fitted: &Fitted, checks: &[CheckRow]) -> Option<String> {
    let warned = |when| checks.iter().any(|row| row.when == when && row.is_conspicuous());
    let explained = checks.iter().any(CheckRow::is_bad);
    (fitted.least_squares && warned(When::After) && !warned(When::Before) && !explained).then(|| {
        "least squares takes the measured motion as exact, and noise on it biases the parameters; \
         that alone can be what the warnings after the fit tell of. With --method \
         maximum-likelihood, which allows for noise, they speak of the machine"
            .into()
    })
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

/// What in the numbers themselves speaks against them.
pub fn doubts(report: &Report) -> Vec<String> {
    let mut doubts = Vec::new();
    if let Some(part) = report.fit.unexplained_motion.filter(|part| *part > CONSPICUOUS) {
        doubts.push(format!(
            "the linear model leaves {:.1} % of the motion unexplained: noise, a nonlinearity, a \
             degree of freedom more, or a record that is not periodic",
            100.0 * part
        ));
    }
    for p in report.parameters.iter().filter(|p| p.row == p.column && p.estimate.value < 0.0) {
        doubts.push(format!("{} is negative: no passive machine has that", p.name));
    }
    doubts
}
