//! Comparison of numbers of this workspace with printed numbers and with closed forms, on one page.
//!
//! No reference comes from a simulator of this workspace.

mod closed_forms;
mod dissertation;
mod journal_bearings;
mod measured;
mod page;
mod programs;

use std::path::Path;

use serde::Serialize;

use crate::thesis::published::Published;
use crate::thesis::results::Results;

/// Agreement of a number with its reference.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The difference is within the tolerance.
    Met,
    /// The printed number is wrong; the text gives the reason for this conclusion.
    Misprint(String),
    /// The difference has no known reason.
    Open,
}

/// A number and its reference.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Quantity.
    pub quantity: String,
    /// Expected number: as printed, or from the closed form.
    pub expected: String,
    /// The number of this workspace.
    pub ours: String,
    /// Ratio of the difference to the tolerance; `None` for text, which is compared literally.
    pub difference_over_tolerance: Option<f64>,
    /// Agreement.
    pub status: Status,
}

impl Row {
    /// Compares a number with a closed form.
    fn by_formula(quantity: String, expected: f64, ours: f64, tolerance: f64) -> Self {
        let ratio = (ours - expected) / tolerance;
        Self {
            quantity,
            expected: format!("{expected:.10e}"),
            ours: format!("{ours:.10e}"),
            difference_over_tolerance: Some(ratio),
            status: if ratio.abs() <= 1.0 { Status::Met } else { Status::Open },
        }
    }
}

/// Rows with the same reference: a publication or a formula.
#[derive(Debug, Clone, Serialize)]
pub struct Judge {
    /// Name of the reference.
    pub name: &'static str,
    /// Publication with its pages, or the formula.
    pub source: &'static str,
    /// Tolerance, with its reason.
    pub tolerance: &'static str,
    /// File of the test that computes the rows.
    pub test: &'static str,
    /// Rows.
    pub rows: Vec<Row>,
}

impl Judge {
    /// Returns the numbers of rows that are met, are misprints, and are open.
    pub fn counts(&self) -> [usize; 3] {
        let of = |matches: fn(&Status) -> bool| {
            self.rows.iter().filter(|row| matches(&row.status)).count()
        };
        [
            of(|status| *status == Status::Met),
            of(|status| matches!(status, Status::Misprint(_))),
            of(|status| *status == Status::Open),
        ]
    }
}

/// Computes all rows, reference by reference.
///
/// # Errors
/// The message of the computation that fails.
pub fn judges(root: &Path) -> Result<Vec<Judge>, String> {
    let published = Published::read(root)?;
    let results = Results::compute(&published, || ())?;
    let mut judges = vec![
        dissertation::estimates(&published, &results)?,
        dissertation::means(&published, &results),
        dissertation::modes(&published)?,
        journal_bearings::lund_thomsen(root)?,
        journal_bearings::short_bearing()?,
        closed_forms::chain()?,
        closed_forms::transient()?,
        programs::opensees(root)?,
        programs::scipy(root)?,
    ];
    judges.extend(measured::records(root)?);
    Ok(judges)
}

/// Writes the page into the book. If a folder is given, writes the page, and the rows as JSON, into
/// this folder instead.
///
/// # Errors
/// The message of the computation or of the file that fails.
pub fn write(root: &Path, folder: Option<&Path>) -> Result<usize, String> {
    let judges = judges(root)?;
    let page = page::markdown(&judges);
    let mut files = vec![(page::place(root), page.clone())];
    if let Some(folder) = folder {
        let json = serde_json::to_string_pretty(&judges).map_err(|e| e.to_string())?;
        files =
            vec![(folder.join("conformance.md"), page), (folder.join("conformance.json"), json)];
    }
    for (file, text) in files {
        std::fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()))?;
    }
    Ok(judges.iter().map(|judge| judge.rows.len()).sum())
}

/// Returns the lines of the committed page that differ from the page computed now.
///
/// # Errors
/// The message of the computation or of the file that fails.
pub fn differences(root: &Path) -> Result<Vec<String>, String> {
    let place = page::place(root);
    let committed =
        std::fs::read_to_string(&place).map_err(|e| format!("{}: {e}", place.display()))?;
    Ok(page::differences(&committed, &page::markdown(&judges(root)?)))
}
