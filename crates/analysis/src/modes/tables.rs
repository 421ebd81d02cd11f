//! Spectral lines of tables of frequency responses.

use std::f64::consts::TAU;

use mechid_io::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use mechid_modal::{DrivingPoint, IdentifiedMode, initial_mode_count};
use mechid_model::ResponseQuantity;
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

use super::averaged::Averaged;
use super::sources::{Output, driving_points};
use crate::AnalysisError;
use crate::identify::added_decay;
use crate::identify::counts::allowed_memory;
use crate::identify::tabulated::with_positive_directions;
use crate::limits::{MANY_MODES, MODAL_PAIR_BYTES, MODAL_TABLE_BYTES, check_bytes};

/// Tables of frequency responses of one structure, and their points.
#[derive(Debug)]
pub(super) struct Tables {
    /// Tables with points in positive directions.
    tables: Vec<FrequencyResponses>,
    /// Segments of each table, if it states them.
    averaged: Vec<Option<Averaged>>,
    /// Points of the forces, in the order of the tables.
    pub forces: Vec<String>,
    /// Points of the responses, in the order of the tables.
    pub responses: Vec<String>,
    /// Rate, in 1/s, that an exponential window adds to the decay of every mode.
    pub added_decay: Option<f64>,
}

impl Tables {
    /// Takes tables, and the quantity of responses in tables that do not state it.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`] without a table, [`AnalysisError::Setting`] if a table states
    /// another quantity, or tables have different exponential windows.
    pub fn new(
        tables: &[FrequencyResponses],
        quantity: Option<ResponseQuantity>,
    ) -> Result<Self, AnalysisError> {
        if tables.is_empty() {
            return Err(AnalysisError::NoRecord);
        }
        let added_decay = added_decay::common_rate(tables)?;
        let prepared = |table: &FrequencyResponses| prepare(table, quantity, added_decay);
        let tables = tables.iter().map(prepared).collect::<Result<Vec<_>, AnalysisError>>()?;
        let points = |point: fn(&ResponseFunction) -> &String| {
            let mut points: Vec<String> = Vec::new();
            for function in tables.iter().flat_map(|table| &table.functions) {
                if !points.contains(point(function)) {
                    points.push(point(function).clone());
                }
            }
            points
        };
        let (forces, responses) = (points(|f| &f.reference), points(|f| &f.response));
        let averaged = tables.iter().map(Averaged::new).collect();
        Ok(Self { averaged, forces, responses, added_decay, tables })
    }

    /// Returns the tables, each with its segments.
    pub fn with_segments(
        &self,
    ) -> impl Iterator<Item = (&FrequencyResponses, Option<&Averaged>)> + '_ {
        self.tables.iter().zip(self.averaged.iter().map(Option::as_ref))
    }

    /// Returns an error if a fit of modes to the lines `data` needs more memory than the analysis
    /// of tables of this size may use. The number of modes is that of the initial estimates.
    ///
    /// # Errors
    /// [`AnalysisError::Memory`].
    pub fn check_memory(&self, data: &LineData) -> Result<(), AnalysisError> {
        let Some((allowed, file)) = allowed_memory(&self.tables) else { return Ok(()) };
        let (outputs, inputs) = (self.responses.len(), self.forces.len());
        let numbers = data.len() * outputs;
        let needed = |modes: usize| {
            // A mode has a pole and complex vectors; residual terms have two complex matrices.
            let of_modes = modes.saturating_mul(2 + 2 * (outputs + inputs));
            let unknowns = of_modes.saturating_add(4 * outputs * inputs);
            let pairs = unknowns.saturating_mul(unknowns).saturating_mul(MODAL_PAIR_BYTES);
            numbers.saturating_mul(MODAL_TABLE_BYTES).saturating_add(pairs)
        };
        // The modes are counted only if the largest possible number of modes would need too much
        // memory.
        let modes = if needed(MANY_MODES) <= allowed {
            0
        } else {
            // If there are no initial estimates, the fit reports why.
            initial_mode_count(data).unwrap_or(0)
        };
        check_bytes(file, numbers, needed(modes), allowed)
    }

    /// Returns the lowest and the highest frequency above zero, in Hz.
    pub fn range_hz(&self) -> [f64; 2] {
        let frequencies = self.tables.iter().flat_map(|table| &table.frequency_hz);
        frequencies
            .filter(|hz| **hz > 0.0)
            .fold([f64::INFINITY, 0.0], |[low, high], hz| [low.min(*hz), high.max(*hz)])
    }

    /// Returns the responses, with the quantities that the tables state.
    pub fn outputs(&self) -> Vec<Output> {
        let functions = || self.tables.iter().flat_map(|table| &table.functions);
        let output = |point: &String| Output {
            name: point.clone(),
            quantity: functions().find(|f| f.response == *point).and_then(|f| f.quantity),
        };
        self.responses.iter().map(output).collect()
    }

    /// Returns the inputs and outputs at the same point.
    pub fn driving_points(&self) -> Vec<DrivingPoint> {
        let stated = |points: &[String]| points.iter().cloned().map(Some).collect::<Vec<_>>();
        driving_points(&stated(&self.forces), &stated(&self.responses))
    }

    /// Returns whether a window smooths the responses of a table.
    pub fn is_smoothed(&self) -> bool {
        self.averaged.iter().flatten().any(Averaged::is_smoothed)
    }

    /// Returns the largest ratio of standard errors for correlated lines to those for independent
    /// lines, at least 1.
    pub fn error_inflation(&self) -> f64 {
        self.averaged.iter().flatten().map(|averaged| averaged.inflation).fold(1.0, f64::max)
    }

    /// Returns the lines in a band (Hz): each force is a record with a unit input. With a `model`,
    /// the responses are corrected: the window bias that averaging causes for the modes of the
    /// model is subtracted.
    ///
    /// # Errors
    /// [`AnalysisError::MissingResponse`] if a table has the responses of only some points to a
    /// force, and the errors of [`LineData`] if the band has no line.
    pub fn lines(
        &self,
        band_hz: [f64; 2],
        model: Option<&[IdentifiedMode]>,
    ) -> Result<LineData, AnalysisError> {
        let mut data: Option<LineData> = None;
        for (table, averaged) in self.with_segments() {
            let rows = rows(table, averaged, band_hz);
            let bias = match (averaged, model) {
                (Some(averaged), Some(model)) => averaged.bias(&rows, model),
                _ => Vec::new(),
            };
            for (input, force) in self.forces.iter().enumerate() {
                let of_force: Vec<&ResponseFunction> =
                    table.functions.iter().filter(|f| f.reference == *force).collect();
                if of_force.is_empty() {
                    continue;
                }
                let functions = self.complete(table, &of_force, force)?;
                let omega = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
                let mut inputs = DMatrix::zeros(rows.len(), self.forces.len());
                inputs.column_mut(input).fill(Complex::from(1.0));
                let outputs = DMatrix::from_fn(rows.len(), functions.len(), |at, output| {
                    let bias = bias.get(at).and_then(Option::as_ref);
                    let bias = bias.and_then(|bias| bias.get((output, input)).copied());
                    let bias = bias.unwrap_or_default();
                    functions[output].values[rows[at]] - bias
                });
                let mut one = LineData::new(omega, inputs, outputs, Transient::None)?;
                if let Some(variance) = noise_variance(table, &functions, &rows) {
                    one = one.with_output_variance(variance)?;
                }
                data = Some(match data {
                    None => one,
                    Some(before) => before.followed_by(&one)?,
                });
            }
        }
        data.ok_or(AnalysisError::NoRecord)
    }

    /// Returns the responses of all points to a force.
    fn complete<'a>(
        &self,
        table: &FrequencyResponses,
        of_force: &[&'a ResponseFunction],
        force: &str,
    ) -> Result<Vec<&'a ResponseFunction>, AnalysisError> {
        let function = |point: &String| {
            let function = of_force.iter().find(|function| function.response == *point);
            function.copied().ok_or_else(|| AnalysisError::MissingResponse {
                file: table.file.clone(),
                response: point.clone(),
                force: force.to_owned(),
            })
        };
        self.responses.iter().map(function).collect()
    }
}

