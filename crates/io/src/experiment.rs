//! A simulated experiment described in a JSON file: system, excitation, scheme, noise.

use std::path::Path;

use mechid_model::SecondOrderSystem;
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::system::SystemDescription;
use crate::{IoError, LineSpec};

/// What to simulate. Every field of the file is one of those below; an unknown one is an error.
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
    sampling: SamplingDescription,
    excitation: Vec<Excitation>,
    /// How the response is computed.
    #[serde(default)]
    pub scheme: SchemeChoice,
    /// Which response: the one that repeats, or the one from rest.
    #[serde(default)]
    pub response: ResponseKind,
    /// Whether a scheme may take steps at which the motion grows by itself.
    #[serde(default)]
    pub allow_unstable: bool,
    /// How many periods of the excitation the record has.
    #[serde(default = "one")]
    pub periods: usize,
    /// Noise added to the records.
    pub noise: Option<Noise>,
}

/// Numbers in the largest force record that is made: 800 MB.
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

/// A multisine on one degree of freedom.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Excitation {
    /// Counted from 1.
    #[serde(default = "one")]
    dof: usize,
    lines: LineSpec,
    /// Amplitude of every line, in N.
    amplitude: f64,
    #[serde(default)]
    phases: PhaseLaw,
    /// Seed of random phases.
    #[serde(default)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PhaseLaw {
    #[default]
    Schroeder,
    SchroederBinary,
    Random,
    Zero,
}

/// How the response to a sampled force is computed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(tag = "name", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SchemeChoice {
    /// No time step at all: line by line through the receptance. Periodic responses only.
    #[default]
    Exact,
    /// Newmark's method; the average acceleration method unless told otherwise.
    Newmark {
        /// β, 1/4 by default.
        #[serde(default = "quarter")]
        beta: f64,
        /// γ, 1/2 by default.
        #[serde(default = "half")]
        gamma: f64,
    },
    /// The central difference method.
    CentralDifference {
        /// Where the displacement before the first sample comes from.
        #[serde(default)]
        start: FirstDisplacements,
    },
    /// Houbolt's method.
    Houbolt {
        /// Where the first two steps come from.
        #[serde(default)]
        start: FirstSteps,
    },
    /// Wilson's θ method.
    WilsonTheta {
        /// θ, 1.4 by default.
        #[serde(default = "wilson")]
        theta: f64,
        /// The force at t + θΔt.
        #[serde(default)]
        load: LoadBeyond,
    },
    /// The classical Runge-Kutta method of fourth order.
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4 {
        /// The force between two samples.
        load: MiddleLoad,
    },
}

fn quarter() -> f64 {
    0.25
}

fn half() -> f64 {
    0.5
}

fn wilson() -> f64 {
    1.4
}

/// The force in the middle of a step, which a sampled force leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MiddleLoad {
    /// The value at the beginning of the step.
    Held,
    /// The mean of both ends.
    Linear,
    /// That of the multisines themselves.
    Exact,
}

/// The displacement before the first sample, for central difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstDisplacements {
    /// By the Taylor step with the consistent acceleration.
    #[default]
    Taylor,
    /// That of the first sample: at rest until then.
    Rest,
}

/// The first two steps of Houbolt's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstSteps {
    /// By Newmark's average acceleration.
    #[default]
    AverageAcceleration,
    /// By central difference.
    CentralDifference,
}

/// The force at t + θΔt, for Wilson's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadBeyond {
    /// On the line through both ends of the step.
    #[default]
    Projected,
    /// Between the samples around it.
    Interpolated,
}

/// Which of the responses to a periodic force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResponseKind {
    /// The steady state: one period is like the next.
    #[default]
    Periodic,
    /// Displacement and velocity are zero at the first sample.
    FromRest,
}

/// White Gaussian noise, independent between channels and records.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// On the force.
    pub force: Option<Level>,
    /// On the displacement.
    pub displacement: Option<Level>,
    /// On the velocity.
    pub velocity: Option<Level>,
    /// On the acceleration.
    pub acceleration: Option<Level>,
    /// Seed of the generator.
    pub seed: u64,
}

/// How strong a noise is.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Standard deviation, in the unit of the record.
    StandardDeviation(f64),
    /// Signal-to-noise ratio, in dB.
    SnrDb(f64),
    /// Standard deviation as a fraction of the RMS value of the channel.
    FractionOfRms(f64),
}

impl From<Level> for NoiseLevel {
    fn from(level: Level) -> Self {
        match level {
            Level::StandardDeviation(value) => NoiseLevel::StandardDeviation(value),
            Level::SnrDb(value) => NoiseLevel::SnrDb(value),
            Level::FractionOfRms(value) => NoiseLevel::FractionOfRms(value),
        }
    }
}

impl Experiment {
    /// The experiment described in a file.
    ///
    /// # Errors
    /// [`IoError::Read`] if it cannot be read, otherwise as [`Experiment::parse`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let file = path.as_ref().display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(file, &text),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// The experiment described by a text; `file` is how messages call it.
    ///
    /// # Errors
    /// [`IoError::Json`] with line and column where the text is no such description.
    pub fn parse(file: impl Into<String>, text: &str) -> Result<Self, IoError> {
        let file = file.into();
        match serde_json::from_str::<Self>(text) {
            Ok(experiment) => Ok(Self { file, ..experiment }),
            Err(source) => Err(IoError::Json { file, source }),
        }
    }

    /// How messages call the file.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The same experiment at another sampling rate, in Hz: the period is so much longer or shorter.
    pub fn with_rate_hz(mut self, rate_hz: f64) -> Self {
        self.sampling.rate_hz = rate_hz;
        self
    }

    /// Samples in one period.
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

    /// One period of the force: samples × degrees of freedom, in N.
    ///
    /// # Errors
    /// [`IoError::Description`] for a degree of freedom that the system does not have,
    /// [`IoError::LineOutside`], [`IoError::Signal`], and those of [`Experiment::system`].
    pub fn force(&self) -> Result<Record, IoError> {
        self.sampled(false)
    }

    /// The same force half a step later, in N: sample k belongs to t = (k + ½) Δt.
    ///
    /// # Errors
    /// As [`Experiment::force`].
    pub fn mid_step_force(&self) -> Result<Record, IoError> {
        self.sampled(true)
    }

    fn sampled(&self, mid_step: bool) -> Result<Record, IoError> {
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
            let lines = excitation.lines.lines(sampling)?;
            let multisine = Multisine::flat(lines, excitation.amplitude, excitation.phases());
            let multisine = multisine.map_err(signal)?;
            let mut channel = force.column_mut(excitation.dof - 1);
            if mid_step {
                for (k, force) in channel.iter_mut().enumerate() {
                    let time = (k as f64 + 0.5) * sampling.dt();
                    *force += multisine.value(time, sampling.omega0());
                }
            } else {
                channel += multisine.sample(sampling).map_err(signal)?.column(0);
            }
        }
        Record::new(sampling, force).map_err(signal)
    }

    fn wrong(&self, what: String) -> IoError {
        IoError::Description { file: self.file.clone(), what }
    }
}

impl Excitation {
    fn phases(&self) -> Phases {
        match self.phases {
            PhaseLaw::Schroeder => Phases::Schroeder,
            PhaseLaw::SchroederBinary => Phases::SchroederBinary,
            PhaseLaw::Random => Phases::Random { seed: self.seed },
            PhaseLaw::Zero => Phases::Zero,
        }
    }
}
