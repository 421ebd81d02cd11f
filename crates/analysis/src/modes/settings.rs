//! Settings of a modal test.

use mechid_model::ResponseQuantity;
use mechid_signal::HitRule;
use serde::{Deserialize, Serialize};

use super::properties::Properties;
use crate::AnalysisError;
use crate::limits::MOST_VALIDATED;
use crate::measurement::Channels;

/// Settings of [`modes`](super::modes()).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModesSettings {
    /// Kind of test.
    pub test: ModalTest,
    /// Lowest and highest frequency to use, in Hz; `None`: the band that the forces excite, or all.
    pub band_hz: Option<[f64; 2]>,
    /// Number of modes; `None`: all significant modes.
    pub modes: Option<usize>,
    /// Maximum number of modes if the number is not given.
    pub max_modes: Option<usize>,
    /// Frequencies, in Hz, of the modes to report (the nearest within 2 %), even if they are weak;
    /// other modes are part of the model, but not reported. A list of any length; empty: all modes.
    pub near_hz: Vec<f64>,
    /// Quantity of the responses of tables that do not state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<ResponseQuantity>,
    /// Points of the forces (one per record for a roving hammer) and of the responses, which define
    /// the driving points and name the entries of the shapes in comparisons; empty: not stated.
    pub places: Places,
    /// Known properties of the structure; none by default.
    #[serde(skip_serializing_if = "Properties::is_empty")]
    pub properties: Properties,
    /// Share at the end of each record, from 0 to 0.8, that a second fit excludes and predicts; 0
    /// for no validation.
    pub validate: f64,
}

/// Points of forces and responses, such as `3` or `12+Z`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Places {
    /// Point of each force column, or of the hammer in each record.
    pub forces: Vec<String>,
    /// Point of each response column.
    pub responses: Vec<String>,
}

/// Kind of a modal test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModalTest {
    /// Test with measured forces of any kind.
    Forced {
        /// Rule that cuts the records into the hits of a hammer; `None`: each record as a whole.
        #[serde(default, deserialize_with = "crate::words::written::optional")]
        hits: Option<HitRule>,
    },
    /// Free decays, one in each record: no force acts, and no force is measured.
    Decay {
        /// Beginning of each decay, in s from the first sample of the window; `None`: detected in
        /// the record.
        #[serde(default)]
        from_s: Option<f64>,
        /// End of the part of each decay that is used, in s from the first sample of the window;
        /// `None`: the end of the window, or the time at which quantisation distorts a channel.
        #[serde(default)]
        to_s: Option<f64>,
    },
    /// Test with unmeasured forces, such as wind or traffic.
    Ambient {
        /// Frequencies, in Hz, of nearby machines; their lines are excluded.
        #[serde(default)]
        without_hz: Vec<f64>,
        /// `true` to exclude the lines of detected harmonics.
        #[serde(default)]
        without_harmonics: bool,
    },
}

impl Default for ModalTest {
    fn default() -> Self {
        Self::Forced { hits: None }
    }
}

impl ModesSettings {
    /// Checks that the record has the columns for this kind of test.
    ///
    /// # Errors
    /// [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`].
    pub(crate) fn check_channels(&self, channels: &Channels) -> Result<(), AnalysisError> {
        if channels.first_response().is_none() {
            return Err(AnalysisError::NoMotion);
        }
        match self.test {
            ModalTest::Forced { .. } if channels.force.is_empty() => Err(AnalysisError::NoForce),
            _ => Ok(()),
        }
    }

    /// Checks the frequency band, and the share of each record that is excluded for the validation.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for an invalid band or share.
    pub(super) fn check(&self) -> Result<(), AnalysisError> {
        if let Some([low, high]) = self.band_hz
            && !(low >= 0.0 && low < high && high.is_finite())
        {
            return Err(self.refused("band_hz", format!("{low} to {high} Hz is not a band")));
        }
        if !(0.0..MOST_VALIDATED).contains(&self.validate) {
            let why = format!(
                "with {} % of each record excluded, too little remains for the fit",
                100.0 * self.validate
            );
            return Err(self.refused("validate_percent", why));
        }
        Ok(())
    }

    /// Returns an error if one of the settings `names`, which do not apply to `what`, is given. The
    /// error names the first of them.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`].
    pub(super) fn refuse(&self, what: &str, names: &[&'static str]) -> Result<(), AnalysisError> {
        let given = [
            ("near_hz", !self.near_hz.is_empty()),
            ("force_at", !self.places.forces.is_empty()),
            ("response_at", !self.places.responses.is_empty()),
            ("validate_percent", self.validate > 0.0),
            ("real_shapes", self.properties.real_shapes),
            ("reciprocal", self.properties.reciprocal),
        ];
        match given.into_iter().find(|(name, given)| *given && names.contains(name)) {
            Some((name, _)) => Err(self.refused(name, format!("it does not apply to {what}"))),
            None => Ok(()),
        }
    }

    /// Returns the error that refuses a setting, with the reason.
    pub(super) fn refused(&self, setting: &'static str, why: String) -> AnalysisError {
        AnalysisError::Setting { setting, why }
    }
}
