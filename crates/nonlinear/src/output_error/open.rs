//! Fits of open records, such as sweeps, that begin with a linear fit.

use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{ResponseQuantity, Terms};
use mechid_signal::Extent;

use super::starts::best_search;
use super::{NonlinearFit, SteppedRecord, Weights, output_error};
use crate::estimate::NonlinearEstimate;
use crate::limits::{OPEN_WINDOWS, OUTPUT_FORGOTTEN};

/// Estimates a nonlinear system from open records by [`output_error`]. The initial estimate is a
/// linear fit with terms whose coefficients are zero.
///
/// If a stiffness is slightly wrong, the simulated response loses its phase relation to the
/// measured response, and the cost of a long record has many minima. Therefore the records are
/// first cut into windows, each with a separate initial state; the estimate from the windows is the
/// initial estimate of the fit to the whole records. If a term has a constant, such as a clearance,
/// the search starts at the given constant, at half and at twice this constant, and the best result
/// is used.
///
/// # Errors
/// As [`output_error`]; relations between parameters are refused.
///
/// # Source
/// Bock (1987), *Randwertproblemmethoden zur Parameteridentifizierung*, Bonner Mathematische
/// Schriften 183 (multiple shooting: windows with independent initial states); Schoukens & Ljung
/// (2019), IEEE Control Systems 39(6), 28–99.
pub fn output_error_of_open_records(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    linear: &Estimate,
    terms: &Terms,
) -> Result<NonlinearFit, EstimateError> {
    let scaled = factors(terms).iter().filter_map(|factor| scaled(terms, *factor));
    let starts = scaled.map(|terms| NonlinearEstimate::without_force(linear, &terms));
    let starts: Vec<_> = starts.collect::<Result<_, _>>()?;
    let start = best_search(&windows(records)?, measured, &starts, Weights::Levels)?.estimate;
    output_error(records, measured, &start)
}

/// Returns the factors for the constants inside the laws. For each factor, one search begins at the
/// given constants times this factor.
fn factors(terms: &Terms) -> &'static [f64] {
    let has_constants = terms.iter().any(|term| !term.law().constants().is_empty());
    if has_constants { &[1.0, 0.5, 2.0] } else { &[1.0] }
}

/// Returns the terms with their constants multiplied; `None` if a law refuses a constant.
fn scaled(terms: &Terms, factor: f64) -> Option<Terms> {
    let scaled_term = |term: &mechid_model::Term| {
        let constants = term.law().constants();
        let values: Vec<f64> = constants.iter().map(|c| c.value * factor).collect();
        if values.is_empty() { Some(term.clone()) } else { term.with_constants(&values) }
    };
    Terms::new(terms.iter().map(scaled_term).collect::<Option<_>>()?).ok()
}

/// Returns the windows of all records. The windows of a record have equal length; a record that is
/// too short for two windows remains whole.
fn windows(records: &[SteppedRecord]) -> Result<Vec<SteppedRecord>, EstimateError> {
    let windows_per_record = OPEN_WINDOWS.div_ceil(records.len().max(1));
    let mut windows = Vec::new();
    for record in records {
        let samples = record.force.len();
        // The initial state of a window has 2n unknowns, so a window needs many more samples than
        // this to determine the other parameters.
        let fewest = (OUTPUT_FORGOTTEN as usize) * 16 * record.force.channels();
        let count = (samples / fewest).clamp(1, windows_per_record);
        let len = samples / count;
        for window in 0..count {
            let cut = |all: &mechid_signal::Record| all.window(window * len, len);
            windows.push(SteppedRecord {
                force: cut(&record.force)?,
                response: cut(&record.response)?,
                extent: Extent::Open,
                periods: 1,
            });
        }
    }
    Ok(windows)
}
