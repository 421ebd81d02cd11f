//! Settings of a bearing test.

use serde::{Deserialize, Serialize};

use crate::AnalysisError;
use crate::identify::IdentifyResponses;
use crate::identify::{LeftOut, LineChoice};
use crate::text::compact;

/// Settings of the identification of a bearing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifyBearing {
    /// Mass of the housing with all parts that move with it, in kg.
    pub stator_mass: f64,
    /// Speed of rotation, in Hz; the lines at its multiples are excluded. `None`: the shaft does
    /// not rotate.
    pub rotation_hz: Option<f64>,
    /// Static load of the bearing, in N, for dimensionless coefficients.
    pub load: Option<f64>,
    /// Size of the bearing and its oil.
    pub size: BearingSize,
    /// Coefficients to identify.
    pub coefficients: Coefficients,
    /// Spectral lines to use.
    pub lines: LineChoice,
    /// Lines to exclude in addition to the lines at multiples of the rotation frequency.
    pub without: LeftOut,
    /// Number of independent averages in the coherence that the tables of frequency responses
    /// contain, a pure number that need not be an integer.
    pub averages: Option<f64>,
    /// Points of tables of frequency responses, x before y; empty: all, in the order of the table.
    pub points: Vec<String>,
}

/// Size of a bearing and its oil; unknown values are `None`.
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
    /// Eight coefficients: those of K and C.
    Eight,
    /// Twelve coefficients: those of K, C and M.
    Twelve,
}

impl IdentifyBearing {
    /// Returns the settings for tables of frequency responses.
    pub(super) fn response_settings(&self) -> Result<IdentifyResponses, AnalysisError> {
        let numbered = |setting| {
            let why =
                "the lines of frequency responses have no numbers: choose a band (`band_hz`), or \
                 exclude frequencies (`without_hz`)"
                    .into();
            Err(AnalysisError::Setting { setting, why })
        };
        let band = match &self.lines {
            LineChoice::Driven => None,
            LineChoice::Band(band) => Some(*band),
            LineChoice::Lines(_) => return numbered("lines"),
        };
        if self.without.lines.is_some() {
            return numbered("without_lines");
        }
        let (averages, points) = (self.averages, self.points.clone());
        Ok(IdentifyResponses { averages, points, band, ..IdentifyResponses::default() })
    }

    /// Refuses a speed of rotation above half the sampling rate `rate_hz`: run-out would alias to
    /// other lines, and the speed is probably in another unit.
    pub(super) fn check_rotation(&self, rate_hz: f64) -> Result<(), AnalysisError> {
        let Some(rotation_hz) = self.rotation_hz.filter(|hz| *hz > 0.5 * rate_hz) else {
            return Ok(());
        };
        let why = format!(
            "{} Hz is above half the sampling rate of {} Hz: is the speed in rev/min? Then it is {} Hz",
            compact(rotation_hz, 6),
            compact(rate_hz, 6),
            compact(rotation_hz / 60.0, 6)
        );
        Err(AnalysisError::Setting { setting: "rotation_hz", why })
    }

    /// Checks that every given number is positive and finite.
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
