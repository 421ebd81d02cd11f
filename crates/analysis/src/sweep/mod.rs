//! Identification at many sampling steps: which step suits an estimator best.

mod gathered;
mod samples;
pub mod settings;
pub mod summary;

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use mechid_checks::{Verdict, periodicity};
use mechid_estimate::{Sweep, SweepPoint, Unknowns, sweep};
use mechid_io::Experiment;
use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::Record;
use serde::{Deserialize, Serialize};

pub use self::gathered::Estimator;
use self::gathered::{Decimated, EstimatorSums};
use self::samples::Samples;
pub use self::settings::{Kind, Settings};
pub use self::summary::SweepSummary;
use self::summary::{Failure, Point};
use crate::AnalysisError;
use crate::identify::KnownMass;
use crate::measurement::{Block, Measurement, Windowed};

/// Settings of a sweep over the sampling step of an identification.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SweepSettings {
    /// Quantity that is swept.
    pub kind: Kind,
    /// Values of the setting, each positive.
    pub settings: Settings,
    /// Estimator.
    pub estimator: Estimator,
    /// Known masses. `None`: the sweep of a described experiment takes the masses of its
    /// description as known, and the sweep of a record takes all masses as unknown.
    pub mass: Option<KnownMass>,
    /// Natural frequency whose cycles NPI counts, in Hz; `None`: the lowest of the machine.
    pub natural_frequency_hz: Option<f64>,
}

/// Record of a simulated experiment.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// Measured force, samples × degrees of freedom, in N.
    pub force: Record,
    /// Measured response.
    pub response: Response,
    /// `true` if the record is whole periods of a steady state.
    pub whole_periods: bool,
}

/// Callback that simulates an experiment; its error is a sentence.
pub type Simulate<'a> = dyn Fn(&Experiment) -> Result<Simulated, String> + Sync + 'a;

/// Identifies a described experiment at every setting; the errors are deviations from the described
/// machine.
///
/// The number of samples in a period is constant. With NPI, a period contains NPI cycles of the
/// natural frequency, so that the step is 2π NPI / (samples · ωn). `progress` is called after each
/// setting.
///
/// # Errors
/// [`AnalysisError::NoSetting`], [`AnalysisError::EmptySweep`] if no setting gives an estimate, and
/// [`AnalysisError::Simulation`] if the description is invalid.
pub fn sweep_experiment(
    experiment: &Experiment,
    how: &SweepSettings,
    simulate: &Simulate<'_>,
    progress: &(dyn Fn() + Sync),
) -> Result<SweepSummary, AnalysisError> {
    let system = experiment.system()?;
    let natural_frequency_hz = how.natural_frequency(&system)?;
    let unknowns = match &how.mass {
        Some(mass) => mass.unknowns(system.dof())?,
        None => Unknowns::known_mass(system.mass())?,
    };
    let (samples, own_hz) = (experiment.samples(), experiment.force()?.sampling().rate_hz());
    let rate_hz = |setting: f64| match how.kind {
        Kind::Npi => samples as f64 * natural_frequency_hz / setting,
        Kind::RateHz => setting,
        Kind::Decimation => own_hz / setting,
    };
    let run = |setting: &f64| {
        let at = experiment.clone().with_rate_hz(rate_hz(*setting));
        let measured = Samples::simulated(simulate(&at).map_err(AnalysisError::Simulation)?);
        let mut gathered = EstimatorSums::new(how.estimator, &measured, samples, 1)?;
        gathered.push(&measured)?;
        gathered.solve(&unknowns)
    };
    let run = |setting: &f64| run(setting).map_err(Arc::new);
    let swept = sweep(&how.settings.0, Some(&system), run, |_| progress());
    let file = experiment.file().to_owned();
    how.summary(file, samples, &swept, Some(&system), (Some(natural_frequency_hz), &rate_hz))
}

