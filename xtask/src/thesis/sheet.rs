//! A table to be written as CSV and Markdown.

use std::fmt::Write as _;

/// Rows of text under named columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sheet {
    /// Column names.
    pub header: Vec<&'static str>,
    /// Cells, as many per row as there are columns.
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    /// A table without rows.
    pub fn new(header: &[&'static str]) -> Self {
        Self { header: header.to_vec(), rows: Vec::new() }
    }

    /// Returns the table as comma-separated values, with quotes around cells that need them.
    pub fn to_csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(&self.header).expect("memory takes all");
        for row in &self.rows {
            writer.write_record(row).expect("as many cells as columns");
        }
        let bytes = writer.into_inner().expect("memory takes all");
        String::from_utf8(bytes).expect("written from strings")
    }

    /// A pipe table.
    pub fn to_markdown(&self) -> String {
        let mut text = format!("| {} |\n|", self.header.join(" | "));
        text.push_str(&"---|".repeat(self.header.len()));
        text.push('\n');
        for row in &self.rows {
            let _ = writeln!(text, "| {} |", row.join(" | ").replace('\n', " "));
        }
        text
    }
}

/// Returns all digits of a number, for files that are compared; empty if the value is not finite.
pub fn exact(value: f64) -> String {
    if value.is_finite() { format!("{value:?}") } else { String::new() }
}

/// Returns enough digits of a number for a comparison with a printed one; a dash if the value is
/// not finite.
pub fn short(value: f64) -> String {
    match value.abs() {
        v if !v.is_finite() => "–".to_owned(),
        v if v >= 1000.0 => format!("{value:.2}"),
        v if v >= 1.0 => format!("{value:.3}"),
        _ => format!("{value:.4}"),
    }
}
