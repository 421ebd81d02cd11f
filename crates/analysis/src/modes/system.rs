//! Modes of a test as a system between forces and responses: for predictions and unknown forces.

use std::path::Path;

use mechid_force::{Channel, FrequencyResponse};
use mechid_io::{input_name, read_json};
use mechid_modal::ModalModel;
use mechid_model::ResponseQuantity;
use mechid_signal::message;
use nalgebra::{Complex, DMatrix};
use serde::Deserialize;

use super::Modes;
use super::saved::from_json_with_modes;
use crate::AnalysisError;
use crate::measurement::Channels;
use crate::measurement::channels::ABSENT;

/// Frequency responses of the modes of a test, with the covariance of the modes: from a result, or
/// from its JSON.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalSystem {
    /// Name for messages, such as the file.
    pub name: String,
    /// Names of the forces.
    pub inputs: Vec<String>,
    /// Names and quantities of the responses.
    pub outputs: Vec<(String, ResponseQuantity)>,
    /// Lowest and highest frequency, in Hz, between which the responses are valid.
    pub band_hz: [f64; 2],
    /// Modes and residual terms.
    pub model: ModalModel,
}

/// Quantity of a measured response, index of its column among the columns of this quantity, and
/// index of its output in the modal model.
pub(crate) type MeasuredChannel = (ResponseQuantity, usize, usize);

/// The fields of a saved result with modes that a system needs.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Saved {
    inputs: Vec<String>,
    outputs: Vec<SavedOutput>,
    band_hz: [f64; 2],
    model: Option<ModalModel>,
}

#[derive(Debug, Deserialize)]
struct SavedOutput {
    column: String,
    unit: Option<String>,
}

impl ModalSystem {
    /// Reads the result of `mechid modes --json`; `None` for the JSON of a machine.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read, [`AnalysisError::SavedModes`] if the modes
    /// have no frequency responses.
    pub fn read(path: impl AsRef<Path>) -> Result<Option<Self>, AnalysisError> {
        let json: serde_json::Value = read_json(path.as_ref())?;
        if json.get("system").is_some() || json.get("modes").is_none() {
            return Ok(None);
        }
        Self::from_json(&input_name(path.as_ref()), json).map(Some)
    }

    /// Takes the modes from the JSON of a result.
    ///
    /// # Errors
    /// [`AnalysisError::SavedModes`] if the modes have no frequency responses.
    pub fn from_json(name: &str, json: serde_json::Value) -> Result<Self, AnalysisError> {
        let refused = |why: String| AnalysisError::SavedModes { file: name.into(), why };
        let saved: Saved = from_json_with_modes(name, json)?;
        let Some(model) = saved.model else {
            return Err(refused(
                "the modes have no frequency responses: `mechid modes` computes frequency responses from \
                 records with forces or from tables"
                    .into(),
            ));
        };
        let quantity = |output: SavedOutput| {
            let is_unit = |one: &ResponseQuantity| output.unit.as_deref() == Some(one.unit());
            let quantity = ResponseQuantity::ALL.into_iter().find(is_unit);
            let why = || refused(format!("the quantity of {} is not stated", output.column));
            quantity.ok_or_else(why).map(|quantity| (output.column.clone(), quantity))
        };
        let outputs: Vec<_> = saved.outputs.into_iter().map(quantity).collect::<Result<_, _>>()?;
        let fits = model.inputs() == saved.inputs.len() && model.outputs() == outputs.len();
        if !(model.is_consistent() && fits) {
            return Err(refused(
                "`model` does not have the sizes of `inputs` and `outputs`".into(),
            ));
        }
        let (name, inputs, band_hz) = (name.into(), saved.inputs, saved.band_hz);
        Ok(Self { name, inputs, outputs, band_hz, model })
    }

    /// Takes the modes of a result.
    ///
    /// # Errors
    /// As [`ModalSystem::from_json`].
    pub fn new(modes: &Modes) -> Result<Self, AnalysisError> {
        let summary = modes.summary();
        let files: Vec<&str> = summary.records.iter().map(|record| record.file.as_str()).collect();
        let json = serde_json::to_value(summary).map_err(|error| AnalysisError::SavedModes {
            file: files.join(", "),
            why: error.to_string(),
        })?;
        Self::from_json(&files.join(", "), json)
    }

