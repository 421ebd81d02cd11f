//! Number of equations and memory that a fit needs, checked before the computation.

use mechid_estimate::Unknowns;
use mechid_numerics::NumericsError;

use super::open_records;
use super::options::{Identify, Source};
use crate::AnalysisError;
use crate::measurement::Windowed;

/// Refuses a fit with fewer equations than unknowns, and a fit whose spectra or transients need too
/// much memory.
///
/// # Errors
/// [`NumericsError::TooFewRows`] and [`AnalysisError::Memory`].
pub(super) fn check(
    how: &Identify,
    records: &[Windowed],
    unknowns: &Unknowns,
    period_given: bool,
) -> Result<(), AnalysisError> {
    let samples = |record: &Windowed| match how.source {
        Source::Segments(_) | Source::Samples(_) => record.samples(),
        // Periods are averaged; each line gives two real equations.
        _ if period_given => record.held.period,
        _ => record.samples(),
    };
    let rows: usize = records.iter().map(samples).sum();
    let terms = match &how.source {
        Source::Terms(fit) => fit.terms.terms.len() + fit.terms.candidates.len(),
        _ => 0,
    };
    // At least one equation of motion has this number of unknowns or more.
    let needed = (unknowns.independent() + terms).div_euclid(unknowns.dof().max(1));
    if rows < needed {
        return Err(NumericsError::TooFewRows { rows, unknowns: needed }.into());
    }
    let lines = |record: &Windowed| match &how.source {
        Source::Samples(_) => 0,
        Source::Segments(fit) => fit.segments.segment.unwrap_or(record.held.period) / 2,
        _ if period_given => record.held.period / 2,
        _ => record.held.force.len() / 2,
    };
    let is_open = match &how.source {
        Source::Open(_) | Source::Hits(_) => true,
        Source::Spectra(_) => !period_given && open_records::suit(records, unknowns),
        _ => false,
    };
    if is_open {
        records.iter().try_for_each(|record| record.check_transients(records))?;
    }
    records.iter().try_for_each(|record| record.check_spectra(lines(record)))
}
