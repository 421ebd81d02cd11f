//! Coherence of the fitted records.

use std::f64::consts::TAU;

use mechid_signal::{Extent, message};
use mechid_spectra::frf::{Frf, FrfEstimator};
use nalgebra::DMatrix;

use super::Identified;
use super::left_out::{LeftOut, LineRule};
use super::lines::LineChoice;
use super::prediction::Prediction;
use crate::AnalysisError;
use crate::frf::{Estimator, Responses, Segmentation, average_of_hits};

/// Multiple coherence of the responses with all forces.
#[derive(Debug, Clone)]
pub struct ResponseCoherence {
    /// Frequencies, in Hz, one per row of `values`.
    pub frequency_hz: Vec<f64>,
    /// Coherences, frequencies × responses, each a ratio from 0 to 1.
    pub values: DMatrix<f64>,
    /// Number of averages in words, such as `6 hits`.
    pub averages: String,
}

impl ResponseCoherence {
    pub(super) fn new(frf: &Frf, averages: String) -> Self {
        let frequency_hz = frf.omega().iter().map(|omega| omega / TAU).collect();
        Self { frequency_hz, values: frf.coherence().clone(), averages }
    }

    /// Returns the coherence on the lines between two frequencies, in Hz.
    fn between(self, [low, high]: [f64; 2]) -> Self {
        let is_inside = |row: &usize| (low..=high).contains(&self.frequency_hz[*row]);
        let rows: Vec<usize> = (0..self.frequency_hz.len()).filter(is_inside).collect();
        Self {
            frequency_hz: rows.iter().map(|row| self.frequency_hz[*row]).collect(),
            values: self.values.select_rows(&rows),
            averages: self.averages,
        }
    }
}

impl Identified {
    /// Returns the coherence of the responses with the forces in the band of the fit. It is
    /// computed from the fitted frequency responses; for hammer tests, from all hits together; for
    /// other records that are not periodic, from segments of the length that [`frf`](crate::frf())
    /// chooses. `None` for whole periods, and if there are too few hits or segments.
    ///
    /// # Errors
    /// An [`AnalysisError`] if a file cannot be read again, and the errors of averages over
    /// segments.
    pub fn coherence(&self) -> Result<Option<ResponseCoherence>, AnalysisError> {
        if let Some(fitted) = &self.fitted.coherence {
            return Ok(Some(fitted.clone()));
        }
        let rule = LineRule { choice: &LineChoice::Driven, without: &LeftOut::default() };
        let coherence = if self.is_hammer_test() {
            let averaged = average_of_hits(&self.records, rule, None)?;
            let hits = self.records.len();
            if hits <= averaged.driven.len() {
                return Ok(None);
            }
            let frf = averaged.average.frf(FrfEstimator::H1)?;
            ResponseCoherence::new(&frf, message::count(hits, "hit"))
        } else if self.is_open() {
            let Some((segments, _)) = Segmentation::default().chosen(&self.records[0], rule)?
            else {
                return Ok(None);
            };
            let averaged = Responses::new(&self.records, &segments, Estimator::H1, rule)?;
            ResponseCoherence::new(&averaged.frf, averaged.averages())
        } else {
            return Ok(None);
        };
        let band = self.spectra().map_or([0.0, f64::INFINITY], |data| {
            let hz = || data.omega().iter().map(|omega| omega / TAU);
            [hz().fold(f64::INFINITY, f64::min), hz().fold(0.0, f64::max)]
        });
        let inside = coherence.between(band);
        Ok(Some(inside).filter(|inside| !inside.frequency_hz.is_empty()))
    }

    /// Returns whether the records are windows of a response that does not repeat.
    fn is_open(&self) -> bool {
        let open =
            matches!(self.fitted.prediction, Prediction::Sampled { extent: Extent::Open, .. });
        open && self.records[0].held.periods == 1
    }
}
