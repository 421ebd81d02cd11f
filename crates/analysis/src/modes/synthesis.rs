//! Frequency responses of identified modes, for other programs.

use std::f64::consts::TAU;

use mechid_io::{FrequencyResponses, ResponseFunction, is_directed_point};

use super::Modes;
use super::diagrams::{DiagramData, Forced};

impl Modes {
    /// Returns the frequency responses of modes and residual terms at the lines of the first
    /// record, in m/N, m/(s·N) or m/(s²·N); `None` without measured forces.
    ///
    /// The points are the stated ones if they are nodes of a universal file (`3`, `12+Z`).
    /// Otherwise they have numbers: first the responses from 1, then the forces.
    pub fn synthesis(&self) -> Option<FrequencyResponses> {
        let DiagramData::Forced(forced) = &self.source else { return None };
        let Forced { data, estimate, quantities, added_decay, .. } = &**forced;
        let summary = self.summary();
        let rows = data.records().first().map_or(0..0, |(rows, _)| rows.clone());
        let omega = &data.omega()[rows];
        let responses: Vec<_> = omega.iter().map(|omega| estimate.response(*omega)).collect();
        let places = &summary.analysis.places;
        let columns: Vec<String> = summary.outputs.iter().map(|row| row.column.clone()).collect();
        let named = if places.responses.is_empty() { &columns } else { &places.responses };
        let outputs = nodes(named, 1);
        let stated = places.forces.len() == summary.inputs.len();
        let named = if stated { &places.forces } else { &summary.inputs };
        let inputs = nodes(named, columns.len() + 1);
        let mut functions = Vec::new();
        for (input, reference) in inputs.iter().enumerate() {
            for (output, response) in outputs.iter().enumerate() {
                functions.push(ResponseFunction {
                    response: response.clone(),
                    reference: reference.clone(),
                    quantity: quantities[output],
                    values: responses.iter().map(|h| h[(output, input)]).collect(),
                    standard_error: None,
                });
            }
        }
        let files: Vec<&str> = summary.records.iter().map(|record| record.file.as_str()).collect();
        Some(FrequencyResponses {
            file: files.join(", "),
            frequency_hz: omega.iter().map(|omega| omega / TAU).collect(),
            functions,
            added_decay: *added_decay,
            ..FrequencyResponses::default()
        })
    }
}

/// Returns the names if all are nodes with directions, otherwise numbers that begin at `first`.
fn nodes(names: &[String], first: usize) -> Vec<String> {
    let is_node = |name: &String| name.parse::<u32>().is_ok() || is_directed_point(name);
    if names.iter().all(is_node) {
        return names.to_vec();
    }
    (first..first + names.len()).map(|number| number.to_string()).collect()
}
