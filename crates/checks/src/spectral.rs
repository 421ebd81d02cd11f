//! Checks of a record before a fit of its spectra or frequency responses.

use mechid_estimate::frequency_domain::equation_rows;
use mechid_estimate::{EstimateError, Unknowns};
use mechid_numerics::NumericsError;
use mechid_signal::Record;
use mechid_spectra::FrequencyData;

use super::claimed_period;
use super::conditioning::conditioning;
use super::excited_lines;
use super::finding::Finding;
use super::period_scatter::repetition;
use super::unequal_periods::unequal_periods;

/// Checks excitation and conditioning before spectra or frequency responses are fitted, for all
/// experiments that are fitted together, for example with one shaker at a time.
///
/// # Errors
/// As [`equation_error`](mechid_estimate::frequency_domain::equation_error).
///
/// # Source
/// As [`before_fit`](super::before_fit).
pub fn before_spectral_fit(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<Vec<Finding>, EstimateError> {
    let mut findings = vec![excited_lines::excitation(data, unknowns)];
    match equation_rows(data)?.solve(unknowns) {
        // Too few rows: conditioning cannot be checked.
        Err(EstimateError::Numerics(NumericsError::TooFewRows { .. })) => {}
        solved => findings.push(conditioning(&solved?)),
    }
    Ok(findings)
}

/// Checks whether force (N) and response of one record, in any quantity, consist of periods of
/// `period` samples: by the deviation of the periods from their mean, or the seam of a single
/// period, and by [`claimed_period`].
///
/// # Errors
/// [`EstimateError::Signal`] if the records are not a whole number of periods.
///
/// # Source
/// Ours.
pub fn steady_periods(
    force: &Record,
    response: &Record,
    period: usize,
) -> Result<Vec<Finding>, EstimateError> {
    let mut findings = vec![repetition(response, period)?];
    match claimed_period(force, period) {
        Some(other_period) => findings.push(other_period),
        None => findings.extend(unequal_periods(force, response, period)?),
    }
    Ok(findings)
}