/// Identifies the machine from every n-th sample of a record, without filtering, for every setting.
///
/// Without a reference, the standard errors are compared; they do not include bias. A long text is
/// read once for all settings and not buffered. `progress` is called after each setting.
///
/// # Errors
/// [`AnalysisError::NpiOfRecord`], [`AnalysisError::SweepRate`] or [`AnalysisError::Decimation`]
/// for settings that are impossible with this record, [`AnalysisError::DegreesOfFreedom`] if the
/// reference has another number of degrees of freedom, [`AnalysisError::NoSetting`],
/// [`AnalysisError::EmptySweep`] if no setting gives an estimate.
pub fn sweep_record(
    measurement: &Measurement,
    how: &SweepSettings,
    reference: Option<&SecondOrderSystem>,
    progress: &(dyn Fn() + Sync),
) -> Result<SweepSummary, AnalysisError> {
    let recorded = measurement.hold(how.estimator.hold())?;
    let measured = &recorded.held;
    let dofs = measured.force.channels();
    if let Some(got) = reference.map(SecondOrderSystem::dof).filter(|got| *got != dofs) {
        return Err(AnalysisError::DegreesOfFreedom { file: "the reference".into(), got, dofs });
    }
    let unknowns = match &how.mass {
        Some(mass) => mass.unknowns(dofs)?,
        None => Unknowns::unknown_mass(dofs)?,
    };
    let natural_frequency_hz = match (reference, how.natural_frequency_hz) {
        (Some(system), None) => Some(how.natural_frequency(system)?),
        (_, given) => given,
    };
    let own_hz = measured.force.sampling().rate_hz();
    let decimation = |setting: f64| match how.kind {
        Kind::Npi => Err(AnalysisError::NpiOfRecord),
        Kind::RateHz => settings::whole(own_hz / setting)
            .ok_or(AnalysisError::SweepRate { rate_hz: setting, own_hz }),
        Kind::Decimation => {
            settings::whole(setting).ok_or(AnalysisError::Decimation { value: setting })
        }
    };
    // Refuses impossible settings before the computation.
    let factors = how.settings.0.iter().map(|s| decimation(*s)).collect::<Result<Vec<_>, _>>()?;
    let gathered = gather(&recorded, how.estimator, &factors)?;
    let run = |setting: &f64| {
        let decimated = gathered[&decimation(*setting)?].as_ref().map_err(Arc::clone)?;
        Ok(decimated.solve(&unknowns)?)
    };
    let rate_hz = |setting: f64| match how.kind {
        Kind::RateHz => setting,
        Kind::Npi | Kind::Decimation => own_hz / setting,
    };
    let swept = sweep(&how.settings.0, reference, run, |_| progress());
    let (file, samples) = (measured.file.clone(), measured.period);
    let mut summary =
        how.summary(file, samples, &swept, reference, (natural_frequency_hz, &rate_hz))?;
    summary.remarks.extend(measured.unit_notes());
    summary.remarks.extend(how.estimator.is_of_spectra().then(|| spectra_note(measured)).flatten());
    Ok(summary)
}

/// Returns the note on the spectra: the samples are not whole periods, or only some of them were
/// searched for driven lines.
fn spectra_note(measured: &Block) -> Option<String> {
    if let Some(last) = measured.held_to() {
        let (first, file) = (measured.first_sample, &measured.file);
        return Some(format!(
            "the excited lines were determined from samples {first} to {last} of {file}"
        ));
    }
    let seam = periodicity(measured.response().0);
    (seam.verdict() > Verdict::Good).then(|| {
        format!(
            "the spectra need whole periods, but the {} samples of {} are not whole periods: {seam}; \
             give `period`, or choose an estimator of the time domain",
            measured.period, measured.file
        )
    })
}

/// Reads a record once, and accumulates the sums for every decimation factor in `factors`.
fn gather(
    recorded: &Windowed,
    estimator: Estimator,
    factors: &[usize],
) -> Result<BTreeMap<usize, Result<Decimated, Failure>>, AnalysisError> {
    let buffered = &recorded.held;
    let beginning = Samples::measured(buffered);
    let start = |factor: &usize| {
        let none = Decimated::new(estimator, *factor, buffered, &beginning);
        (*factor, none.map_err(Arc::new))
    };
    let mut gathered: BTreeMap<_, _> = factors.iter().map(start).collect();
    let samples = estimator.chunk(buffered.period);
    recorded.chunks(samples, samples, &mut |chunk| {
        let chunk = Samples::measured(chunk);
        for decimated in gathered.values_mut() {
            // A failure at one setting does not affect the others.
            if let Some(Err(reason)) = decimated.as_mut().ok().map(|d| d.push(&chunk)) {
                *decimated = Err(Arc::new(reason));
            }
        }
        Ok(())
    })?;
    Ok(gathered)
}

impl SweepSettings {
    fn natural_frequency(&self, system: &SecondOrderSystem) -> Result<f64, AnalysisError> {
        if let Some(hz) = self.natural_frequency_hz {
            return Ok(hz);
        }
        let modes = system.modes()?;
        let lowest = modes.iter().map(|m| m.natural_frequency()).fold(f64::INFINITY, f64::min);
        Ok(lowest / TAU)
    }

    fn summary(
        &self,
        file: String,
        samples_per_period: usize,
        swept: &Sweep<f64, Failure>,
        reference: Option<&SecondOrderSystem>,
        (natural_frequency_hz, rate_hz): (Option<f64>, &dyn Fn(f64) -> f64),
    ) -> Result<SweepSummary, AnalysisError> {
        let point = |point: &SweepPoint<f64, Failure>| {
            let step_s = 1.0 / rate_hz(point.setting);
            Point::new(self.kind, point, reference, step_s, natural_frequency_hz)
        };
        let points = swept.points().iter().map(point).collect::<Result<Vec<_>, _>>()?;
        let Some(best) = swept.best().map(|best| best.setting) else {
            return Err(nothing_found(swept));
        };
        Ok(SweepSummary {
            file,
            estimator: self.estimator.name(),
            setting: self.kind,
            samples_per_period,
            natural_frequency_hz,
            confidence: crate::identify::rows::CONFIDENCE,
            points,
            best_setting: best,
            best_npi: (self.kind == Kind::Npi).then_some(best),
            remarks: Vec::new(),
            analysis: self.clone(),
        })
    }
}

/// Returns the error of a sweep without an estimate, with the reason of the failure at the first
/// setting.
fn nothing_found(swept: &Sweep<f64, Failure>) -> AnalysisError {
    let describe = |point: &SweepPoint<f64, Failure>| AnalysisError::EmptySweep {
        setting: point.setting,
        reason: summary::failure(point).unwrap_or_default(),
    };
    swept.points().first().map_or(AnalysisError::NoSetting, describe)
}
