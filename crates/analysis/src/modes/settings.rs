//! Settings of a modal test.

use mechid_model::ResponseQuantity;
use mechid_signal::HitRule;
use serde::{Deserialize, Serialize};

use crate::AnalysisError;
use crate::limits::MOST_VALIDATED;
use crate::measurement::Channels;

/// Settings of [`modes`](super::modes()).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModesSettings {
    /// Kind of test.
    pub test: ModalTest,
    /// Lowest and highest frequency to use, in Hz; `None`: the band that the forces drive, or all.
    pub band_hz: Option<[f64; 2]>,
    /// Number of modes; `None`: as many as the record shows.
    pub modes: Option<usize>,
    /// Largest number of modes where the number is not given.
    pub max_modes: Option<usize>,
    /// Frequencies, in Hz, near which a mode is looked for whatever the start shows; a list of any
    /// length.
    pub near_hz: Vec<f64>,
    /// Quantity of the responses of tables that do not state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<ResponseQuantity>,
    /// Places of the forces, one each (of a roving hammer one per record), and of the responses, by
    /// which a driving point is known; empty: not stated.
    pub places: Places,
    /// Share of each record, at its end, from 0 to 0.8, that is kept out of a second fit and
    /// predicted by it; 0 for no such test.
    pub validate: f64,
}

/// Places of forces and responses, such as `3` or `12+Z`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Places {
    /// Place of each force column, or of the struck point of each record.
    pub forces: Vec<String>,
    /// Place of each response column.
    pub responses: Vec<String>,
}

/// Kind of a modal test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModalTest {
    /// Forces are measured, whatever they are.
    Forced {
        /// Cuts the records into the hits of a hammer by this rule; `None`: each record as a whole.
        #[serde(default, deserialize_with = "crate::words::written::optional")]
        hits: Option<HitRule>,
    },
    /// Forces act that are not measured, such as wind or traffic.
    Ambient {
        /// Frequencies, in Hz, of machines nearby, whose lines are left out.
        #[serde(default)]
        without_hz: Vec<f64>,
        /// `true` to leave out the harmonics that are found.
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
    /// Checks that there are the columns that the kind of test needs.
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

    /// # Errors
    /// [`AnalysisError::Setting`] for a band or a share that is none.
    pub(super) fn check(&self) -> Result<(), AnalysisError> {
        if let Some([low, high]) = self.band_hz
            && !(low >= 0.0 && low < high && high.is_finite())
        {
            return Err(self.refused("band_hz", format!("{low} to {high} Hz is no band")));
        }
        if !(0.0..MOST_VALIDATED).contains(&self.validate) {
            let why = format!("{} % of a record leaves too little to fit", 100.0 * self.validate);
            return Err(self.refused("validate_percent", why));
        }
        Ok(())
    }

    /// Returns the error of a setting.
    pub(super) fn refused(&self, setting: &'static str, why: String) -> AnalysisError {
        AnalysisError::Setting { setting, why }
    }
}
