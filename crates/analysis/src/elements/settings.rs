//! Settings of the identification of a machine of named elements.

use mechid_estimate::likelihood::{NoiseSource, Settings};
use mechid_model::ResponseQuantity;
use mechid_model::elements::{Input, InstrumentedMachine};
use mechid_signal::HitRule;
use mechid_spectra::Pooling;
use serde::{Deserialize, Serialize};

use super::ElementData;
use crate::AnalysisError;
use crate::identify::{Band, Disturbance};
use crate::measurement::Channels;

/// Settings of the identification of a machine of named elements.
///
/// A record is read as whole periods if its window has a `period`, otherwise as an open record.
/// With `hits`, every good hit of a hammer is an open record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentifyElements {
    /// The machine with its sensors and inputs.
    pub machine: InstrumentedMachine,
    /// Frequencies to use; `None`: those that the inputs excite.
    #[serde(default)]
    pub band: Option<Band>,
    /// Frequencies of excluded lines.
    #[serde(default)]
    pub without_hz: Vec<Disturbance>,
    /// Rule for the division of records of a hammer test into hits.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::words::written::optional"
    )]
    pub hits: Option<HitRule>,
    /// Noise spectrum that weights the lines.
    #[serde(default)]
    pub noise: Pooling,
    /// Standard deviation of the noise on the samples of the forces, in N: one value for all forces
    /// or one value for each. The setting applies to open records and hits. `None`: the noise is
    /// estimated above the band that the forces drive, or between the hits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_noise: Option<Vec<f64>>,
    /// Maximum number of searches: one from the given initial values, the others from random ones.
    #[serde(default = "usual_starts")]
    pub starts: usize,
    /// Seed of the random initial values.
    #[serde(default)]
    pub seed: u64,
    /// Confidence level of the intervals, a probability.
    #[serde(default = "usual_confidence")]
    pub confidence: f64,
}

fn usual_starts() -> usize {
    Settings::default().starts
}

fn usual_confidence() -> f64 {
    Settings::default().confidence
}

impl IdentifyElements {
    /// Creates the default settings for a machine with its sensors and inputs.
    pub fn new(machine: InstrumentedMachine) -> Self {
        Self {
            machine,
            band: None,
            without_hz: Vec::new(),
            hits: None,
            noise: Pooling::Automatic,
            force_noise: None,
            starts: usual_starts(),
            seed: 0,
            confidence: usual_confidence(),
        }
    }

    /// Returns the columns of a record: the names of the sensors and of the inputs.
    ///
    /// # Errors
    /// [`AnalysisError::Likelihood`] if the description of the machine does not make sense,
    /// [`AnalysisError::Setting`] if an input is an unbalance, because no record contains an
    /// unbalance.
    pub fn channels(&self) -> Result<Channels, AnalysisError> {
        self.machine.assembly().map_err(AnalysisError::machine)?;
        let mut channels = Channels::default();
        for sensor in &self.machine.instruments.sensors {
            group(&mut channels, sensor.quantity).push(sensor.name.clone());
        }
        for input in &self.machine.instruments.inputs {
            match input {
                Input::Force { name, .. } => channels.force.push(name.clone()),
                Input::Support { name, quantity } => {
                    group(&mut channels, *quantity).push(name.clone());
                }
                Input::Unbalance { name, .. } => {
                    let why = format!(
                        "input {name:?} is an unbalance, and a record has no column for it: give a table \
                         over the speed (`speed_table`)"
                    );
                    return Err(AnalysisError::Setting { setting: "machine", why });
                }
            }
        }
        Ok(channels)
    }

    /// Checks that no noise of the forces is stated for data that do not use it.
    pub(super) fn refuse_force_noise(&self, of: &str) -> Result<(), AnalysisError> {
        match self.force_noise {
            None => Ok(()),
            Some(_) => {
                let why = format!("the setting applies to open records and hits, not to {of}");
                Err(AnalysisError::Setting { setting: "force_noise", why })
            }
        }
    }

    /// Returns the settings of the likelihood.
    pub(super) fn likelihood(&self, data: &ElementData) -> Settings {
        let noise = match (data.source, self.noise) {
            (None, Pooling::AllLines) => NoiseSource::WhiteResidual,
            (None, _) => NoiseSource::SmoothResidual,
            (Some(_), _) => NoiseSource::Automatic,
        };
        let (starts, seed, confidence) = (self.starts, self.seed, self.confidence);
        Settings { noise, starts, seed, confidence, ..Settings::default() }
    }
}

fn group(channels: &mut Channels, quantity: ResponseQuantity) -> &mut Vec<String> {
    match quantity {
        ResponseQuantity::Displacement => &mut channels.displacement,
        ResponseQuantity::Velocity => &mut channels.velocity,
        ResponseQuantity::Acceleration => &mut channels.acceleration,
    }
}
