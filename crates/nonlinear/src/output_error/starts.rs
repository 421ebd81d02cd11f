//! Search from several initial estimates.

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;

use super::{NonlinearFit, SteppedRecord, Weights, search};
use crate::estimate::NonlinearEstimate;

/// Returns the output-error fit with the smallest residual from several initial estimates:
/// constants inside the laws, such as a clearance, cause several minima.
///
/// # Errors
/// As [`output_error`](super::output_error()) from the first initial estimate if no initial
/// estimate leads to a minimum, and [`EstimateError::NotConverged`] without an initial estimate.
///
/// # Source
/// As [`output_error`](super::output_error()).
pub fn best_output_error(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    starts: &[NonlinearEstimate],
) -> Result<NonlinearFit, EstimateError> {
    best_search(records, measured, starts, Weights::Noise)
}

/// Returns the fit of [`best_output_error`] with these weights.
pub(super) fn best_search(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    starts: &[NonlinearEstimate],
    weights: Weights,
) -> Result<NonlinearFit, EstimateError> {
    let mut best = Err(EstimateError::NotConverged { searches: starts.len(), steps: 0 });
    for (at, start) in starts.iter().enumerate() {
        let residual_power = |fit: &NonlinearFit| -> f64 {
            fit.estimate.unexplained().iter().map(|part| part * part).sum()
        };
        match (search(records, measured, start, weights), &best) {
            (Ok(fit), Ok(other)) if residual_power(&fit) >= residual_power(other) => {}
            (Err(_), _) if at > 0 => {}
            (fit, _) => best = fit,
        }
    }
    best
}
