//! Values that are printed in two places.

use super::super::super::published::{Cell, Published};
use super::super::evidence::Evidence;

/// Returns a row for each pair of tables: their names, the number of comparisons, and the
/// differences.
pub fn rows(evidence: &Evidence) -> Vec<Vec<String>> {
    let published = evidence.published;
    let symposium: Vec<(Cell, Cell)> =
        (2..=9).flat_map(|n| pairs(published, "D-symposium-1", &format!("5.6.{n}"))).collect();
    let row = |name: &str, pairs: Vec<(Cell, Cell)>| {
        let numbers = [|c: &Cell| c.estimate.clone(), |c: &Cell| c.error_percent.clone()];
        let differing: Vec<String> = pairs
            .iter()
            .flat_map(|(a, b)| numbers.iter().map(move |of| (a, of(a), of(b))))
            .filter(|(_, a, b)| !a.starts_with(b.as_str()))
            .map(|(cell, a, b)| {
                let npi = cell.npi.unwrap_or(f64::NAN);
                format!("{} {}, NPI {npi}: {a} and {b}", cell.method.name(), cell.parameter)
            })
            .collect();
        let differing = if differing.is_empty() { "none".to_owned() } else { differing.join("; ") };
        vec![name.to_owned(), (2 * pairs.len()).to_string(), differing]
    };
    vec![
        row("5.2.2 and 5.2.4, NPI 2 and 4", pairs(published, "5.2.2", "5.2.4")),
        row("5.2.3 and 5.2.5, NPI 2 and 4", pairs(published, "5.2.3", "5.2.5")),
        row("symposium table 1 and 5.6.2–5.6.9, cut to their decimals, NPI 6", symposium),
    ]
}

/// Pairs of cells, one from each table, that have the same parameter, settings and method.
fn pairs(published: &Published, one: &str, other: &str) -> Vec<(Cell, Cell)> {
    let same = |a: &Cell, b: &Cell| {
        a.parameter == b.parameter && a.method == b.method && a.npi == b.npi && a.nt == b.nt
    };
    published
        .table(one)
        .filter_map(|a| Some((a.clone(), published.table(other).find(|b| same(a, b))?.clone())))
        .collect()
}
