//! A simulated experiment described in a JSON file: system, excitation, scheme, noise.

mod excitation;
mod noise;
mod response;
mod scheme;
mod study;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mechid_model::{InitialState, SecondOrderSystem, SparseSystem};
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
use crate::limits::{SIMULATED_BYTES, SIMULATION_MEMORY};
use crate::system::{LoadedSystem, NonlinearDescription, SystemSource, too_many};
use crate::{IoError, escaped, json};

/// Simulated experiment. An unknown field in the file is an error.
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
    /// Paths of the files that the description names.
    #[serde(skip)]
    files: Vec<PathBuf>,
    system: SystemSource,
    /// The machine in sparse matrices, if it is large and sparse.
    #[serde(skip)]
    sparse: Option<SparseSystem>,
    #[serde(default)]
    nonlinear: Option<NonlinearDescription>,
    sampling: SamplingDescription,
    #[serde(deserialize_with = "excitation::one_or_more")]
    excitation: Vec<Excitation>,
    /// Scheme that computes the response.
    #[serde(default)]
    pub scheme: SchemeChoice,
    /// Kind of the response: periodic steady state, or response from initial conditions.
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
    /// Degrees of freedom whose response is recorded, counted from 1; see [`Experiment::outputs`].
    #[serde(default)]
    outputs: Option<Vec<usize>>,
    /// Limit of the memory of a simulation, in units of GB; `None` for the default limit.
    #[serde(skip)]
    memory_gb: Option<f64>,
}

fn one() -> usize {
    1
}

