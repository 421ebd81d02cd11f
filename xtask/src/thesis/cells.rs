//! Printed and computed cells, with a verdict on each.

use super::case::Machine;
use super::misprints::{self, Field, MeanMisprint, Misprint};
use super::published::{Cell, Method, Published};
use super::results::{Key, Results};
use super::verdict::{Verdict, compare};

/// A printed number and the recomputed one.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Value as printed.
    pub printed: String,
    /// Value as recomputed, slips included.
    pub value: f64,
    /// Verdict of the comparison.
    pub verdict: Verdict,
    /// Reason, if the printed number is a misprint.
    pub reason: Option<&'static str>,
}

/// One printed cell of an identification table, reproduced and corrected.
#[derive(Debug, Clone)]
pub struct Row {
    /// Printed cell.
    pub cell: Cell,
    /// The estimate.
    pub estimate: Judged,
    /// Error of the estimate, in per cent.
    pub error: Judged,
    /// Estimate by the same estimator without slips.
    pub correct: f64,
    /// Error of the estimate without slips, in per cent.
    pub correct_error: f64,
    /// Estimate by our best estimator.
    pub best: f64,
    /// Error of our best estimator, in per cent.
    pub best_error: f64,
}

/// The rows of a table whose settings are known.
pub fn rows(table: &str, published: &Published, results: &Results) -> Vec<Row> {
    published.table(table).filter_map(|cell| row(cell, results)).collect()
}

fn row(cell: &Cell, results: &Results) -> Option<Row> {
    let key = Key::from_cell(cell)?;
    let estimates = results.get(key)?;
    let machine = key.case().machine;
    let at = machine.parameters().iter().position(|p| *p == cell.parameter)?;
    let truth = machine.truth()[at];
    let percent = |v: f64| 100.0 * ((v - truth) / truth).abs();
    let value = estimates.slipped[at];
    let misprint = |field| misprints::find(&cell.table, cell.method, cell.npi, field);
    let estimate = judge(value, &cell.estimate, misprint(Field::Estimate), -value);
    let error = judge_error(
        percent(value),
        percent(-value),
        cell,
        misprint(Field::Error),
        cell.estimate.parse().map_or(f64::NAN, percent),
    );
    Some(Row {
        cell: cell.clone(),
        estimate,
        error,
        correct: estimates.correct[at],
        correct_error: percent(estimates.correct[at]),
        best: estimates.best[at],
        best_error: percent(estimates.best[at]),
    })
}

/// Judges a number. A listed misprint is accepted only if its correction agrees with the computed
/// number. The correction of a cell is its corrected digits; that of a whole column is the opposite
/// sign of the printed digits.
fn judge(value: f64, printed: &str, misprint: Option<&'static Misprint>, reversed: f64) -> Judged {
    let plain = compare(value, printed);
    let (verdict, reason) = match misprint {
        Some(m) if plain == Verdict::Unexplained => {
            let confirmed = match m.npi {
                Some(_) => compare(value, m.right),
                None => compare(reversed, printed),
            };
            let known = matches!(confirmed, Verdict::ToTheDigit | Verdict::Rounding);
            if known { (Verdict::Misprint, Some(m.reason)) } else { (plain, None) }
        }
        Some(m) if m.npi.is_some() && plain == Verdict::Rounding => {
            (Verdict::Misprint, Some(m.reason))
        }
        _ => (plain, None),
    };
    Judged { printed: printed.to_owned(), value, verdict, reason }
}

/// Judges an error, which may have been computed from the printed, already rounded estimate.
fn judge_error(
    value: f64,
    reversed: f64,
    cell: &Cell,
    misprint: Option<&'static Misprint>,
    from_printed: f64,
) -> Judged {
    let mut judged = judge(value, &cell.error_percent, misprint, reversed);
    if judged.verdict == Verdict::Unexplained && cell.error_percent.is_empty() {
        judged.verdict = Verdict::ToTheDigit;
    }
    if judged.verdict == Verdict::Unexplained
        && compare(from_printed, &cell.error_percent) == Verdict::ToTheDigit
    {
        judged.verdict = Verdict::Rounding;
    }
    judged
}

/// A printed mean error, the mean of the printed errors, and our mean error.
#[derive(Debug, Clone)]
pub struct Mean {
    /// Estimated parameter.
    pub parameter: String,
    /// Column.
    pub method: Method,
    /// Printed mean error, compared with the mean of the printed errors of the column.
    pub printed: Judged,
    /// Mean of the errors without slips.
    pub correct: f64,
    /// Mean of the errors of our best estimator.
    pub best: f64,
}

/// The mean-error row of a table.
pub fn means(table: &str, published: &Published, rows: &[Row]) -> Vec<Mean> {
    let printed = published.means.iter().filter(|m| m.table == table);
    printed
        .map(|m| {
            let column: Vec<&Row> = rows
                .iter()
                .filter(|r| r.cell.method == m.method && r.cell.parameter == m.parameter)
                .collect();
            let listed = misprints::MEANS.iter().find(|x| x.table == table && x.method == m.method);
            Mean {
                parameter: m.parameter.clone(),
                method: m.method,
                printed: judge_mean(&column, &m.mean_error_percent, listed),
                correct: average(column.iter().map(|r| r.correct_error)),
                best: average(column.iter().map(|r| r.best_error)),
            }
        })
        .collect()
}

/// Judges a mean. As for a cell, a listed misprint is accepted only if one of three means of the
/// column confirms the corrected number: the mean of the printed errors, the mean of these errors
/// with their own misprints corrected, or the mean of the computed errors.
fn judge_mean(column: &[&Row], printed: &str, listed: Option<&'static MeanMisprint>) -> Judged {
    let digits = |r: &&Row| r.error.printed.parse::<f64>().ok();
    let value = average(column.iter().filter_map(digits));
    let put_right = average(column.iter().filter_map(|r| right_error(r).or_else(|| digits(r))));
    let ours = average(column.iter().map(|r| r.error.value));
    let confirmed = |m: &MeanMisprint| {
        let same = |mean| matches!(compare(mean, m.right), Verdict::ToTheDigit | Verdict::Rounding);
        [value, put_right, ours].into_iter().any(same)
    };
    let (verdict, reason) = match listed {
        Some(m) if confirmed(m) => (Verdict::Misprint, Some(m.reason)),
        _ => (compare(value, printed), None),
    };
    Judged { printed: printed.to_owned(), value, verdict, reason }
}

/// Returns the correct error of a cell whose printed error is a misprint; otherwise `None`.
fn right_error(row: &Row) -> Option<f64> {
    let cell = &row.cell;
    let misprint = misprints::find(&cell.table, cell.method, cell.npi, Field::Error)?;
    misprint.npi.and_then(|_| misprint.right.parse().ok())
}

fn average(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}

/// The machine of a table, for its headings.
pub fn machine_of(cell: &Cell) -> Machine {
    if cell.parameter.len() == 3 {
        Machine::Bearing { kyx: mechid::model::KyxSign::Minus }
    } else {
        Machine::SDOF
    }
}
