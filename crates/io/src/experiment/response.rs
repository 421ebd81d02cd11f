//! The response that an experiment records.

use serde::{Deserialize, Serialize};

/// Kind of the response to the force.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResponseKind {
    /// The periodic steady state.
    #[default]
    Periodic,
    /// Displacement and velocity are zero at the first sample.
    FromRest,
    /// Displacement and velocity are given at the first sample.
    From(InitialMotion),
}

/// Displacement and velocity at the first sample.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitialMotion {
    /// x(0), in m; zero by default.
    #[serde(skip_serializing_if = "PerDof::is_zero")]
    pub displacement: PerDof,
    /// ẋ(0), in m/s; zero by default.
    #[serde(skip_serializing_if = "PerDof::is_zero")]
    pub velocity: PerDof,
}

/// One number per degree of freedom, or a single number for a system with one degree of freedom.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected a number, or a list with one for each degree of freedom")]
pub enum PerDof {
    /// Zero everywhere.
    #[default]
    #[serde(skip)]
    Zero,
    /// One number for the only degree of freedom, in m or m/s.
    One(f64),
    /// One number for each degree of freedom, in m or m/s.
    Each(Vec<f64>),
}

impl PerDof {
    fn is_zero(&self) -> bool {
        *self == Self::Zero
    }

    /// Returns one value for each of `dof` degrees of freedom; if another number of values was
    /// given, the error is that number.
    pub(super) fn values(&self, dof: usize) -> Result<Vec<f64>, usize> {
        match self {
            Self::Zero => Ok(vec![0.0; dof]),
            Self::One(value) if dof == 1 => Ok(vec![*value]),
            Self::One(_) => Err(1),
            Self::Each(values) if values.len() == dof => Ok(values.clone()),
            Self::Each(values) => Err(values.len()),
        }
    }
}
