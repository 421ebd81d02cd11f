//! Records as comma-separated text.

use std::fmt::Write as _;

use mechid_signal::Sampling;

/// A table with a `time` column in seconds and the named columns, as [`Table`](crate::Table) reads
/// it back bit for bit: every number has as many digits as it takes to tell it from its neighbours.
///
/// # Panics
/// If a column is not as long as the sampling.
pub fn csv_text(sampling: Sampling, columns: &[(String, &[f64])]) -> String {
    let mut text = String::from("time");
    for (name, column) in columns {
        assert_eq!(column.len(), sampling.len(), "column {name} is as long as the time axis");
        text.push(',');
        text.push_str(&quoted(name));
    }
    text.push('\n');
    for (k, time) in sampling.times().enumerate() {
        let _ = write!(text, "{time:?}");
        for (_, column) in columns {
            let _ = write!(text, ",{:?}", column[k]);
        }
        text.push('\n');
    }
    text
}

fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r', ';', '\t']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.into()
    }
}
