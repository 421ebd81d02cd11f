//! `mechid force`: the force that drove a known machine.

pub(super) mod machine;
pub(super) mod method;
pub(super) mod motion;
mod periods;
mod rates;
mod report;
mod stretches;
mod strongest;
mod taken;
mod unexplained;

use std::path::PathBuf;

use clap::Args;
use mechid::force::{IdentifiedForce, Rule, Start};
use mechid::io::LineSpec;

use self::machine::Machine;
use self::method::{Choice, Found, How, Method, Request};
use self::motion::{MotionArgs, Recorded};
use self::rates::Rates;
use self::report::{Chosen, Report};
use self::taken::Taken;
use self::unexplained::Measured;
use crate::error::CliError;
use crate::options::{PlotArgs, RecordArgs, ReportArgs, at_least_one};
use crate::outcome::Outcome;

/// Find the force that drove a known machine from its measured motion
///
/// The window is one or more whole periods if --period or --lines is given (they are averaged), an
/// open record otherwise. Where the machine comes from `mechid identify --json`, its uncertainty
/// counts in the standard error of the force.
///
/// A long text is read a stretch at a time. The methods continuous and discretised hold no open
/// record either; any other method, --spectrum and --plot hold all of it, of the columns used alone.
/// Of whole periods only their mean is held.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify record.csv --force force --displacement displacement --json > machine.json
  mechid force run.csv --system machine.json --displacement displacement --output force.csv
  mechid force run.csv --system rotor.json --displacement x,0 --forced 2 --period 256 \\
      --lines 1:40 --output force.csv --spectrum lines.csv --plot force.svg")]
