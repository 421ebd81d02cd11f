//! Fits of open records, such as sweeps, from a linear fit on.

use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{ResponseQuantity, Terms};
use mechid_signal::Extent;

use super::{NonlinearFit, SteppedRecord, best_output_error, output_error};
use crate::estimate::NonlinearEstimate;
use crate::limits::{OPEN_WINDOWS, OUTPUT_FORGOTTEN};

/// [`output_error`] on open records from a linear fit of them on, the terms having no force at first.
///
/// A response runs out of step with the measured one where the spring is wrong by little, and a long record has many
/// minima. So the records are cut into windows first, each with a start of its own, in which it runs out of step little;
/// what they give is the start of the fit to the whole records. Terms with a constant inside, such as a clearance, are
/// searched for from that constant, from half of it and from twice as much, the best of which leads on.
///
/// # Errors
/// Those of [`output_error`], and of relations between the parameters, which it has not.
///
/// # Source
/// Bock (1987), *Randwertproblemmethoden zur Parameteridentifizierung*, Bonner Mathematische Schriften 183 (multiple
/// shooting: windows with starts of their own); Schoukens & Ljung (2019), IEEE Control Systems 39(6), 28–99.
pub fn output_error_of_open_records(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    linear: &Estimate,
    terms: &Terms,
) -> Result<NonlinearFit, EstimateError> {
    let scaled = factors(terms).iter().filter_map(|factor| scaled(terms, *factor));
    let starts = scaled.map(|terms| NonlinearEstimate::without_force(linear, &terms));
    let starts: Vec<_> = starts.collect::<Result<_, _>>()?;
    let start = best_output_error(&windows(records)?, measured, &starts)?.estimate;
    output_error(records, measured, &start)
}

/// Factors of the constants inside the laws that a search begins with.
fn factors(terms: &Terms) -> &'static [f64] {
    let has_constants = terms.iter().any(|term| !term.law().constants().is_empty());
    if has_constants { &[1.0, 0.5, 2.0] } else { &[1.0] }
}

/// The terms with their constants multiplied; `None` where a law refuses it.
fn scaled(terms: &Terms, factor: f64) -> Option<Terms> {
    let of = |term: &mechid_model::Term| {
        let constants = term.law().constants();
        let values: Vec<f64> = constants.iter().map(|c| c.value * factor).collect();
        if values.is_empty() { Some(term.clone()) } else { term.with_constants(&values) }
    };
    Terms::new(terms.iter().map(of).collect::<Option<_>>()?).ok()
}

/// The records in windows of equal length, as far as they are long enough for that.
fn windows(records: &[SteppedRecord]) -> Result<Vec<SteppedRecord>, EstimateError> {
    let each = OPEN_WINDOWS.div_ceil(records.len().max(1));
    let mut windows = Vec::new();
    for record in records {
        let samples = record.force.len();
        // A start takes 2n numbers: as many samples again for each of them tell little.
        let fewest = (OUTPUT_FORGOTTEN as usize) * 16 * record.force.channels();
        let count = (samples / fewest).clamp(1, each);
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
