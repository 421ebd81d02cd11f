//! A saved result with modes: the output of `--json`, in the form that pages and comparisons read.

use std::path::Path;

use mechid_io::{input_name, read_json};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use super::Diagrams;
use crate::decay;
use crate::identify::rows::Uncertain;
use crate::measurement::Channels;
use crate::modal::{self, ModalSummary, ShapeEntry, ShapedMode};
use crate::{AnalysisError, Machine};

/// Result with modes as `--json` prints it: of a test, a free decay, an identification or a
/// machine.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedModes {
    /// Files of the records, or of the machine.
    #[serde(skip)]
    pub name: String,
    /// Modes by rising frequency.
    pub modes: Vec<SavedMode>,
    /// Records of the result, or tables of frequency responses.
    #[serde(default)]
    pub records: Vec<SavedRecord>,
    /// Record of a free decay.
    #[serde(flatten)]
    record: Option<SavedRecord>,
    /// Names of the forces of a test; empty without forces.
    #[serde(default)]
    pub inputs: Vec<String>,
    #[serde(default)]
    outputs: Vec<SavedResponse>,
    #[serde(default)]
    channels: SavedChannels,
    #[serde(default)]
    response_names: Vec<String>,
    /// SI unit of the responses of a free decay.
    pub unit: Option<String>,
    /// Lowest and highest frequency used, in Hz.
    pub band_hz: Option<[f64; 2]>,
    /// Checks of the data and of the fit.
    #[serde(default)]
    pub checks: Vec<SavedCheck>,
    /// Rejected candidates for modes.
    #[serde(default)]
    pub dropped: Vec<SavedCandidate>,
    /// Remarks to read before using the numbers.
    #[serde(default, alias = "remarks")]
    pub notes: Vec<String>,
    /// Frequency over amplitude of a nonlinear response; `None` for a linear response.
    pub backbone: Option<SavedBackbone>,
    system: Option<serde::de::IgnoredAny>,
    /// Stabilisation diagram and mode indicator, if they were saved.
    pub diagrams: Option<Diagrams>,
    #[serde(default)]
    analysis: SavedAnalysis,
}

/// One mode of a saved result.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedMode {
    /// Frequencies, damping, pole and shape.
    #[serde(flatten)]
    pub mode: ShapedMode,
    #[serde(default)]
    participation: Vec<ShapeEntry>,
    /// Modal phase collinearity of the shape of a test, a pure number from 0 to 1.
    pub phase_collinearity: Option<f64>,
    /// Share of the motion due to the measured forces, a ratio.
    pub driven_share: Option<f64>,
    /// Modal mass for the shape scaled to 1 at its largest entry, in kg.
    pub modal_mass: Option<f64>,
    /// Standard error of the modal mass, in kg.
    pub modal_mass_standard_error: Option<f64>,
    /// Ratio of the sum of squares of this mode to that of all modes of a free decay.
    pub energy_share: Option<f64>,
}

/// Record or table of a saved result.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedRecord {
    /// Name of the file.
    pub file: String,
    /// First sample used, counted from 1; `None` for a table or a machine.
    pub first_sample: Option<usize>,
    /// Last sample used, counted from 1; `None` for a table or a machine.
    pub last_sample: Option<usize>,
    /// Sampling rate, in Hz; `None` for a table or a machine.
    pub sample_rate_hz: Option<f64>,
    /// Number of frequencies of a table; `None` for a record.
    pub frequencies: Option<usize>,
}

/// Response of a test or of a free decay, with its fit.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedResponse {
    /// Name of the column.
    pub column: String,
    /// Share of the variance that the model explains, a ratio.
    #[serde(alias = "variance_explained")]
    pub explained: Option<f64>,
    /// Share of the variance that is predicted, a ratio; `None` without a validation.
    #[serde(alias = "variance_predicted")]
    pub predicted: Option<f64>,
    /// Ratio of the RMS of the sensor noise to the RMS of the response.
    pub noise_share: Option<f64>,
}

