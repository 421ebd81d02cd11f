//! Results as Parquet.

use std::path::Path;

use mechid::io::{ParquetColumn, ParquetValues, write_parquet};

use super::Coverage;
use super::coverage::Interval;

fn text(name: &'static str, values: impl Iterator<Item = String>) -> ParquetColumn {
    ParquetColumn { name, values: ParquetValues::Text(values.map(Some).collect()) }
}

fn numbers(name: &'static str, values: impl Iterator<Item = Option<f64>>) -> ParquetColumn {
    ParquetColumn { name, values: ParquetValues::Number(values.collect()) }
}

/// Writes a row for each interval of each experiment.
pub(super) fn write(path: &Path, all: &[(Coverage, Vec<Interval>)]) -> Result<(), String> {
    let rows = || all.iter().flat_map(|(of, all)| all.iter().map(move |interval| (of, interval)));
    let part = |at: usize| rows().map(move |(_, i)| i.estimate.map(|estimate| estimate[at]));
    let columns = [
        text("study", rows().map(|(of, _)| of.kind.to_owned())),
        text("parameter", rows().map(|(of, _)| of.parameter.to_owned())),
        ParquetColumn {
            name: "seed",
            values: ParquetValues::Count(rows().map(|(_, i)| Some(i.seed as i64)).collect()),
        },
        numbers("truth", rows().map(|(_, i)| Some(i.truth))),
        numbers("estimate", part(0)),
        numbers("low", part(1)),
        numbers("high", part(2)),
    ];
    write_parquet(path, &columns, &[]).map_err(|e| e.to_string())
}

/// Writes the cells of the tables that a study printed, one row for each cell.
pub(super) fn write_cells(path: &Path, cells: &[[String; 4]]) -> Result<(), String> {
    let names = ["study", "row", "column", "value"];
    let columns: Vec<ParquetColumn> = names
        .iter()
        .enumerate()
        .map(|(at, name)| text(name, cells.iter().map(move |cell| cell[at].clone())))
        .collect();
    write_parquet(path, &columns, &[]).map_err(|e| e.to_string())
}
