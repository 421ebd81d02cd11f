//! Noise on the records of an experiment.

use mechid_signal::NoiseLevel;
use serde::Deserialize;

/// White Gaussian noise, independent between channels and records.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Noise on the force.
    pub force: Option<Level>,
    /// Noise on the displacement.
    pub displacement: Option<Level>,
    /// Noise on the velocity.
    pub velocity: Option<Level>,
    /// Noise on the acceleration.
    pub acceleration: Option<Level>,
    /// Seed of the generator.
    pub seed: u64,
}

/// Level of a noise.
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
