//! A simulated experiment described in a JSON file: system, excitation, scheme, noise.

mod excitation;
mod noise;
mod response;
mod scheme;
mod study;

use std::path::Path;

use mechid_model::{InitialState, NonlinearSystem, SecondOrderSystem};
use mechid_signal::{Record, Sampling, message};
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use self::excitation::Excitation;
pub use self::noise::{Level, Noise};
pub use self::response::{InitialMotion, PerDof, ResponseKind};
pub use self::scheme::{
    FirstDisplacements, FirstSteps, HeldOrLinear, LoadBeyond, MiddleLoad, ReturnedAcceleration,
    SchemeChoice, SubStepLoad,
};
pub use self::study::{ExperimentStudy, StudyField, StudyRuns};
use crate::system::{NonlinearDescription, SystemDescription};
use crate::{IoError, escaped, json};

/// A simulated experiment. An unknown field in the file is an error.
///
/// ```
/// use mechid_io::Experiment;
///
/// let experiment = Experiment::parse("machine.json", r#"{
///     "system": { "mass": 10, "damping": 180, "stiffness": 5000 },
///     "sampling": { "samples": 256, "rate_hz": 100 },
///     "excitation": [{ "dof": 1, "lines": "all", "amplitude": 50, "phases": "schroeder-binary" }],
///     "scheme": { "name": "newmark" },
///     "noise": { "displacement": { "snr_db": 40 }, "seed": 1 }
/// }"#)?;
/// assert_eq!(experiment.system()?.dof(), 1);
/// assert_eq!(experiment.force()?.len(), 256);
/// # Ok::<(), mechid_io::IoError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    #[serde(skip)]
    file: String,
    system: SystemDescription,
    #[serde(default)]
    nonlinear: Option<NonlinearDescription>,
    sampling: SamplingDescription,
    #[serde(deserialize_with = "excitation::one_or_more")]
    excitation: Vec<Excitation>,
    /// Scheme that computes the response.
    #[serde(default)]
    pub scheme: SchemeChoice,
    /// Kind of the response: the periodic steady state, or from initial conditions.
    #[serde(default)]
    pub response: ResponseKind,
    /// `true` if unstable time steps are allowed.
    #[serde(default)]
    pub allow_unstable: bool,
    /// Number of periods of the excitation in the record.
    #[serde(default = "one")]
    pub periods: usize,
    /// Noise added to the records.
    pub noise: Option<Noise>,
}

/// Largest number of values in a force record: 800 MB.
const LARGEST: usize = 100_000_000;

fn one() -> usize {
    1
}

/// Number of samples in a period, and their rate.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SamplingDescription {
    samples: usize,
    rate_hz: f64,
}

