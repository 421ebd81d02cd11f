//! Spectral lines of tables of frequency responses.

use std::f64::consts::TAU;

use mechid_io::{FrequencyResponses, ResponseFunction};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

use super::sources::Output;
use crate::AnalysisError;

/// Tables of frequency responses of one structure, and the points that they name.
#[derive(Debug)]
pub(super) struct Tables<'a> {
    tables: &'a [FrequencyResponses],
    /// Points of the forces, in the order of the tables.
    pub forces: Vec<String>,
    /// Points of the responses, in the order of the tables.
    pub responses: Vec<String>,
}

impl<'a> Tables<'a> {
    /// # Errors
    /// [`AnalysisError::NoRecord`] without a table.
    pub fn new(tables: &'a [FrequencyResponses]) -> Result<Self, AnalysisError> {
        if tables.is_empty() {
            return Err(AnalysisError::NoRecord);
        }
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
        Ok(Self { tables, forces, responses })
    }

    /// Lowest and highest frequency above zero, in Hz.
    pub fn range_hz(&self) -> [f64; 2] {
        let frequencies = self.tables.iter().flat_map(|table| &table.frequency_hz);
        frequencies
            .filter(|hz| **hz > 0.0)
            .fold([f64::INFINITY, 0.0], |[low, high], hz| [low.min(*hz), high.max(*hz)])
    }

    /// Responses, with the quantities that the tables state.
    pub fn outputs(&self) -> Vec<Output> {
        let functions = || self.tables.iter().flat_map(|table| &table.functions);
        let output = |point: &String| Output {
            name: point.clone(),
            quantity: functions().find(|f| f.response == *point).and_then(|f| f.quantity),
        };
        self.responses.iter().map(output).collect()
    }

    /// Input and output at the same point, counted from 0.
    pub fn driving_points(&self) -> Vec<(usize, usize)> {
        let output = |point| self.responses.iter().position(|other| other == point);
        let inputs = self.forces.iter().enumerate();
        inputs.filter_map(|(input, point)| Some((input, output(point)?))).collect()
    }

    /// Lines in a band (Hz): each force in turn is a record with a unit input there.
    ///
    /// # Errors
    /// [`AnalysisError::NoResponse`] if a table has the response of one point to a force, and not that
    /// of another, [`AnalysisError::EmptyBand`]-like errors of [`LineData`] if the band has no line.
    pub fn lines(&self, band_hz: [f64; 2]) -> Result<LineData, AnalysisError> {
        let mut all: Option<LineData> = None;
        for table in self.tables {
            for (input, force) in self.forces.iter().enumerate() {
                let of_force: Vec<&ResponseFunction> =
                    table.functions.iter().filter(|f| f.reference == *force).collect();
                if of_force.is_empty() {
                    continue;
                }
                let one = self.lines_of(table, &of_force, input, band_hz)?;
                all = Some(match all {
                    None => one,
                    Some(before) => before.followed_by(&one)?,
                });
            }
        }
        all.ok_or(AnalysisError::NoRecord)
    }

    fn lines_of(
        &self,
        table: &FrequencyResponses,
        of_force: &[&ResponseFunction],
        input: usize,
        [low, high]: [f64; 2],
    ) -> Result<LineData, AnalysisError> {
        let functions: Vec<&ResponseFunction> = self
            .responses
            .iter()
            .map(|point| {
                let function = of_force.iter().find(|function| function.response == *point);
                function.copied().ok_or_else(|| AnalysisError::NoResponse {
                    file: table.file.clone(),
                    response: point.clone(),
                    force: self.forces[input].clone(),
                })
            })
            .collect::<Result<_, _>>()?;
        let inside = |hz: f64| hz > 0.0 && (low..=high).contains(&hz);
        let rows: Vec<usize> =
            (0..table.frequency_hz.len()).filter(|row| inside(table.frequency_hz[*row])).collect();
        let omega = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
        let mut inputs = DMatrix::zeros(rows.len(), self.forces.len());
        inputs.column_mut(input).fill(Complex::from(1.0));
        let outputs = DMatrix::from_fn(rows.len(), functions.len(), |row, at| {
            functions[at].values[rows[row]]
        });
        Ok(LineData::new(omega, inputs, outputs, Transient::None)?)
    }
}
