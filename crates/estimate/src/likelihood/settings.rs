//! Settings of a fit.

use super::LikelihoodError;

/// Source of the noise covariance of the outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum NoiseSource {
    /// Covariance that the data state; if the data state none, it is estimated from the residual.
    #[default]
    Automatic,
    /// Covariance estimated from the residual: white noise of unknown level in every output.
    WhiteResidual,
    /// Covariance estimated from the residual: noise with a smooth unknown spectrum in every
    /// output.
    SmoothResidual,
}

/// Settings of a fit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Settings {
    /// Source of the noise covariance of the outputs.
    pub noise: NoiseSource,
    /// Maximum number of searches: one from the given initial values, the others from random ones.
    pub starts: usize,
    /// Geometric standard deviation of random initial values about the given ones, a factor.
    pub spread: f64,
    /// Seed of the random initial values.
    pub seed: u64,
    /// Confidence level of the intervals, a probability.
    pub confidence: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { noise: NoiseSource::Automatic, starts: 12, spread: 2.0, seed: 0, confidence: 0.95 }
    }
}

impl Settings {
    /// Checks that the numbers are in range.
    pub(super) fn check(&self) -> Result<(), LikelihoodError> {
        let refuse =
            |name, requirement, value| Err(LikelihoodError::Setting { name, requirement, value });
        if !(self.confidence > 0.0 && self.confidence < 1.0) {
            return refuse("confidence", "between 0 and 1", self.confidence);
        }
        if !(self.spread >= 1.0 && self.spread.is_finite()) {
            return refuse("spread", "a factor of at least 1", self.spread);
        }
        Ok(())
    }
}