impl Experiment {
    /// Reads the description of an experiment in a file, or on standard input as `-`.
    ///
    /// # Errors
    /// [`IoError::Read`] if it cannot be read, otherwise as [`Experiment::parse`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        json::read::<Self>(path.as_ref()).map(|(file, experiment)| Self { file, ..experiment })
    }

    /// Reads the description of an experiment in a text; `file` is its name in messages.
    ///
    /// # Errors
    /// [`IoError::NotJson`] for a text of another kind, [`IoError::Json`] with field, line and column
    /// for a wrong description.
    pub fn parse(file: impl Into<String>, text: &str) -> Result<Self, IoError> {
        let file = escaped(&file.into()).into_owned();
        json::parse::<Self>(&file, text).map(|experiment| Self { file, ..experiment })
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the same experiment at another sampling rate, in Hz; the number of samples in a period
    /// stays the same.
    pub fn with_rate_hz(mut self, rate_hz: f64) -> Self {
        self.sampling.rate_hz = rate_hz;
        self
    }

    /// Number of samples in one period.
    pub fn samples(&self) -> usize {
        self.sampling.samples
    }

    /// The system described.
    ///
    /// # Errors
    /// [`IoError::Description`] if parameters are missing or one too many, [`IoError::Model`] if
    /// they make no system.
    pub fn system(&self) -> Result<SecondOrderSystem, IoError> {
        self.system.system(&self.file)
    }

    /// The system with its nonlinear terms, if it has any.
    ///
    /// # Errors
    /// Those of [`Experiment::system`], and [`IoError::Model`] if the terms do not belong to the system.
    pub fn nonlinear_system(&self) -> Result<Option<NonlinearSystem>, IoError> {
        let Some(NonlinearDescription { terms, coefficients, .. }) = &self.nonlinear else {
            return Ok(None);
        };
        let system = NonlinearSystem::new(self.system()?, terms.clone(), coefficients.clone());
        system.map(Some).map_err(|source| IoError::Model { file: self.file.clone(), source })
    }

    /// One period of the force: samples × degrees of freedom, in N.
    ///
    /// # Errors
    /// [`IoError::Description`] for a degree of freedom that the system does not have,
    /// [`IoError::LineOutside`], [`IoError::Signal`], and those of [`Experiment::system`].
    pub fn force(&self) -> Result<Record, IoError> {
        self.sampled(None)
    }

    /// One period of the force at instants within the steps, in N: sample k is at
    /// t = (k + `part`) Δt, `part` being a pure number.
    ///
    /// # Errors
    /// As [`Experiment::force`], and [`IoError::Description`] for a force that is unknown there.
    pub fn force_within_steps(&self, part: f64) -> Result<Record, IoError> {
        self.sampled(Some(part))
    }

    /// The initial state, of a response that is not periodic.
    ///
    /// # Errors
    /// [`IoError::Description`] if it has not one number per degree of freedom, [`IoError::Model`]
    /// for numbers that are not finite, and those of [`Experiment::system`].
    pub fn initial_state(&self) -> Result<InitialState, IoError> {
        let dof = self.system()?.dof();
        let ResponseKind::From(InitialMotion { displacement, velocity }) = &self.response else {
            return Ok(InitialState::rest(dof));
        };
        let vector = |what: &str, given: &PerDof| {
            self.per_dof(&format!("the {what} at the first sample"), given).map(DVector::from_vec)
        };
        let state =
            InitialState::new(vector("displacement", displacement)?, vector("velocity", velocity)?);
        state.map_err(|source| IoError::Model { file: self.file.clone(), source })
    }

    /// One number per degree of freedom of the system, in the unit given; `what` is their name in
    /// messages.
    ///
    /// # Errors
    /// [`IoError::Description`] if there are more or fewer, and those of [`Experiment::system`].
    pub fn per_dof(&self, what: &str, given: &PerDof) -> Result<Vec<f64>, IoError> {
        let dof = self.system()?.dof();
        let wrong = |got| {
            let (got, dof) =
                (message::count(got, "entry"), message::count(dof, "degree of freedom"));
            format!("{what} has {got}, the system has {dof}")
        };
        given.values(dof).map_err(|got| self.wrong(wrong(got)))
    }

    fn sampled(&self, within_step: Option<f64>) -> Result<Record, IoError> {
        let dof = self.system()?.dof();
        let signal = |source| IoError::Signal { file: self.file.clone(), source };
        if self.periods == 0 {
            return Err(self.wrong("periods must be at least 1".into()));
        }
        let SamplingDescription { samples, rate_hz } = self.sampling;
        if !(rate_hz > 0.0 && (1.0 / rate_hz).is_normal()) {
            return Err(IoError::SampleRate { rate_hz });
        }
        let numbers = samples.saturating_mul(dof).saturating_mul(self.periods);
        if numbers > LARGEST {
            return Err(self.wrong(format!(
                "{samples} samples × {} periods × {dof} degrees of freedom are {numbers} numbers, \
                 the limit is {LARGEST}",
                self.periods
            )));
        }
        let sampling = Sampling::from_rate_hz(rate_hz, samples).map_err(signal)?;
        let mut force = DMatrix::zeros(samples, dof);
        for excitation in &self.excitation {
            if !(1..=dof).contains(&excitation.dof) {
                return Err(self.wrong(format!(
                    "the excitation drives degree of freedom {}, the system has {dof}",
                    excitation.dof
                )));
            }
            let part = excitation.sampled(sampling, within_step, &self.file)?;
            force.column_mut(excitation.dof - 1).iter_mut().zip(part).for_each(|(f, p)| *f += p);
        }
        Record::new(sampling, force).map_err(signal)
    }

    fn wrong(&self, what: String) -> IoError {
        IoError::Description { file: self.file.clone(), what }
    }
}
