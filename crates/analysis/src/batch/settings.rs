//! Settings of an identification, with everything needed to read its records.

use std::path::Path;

use mechid_io::read_json;
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_128;

use crate::measurement::{Channels, Measurement, Reading, RecordPlan, Window};
use crate::{AnalysisError, Identify, IdentifyElements, ModesSettings};

/// An identification, or a modal test, to be repeated on many records with the same columns.
///
/// It contains everything except the record: a record and this value determine a result.
///
/// ```
/// use mechid_analysis::{Channels, Measurement, ResponseQuantity, SavedAnalysis, Window};
///
/// let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
/// let analysis = SavedAnalysis {
///     channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
///     window: Window { period: Some(256), ..Window::default() },
///     ..SavedAnalysis::default()
/// };
/// let row = analysis.row("rig", || analysis.open(rig));
/// assert_eq!(row.error, None);
/// assert_eq!(row.parameters[0].name, "m");
/// // A record that cannot be identified gives a row, too.
/// let row = analysis.row("lost", || analysis.open("lost.csv"));
/// assert_eq!(row.error.unwrap().code, "io.read");
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SavedAnalysis {
    /// Columns of force and response.
    pub channels: Channels,
    /// Settings for reading the files.
    pub reading: Reading,
    /// Samples to use of each record.
    pub window: Window,
    /// Settings of the identification.
    pub identify: Identify,
    /// Settings of the identification for a machine of named elements. The names of its sensors and
    /// inputs are the names of the columns, and `channels` and `identify` are not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elements: Option<IdentifyElements>,
    /// Settings of a modal test, which replaces the identification; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modes: Option<ModesSettings>,
    /// Time after which the searches for the result of a record end at their best points so far, in
    /// s; `None` without a limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_limit: Option<f64>,
}

impl SavedAnalysis {
    /// Reads an analysis from a JSON file (`-`: standard input) and checks it.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read or has an invalid field, and the errors of
    /// [`SavedAnalysis::check`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, AnalysisError> {
        let read: Self = read_json(path)?;
        read.check()?;
        Ok(read)
    }

    /// Checks the settings for errors that would prevent the identification of every record.
    ///
    /// # Errors
    /// [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`], [`AnalysisError::ColumnCount`], and
    /// [`AnalysisError::Setting`] for a window that is counted from 0 or has no samples, and for
    /// two kinds of identification at once.
    pub fn check(&self) -> Result<(), AnalysisError> {
        let channels = self.record_channels()?;
        match (&self.elements, &self.modes) {
            (None, None) => channels.check_pairs()?,
            (None, Some(settings)) => settings.check_channels(&channels)?,
            (Some(_), None)
                if self.channels == Channels::default() && self.identify == Identify::default() => {
            }
            (Some(_), _) => {
                let why = "a machine of named elements states its columns and settings itself: leave `channels`, \
                           `identify` and `modes` out";
                return Err(AnalysisError::Setting { setting: "elements", why: why.into() });
            }
        }
        let Window { start, period, periods } = self.window;
        for (setting, count) in [("start", Some(start)), ("period", period), ("periods", periods)] {
            if count == Some(0) {
                let why = "it is counted from 1".into();
                return Err(AnalysisError::Setting { setting, why });
            }
        }
        Ok(())
    }

    /// Returns the columns of a record.
    ///
    /// # Errors
    /// The errors of [`IdentifyElements::channels`].
    pub(crate) fn record_channels(&self) -> Result<Channels, AnalysisError> {
        match &self.elements {
            Some(elements) => elements.channels(),
            None => Ok(self.channels.clone()),
        }
    }

    /// Opens a record with the columns, the reading settings and the window of the analysis.
    ///
    /// # Errors
    /// As [`Measurement::open_with`].
    pub fn open(&self, path: impl AsRef<Path>) -> Result<Measurement, AnalysisError> {
        let plan = RecordPlan {
            path: path.as_ref().to_owned(),
            channels: self.record_channels()?,
            reading: self.reading.clone(),
            window: self.window.clone(),
        };
        plan.open()
    }

    /// Returns a hash of all settings, in hexadecimal digits; rows with equal hashes come from the
    /// same analysis.
    pub fn hash(&self) -> String {
        // Structs of numbers and texts with named fields always have a JSON form.
        let json = serde_json::to_string(self).unwrap_or_default();
        hash(json.as_bytes())
    }
}

/// Returns the hash of some bytes in hexadecimal digits.
pub(crate) fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", XxHash3_128::oneshot(bytes))
}
