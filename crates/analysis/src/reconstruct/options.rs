//! Settings of a force reconstruction, as values that can be saved and repeated.

use mechid_force::Rule;
use mechid_io::LineSpec;
use serde::{Deserialize, Serialize};

use crate::identify::Band;

/// Settings for the reconstruction of the unknown force on a known machine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reconstruct {
    /// Method.
    pub method: Method,
    /// Degrees of freedom on which a force acts, counted from 1; empty: all.
    pub forced: Vec<usize>,
    /// Spectral lines with force; `None` if unknown.
    pub lines: Option<LineSpec>,
    /// Frequency band of the reconstructed force, limits included. `None`: all frequencies, or, if
    /// no displacement is measured, the frequencies at which the responses show a force.
    pub band_hz: Option<Band>,
    /// `true` if an open record begins at rest.
    pub at_rest: bool,
    /// Standard deviation of the noise in each measured column, in its unit, before periods are
    /// averaged; empty: estimated.
    pub noise: Vec<f64>,
    /// Choice of the regularisation parameter.
    pub rule: ParameterRule,
}

/// Method of a force reconstruction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Chosen automatically for the record.
    #[default]
    Auto,
    /// Equation of motion, sample by sample; needs displacement, velocity and acceleration of every
    /// degree of freedom.
    Continuous,
    /// Exact step from each sample to the next, with a force that is linear between samples; needs
    /// displacement and velocity of every degree of freedom.
    Discretised,
    /// Dynamic stiffness, line by line; needs whole periods.
    FrequencyDomain,
    /// Empirical-Bayes shrinkage (posterior mean of the force), for whole periods or a short
    /// record.
    Shrinkage,
    /// Tikhonov regularisation, for whole periods or a short record.
    Tikhonov,
    /// Truncated singular value decomposition, for whole periods or a short record.
    TruncatedSvd,
    /// Augmented Kalman filter and smoother, for an open record of any length.
    Kalman,
}

/// Choice of the regularisation parameter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ParameterRule {
    /// The λ whose force is closest to the posterior mean of the force; maximum likelihood gives
    /// the variances that this mean needs.
    #[default]
    Likelihood,
    /// Generalised cross-validation.
    Gcv,
    /// Corner of the L-curve.
    LCurve,
    /// A given parameter λ, in the unit of a scaled channel per N.
    Given(f64),
}

impl ParameterRule {
    pub(crate) fn rule(self) -> Rule {
        match self {
            Self::Likelihood => Rule::Likelihood,
            Self::Gcv => Rule::Gcv,
            Self::LCurve => Rule::LCurve,
            Self::Given(lambda) => Rule::Given(lambda),
        }
    }
}

impl Reconstruct {
    /// Returns the settings for an automatic choice of the method.
    pub fn auto() -> Self {
        Self::default()
    }

    /// Returns the settings for one method.
    pub fn by(method: Method) -> Self {
        Self { method, ..Self::default() }
    }

    /// Reconstructs the force only between two frequencies.
    #[must_use]
    pub fn band(self, band_hz: Band) -> Self {
        Self { band_hz: Some(band_hz), ..self }
    }

    /// Reconstructs forces only on these degrees of freedom, counted from 1.
    #[must_use]
    pub fn forced(self, dofs: impl Into<Vec<usize>>) -> Self {
        Self { forced: dofs.into(), ..self }
    }
}
