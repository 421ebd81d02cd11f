//! Appendix B: estimates on records refined by straight lines.
//!
//! The text names neither the integrator nor the interpolated quantities. The most direct
//! interpretation is used here: Newmark, Nt = 128, displacement, velocity and force refined
//! together. It does not give the printed numbers; no other interpretation that we tried gives
//! them, either. The shape of the printed columns, K and C falling steeply from NPI 6 to 10, is
//! that of a first period from rest, not of the periodic steady state of the other tables; but no
//! such run gave the printed digits, either.

use mechid::estimate::Unknowns;
use mechid::estimate::time_domain::TimeDomain;
use mechid::model::Discretisation;
use mechid::signal::Extent;
use mechid::signal::resample::refine;
use mechid::signal::{Interpolation, Record};

use super::case::{Case, Machine};
use super::cells::{Judged, Row};
use super::published::{Cell, Method, Published};
use super::simulate::{Sequences, correct};
use super::verdict::Verdict;

/// Tables B1 and B2.
///
/// # Errors
/// The message of the estimation that fails.
pub fn rows(table: &str, published: &Published) -> Result<Vec<Row>, String> {
    let points = if table == "B1" { 1 } else { 2 };
    published.table(table).map(|cell| row(cell, points)).collect()
}

fn row(cell: &Cell, points: usize) -> Result<Row, String> {
    let npi = cell.npi.ok_or("tables B1 and B2 state NPI")?;
    let case = Case { machine: Machine::SDOF, nt: 128, npi };
    let sequences = correct(case, Method::Newmark)?;
    let at = Machine::SDOF.parameters().iter().position(|p| *p == cell.parameter).unwrap_or(0);
    let truth = Machine::SDOF.truth()[at];
    let percent = |v: f64| 100.0 * ((v - truth) / truth).abs();
    let euler = refined(&sequences, points + 1, Interpolation::Linear, Discretisation::Euler)?[at];
    let best = refined(&sequences, 1, Interpolation::Linear, Discretisation::FirstOrderHold)?[at];
    let judged = |printed: &str, value| Judged {
        printed: printed.to_owned(),
        value,
        verdict: Verdict::Unexplained,
        reason: None,
    };
    Ok(Row {
        cell: cell.clone(),
        estimate: judged(&cell.estimate, euler),
        error: judged(&cell.error_percent, percent(euler)),
        correct: euler,
        correct_error: percent(euler),
        best,
        best_error: percent(best),
    })
}

/// Returns the estimates on records with `factor − 1` interpolated instants in every interval.
///
/// # Errors
/// The message of the interpolation or the estimation that fails.
pub fn refined(
    sequences: &Sequences,
    factor: usize,
    interpolation: Interpolation,
    discretisation: Discretisation,
) -> Result<Vec<f64>, String> {
    let words = |e: mechid::signal::SignalError| e.to_string();
    let fine = |r: &Record| refine(r, factor, interpolation).map_err(words);
    let unknowns =
        Unknowns::known_mass(sequences.machine.system().mass()).map_err(|e| e.to_string())?;
    let fit = TimeDomain::new(discretisation, Extent::Open)
        .fit(
            &fine(sequences.response.displacement())?,
            &fine(sequences.response.velocity())?,
            &fine(&sequences.force)?,
            &unknowns,
        )
        .map_err(|e| e.to_string())?;
    let estimate = fit.estimate();
    Ok(sequences.machine.listed(&estimate.stiffness(), &estimate.damping()))
}