/// Number of samples in a period, and the sampling rate.
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
    /// [`IoError::Read`] if the file cannot be read, otherwise as [`Experiment::parse`]. Names of
    /// other files in the description are relative to the folder of this file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let (file, experiment) = json::read::<Self>(path.as_ref())?;
        experiment.loaded(file, json::folder(path.as_ref()))
    }

    /// Reads the description of an experiment in a text; `file` is its name in messages. The paths
    /// of other files in the description are relative to the current folder.
    ///
    /// # Errors
    /// [`IoError::NotJson`] for a text of another kind, [`IoError::Json`] with field, line and
    /// column for a wrong description, or a wrong system in another file; [`IoError::Read`],
    /// [`IoError::Malformed`], [`IoError::TooLarge`] and [`IoError::Model`] for a Matrix Market
    /// file.
    pub fn parse(file: impl Into<String>, text: &str) -> Result<Self, IoError> {
        let file = escaped(&file.into()).into_owned();
        json::parse::<Self>(&file, text)?.loaded(file, Path::new(""))
    }

    /// Sets the name for messages, and reads the system or its matrices in files relative to
    /// `folder`. Nonlinear terms of the description replace the nonlinear terms of the file with
    /// the system.
    fn loaded(mut self, file: String, folder: &Path) -> Result<Self, IoError> {
        let LoadedSystem { sparse, nonlinear, files } = self.system.load(&file, folder)?;
        let nonlinear = self.nonlinear.take().or(nonlinear);
        Ok(Self { file, sparse, nonlinear, files, ..self })
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Paths of the files that the description names: matrices, and a file with the system.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Returns the same experiment at another sampling rate, in Hz; the number of samples in a
    /// period stays the same.
    pub fn with_rate_hz(mut self, rate_hz: f64) -> Self {
        self.sampling.rate_hz = rate_hz;
        self
    }

    /// Returns the same experiment with another limit of the memory of its simulation, in units of
    /// GB; `None` means the default limit of 1.07 GB.
    pub fn with_memory_gb(mut self, memory_gb: Option<f64>) -> Self {
        self.memory_gb = memory_gb;
        self
    }

    /// Number of samples in one period.
    pub fn samples(&self) -> usize {
        self.sampling.samples
    }

    /// Returns the system.
    ///
    /// # Errors
    /// [`IoError::Description`] if a parameter is missing or redundant, or the system is
    /// [sparse](Experiment::sparse_system); [`IoError::Model`] if the parameters do not form a
    /// valid system.
    pub fn system(&self) -> Result<SecondOrderSystem, IoError> {
        match &self.sparse {
            None => self.system.system(&self.file),
            Some(_) if self.system.lists_rows() => self.system.system(&self.file),
            Some(sparse) => Err(too_many(&self.file, sparse.dof())),
        }
    }

    /// Returns the system in sparse matrices, if it is large: more than 64 degrees of freedom if
    /// Matrix Market files or lists of entries describe it, more than 300 if full matrices do. At
    /// most a tenth of the entries of full matrices may be unequal to zero.
    pub fn sparse_system(&self) -> Option<&SparseSystem> {
        self.sparse.as_ref()
    }

    /// Returns the number of degrees of freedom of the system.
    ///
    /// # Errors
    /// As [`Experiment::system`].
    pub fn dof(&self) -> Result<usize, IoError> {
        match &self.sparse {
            None => Ok(self.system()?.dof()),
            Some(sparse) => Ok(sparse.dof()),
        }
    }

    /// Returns the degrees of freedom, counted from 0, of the force channels: all degrees of
    /// freedom or, for a sparse system, the degrees of freedom with an excitation, in rising order.
    ///
    /// # Errors
    /// [`IoError::Description`] for a degree of freedom that the system does not have, and those of
    /// [`Experiment::system`].
    pub fn forced(&self) -> Result<Vec<usize>, IoError> {
        let dof = self.dof()?;
        for excitation in &self.excitation {
            if !(1..=dof).contains(&excitation.dof) {
                return Err(self.wrong(format!(
                    "the excitation drives degree of freedom {} (counted from 1), but the system has {dof}",
                    excitation.dof
                )));
            }
        }
        if self.sparse.is_none() || self.system.lists_rows() {
            return Ok((0..dof).collect());
        }
        let driven: BTreeSet<usize> =
            self.excitation.iter().map(|excitation| excitation.dof - 1).collect();
        // A zero force gives the record a time axis if no force is described.
        Ok(if driven.is_empty() { vec![0] } else { driven.into_iter().collect() })
    }

    /// Returns the degrees of freedom, counted from 0, whose response is recorded: the described
    /// `outputs`. By default, these are all degrees of freedom or, for a sparse system, the degrees
    /// of freedom with a force.
    ///
    /// # Errors
    /// [`IoError::Description`] for an empty list, for a degree of freedom that the system does not
    /// have or that is named twice, and the errors of [`Experiment::forced`].
    pub fn outputs(&self) -> Result<Vec<usize>, IoError> {
        let Some(outputs) = &self.outputs else { return self.forced() };
        let dof = self.dof()?;
        if outputs.is_empty() {
            return Err(self.wrong("`outputs` is an empty list of degrees of freedom".into()));
        }
        for (place, output) in outputs.iter().enumerate() {
            if !(1..=dof).contains(output) {
                return Err(self.wrong(format!(
                    "`outputs` names degree of freedom {output} (counted from 1), but the system has {dof}"
                )));
            }
            if outputs[..place].contains(output) {
                return Err(self.wrong(format!("`outputs` names degree of freedom {output} twice")));
            }
        }
        Ok(outputs.iter().map(|output| output - 1).collect())
    }

    /// Returns the nonlinear terms of the system with their coefficients, if it has any.
    ///
    /// # Errors
    /// As [`Experiment::dof`], and [`IoError::Model`] if a term does not fit the system.
    pub fn nonlinear(&self) -> Result<Option<&NonlinearDescription>, IoError> {
        let Some(described) = &self.nonlinear else { return Ok(None) };
        let NonlinearDescription { terms, coefficients, .. } = described;
        let fits =
            terms.check_dof(self.dof()?).and_then(|()| terms.check_coefficients(coefficients));
        fits.map_err(|source| IoError::Model { file: self.file.clone(), source })?;
        Ok(Some(described))
    }

    /// Returns one period of the force: samples × [forced](Experiment::forced) degrees of freedom,
    /// in N.
    ///
    /// # Errors
    /// [`IoError::SimulationMemory`], [`IoError::Description`] for a degree of freedom that the
    /// system does not have, [`IoError::LineOutside`], [`IoError::Signal`], and the errors of
    /// [`Experiment::system`].
    pub fn force(&self) -> Result<Record, IoError> {
        self.sampled(None)
    }

    /// Returns one period of the force at instants within the steps, in N: sample k is at t = (k +
    /// `part`) Δt, where `part` is a pure number.
    ///
    /// # Errors
    /// As [`Experiment::force`], and [`IoError::Description`] for a force that is unknown between
    /// samples.
    pub fn force_within_steps(&self, part: f64) -> Result<Record, IoError> {
        self.sampled(Some(part))
    }

    /// Returns the initial state of a response that is not periodic.
    ///
    /// # Errors
    /// [`IoError::Description`] if the number of values differs from the number of degrees of
    /// freedom, [`IoError::Model`] for values that are not finite, and the errors of
    /// [`Experiment::system`].
    pub fn initial_state(&self) -> Result<InitialState, IoError> {
        let dof = self.dof()?;
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

    /// Returns one number per degree of freedom of the system, in the unit given; `what` is their
    /// name in messages.
    ///
    /// # Errors
    /// [`IoError::Description`] if there are more or fewer numbers, and the errors of
    /// [`Experiment::system`].
    pub fn per_dof(&self, what: &str, given: &PerDof) -> Result<Vec<f64>, IoError> {
        let dof = self.dof()?;
        let wrong = |got| {
            let (got, dof) =
                (message::count(got, "entry"), message::count(dof, "degree of freedom"));
            format!("{what} has {got}, but the system has {dof}")
        };
        given.values(dof).map_err(|got| self.wrong(wrong(got)))
    }

    fn sampled(&self, within_step: Option<f64>) -> Result<Record, IoError> {
        let (forced, outputs) = (self.forced()?, self.outputs()?);
        let signal = |source| IoError::Signal { file: self.file.clone(), source };
        if self.periods == 0 {
            return Err(self.wrong("periods must be at least 1".into()));
        }
        let SamplingDescription { samples, rate_hz } = self.sampling;
        if !(rate_hz > 0.0 && (1.0 / rate_hz).is_normal()) {
            return Err(IoError::SampleRate { rate_hz });
        }
        let channels = forced.len().max(outputs.len());
        let numbers = samples.saturating_mul(channels).saturating_mul(self.periods);
        self.check_memory(numbers)?;
        let sampling = Sampling::from_rate_hz(rate_hz, samples).map_err(signal)?;
        let mut force = DMatrix::zeros(samples, forced.len());
        for excitation in &self.excitation {
            let part = excitation.sampled(sampling, within_step, &self.file)?;
            let channel = forced.binary_search(&(excitation.dof - 1));
            let channel = channel.expect("every driven degree of freedom has a channel");
            force.column_mut(channel).iter_mut().zip(part).for_each(|(f, p)| *f += p);
        }
        Record::new(sampling, force).map_err(signal)
    }

    /// Refuses a simulation of `numbers` numbers that needs too much memory.
    fn check_memory(&self, numbers: usize) -> Result<(), IoError> {
        let needed_gb = numbers as f64 * SIMULATED_BYTES as f64 / 1e9;
        let allowed_gb = self.memory_gb.unwrap_or(SIMULATION_MEMORY as f64 / 1e9);
        if needed_gb <= allowed_gb {
            return Ok(());
        }
        let file = self.file.clone();
        Err(IoError::SimulationMemory { file, numbers, needed_gb, allowed_gb })
    }

    fn wrong(&self, what: String) -> IoError {
        IoError::Description { file: self.file.clone(), what }
    }
}