/// Returns the variance of some responses to a force (rows × responses), up to a factor: from their
/// standard errors or, if there are none, from their coherence. `None` if a response has neither of
/// them, or if a variance is not positive and finite.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (the variance from the coherence).
fn noise_variance(
    table: &FrequencyResponses,
    functions: &[&ResponseFunction],
    rows: &[usize],
) -> Option<DMatrix<f64>> {
    let force = &functions.first()?.reference;
    let is_one_force = table.functions.iter().all(|function| function.reference == *force);
    let coherence_of = |function: &ResponseFunction| {
        let is_its = |one: &&CoherenceFunction| {
            one.response == function.response
                && one.reference.as_ref().map_or(is_one_force, |reference| reference == force)
        };
        table.coherence.iter().find(is_its).map(|one| &one.values)
    };
    let column = |function: &&ResponseFunction| -> Option<Vec<f64>> {
        if let Some(errors) = &function.standard_error {
            return Some(rows.iter().map(|row| 2.0 * errors[*row].powi(2)).collect());
        }
        let coherence = coherence_of(function)?;
        let variance = |row: &usize| {
            function.values[*row].norm_sqr() * (1.0 - coherence[*row]) / coherence[*row]
        };
        Some(rows.iter().map(variance).collect())
    };
    let columns = functions.iter().map(column).collect::<Option<Vec<_>>>()?;
    let is_noise = |variance: &f64| variance.is_finite() && *variance > 0.0;
    let is_complete = columns.iter().flatten().all(is_noise);
    is_complete.then(|| DMatrix::from_fn(rows.len(), columns.len(), |row, at| columns[at][row]))
}

/// Returns the rows of a table in a band (Hz) with independent errors, without 0 Hz.
pub(super) fn rows(
    table: &FrequencyResponses,
    averaged: Option<&Averaged>,
    [low, high]: [f64; 2],
) -> Vec<usize> {
    let inside = |hz: f64| hz > 0.0 && (low..=high).contains(&hz);
    let hz = &table.frequency_hz;
    let rows = (0..hz.len()).filter(|row| inside(hz[*row]));
    match averaged {
        Some(averaged) => averaged.independent(rows),
        None => rows.collect(),
    }
}

/// Returns a table with points in positive directions and the stated quantity. If the table has an
/// exponential window, also corrects velocities and accelerations such that they are derivatives of
/// the displacement.
fn prepare(
    table: &FrequencyResponses,
    quantity: Option<ResponseQuantity>,
    added_decay: Option<f64>,
) -> Result<FrequencyResponses, AnalysisError> {
    let mut table = with_positive_directions(table, &[]).into_owned();
    for function in &mut table.functions {
        match (function.quantity, quantity) {
            (Some(of_file), Some(given)) if of_file != given => {
                let why = format!("{} states {of_file}, not {given}", table.file);
                return Err(AnalysisError::Setting { setting: "quantity", why });
            }
            (of_file, given) => function.quantity = of_file.or(given),
        }
    }
    let first = table.functions.first().and_then(|function| function.quantity);
    Ok(match (added_decay, first) {
        (Some(rate), Some(quantity)) => added_decay::as_derivatives(&table, quantity, rate),
        _ => table,
    })
}
