//! Settings of a bearing test.

use serde::{Deserialize, Serialize};

use crate::AnalysisError;
use crate::identify::LineChoice;

/// Settings of the identification of a bearing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifyBearing {
    /// Mass of the housing with all that moves with it, in kg.
    pub stator_mass: f64,
    /// Speed of rotation, in Hz; its lines and multiples are left out. `None`: the shaft stands still.
    pub rotation_hz: Option<f64>,
    /// Static load of the bearing, in N, for dimensionless coefficients.
    pub load: Option<f64>,
    /// Size of the bearing and its oil.
    pub size: BearingSize,
    /// Coefficients to identify.
    pub coefficients: Coefficients,
    /// Spectral lines to use.
    pub lines: LineChoice,
}

/// Size of a bearing and its oil, as far as it is known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BearingSize {
    /// Radial clearance, in m.
    pub clearance: Option<f64>,
    /// Diameter of the journal, in m.
    pub diameter: Option<f64>,
    /// Length of the bearing, in m.
    pub length: Option<f64>,
    /// Dynamic viscosity of the oil, in Pa·s.
    pub viscosity: Option<f64>,
}

/// Coefficients of a film.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coefficients {
    /// Twelve if a likelihood-ratio test at 5 % finds inertia of the fluid, otherwise eight.
    #[default]
    Automatic,
    /// K and C.
    Eight,
    /// K, C and M.
    Twelve,
}

impl IdentifyBearing {
    /// Checks that every number given is positive and finite.
    pub(super) fn check(&self) -> Result<(), AnalysisError> {
        let size = &self.size;
        for (setting, value) in [
            ("stator_mass", Some(self.stator_mass)),
            ("rotation_hz", self.rotation_hz),
            ("load", self.load),
            ("clearance", size.clearance),
            ("diameter", size.diameter),
            ("length", size.length),
            ("viscosity", size.viscosity),
        ] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                let why = format!(
                    "a positive number is needed, not {}",
                    mechid_signal::message::number(value)
                );
                return Err(AnalysisError::Setting { setting, why });
            }
        }
        Ok(())
    }
}
