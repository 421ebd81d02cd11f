//! Settings of an identification from tables of frequency responses.

use mechid_model::ResponseQuantity;
use serde::{Deserialize, Serialize};

use super::lines::Band;
use super::mass::KnownMass;
use super::options::Method;
use super::structure::Structure;

/// Settings of an identification from tables of frequency responses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifyResponses {
    /// Measured quantity of the responses; `None`: as the table states it.
    pub quantity: Option<ResponseQuantity>,
    /// Number of independent averages in the coherence, a pure number.
    pub averages: Option<f64>,
    /// Points of the responses, one per degree of freedom; empty: all, in the order of the table.
    pub points: Vec<String>,
    /// Frequency band to use; `None`: all frequencies above zero.
    pub band: Option<Band>,
    /// Known masses.
    pub mass: KnownMass,
    /// Form of M, C and K, for instance a chain.
    #[serde(skip_serializing_if = "Structure::is_empty")]
    pub structure: Structure,
    /// Estimator; `None`: maximum likelihood.
    pub method: Option<Method>,
}
