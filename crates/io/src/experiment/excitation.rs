//! The forces of an experiment, each on one degree of freedom.

use std::fmt;

use mechid_signal::excitation::{HalfSine, Harmonic, Impulse, Prbs, Random, Sweep, SweepLaw};
use mechid_signal::{Multisine, Phases, Record, Sampling, SignalError};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{DeserializeOwned, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::{IoError, LineSpec, json};

/// Force on a degree of freedom: an object with a `kind`, which is `multisine` by default.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Excitation {
    /// Degree of freedom, counted from 1.
    pub dof: usize,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Multisine(MultisineForce),
    Harmonic(HarmonicForce),
    Sweep(SweepForce),
    Prbs(PrbsForce),
    Random(RandomForce),
    Impulse(ImpulseForce),
    HalfSine(HalfSineForce),
}

/// Reads the excitations of a description: a list, or a single one without brackets.
pub(super) fn one_or_more<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Excitation>, D::Error> {
    struct OneOrMore;
    impl<'de> Visitor<'de> for OneOrMore {
        type Value = Vec<Excitation>;

        fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
            to.write_str("a force or a list of forces, each in braces")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, forces: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(forces))
        }

        fn visit_map<A: MapAccess<'de>>(self, force: A) -> Result<Self::Value, A::Error> {
            Ok(vec![Excitation::deserialize(MapAccessDeserializer::new(force))?])
        }
    }
    from.deserialize_any(OneOrMore)
}