    /// Returns the input of each force column: by its name, or by its order if there is a column
    /// for every force and a name is unknown.
    pub(crate) fn inputs_of(&self, columns: &[String]) -> Result<Vec<usize>, AnalysisError> {
        let find = |column: &String| self.inputs.iter().position(|input| input == column);
        if let Some(all) = columns.iter().map(find).collect::<Option<Vec<_>>>() {
            return Ok(all);
        }
        if columns.len() == self.inputs.len() {
            return Ok((0..columns.len()).collect());
        }
        let why = format!(
            "{} for the forces {} of {}: name the columns, or give one column for each force",
            message::count(columns.len(), "column"),
            self.inputs.join(", "),
            self.name
        );
        Err(AnalysisError::Setting { setting: "force", why })
    }

    /// Returns the output of each response column of a record, quantity by quantity: by its name,
    /// or by its order if there is a column for every response of this quantity.
    pub(crate) fn outputs_of(
        &self,
        channels: &Channels,
    ) -> Result<Vec<MeasuredChannel>, AnalysisError> {
        let mut columns_and_outputs = Vec::new();
        for quantity in ResponseQuantity::ALL {
            let columns = channels.response(quantity);
            let outputs: Vec<usize> =
                (0..self.outputs.len()).filter(|at| self.outputs[*at].1 == quantity).collect();
            let named = |at: usize| {
                let name = channels.response_name(quantity, at);
                outputs.iter().copied().find(|output| self.outputs[*output].0 == name)
            };
            let in_order = |at: usize| (columns.len() == outputs.len()).then(|| outputs[at]);
            let present = (0..columns.len()).filter(|at| columns[*at] != ABSENT);
            let names: Option<Vec<_>> = present.clone().map(|at| Some((at, named(at)?))).collect();
            let order = || present.map(|at| Some((at, in_order(at)?))).collect();
            let Some(pairs): Option<Vec<(usize, usize)>> = names.or_else(order) else {
                let known: Vec<&str> =
                    outputs.iter().map(|output| self.outputs[*output].0.as_str()).collect();
                let why = format!(
                    "{} of {quantity} for {} of {}: {}",
                    message::count(columns.len(), "column"),
                    message::count(outputs.len(), "response"),
                    self.name,
                    if known.is_empty() { "none".into() } else { known.join(", ") },
                );
                return Err(AnalysisError::Setting { setting: "response", why });
            };
            let of_quantity = pairs.into_iter();
            columns_and_outputs
                .extend(of_quantity.map(|(column, output)| (quantity, column, output)));
        }
        Ok(columns_and_outputs)
    }
}

impl FrequencyResponse for ModalSystem {
    fn inputs(&self) -> usize {
        self.inputs.len()
    }

    fn sensors(&self) -> usize {
        self.outputs.len()
    }

    fn response(
        &self,
        channels: &[Channel],
        forced: &[usize],
        omega: f64,
    ) -> Option<DMatrix<Complex<f64>>> {
        let matrix = self.model.response(omega);
        let is_finite = matrix.iter().all(|z| z.re.is_finite() && z.im.is_finite());
        let entry = |i: usize, j: usize| matrix[(channels[i].dof, forced[j])];
        is_finite.then(|| DMatrix::from_fn(channels.len(), forced.len(), entry))
    }

    fn response_covariance(
        &self,
        channels: &[Channel],
        forced: &[usize],
        omega: f64,
        forces: &[Complex<f64>],
    ) -> Option<DMatrix<Complex<f64>>> {
        let mut of_inputs = vec![Complex::default(); self.inputs.len()];
        forced.iter().zip(forces).for_each(|(input, force)| of_inputs[*input] = *force);
        let covariance = self.model.response_covariance(omega, &of_inputs);
        let entry = |i: usize, j: usize| covariance[(channels[i].dof, channels[j].dof)];
        Some(DMatrix::from_fn(channels.len(), channels.len(), entry))
    }
}