/// Responses of a free decay, or names of the channels of an identification.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
enum SavedChannels {
    Responses(Vec<SavedResponse>),
    Names(Channels),
}

impl Default for SavedChannels {
    fn default() -> Self {
        Self::Responses(Vec::new())
    }
}

/// Check of a saved result.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedCheck {
    #[serde(alias = "code")]
    subject: String,
    passed: Option<bool>,
    verdict: Option<String>,
    /// The finding, in a sentence.
    pub text: String,
}

/// Candidate that did not become a mode.
#[derive(Debug, Clone, Deserialize)]
pub struct SavedCandidate {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio, a pure number.
    pub damping_ratio: f64,
    /// Reason, in a sentence.
    pub reason: String,
}

/// Frequency as a function of amplitude: of a free decay (with its damping), or of the modes of a
/// nonlinear machine.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub enum SavedBackbone {
    /// One mode of a free decay.
    Decay(decay::BackboneRow),
    /// Undamped modes of a machine.
    Machine(Vec<modal::BackboneRow>),
}

#[derive(Debug, Clone, Default, Deserialize)]
struct SavedAnalysis {
    #[serde(default)]
    places: SavedPlaces,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct SavedPlaces {
    #[serde(default)]
    responses: Vec<String>,
}

/// Takes a value from the JSON of a result with modes.
///
/// # Errors
/// [`AnalysisError::SavedModes`] if `modes` is not a list, as in the settings of an analysis, or if
/// a field is absent, unknown or of another kind.
pub(super) fn from_json_with_modes<T: DeserializeOwned>(
    name: &str,
    json: serde_json::Value,
) -> Result<T, AnalysisError> {
    let refused = |why: String| AnalysisError::SavedModes { file: name.into(), why };
    if !json["modes"].is_array() {
        let why = "its modes are not a list; if it has the settings of an analysis, give the \
                   result instead: the output of `mechid modes --json`";
        return Err(refused(why.into()));
    }
    // In messages, backticks mark the names of settings, so the names of JSON fields are quoted
    // with ".
    let why = |error: serde_json::Error| {
        error.to_string().replace("missing field", "it lacks the field").replace('`', "\"")
    };
    serde_json::from_value(json).map_err(|error| refused(why(error)))
}

impl SavedModes {
    /// Reads a result, or computes the modes of a described machine.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read, [`AnalysisError::SavedModes`] if it is
    /// not a result with modes, and the errors of [`ModalSummary::from_machine`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, AnalysisError> {
        let path = path.as_ref();
        let json: serde_json::Value = read_json(path)?;
        if json.get("modes").is_some() {
            Self::from_json(&input_name(path), json)
        } else {
            Self::from_result(&ModalSummary::from_machine(&Machine::read(path)?)?)
        }
    }

    /// Takes the modes from the JSON of a result.
    ///
    /// # Errors
    /// [`AnalysisError::SavedModes`] if the JSON has no modes.
    pub fn from_json(name: &str, json: serde_json::Value) -> Result<Self, AnalysisError> {
        let mut saved: Self = from_json_with_modes(name, json)?;
        if saved.records.is_empty() {
            saved.records.extend(saved.record.take());
        }
        let files: Vec<&str> = saved.records.iter().map(|record| record.file.as_str()).collect();
        saved.name = if files.is_empty() { name.into() } else { files.join(", ") };
        Ok(saved)
    }

    /// Takes the modes of a result that `--json` prints.
    ///
    /// # Errors
    /// [`AnalysisError::SavedModes`] if the result has no modes.
    pub fn from_result(result: &impl Serialize) -> Result<Self, AnalysisError> {
        let json = serde_json::to_value(result).map_err(|error| AnalysisError::SavedModes {
            file: "the result".into(),
            why: error.to_string(),
        })?;
        Self::from_json("the result", json)
    }

