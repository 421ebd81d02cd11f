//! Prediction of records that were not part of the fit.

use nalgebra::{Complex, DMatrix, DVectorView};

use super::checks::prediction_checks;
use super::diagrams::DiagramData;
use super::settings::ModalTest;
use super::sources::Recorded;
use super::{Modes, ModesSummary};
use crate::AnalysisError;
use crate::measurement::Measurement;

impl Modes {
    /// Predicts other records of the same structure from their forces; returns the share of the
    /// variance of each response in the band that the modes explain. The initial state of each
    /// record is estimated.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for modes without measured forces, [`AnalysisError::Modal`] for
    /// another number of forces or responses, and an error if a file cannot be read.
    pub fn predict(&self, measurements: &[Measurement]) -> Result<Vec<f64>, AnalysisError> {
        let ModesSummary { analysis, band_hz, .. } = self.summary();
        let (DiagramData::Forced(forced), ModalTest::Forced { hits }) =
            (&self.source, &analysis.test)
        else {
            let why = "without measured forces, no response can be predicted".into();
            return Err(AnalysisError::Setting { setting: "validate", why });
        };
        let recorded = Recorded::from_forced(measurements, hits.as_ref(), &analysis.places)?;
        let data = recorded.lines(*band_hz)?;
        Ok(explained(data.outputs(), &forced.estimate.synthesis(&data)?))
    }

    /// Predicts other records like [`Modes::predict`], and adds the predicted shares of the
    /// variance to the summary.
    ///
    /// # Errors
    /// As [`Modes::predict`].
    pub fn add_validation(&mut self, measurements: &[Measurement]) -> Result<(), AnalysisError> {
        let shares = self.predict(measurements)?;
        let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        self.summary.variance_predicted = Some(mean);
        let names: Vec<String> =
            self.summary.outputs.iter().map(|row| row.column.clone()).collect();
        self.summary.checks.extend(prediction_checks(&shares, &names));
        for (row, share) in self.summary.outputs.iter_mut().zip(shares) {
            row.variance_predicted = Some(share);
        }
        Ok(())
    }
}

/// Returns the share of the variance of each measured response that the modelled response explains.
pub(super) fn explained(
    measured: &DMatrix<Complex<f64>>,
    modelled: &DMatrix<Complex<f64>>,
) -> Vec<f64> {
    let share = |(measured, model): (DVectorView<'_, _>, DVectorView<'_, Complex<f64>>)| {
        1.0 - (measured - model).norm_squared() / measured.norm_squared()
    };
    measured.column_iter().zip(modelled.column_iter()).map(share).collect()
}
