//! `mechid sweep`: how an estimator does over a range of sampling steps.

mod gathered;
mod report;
mod samples;
mod settings;

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use indicatif::ProgressBar;
use mechid::estimate::{Estimate, Sweep, SweepPoint, Unknowns, sweep};
use mechid::io::{Experiment, read_system};
use mechid::model::SecondOrderSystem;

use self::gathered::{Estimator, Gathered, Thinned};
use self::report::{Failure, Point, Report};
use self::samples::Samples;
use self::settings::{Kind, SettingArgs};
use super::identify::mass::KnownMass;
use super::identify::measurement::{ChannelArgs, Recorded};
use crate::error::CliError;
use crate::options::{PlotArgs, RecordArgs, ReportArgs};
use crate::outcome::Outcome;

/// Identify a machine at many sampling steps, and find the step that suits the estimator best
///
/// From the description of an experiment (SYSTEM.json, as "mechid simulate" takes it) each setting is
/// simulated: NPI or a rate replaces the sampling rate and the number of samples in a period stays.
/// With NPI a period holds that many cycles of the natural frequency, so that the step is
/// 2π NPI / (samples · ωn). The machine described is the truth that errors are measured against.
///
/// Of a measured record every n-th sample is taken, with nothing filtered; columns and window are
/// chosen as in "mechid identify". Without --reference the standard errors are compared, which know
/// nothing of bias. A long text is gone through once for all settings, a stretch at a time, and not
/// held; of spectra one long period is, and the lines that are driven are found in the first 262144
/// samples.
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
    /// Natural frequency that NPI counts, in Hz [default: the lowest of the machine]
    #[arg(long, value_name = "HZ")]
    natural_frequency_hz: Option<f64>,
    /// How the machine is found
    #[arg(long, value_name = "ESTIMATOR", value_enum, default_value_t = Estimator::Linear)]
    estimator: Estimator,
    /// Find the mass of a described machine, too; without this it is taken from the description
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
    /// The machine that errors of a record's estimates are measured against
    #[arg(long, value_name = "SYSTEM.json")]
    reference: Option<PathBuf>,
    /// Tell of the best setting only, with its intervals (JSON has them for all)
    #[arg(long)]
    best: bool,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl SweepArgs {
    /// Runs all settings and tells which was best.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let described = |ending: &std::ffi::OsStr| ending.eq_ignore_ascii_case("json");
        let report = match self.input.record.extension().is_some_and(described) {
            true => self.over_experiment()?,
            false => self.over_record()?,
        };
        Outcome::new(report.text(self.best), &report)?.with_plot(&self.plot, || Ok(report.figure()))
    }

    fn over_experiment(&self) -> Result<Report, CliError> {
        let why = "belongs to a record; the experiment described has its own";
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
        let system = experiment.system()?;
        let natural_frequency_hz = self.natural_frequency_hz(&system)?;
        let unknowns = match (&self.mass, self.unknown_mass) {
            (Some(mass), _) => mass.unknowns(system.dof())?,
            (None, true) => Unknowns::unknown_mass(system.dof())?,
            (None, false) => Unknowns::known_mass(system.mass())?,
        };
        let (samples, own_hz) = (experiment.samples(), experiment.force()?.sampling().rate_hz());
        let (kind, settings) = self.settings.chosen();
        let rate_hz = |setting: f64| match kind {
            Kind::Npi => samples as f64 * natural_frequency_hz / setting,
            Kind::RateHz => setting,
            Kind::Decimation => own_hz / setting,
        };
        let run = |setting: &f64| {
            let at = experiment.clone().with_rate_hz(rate_hz(*setting));
            let measured = Samples::simulated(&at)?;
            let mut gathered = Gathered::new(self.estimator, &measured, samples, 1)?;
            gathered.push(&measured)?;
            gathered.solve(&unknowns)
        };
        let found = self.sweep(settings, Some(&system), |setting| run(setting).map_err(Arc::new));
        let file = experiment.file().to_owned();
        let hz = Some(natural_frequency_hz);
        self.report(file, samples, &found, Some(&system), (hz, &rate_hz))
    }

    fn over_record(&self) -> Result<Report, CliError> {
        let recorded = self.channels.record(&self.input, self.estimator.hold())?;
        let measured = &recorded.held;
        let unknowns = match &self.mass {
            Some(mass) => mass.unknowns(measured.force.channels())?,
            None => Unknowns::unknown_mass(measured.force.channels())?,
        };
        let reference = self.reference.as_ref().map(read_system).transpose()?;
        let natural_frequency_hz = match (&reference, self.natural_frequency_hz) {
            (Some(system), None) => Some(self.natural_frequency_hz(system)?),
            (_, given) => given,
        };
        let own_hz = measured.force.sampling().rate_hz();
        let (kind, settings) = self.settings.chosen();
        let decimation = |setting: f64| match kind {
            Kind::Npi => Err(CliError::MisplacedOption {
                option: "--npi",
                why: "belongs to the description of an experiment: a record has its rate; --decimate \
                      takes every n-th sample",
            }),
            Kind::RateHz => settings::whole(own_hz / setting)
                .ok_or(CliError::SweepRate { rate_hz: setting, own_hz }),
            Kind::Decimation => {
                settings::whole(setting).ok_or(CliError::Decimation { value: setting })
            }
        };
        // What cannot be taken from this record at all is said before anything runs.
        let factors = settings.iter().map(|s| decimation(*s)).collect::<Result<Vec<_>, _>>()?;
        let gathered = self.gather(&recorded, &factors)?;
        let run = |setting: &f64| {
            let thinned = gathered[&decimation(*setting)?].as_ref().map_err(Arc::clone)?;
            Ok(thinned.solve(&unknowns)?)
        };
        let rate_hz = |setting: f64| match kind {
            Kind::RateHz => setting,
            Kind::Npi | Kind::Decimation => own_hz / setting,
        };
        let found = self.sweep(settings, reference.as_ref(), run);
        let (file, samples) = (measured.file.clone(), measured.period);
        let how = (natural_frequency_hz, &rate_hz as &dyn Fn(f64) -> f64);
        let mut report = self.report(file, samples, &found, reference.as_ref(), how)?;
        report.remarks.extend(measured.of_units.clone());
        if let (true, Some(last)) = (self.estimator.is_of_spectra(), measured.held_to()) {
            let (first, file) = (measured.first_sample, &measured.file);
            report.remarks.push(format!(
                "the lines that are driven were found in samples {first} to {last} of {file}"
            ));
        }
        Ok(report)
    }

    /// Goes through a record once, for all of these decimations.
    fn gather(
        &self,
        recorded: &Recorded,
        factors: &[usize],
    ) -> Result<BTreeMap<usize, Result<Thinned, Failure>>, CliError> {
        let (held, estimator) = (&recorded.held, self.estimator);
        let beginning = Samples::measured(held);
        let start = |factor: &usize| {
            let none = Thinned::new(estimator, *factor, held, &beginning);
            (*factor, none.map_err(Arc::new))
        };
        let mut gathered: BTreeMap<_, _> = factors.iter().map(start).collect();
        let samples = estimator.stretch(held.period);
        recorded.stretches(samples, samples, &mut |stretch| {
            let stretch = Samples::measured(stretch);
            for thinned in gathered.values_mut() {
                // What goes wrong at one setting leaves the others alone.
                if let Some(Err(reason)) = thinned.as_mut().ok().map(|t| t.push(&stretch)) {
                    *thinned = Err(Arc::new(reason));
                }
            }
            Ok(())
        })?;
        Ok(gathered)
    }

    fn natural_frequency_hz(&self, system: &SecondOrderSystem) -> Result<f64, CliError> {
        if let Some(hz) = self.natural_frequency_hz {
            return Ok(hz);
        }
        let modes = system.modes()?;
        let lowest = modes.iter().map(|m| m.natural_frequency()).fold(f64::INFINITY, f64::min);
        Ok(lowest / TAU)
    }

    fn sweep(
        &self,
        settings: &[f64],
        reference: Option<&SecondOrderSystem>,
        run: impl Fn(&f64) -> Result<Estimate, Failure> + Sync,
    ) -> Sweep<f64, Failure> {
        let bar = match self.report.quiet {
            true => ProgressBar::hidden(),
            // Hides itself where nobody watches.
            false => ProgressBar::new(settings.len() as u64),
        };
        let found = sweep(settings, reference, run, |_| bar.inc(1));
        bar.finish_and_clear();
        found
    }

    fn report(
        &self,
        file: String,
        samples_per_period: usize,
        found: &Sweep<f64, Failure>,
        reference: Option<&SecondOrderSystem>,
        (natural_frequency_hz, rate_hz): (Option<f64>, &dyn Fn(f64) -> f64),
    ) -> Result<Report, CliError> {
        let (kind, _) = self.settings.chosen();
        let point = |point: &SweepPoint<f64, Failure>| {
            Point::new(kind, point, reference, 1.0 / rate_hz(point.setting), natural_frequency_hz)
        };
        let points = found.points().iter().map(point).collect::<Result<Vec<_>, _>>()?;
        let Some(best) = found.best().map(|best| best.setting) else {
            return Err(nothing_found(found));
        };
        Ok(Report::new(
            file,
            self.estimator,
            kind,
            samples_per_period,
            natural_frequency_hz,
            points,
            best,
        ))
    }
}

/// What went wrong at the first setting, in its own words.
fn nothing_found(found: &Sweep<f64, Failure>) -> CliError {
    let describe = |point: &SweepPoint<f64, Failure>| CliError::EmptySweep {
        setting: point.setting,
        reason: report::failure(point).unwrap_or_default(),
    };
    found.points().first().map_or(CliError::NothingToDraw, describe)
}
