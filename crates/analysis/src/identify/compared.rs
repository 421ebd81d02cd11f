//! Comparison of a fit with fits to parts of its data and with larger models.

use std::ops::Range;

use mechid_checks::{Finding, RowParts, agreement_of_parts, omitted_term};
use mechid_estimate::Estimate;
use mechid_estimate::frequency_domain::{PartsOfFit, SampledRows, Split};
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, SpectraError};
use nalgebra::DMatrix;

/// Comparison of a fit with fits to parts of its data and with larger models.
#[derive(Default)]
pub(super) struct Compared {
    /// Findings of the comparisons with parts of the data and with larger models.
    pub(super) parts: Vec<Finding>,
    /// Mean square error that an omitted term adds to the covariance of the parameters.
    pub(super) omitted: Option<DMatrix<f64>>,
}

impl Compared {
    /// Compares a fit with fits to parts of its data. If `records` is given, it also compares the
    /// fit with larger models; `records` states which rows of the data belong to which record, and
    /// the sampling of this record. It is empty if the sampling is not known.
    pub(super) fn new(
        fit: &PartsOfFit<'_>,
        splits: &[(Split, RowParts)],
        records: Option<&[SampledRows]>,
        estimate: &Estimate,
    ) -> Self {
        let omitted = records.and_then(|records| omitted_term(fit, records, estimate));
        let (term, omitted) = omitted.unzip();
        Self {
            parts: agreement_of_parts(fit, splits).into_iter().chain(term).collect(),
            omitted: omitted.map(|omitted| omitted.mean_square),
        }
    }

    /// Compares a fit of averaged responses with fits to bands of lines and, if there are several
    /// `records`, with fits to single records. Each entry of `records` has the averages and the
    /// degrees of freedom of the forces, counted from 0; `data` has the data of all records.
    ///
    /// # Errors
    /// The errors of [`Frf::data`].
    pub(super) fn from_averages(
        data: &FrequencyData,
        records: &[(Frf, Vec<usize>)],
        estimate: &Estimate,
    ) -> Result<Self, SpectraError> {
        let mut splits = vec![(Split::Bands, RowParts::Records)];
        if records.len() > 1 {
            let averages = records.iter().map(|(frf, driven)| frf.data(driven));
            let averages: Vec<FrequencyData> = averages.collect::<Result<_, _>>()?;
            splits.push((Split::Rows(rows_of(&averages)), RowParts::Records));
        }
        let parts = PartsOfFit::from_responses(data, records, estimate);
        Ok(parts.map_or_else(Self::default, |fit| Self::new(&fit, &splits, Some(&[]), estimate)))
    }

    /// Removes the omitted term from the comparison if another explanation of the residual explains
    /// more than this term. `remaining` is the fraction of the residual power that remains with the
    /// other explanation.
    pub(super) fn without_unlikely_term(mut self, remaining: Option<f64>) -> Self {
        let is_less_likely = |finding: &Finding| match (finding, remaining) {
            (Finding::TermLeftOut(term), Some(remaining)) => term.explained < 1.0 - remaining,
            _ => false,
        };
        if self.parts.iter().any(is_less_likely) {
            self.parts.retain(|finding| !is_less_likely(finding));
            self.omitted = None;
        }
        self
    }
}

/// Returns the rows of each record in the joint data.
pub(super) fn rows_of(records: &[FrequencyData]) -> Vec<Vec<Range<usize>>> {
    let mut first = 0;
    let rows = records.iter().map(|data| {
        let rows = first..first + data.len();
        first = rows.end;
        vec![rows]
    });
    rows.collect()
}
