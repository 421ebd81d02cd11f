//! Stabilisation diagram and mode indicator of a result.

use std::f64::consts::TAU;

use mechid_modal::ModalEstimate;
use mechid_modal::indicators::complex_mode_indicator;
use mechid_modal::stabilisation::Stabilisation;
use mechid_model::ResponseQuantity;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use serde::{Deserialize, Serialize};

use crate::AnalysisError;

/// Diagrams for a choice of the number of modes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Diagrams {
    /// Poles of models of rising order: the initial estimates of the modes.
    pub stabilisation: StabilisationRows,
    /// Complex mode indicator function; `None` without measured forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode_indicator: Option<ModeIndicator>,
}

/// Poles of models of rising order, column by column.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct StabilisationRows {
    /// Order of the model of each pole.
    pub order: Vec<usize>,
    /// Natural frequencies, in Hz, one for each pole.
    pub frequency_hz: Vec<f64>,
    /// Damping ratios, pure numbers, one for each pole.
    pub damping_ratio: Vec<f64>,
    /// Flags, one for each pole: true if frequency and damping (for ambient records also the shape)
    /// agree with a pole of the model whose order is lower by one step.
    pub is_stable: Vec<bool>,
}

/// Singular values of the frequency responses at each frequency.
///
/// Peaks of the first singular value are modes; a peak of the second singular value at the same
/// frequency is a second mode.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ModeIndicator {
    /// `true` for measured responses (tables), `false` for the responses of the identified modes
    /// and residual terms (records).
    pub is_measured: bool,
    /// Frequencies, in Hz, one per singular value of a list.
    pub frequency_hz: Vec<f64>,
    /// Singular values, the largest first, each a list with one value for each frequency: pure
    /// numbers, because responses and forces are divided by their RMS in the band.
    pub singular_values: Vec<Vec<f64>>,
}

/// Data of the diagrams.
#[derive(Debug)]
pub(super) enum DiagramData {
    Forced(Box<Forced>),
    Ambient(Stabilisation),
}

/// Fit of a test with measured forces.
#[derive(Debug)]
pub(super) struct Forced {
    pub data: LineData,
    pub estimate: ModalEstimate,
    /// `true` if the data are tables of frequency responses.
    pub is_table: bool,
    /// Quantity of each response.
    pub quantities: Vec<Option<ResponseQuantity>>,
    /// Decay rate, in 1/s, that an exponential window adds.
    pub added_decay: Option<f64>,
}

impl DiagramData {
    pub fn diagrams(&self) -> Result<Diagrams, AnalysisError> {
        Ok(match self {
            Self::Ambient(stabilisation) => Diagrams {
                stabilisation: StabilisationRows::new(stabilisation),
                mode_indicator: None,
            },
            Self::Forced(forced) => {
                let Forced { data, estimate, is_table, .. } = &**forced;
                let stabilisation = mechid_modal::stabilisation_of(data)?;
                Diagrams {
                    stabilisation: StabilisationRows::new(&stabilisation),
                    mode_indicator: (data.inputs().ncols() > 0)
                        .then(|| ModeIndicator::new(data, estimate, *is_table))
                        .transpose()?,
                }
            }
        })
    }
}

impl StabilisationRows {
    fn new(stabilisation: &Stabilisation) -> Self {
        let poles = stabilisation.poles();
        Self {
            order: poles.iter().map(|one| one.order).collect(),
            frequency_hz: poles.iter().map(|one| one.pole.natural_frequency_hz()).collect(),
            damping_ratio: poles.iter().map(|one| one.pole.damping_ratio()).collect(),
            is_stable: poles.iter().map(|one| one.is_stable()).collect(),
        }
    }
}

impl ModeIndicator {
    fn new(
        data: &LineData,
        estimate: &ModalEstimate,
        is_table: bool,
    ) -> Result<Self, AnalysisError> {
        let level = |values: &DMatrix<Complex<f64>>, at: usize| {
            let column = values.column(at);
            (column.norm_squared() / column.len() as f64).sqrt()
        };
        let outputs: Vec<f64> =
            (0..data.outputs().ncols()).map(|at| level(data.outputs(), at)).collect();
        let inputs: Vec<f64> =
            (0..data.inputs().ncols()).map(|at| level(data.inputs(), at)).collect();
        let measured = if is_table { measured_responses(data) } else { None };
        let is_measured = measured.is_some();
        let (omega, mut responses) = measured.unwrap_or_else(|| {
            let rows = data.records().first().map_or(0..0, |(rows, _)| rows.clone());
            let omega = data.omega()[rows].to_vec();
            let responses = omega.iter().map(|omega| estimate.response(*omega)).collect();
            (omega, responses)
        });
        for response in &mut responses {
            for (mut column, input) in response.column_iter_mut().zip(&inputs) {
                column
                    .iter_mut()
                    .zip(&outputs)
                    .for_each(|(value, output)| *value *= input / output);
            }
        }
        let values = complex_mode_indicator(&responses)?;
        Ok(Self {
            is_measured,
            frequency_hz: omega.iter().map(|omega| omega / TAU).collect(),
            singular_values: values.column_iter().map(|c| c.iter().copied().collect()).collect(),
        })
    }
}

/// Frequencies (rad/s), and the response at each frequency.
type MeasuredResponses = (Vec<f64>, Vec<DMatrix<Complex<f64>>>);

/// Returns the frequencies (rad/s) and responses, outputs × inputs, of a table with one record for
/// every force on the same lines; `None` for other tables.
fn measured_responses(data: &LineData) -> Option<MeasuredResponses> {
    let (inputs, outputs) = (data.inputs().ncols(), data.outputs().ncols());
    let records = data.records();
    let (first, _) = records.first()?;
    let omega = data.omega()[first.clone()].to_vec();
    let same = |rows: &std::ops::Range<usize>| data.omega()[rows.clone()] == omega[..];
    if records.len() != inputs || !records.iter().all(|(rows, _)| same(rows)) {
        return None;
    }
    let mut responses = vec![DMatrix::zeros(outputs, inputs); omega.len()];
    for (input, (rows, _)) in records.iter().enumerate() {
        for (response, row) in responses.iter_mut().zip(rows.clone()) {
            if data.inputs()[(row, input)] == Complex::default() {
                return None;
            }
            response.set_column(input, &data.outputs().row(row).transpose());
        }
    }
    Some((omega, responses))
}
