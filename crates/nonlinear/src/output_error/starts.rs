//! Several starts of a search.

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;

use super::{NonlinearFit, SteppedRecord, output_error};
use crate::estimate::NonlinearEstimate;

/// [`output_error`] from several starts, of which the one that leaves least of the response leads on: constants inside
/// the laws, such as a clearance, make minima of their own.
///
/// # Errors
/// Those of [`output_error`] from the first start if none leads to a minimum, and
/// [`EstimateError::NotConverged`] without a start.
///
/// # Source
/// The source of [`output_error`].
pub fn best_output_error(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    starts: &[NonlinearEstimate],
) -> Result<NonlinearFit, EstimateError> {
    let mut best = Err(EstimateError::NotConverged { searches: starts.len(), steps: 0 });
    for (at, start) in starts.iter().enumerate() {
        let left = |fit: &NonlinearFit| -> f64 {
            fit.estimate.unexplained().iter().map(|part| part * part).sum()
        };
        match (output_error(records, measured, start), &best) {
            (Ok(fit), Ok(other)) if left(&fit) >= left(other) => {}
            (Err(_), _) if at > 0 => {}
            (fit, _) => best = fit,
        }
    }
    best
}