    /// Returns whether the result has M, C and K.
    pub fn has_system(&self) -> bool {
        self.system.is_some()
    }

    /// Returns the responses of a test or of a free decay; empty for a machine.
    pub fn responses(&self) -> &[SavedResponse] {
        match &self.channels {
            SavedChannels::Responses(channels) if self.outputs.is_empty() => channels,
            _ => &self.outputs,
        }
    }

    /// Returns whether the shapes have their entries at the forces, because more points are struck
    /// than measured.
    fn are_shapes_at_forces(&self) -> bool {
        !self.outputs.is_empty() && self.inputs.len() > self.outputs.len()
    }

    /// Returns the names of the response columns; empty for a machine.
    pub fn columns(&self) -> Vec<String> {
        self.responses().iter().map(|response| response.column.clone()).collect()
    }

    /// Returns the modes with their shapes and the points of the entries: the places of the
    /// responses if they are stated, otherwise the names of the channels.
    pub fn shapes(&self) -> (Vec<ShapedMode>, Vec<String>) {
        let at_forces = self.are_shapes_at_forces();
        let shape = |saved: &SavedMode| {
            let mut mode = saved.mode.clone();
            if at_forces {
                mode.shape.clone_from(&saved.participation);
            }
            mode
        };
        (self.modes.iter().map(shape).collect(), self.points())
    }

    fn points(&self) -> Vec<String> {
        let stated = &self.analysis.places.responses;
        let entries = self.modes.first().map_or(0, |mode| mode.mode.shape.len());
        if self.are_shapes_at_forces() {
            self.inputs.clone()
        } else if !stated.is_empty() {
            stated.clone()
        } else if !self.response_names.is_empty() {
            self.response_names.clone()
        } else if !self.responses().is_empty() {
            self.columns()
        } else if let SavedChannels::Names(names) = &self.channels
            && let Some(kind) = names.first_response()
        {
            (0..entries).map(|dof| names.response_name(kind, dof)).collect()
        } else {
            (1..=entries).map(|number| number.to_string()).collect()
        }
    }
}

impl SavedCheck {
    /// Returns the name of the check as words.
    pub fn subject(&self) -> String {
        self.subject.replace('_', " ")
    }

    /// Returns the verdict: good, doubtful or bad.
    pub fn verdict(&self) -> &str {
        match (self.passed, &self.verdict) {
            (Some(true), _) => "good",
            (None, Some(verdict)) => verdict,
            _ => "doubtful",
        }
    }

    /// Returns the finding; `None` for a check that passed.
    pub fn text_to_show(&self) -> Option<&str> {
        (self.passed != Some(true)).then_some(self.text.as_str())
    }

    /// Returns whether the verdict is not good.
    pub fn is_conspicuous(&self) -> bool {
        self.verdict() != "good"
    }
}

/// Value in a saved result, in which infinite numbers are null.
#[derive(Deserialize)]
pub(crate) struct SavedValue {
    value: Option<f64>,
    #[serde(default)]
    standard_error: Option<f64>,
    #[serde(default)]
    interval: Option<[Option<f64>; 2]>,
}

impl From<SavedValue> for Uncertain {
    fn from(saved: SavedValue) -> Self {
        let interval = saved
            .interval
            .map(|[low, high]| [low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)]);
        // A known value has no interval. An interval without a standard error therefore means an
        // infinite standard error.
        let infinite = interval.map(|_| f64::INFINITY);
        let standard_error = saved.standard_error.or(infinite);
        Self { value: saved.value.unwrap_or(f64::NAN), standard_error, interval }
    }
}

/// Reads a pair of standard errors, in which infinite numbers are null.
pub(crate) fn saved_errors<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[f64; 2]>, D::Error> {
    let pair = Option::<[Option<f64>; 2]>::deserialize(deserializer)?;
    Ok(pair.map(|errors| errors.map(|error| error.unwrap_or(f64::INFINITY))))
}
