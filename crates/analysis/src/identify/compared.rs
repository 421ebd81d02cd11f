//! Comparison of a fit with its parts and with larger models.

use mechid_checks::{Finding, RowParts, agreement_of_parts, omitted_term};
use mechid_estimate::Estimate;
use mechid_estimate::frequency_domain::{PartsOfFit, SampledRows, Split};
use nalgebra::DMatrix;

/// What a comparison of a fit with its parts and with larger models shows.
#[derive(Default)]
pub(super) struct Compared {
    /// The findings.
    pub(super) parts: Vec<Finding>,
    /// Mean square that a term left out adds to the covariance of the parameters.
    pub(super) omitted: Option<DMatrix<f64>>,
}

impl Compared {
    pub(super) fn new(
        fit: &PartsOfFit<'_>,
        splits: &[(Split, RowParts)],
        records: &[SampledRows],
        estimate: &Estimate,
    ) -> Self {
        let (term, omitted) = omitted_term(fit, records, estimate).unzip();
        Self {
            parts: agreement_of_parts(fit, splits).into_iter().chain(term).collect(),
            omitted: omitted.map(|omitted| omitted.mean_square),
        }
    }
}
