//! Checks before a fit: enough equations for the unknowns, and enough memory.

use std::collections::BTreeSet;

use mechid_estimate::Unknowns;
use mechid_io::{FrequencyResponses, Limits, ResponseFunction};
use mechid_numerics::NumericsError;

use super::open_records;
use super::options::{Identify, Source};
use super::response_settings::IdentifyResponses;
use crate::AnalysisError;
use crate::limits::{
    TABLE_BYTES, TABLE_DOF_BYTES, TABLE_SENSITIVITIES, TABLE_SENSITIVITY_BYTES, UNKNOWN_PAIR_BYTES,
    check_bytes,
};
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

/// Refuses a fit to tables if it needs more memory than the limit for files of their size.
///
/// # Errors
/// [`AnalysisError::Memory`], and the errors of the settings of the masses.
pub(super) fn check_tables(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<(), AnalysisError> {
    let Some((allowed, file)) = allowed_memory(tables) else { return Ok(()) };
    let is_chosen = |function: &&ResponseFunction| {
        let points = [&function.response, &function.reference];
        how.points.is_empty() || points.iter().all(|point| how.points.contains(point))
    };
    let is_in_band =
        |hz: &&f64| how.band.is_none_or(|band| (band.low_hz..=band.high_hz).contains(*hz));
    let of_table = |table: &FrequencyResponses| {
        let lines = table.frequency_hz.iter().filter(is_in_band).count();
        lines * table.functions.iter().filter(is_chosen).count()
    };
    let numbers: usize = tables.iter().map(of_table).sum();
    // Because of reciprocity, every force point is also a response point. The direction −Z is the
    // degree of freedom of +Z.
    let functions = tables.iter().flat_map(|table| &table.functions).filter(is_chosen);
    let points = functions.flat_map(|function| [&function.response, &function.reference]);
    let dof = points.map(|point| point.replace('-', "+")).collect::<BTreeSet<_>>().len();
    // Impossible settings count as no unknowns here; a later step refuses them.
    let unknowns = how.mass.unknowns(dof).and_then(|all| how.structure.apply(all));
    let unknowns = unknowns.map_or(0, |unknowns| unknowns.independent());
    let sensitivities = numbers.saturating_mul(unknowns).saturating_mul(TABLE_SENSITIVITY_BYTES);
    let of_lines = numbers.saturating_mul(TABLE_BYTES + dof * TABLE_DOF_BYTES);
    let of_unknowns = unknowns.saturating_mul(unknowns).saturating_mul(UNKNOWN_PAIR_BYTES);
    let sensitivities = if sensitivities <= TABLE_SENSITIVITIES { sensitivities } else { 0 };
    let needed = of_lines.saturating_add(sensitivities).saturating_add(of_unknowns);
    check_bytes(file, numbers, needed, allowed)
}

/// Returns the memory, in bytes, that all tables may use together. A table that is not from a file
/// may use the memory of a file with its numbers.
pub(crate) fn memory_of_tables(tables: &[FrequencyResponses]) -> usize {
    let of_table = |table: &FrequencyResponses| {
        let numbers = 2 * table.frequency_hz.len() * table.functions.len();
        table.memory.unwrap_or_else(|| Limits::DEFAULT.memory(size_of::<f64>() * numbers))
    };
    tables.iter().map(of_table).sum()
}

/// Returns the largest of the memory limits of the tables, in bytes, and the name of its file;
/// `None` if a table is not from a file. The analysis of all tables together may use this memory.
pub(crate) fn allowed_memory(tables: &[FrequencyResponses]) -> Option<(usize, &str)> {
    let each = tables.iter().map(|table| Some((table.memory?, table.file.as_str())));
    each.collect::<Option<Vec<_>>>()?.into_iter().max_by_key(|(memory, _)| *memory)
}