/// Names of the kinds of excitation in a description.
const KINDS: &str = "multisine, harmonic, sweep, prbs, random, impulse, half-sine";

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct MultisineForce {
    lines: LineSpec,
    /// Amplitude of every line, in N.
    amplitude: f64,
    #[serde(default, deserialize_with = "json::word")]
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

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct HarmonicForce {
    amplitude: f64,
    frequency_hz: f64,
    #[serde(default)]
    phase_rad: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepForce {
    amplitude: f64,
    start_hz: f64,
    end_hz: f64,
    duration_s: f64,
    #[serde(default, deserialize_with = "json::word")]
    law: Law,
    #[serde(default)]
    ramp_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Law {
    #[default]
    Linear,
    Logarithmic,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct PrbsForce {
    order: u32,
    amplitude: f64,
    #[serde(default = "super::one")]
    hold_samples: usize,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct RandomForce {
    standard_deviation: f64,
    /// Lower and upper end of the band; without a band the noise is white.
    band_hz: Option<[f64; 2]>,
    /// Fraction of the period after which the force is zero.
    burst: Option<f64>,
    #[serde(default)]
    seed: u64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct ImpulseForce {
    /// Momentum (N·s).
    momentum: f64,
    #[serde(default)]
    at_s: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct HalfSineForce {
    peak: f64,
    #[serde(default)]
    start_s: f64,
    duration_s: f64,
}

impl<'de> Deserialize<'de> for Excitation {
    /// Implemented by hand because serde has no default for the tag of an enum.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        fn rest<T: DeserializeOwned, E: serde::de::Error>(
            fields: Map<String, Value>,
        ) -> Result<T, E> {
            serde_path_to_error::deserialize(Value::Object(fields)).map_err(E::custom)
        }
        let wrong = |field: &str, e: serde_json::Error| D::Error::custom(format!("{field}: {e}"));
        let mut fields = Map::deserialize(deserializer)?;
        let dof = match fields.shift_remove("dof") {
            Some(dof) => serde_json::from_value(dof).map_err(|e| wrong("dof", e))?,
            None => 1,
        };
        let kind = match fields.shift_remove("kind") {
            Some(kind) => serde_json::from_value(kind).map_err(|e| wrong("kind", e))?,
            None => "multisine".to_owned(),
        };
        let kind = match kind.as_str() {
            "multisine" => Kind::Multisine(rest(fields)?),
            "harmonic" => Kind::Harmonic(rest(fields)?),
            "sweep" => Kind::Sweep(rest(fields)?),
            "prbs" => Kind::Prbs(rest(fields)?),
            "random" => Kind::Random(rest(fields)?),
            "impulse" => Kind::Impulse(rest(fields)?),
            "half-sine" => Kind::HalfSine(rest(fields)?),
            other => {
                let message =
                    format!("unknown kind of excitation `{other}`, expected one of {KINDS}");
                return Err(D::Error::custom(message));
            }
        };
        Ok(Self { dof, kind })
    }
}

/// Course of the force between two samples.
enum Between {
    /// A function of time.
    Function(Box<dyn Fn(f64) -> f64>),
    /// The value of the earlier sample.
    Held,
    /// Unknown; the text is the name of the force in messages.
    Unknown(&'static str),
}

impl Excitation {
    /// Returns the force over one period, in N. If `within_step` is given, the force is shifted by
    /// this fraction of a step; a shift is an error for a force that is unknown between samples.
    pub fn sampled(
        &self,
        sampling: Sampling,
        within_step: Option<f64>,
        file: &str,
    ) -> Result<Vec<f64>, IoError> {
        let (samples, between) = self.force(sampling, file)?;
        match (between, within_step) {
            (Between::Function(value), Some(part)) => {
                let instants = (0..sampling.len()).map(|k| (k as f64 + part) * sampling.dt());
                Ok(instants.map(value).collect())
            }
            (Between::Unknown(what), Some(_)) => Err(IoError::Description {
                file: file.into(),
                what: format!(
                    "the scheme needs the force between samples, but {what} is defined only at the samples: choose \
                     `load` held or linear"
                ),
            }),
            _ => Ok(samples.channel(0).to_vec()),
        }
    }

    fn force(&self, sampling: Sampling, file: &str) -> Result<(Record, Between), IoError> {
        let lines = match &self.kind {
            Kind::Multisine(m) => m.lines.lines(sampling)?,
            _ => Vec::new(),
        };
        self.kind
            .force(sampling, lines)
            .map_err(|source| IoError::Signal { file: file.into(), source })
    }
}

impl Kind {
    fn force(
        &self,
        sampling: Sampling,
        lines: Vec<usize>,
    ) -> Result<(Record, Between), SignalError> {
        Ok(match self {
            Kind::Multisine(m) => {
                let force = Multisine::flat(lines, m.amplitude, m.phases())?;
                let (samples, omega0) = (force.sample(sampling)?, sampling.omega0());
                (samples, Between::Function(Box::new(move |t| force.value(t, omega0))))
            }
            Kind::Harmonic(h) => {
                let force = Harmonic::new(h.amplitude, h.frequency_hz, h.phase_rad)?;
                (force.sample(sampling)?, Between::Function(Box::new(move |t| force.value(t))))
            }
            Kind::Sweep(s) => {
                let force = s.sweep()?;
                (force.sample(sampling)?, Between::Function(Box::new(move |t| force.value(t))))
            }
            Kind::HalfSine(h) => {
                let force = HalfSine::new(h.peak, h.start_s, h.duration_s)?;
                (force.sample(sampling)?, Between::Function(Box::new(move |t| force.value(t))))
            }
            Kind::Prbs(p) => {
                let force = Prbs::new(p.order, p.amplitude, p.hold_samples)?;
                (force.sample(sampling)?, Between::Held)
            }
            Kind::Random(r) => (r.random()?.sample(sampling)?, Between::Unknown("a random force")),
            Kind::Impulse(i) => {
                let force = Impulse::new(i.momentum, i.at_s)?;
                (force.sample(sampling)?, Between::Unknown("an impulse"))
            }
        })
    }
}

impl MultisineForce {
    fn phases(&self) -> Phases {
        match self.phases {
            PhaseLaw::Schroeder => Phases::Schroeder,
            PhaseLaw::SchroederBinary => Phases::SchroederBinary,
            PhaseLaw::Random => Phases::Random { seed: self.seed },
            PhaseLaw::Zero => Phases::Zero,
        }
    }
}

impl SweepForce {
    fn sweep(&self) -> Result<Sweep, SignalError> {
        let law = match self.law {
            Law::Linear => SweepLaw::Linear,
            Law::Logarithmic => SweepLaw::Logarithmic,
        };
        Sweep::new(self.amplitude, self.start_hz, self.end_hz, self.duration_s, law)?
            .with_ramps(self.ramp_s)
    }
}

impl RandomForce {
    fn random(&self) -> Result<Random, SignalError> {
        let force = match self.band_hz {
            Some([low, high]) => {
                Random::band_limited(self.standard_deviation, low, high, self.seed)?
            }
            None => Random::white(self.standard_deviation, self.seed)?,
        };
        self.burst.map_or(Ok(force), |part| force.burst(part))
    }
}
