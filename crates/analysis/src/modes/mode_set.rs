//! Sets of modes to compare: a result, a saved result, a machine, or a finite-element model.

use std::path::Path;

use mechid_io::{NodalModes, input_name, read_json};
use mechid_modal::compare::{ComparedMode, Measured};
use mechid_modal::indicators::ShapeWithCovariance;
use nalgebra::{Complex, DMatrix, DVector};
use serde::Deserialize;

use super::SavedModes;
use super::saved::from_json_with_modes;
use super::summary::ModesSummary;
use crate::modal::{ModalSummary, ShapedMode};
use crate::{AnalysisError, Machine};

/// Modes with the points of their shapes.
#[derive(Debug, Clone)]
pub struct ModeSet {
    /// Name for messages, such as the file.
    pub name: String,
    /// Points and directions of the entries of each shape, such as `3` or `12+Z`.
    pub points: Vec<String>,
    /// Modes that oscillate, by rising frequency.
    pub modes: Vec<ComparedMode>,
}

/// Modes given by frequencies and shapes, such as the modes of a finite-element model. Unknown
/// fields are refused, because they may be misspelt.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainModes {
    modes: Vec<PlainMode>,
    #[serde(default)]
    response_names: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainMode {
    natural_frequency_hz: PlainValue,
    #[serde(default)]
    damping_ratio: Option<PlainValue>,
    shape: Vec<PlainEntry>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainValue {
    value: f64,
    #[serde(default)]
    standard_error: Option<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainEntry {
    value: [f64; 2],
    #[serde(default)]
    standard_error: Option<[f64; 2]>,
}

impl PlainValue {
    fn measured(self) -> Measured {
        Measured::new(self.value, self.standard_error.unwrap_or(0.0))
    }
}

impl ModeSet {
    /// Reads modes: what `mechid modes --json` or `mechid identify --json` printed, the description
    /// of a machine, or the datasets 55 of a universal file.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read or understood,
    /// [`AnalysisError::NothingToCompare`] without a mode that oscillates.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, AnalysisError> {
        let path = path.as_ref();
        let name = input_name(path);
        match read_json::<serde_json::Value>(path) {
            Err(mechid_io::IoError::NotJson { .. }) => Self::from_nodal(&NodalModes::read(path)?),
            Err(error) => Err(error.into()),
            Ok(json) if json.get("modes").is_some() => Self::from_json(&name, json),
            Ok(_) => Self::from_machine(&ModalSummary::from_machine(&Machine::read(path)?)?),
        }
    }

    /// Takes modes from the JSON of a result, or from a JSON that has only frequencies and shapes.
    ///
    /// # Errors
    /// [`AnalysisError::SavedModes`] if the JSON has no modes, or an unknown field in addition to
    /// frequencies and shapes, [`AnalysisError::NothingToCompare`].
    pub fn from_json(name: &str, json: serde_json::Value) -> Result<Self, AnalysisError> {
        // Every mode of a result has an eigenvalue, so modes without an eigenvalue are given by
        // frequencies and shapes only.
        if json["modes"].get(0).is_none_or(|mode| mode.get("eigenvalue").is_some()) {
            let (modes, points) = SavedModes::from_json(name, json)?.shapes();
            return Self::from_shaped(name, points, &modes);
        }
        let plain: PlainModes = from_json_with_modes(name, json)?;
        let modes = plain.modes.into_iter().map(|mode| {
            let damping_ratio = mode.damping_ratio.map(PlainValue::measured);
            (mode.natural_frequency_hz.measured(), damping_ratio, mode.shape)
        });
        Self::new(name, plain.response_names, modes)
    }

    /// Takes the modes of a test. The points are the stated points of the responses or, if none are
    /// stated, the names of the columns.
    ///
    /// # Errors
    /// [`AnalysisError::NothingToCompare`].
    pub fn from_summary(summary: &ModesSummary) -> Result<Self, AnalysisError> {
        let files: Vec<&str> = summary.records.iter().map(|record| record.file.as_str()).collect();
        let (modes, mut points) = summary.shapes();
        let places = &summary.analysis.places.responses;
        if !places.is_empty() && summary.inputs.len() <= summary.outputs.len() {
            points.clone_from(places);
        }
        Self::from_shaped(&files.join(", "), points, &modes)
    }

    /// Takes the modes of a machine.
    ///
    /// # Errors
    /// [`AnalysisError::NothingToCompare`].
    pub fn from_machine(summary: &ModalSummary) -> Result<Self, AnalysisError> {
        Self::from_shaped(&summary.file, summary.response_names.clone(), &summary.modes)
    }

    /// Takes modes with the names of the entries of their shapes.
    ///
    /// # Errors
    /// [`AnalysisError::NothingToCompare`].
    pub fn from_shaped(
        name: &str,
        points: Vec<String>,
        modes: &[ShapedMode],
    ) -> Result<Self, AnalysisError> {
        let measured = |value: &crate::identify::rows::Uncertain| {
            Measured::new(value.value, value.standard_error.unwrap_or(0.0))
        };
        let modes = modes.iter().filter(|mode| mode.row.oscillates).map(|mode| {
            let entry = |entry: &crate::modal::ShapeEntry| PlainEntry {
                value: entry.value,
                standard_error: entry.standard_error,
            };
            (
                measured(&mode.row.natural_frequency_hz),
                Some(measured(&mode.row.damping_ratio)),
                mode.shape.iter().map(entry).collect(),
            )
        });
        Self::new(name, points, modes)
    }

    /// Takes the modes of a universal file as exactly known.
    ///
    /// # Errors
    /// [`AnalysisError::NothingToCompare`].
    pub fn from_nodal(nodal: &NodalModes) -> Result<Self, AnalysisError> {
        let exact = |value: f64| Measured::new(value, 0.0);
        let modes = nodal.modes.iter().map(|mode| {
            let entry = |z: &Complex<f64>| PlainEntry { value: [z.re, z.im], standard_error: None };
            // A file of undamped modes has a damping of zero, which is not a value to compare.
            let damping_ratio = Some(mode.damping_ratio).filter(|ratio| *ratio != 0.0).map(exact);
            (exact(mode.frequency_hz), damping_ratio, mode.shape.iter().map(entry).collect())
        });
        Self::new(&nodal.file, nodal.points.clone(), modes)
    }

    fn new(
        name: &str,
        points: Vec<String>,
        modes: impl Iterator<Item = (Measured, Option<Measured>, Vec<PlainEntry>)>,
    ) -> Result<Self, AnalysisError> {
        let nothing = || AnalysisError::NothingToCompare { file: name.into() };
        let mut compared = Vec::new();
        for (natural_frequency_hz, damping_ratio, shape) in modes {
            if !(natural_frequency_hz.value > 0.0 && natural_frequency_hz.value.is_finite()) {
                continue;
            }
            let shape = with_covariance(&shape)?;
            compared.push(ComparedMode { natural_frequency_hz, damping_ratio, shape });
        }
        let entries = compared.first().ok_or_else(nothing)?.shape.shape().len();
        let points = match points.len() {
            0 => (1..=entries).map(|number| number.to_string()).collect(),
            len if len == entries => points,
            len => {
                let why = format!(
                    "{len} names of points, but each mode shape has {entries} entries: give one name per entry"
                );
                return Err(AnalysisError::SavedModes { file: name.into(), why });
            }
        };
        if compared.iter().any(|mode| mode.shape.shape().len() != entries) {
            return Err(nothing());
        }
        compared
            .sort_by(|a, b| a.natural_frequency_hz.value.total_cmp(&b.natural_frequency_hz.value));
        Ok(Self { name: name.into(), points, modes: compared })
    }

    /// Returns the modes at some of the points. Each entry is the index of a point, and a sign; the
    /// value at the point is multiplied by this sign.
    pub(super) fn at(&self, entries: &[(usize, f64)]) -> Result<Vec<ComparedMode>, AnalysisError> {
        let restrict = |mode: &ComparedMode| {
            let (shape, covariance) = (mode.shape.shape(), mode.shape.covariance());
            let (total, len) = (shape.len(), entries.len());
            let values = entries.iter().map(|(at, sign)| shape[*at] * *sign);
            let values = DVector::from_iterator(len, values);
            let source = |row: usize| {
                let (at, sign) = entries[row % len];
                (if row < len { at } else { total + at }, sign)
            };
            let covariance = DMatrix::from_fn(2 * len, 2 * len, |row, column| {
                let ((i, a), (j, b)) = (source(row), source(column));
                a * b * covariance[(i, j)]
            });
            let shape = ShapeWithCovariance::new(values, covariance)?;
            Ok(ComparedMode { shape, ..mode.clone() })
        };
        self.modes.iter().map(restrict).collect()
    }
}

/// Returns a shape with independent errors of real and imaginary parts.
fn with_covariance(shape: &[PlainEntry]) -> Result<ShapeWithCovariance, AnalysisError> {
    let values = shape.iter().map(|entry| Complex::new(entry.value[0], entry.value[1]));
    let errors = shape.iter().map(|entry| entry.standard_error.unwrap_or_default());
    let (re, im): (Vec<f64>, Vec<f64>) = errors.map(|[re, im]| (re * re, im * im)).unzip();
    let variances = DVector::from_iterator(2 * shape.len(), re.into_iter().chain(im));
    let values = DVector::from_iterator(shape.len(), values);
    Ok(ShapeWithCovariance::new(values, DMatrix::from_diagonal(&variances))?)
}