pub struct ForceArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// The machine: a report of `mechid identify --json`, or a description with a system
    #[arg(long, value_name = "IDENTIFIED.json")]
    system: PathBuf,
    #[command(flatten)]
    motion: MotionArgs,
    /// Degrees of freedom on which a force acts, counted from 1 [default: all]
    #[arg(long, value_name = "DOF,…", value_delimiter = ',', value_parser = at_least_one)]
    forced: Vec<usize>,
    /// How to find the force
    #[arg(long, value_name = "METHOD", value_enum, default_value_t = Method::Auto)]
    method: Method,
    /// Spectral lines with force: all, odd, even, or numbers and ranges first:step:last
    #[arg(long, value_name = "LINES")]
    lines: Option<LineSpec>,
    /// An open record begins at rest
    #[arg(long)]
    at_rest: bool,
    /// Standard deviation of the noise in each measured column, in its unit, before periods are
    /// averaged [default: found]
    #[arg(long, value_name = "LEVEL,…", value_delimiter = ',', allow_negative_numbers = true)]
    noise: Vec<f64>,
    /// How to choose the regularisation parameter
    #[arg(long, value_name = "RULE", value_enum, default_value_t = Choice::Likelihood)]
    rule: Choice,
    /// The regularisation parameter, instead of a rule
    #[arg(long, value_name = "LAMBDA", allow_negative_numbers = true, conflicts_with = "rule")]
    parameter: Option<f64>,
    /// Where the force goes: time, force and standard error, in s and N
    #[arg(long, short, value_name = "FORCE.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Where its spectrum goes, on the lines of --lines or on all: frequency in Hz, amplitude in N,
    /// phase in degrees
    #[arg(long, value_name = "SPECTRUM.csv", help_heading = "Output")]
    spectrum: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl ForceArgs {
    /// Reads, reconstructs, and tells.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let machine = Machine::read(&self.system)?;
        let dofs = machine.system.dof();
        let periodic = self.input.period.is_some() || self.lines.is_some();
        let recorded = self.motion.open(&self.input, dofs, periodic)?;
        let request = self.request(&recorded, dofs, periodic)?;
        let mut taken = Taken::new(recorded.sampling, dofs, periodic, self.output.clone())?;
        let (how, force) = self.find(&request, &machine, &recorded, &mut taken)?;
        let report = self.describe(&machine, &recorded, &request, &how, &taken);
        let mut outcome = Outcome::new(report.text(), &report)?;
        if let Some(file) = taken.finish()? {
            outcome = outcome.with_begun(file);
        }
        let Some(force) = &force else { return Ok(outcome) };
        if let Some(path) = &self.spectrum {
            let file = report::spectrum_file(path, force, request.lines.as_deref())?;
            outcome = outcome.with_begun(file);
        }
        outcome.with_plot(&self.plot, || Ok(report::figure(&how, force, &request.forced)))
    }

    /// The force, a stretch at a time where that will do; only otherwise it is handed over.
    fn find(
        &self,
        request: &Request,
        machine: &Machine,
        recorded: &Recorded,
        taken: &mut Taken,
    ) -> Result<(How, Option<IdentifiedForce>), CliError> {
        let (dofs, samples) = (machine.system.dof(), recorded.sampling.len());
        let (method, why) = method::choose(request, &recorded.channels, samples, dofs);
        let all_at_once = self.spectrum.is_some() || self.plot.plot.is_some();
        let mut rates = Rates::of(&recorded.channels);
        let (mut how, force) = if !all_at_once && stretches::are_enough_for(method, request) {
            stretches::find(request, machine, recorded, method, &mut |stretch, force, kept| {
                rates.push(stretch);
                taken.push(force, kept, !request.noise.is_empty())
            })?;
            (How::of_equation(method, why, request), None)
        } else {
            let held = recorded.hold()?;
            rates.push(&held.motion);
            let Found { force, mut how } = method::find(request, machine, &held.motion)?;
            taken.push_all(&force, how.counts_noise)?;
            how.remarks.extend(periods::remark(recorded, &held));
            periods::tell_noise(how.unexplained.as_mut(), recorded, &held);
            (how, Some(force))
        };
        how.remarks.extend(rates.remarks(recorded.columns()));
        Ok((how, force))
    }

    fn request(
        &self,
        recorded: &Recorded,
        dofs: usize,
        periodic: bool,
    ) -> Result<Request, CliError> {
        let (levels, columns) = (self.noise.len(), recorded.columns().len());
        if levels > 0 && levels != columns {
            return Err(CliError::NoiseCount { levels, columns });
        }
        let lines = self.lines.as_ref().map(|spec| spec.lines(recorded.sampling));
        let rule = match (self.parameter, self.rule) {
            (Some(lambda), _) => Rule::Given(lambda),
            (None, Choice::Likelihood) => Rule::Likelihood,
            (None, Choice::Gcv) => Rule::Gcv,
            (None, Choice::LCurve) => Rule::LCurve,
        };
        Ok(Request {
            method: self.method,
            forced: match self.forced.as_slice() {
                [] => (0..dofs).collect(),
                some => some.iter().map(|dof| dof - 1).collect(),
            },
            lines: lines.transpose()?,
            periodic,
            start: if self.at_rest { Start::FromRest } else { Start::InMotion },
            rule,
            noise: recorded.levels(&self.noise),
            averaged: recorded.periods,
        })
    }

    fn describe(
        &self,
        machine: &Machine,
        recorded: &Recorded,
        request: &Request,
        how: &How,
        taken: &Taken,
    ) -> Report {
        let mut remarks = recorded.of_units().to_vec();
        remarks.extend(taken.remark());
        remarks.extend(how.remarks.iter().cloned());
        let unexplained = how.unexplained.as_deref();
        let channels = Measured::all(recorded, unexplained);
        let dofs = machine.system.dof();
        remarks.extend(unexplained::remark(&channels, unexplained, request, dofs));
        if machine.uncertain.is_some() && !how.counts_noise {
            remarks.push(
                "the standard error counts the uncertainty of the machine, not the noise of the \
                 record: state that with --noise"
                    .to_owned(),
            );
        }
        if machine.uncertain.is_none() {
            remarks.push(
                "the machine is taken as exactly known: its file has no covariance".to_owned(),
            );
        }
        Report {
            file: recorded.file().to_owned(),
            machine: mechid::io::input_name(&self.system),
            method: how.method,
            why: how.why.clone(),
            samples: recorded.sampling.len(),
            periods: request.periodic.then_some(recorded.periods),
            sample_rate_hz: recorded.sampling.rate_hz(),
            machine_uncertainty: machine.uncertain.is_some(),
            noise_uncertainty: how.counts_noise,
            chosen: how
                .chosen
                .iter()
                .map(|(name, value, unit)| Chosen { name: name.clone(), value: *value, unit })
                .collect(),
            channels,
            forces: taken.forces(&request.forced),
            remarks,
        }
    }
}
