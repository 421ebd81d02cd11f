//! All judged cells by table, and two ways to read them: as printed, and corrected.

use std::collections::BTreeMap;

use super::super::cells::{self, Mean, Row};
use super::super::published::{Method, Published};
use super::super::results::Results;
use super::markdown::number;

/// Printed and computed values, cell by cell.
pub struct Evidence<'a> {
    /// Printed values.
    pub published: &'a Published,
    /// Computed values.
    pub results: &'a Results,
    /// Numbers of the tables, such as `5.6.4`, in printed order.
    pub tables: Vec<String>,
    rows: BTreeMap<String, Vec<Row>>,
    means: BTreeMap<String, Vec<Mean>>,
}

impl<'a> Evidence<'a> {
    /// Judges every cell.
    pub fn new(published: &'a Published, results: &'a Results) -> Self {
        let mut tables: Vec<String> = published.tables().map(str::to_owned).collect();
        tables.sort_by_key(|t| sorting(t));
        let rows: BTreeMap<String, Vec<Row>> =
            tables.iter().map(|t| (t.clone(), cells::rows(t, published, results))).collect();
        let means = rows.iter().map(|(t, r)| (t.clone(), cells::means(t, published, r))).collect();
        Self { published, results, tables, rows, means }
    }

    /// The cells of a table whose settings are known.
    pub fn rows(&self, table: &str) -> &[Row] {
        self.rows.get(table).map_or(&[], Vec::as_slice)
    }

    /// The mean-error row of a table.
    pub fn means(&self, table: &str) -> &[Mean] {
        self.means.get(table).map_or(&[], Vec::as_slice)
    }

    /// Every cell whose settings are known.
    pub fn all(&self) -> impl Iterator<Item = &Row> {
        self.rows.values().flatten()
    }

    /// The numbers as printed.
    pub fn printed(&self) -> View<'_> {
        View { evidence: self, source: Source::Printed }
    }

    /// The numbers without slips.
    pub fn corrected(&self) -> View<'_> {
        View { evidence: self, source: Source::Corrected }
    }
}

/// Returns the sorting key of a table: the numbers in its name, so that 5.6.10 comes after 5.6.9.
fn sorting(table: &str) -> Vec<(bool, u32, String)> {
    let part = |p: &str| (p.parse::<u32>().is_err(), p.parse().unwrap_or(0), p.to_owned());
    table.split('.').map(part).collect()
}

/// Numbers with which a claim is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Printed numbers; for reruns, numbers computed with every slip.
    Printed,
    /// Numbers recomputed without slips.
    Corrected,
}

/// The tables with the numbers of one [`Source`].
#[derive(Clone, Copy)]
pub struct View<'a> {
    evidence: &'a Evidence<'a>,
    /// Source of the numbers.
    pub source: Source,
}

impl View<'_> {
    /// Returns pairs of NPI and error in % for one column and one parameter of a table; the table
    /// has several parameters.
    pub fn series_of(&self, table: &str, parameter: &str, method: Method) -> Vec<(f64, f64)> {
        self.evidence
            .rows(table)
            .iter()
            .filter(|r| r.cell.method == method && r.cell.parameter == parameter)
            .filter_map(|r| Some((r.cell.npi?, self.error_of(r)?)))
            .collect()
    }

    /// Pairs of NPI and error in %, for one column.
    pub fn series(&self, table: &str, method: Method) -> Vec<(f64, f64)> {
        self.column(table, method).filter_map(|r| Some((r.cell.npi?, self.error_of(r)?))).collect()
    }

    /// Pairs of NPI and signed deviation from the true value in %, for one column.
    pub fn deviations(&self, table: &str, method: Method) -> Vec<(f64, f64)> {
        let deviation = |r: &Row| {
            let value = match self.source {
                Source::Printed => r.cell.estimate.parse().ok()?,
                Source::Corrected => r.correct,
            };
            let truth = truth(r)?;
            Some((r.cell.npi?, 100.0 * (value - truth) / truth))
        };
        self.column(table, method).filter_map(deviation).collect()
    }

    /// Pairs of NPI and error in % for one column, with the errors of our best estimator.
    pub fn best(&self, table: &str, method: Method) -> Vec<(f64, f64)> {
        self.column(table, method).filter_map(|r| Some((r.cell.npi?, r.best_error))).collect()
    }

    /// Printed errors, in %, in a table that names no integrator.
    pub fn unspecified(&self, table: &str, parameter: &str) -> Vec<f64> {
        let cells = self.evidence.published.table(table);
        cells
            .filter(|c| c.method == Method::Unspecified && c.parameter == parameter)
            .filter_map(|c| c.error_percent.parse().ok())
            .collect()
    }

    /// Printed errors, in %, in one column; for tables that cannot be replayed.
    pub fn printed_errors(&self, table: &str, method: Method) -> Vec<f64> {
        let cells = self.evidence.published.table(table).filter(|c| c.method == method);
        cells.filter_map(|c| c.error_percent.parse().ok()).collect()
    }

    /// Returns the error in % of one cell.
    ///
    /// NaN if the table has no such cell: every comparison with it is false.
    pub fn error(&self, table: &str, method: Method, npi: f64) -> f64 {
        let at = |(n, _): &&(f64, f64)| *n == npi;
        self.series(table, method).iter().find(at).map_or(f64::NAN, |(_, e)| *e)
    }

    /// The mean error in % of one column.
    pub fn mean(&self, table: &str, method: Method) -> f64 {
        mean(self.series(table, method).iter().map(|(_, e)| *e))
    }

    /// Returns the mean errors of a table in words, the smallest first.
    pub fn ranking(&self, table: &str) -> String {
        let mut means = Method::ALL.map(|m| (self.mean(table, m), m.name()));
        means.sort_by(|a, b| a.0.total_cmp(&b.0));
        means.map(|(e, name)| format!("{name} {}", number(e))).join(", ")
    }

    fn column(&self, table: &str, method: Method) -> impl Iterator<Item = &Row> {
        self.evidence.rows(table).iter().filter(move |r| r.cell.method == method)
    }

    fn error_of(&self, row: &Row) -> Option<f64> {
        match self.source {
            Source::Printed => row.error.printed.parse().ok(),
            Source::Corrected => Some(row.correct_error),
        }
    }
}

fn truth(row: &Row) -> Option<f64> {
    let machine = cells::machine_of(&row.cell);
    let at = machine.parameters().iter().position(|p| *p == row.cell.parameter)?;
    Some(machine.truth()[at])
}

/// The arithmetic mean.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}
