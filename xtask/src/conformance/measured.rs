//! Measured records of others: published numbers compared with those on the pages of the gallery.
//!
//! The records are not part of the project. Our numbers come from the pages of the gallery. Where
//! the records are available, the book's test compares these pages with the program. This page is
//! therefore the same with and without the records.

use std::path::Path;

use csv::StringRecord;

use super::{Judge, Row, Status};

/// Record with its source and tolerance: page of the gallery, name, source, tolerance.
const RECORDS: [[&str; 4]; 6] = [
    [
        "subframe",
        "Steel subframe, two shakers",
        "DaISy 96-013 through SLICOT; a subspace model of all 5,000 samples (N4SID of nfoursid 1.0.2, 12 block rows, order 40)",
        "0.1 Hz, half the line spacing of the record, and a tenth of the damping ratio, because a subspace model states no error",
    ],
    [
        "beam-frf",
        "Cantilever, one frequency response",
        "J. C. Slater, Vibration Toolbox, example of sdof_cf",
        "0.03125 Hz, a tenth of the line spacing, because the printed fit states no error",
    ],
    [
        "cd-arm",
        "CD player's arm",
        "DaISy through SLICOT; shares that a subspace model of order 12 explains; shares that such a model, fitted to the first 60 % (N4SID of nfoursid 1.0.2, 15 block rows), predicts",
        "no lower than the other model",
    ],
    [
        "air-track",
        "Mass on an air track",
        "M. Schmidt and H. Lipson, Science 324, 2009, supplement; a decaying cosine by SciPy's curve_fit over the same samples",
        "three of our standard errors: both programs fit the same samples, but SciPy assumes white noise and mechid coloured noise",
    ],
    [
        "shake-table",
        "Storey on a shake table",
        "mdof, Stiff 1 story, El Centro Trial 1; the highest line of NumPy's spectrum of the storey",
        "one line, 0.047 Hz",
    ],
    [
        "silverbox",
        "Silverbox",
        "least squares over 335 lines by NumPy; J. Schoukens and L. Ljung, IEEE Control Systems 39(6), 2019: simulation errors of physical models and of the best black box, on a part of the record that is not used here; noise of the record from the lines without force",
        "0.2 Hz and 0.001, because the two fits weight the lines differently and the hardening spring moves the resonance by 4 Hz; errors: not above those published for another part of the record, and not below the noise",
    ],
];

/// Compares the published numbers of all records with those on the pages of the gallery.
pub(super) fn records(root: &Path) -> Result<Vec<Judge>, String> {
    let file = root.join("tests/published/programs/measured.csv");
    let words = |e: &dyn std::fmt::Display| format!("{}: {e}", file.display());
    let mut reader = csv::Reader::from_path(&file).map_err(|e| words(&e))?;
    let lines = reader.records().collect::<Result<Vec<_>, _>>().map_err(|e| words(&e))?;
    RECORDS
        .iter()
        .map(|[page, name, source, tolerance]| {
            let path = root.join(format!("docs/book/src/gallery/{page}.md"));
            let shown =
                std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            let row = |line: &StringRecord| {
                row(line, &shown).ok_or_else(|| words(&line.iter().collect::<Vec<_>>().join(",")))
            };
            let rows = lines
                .iter()
                .filter(|line| &line[0] == *page)
                .map(row)
                .collect::<Result<Vec<_>, _>>()?;
            Ok(Judge { name, source, tolerance, test: "crates/cli/tests/book/gallery.rs", rows })
        })
        .collect()
}

/// Returns the row for a line of the file, which has eight cells: page, quantity, expected value,
/// kind and size of the tolerance, and the position of our number on the page. The position is the
/// beginning of its line, the index among the lines with this beginning, and the index of the word,
/// both counted from 1.
fn row(line: &StringRecord, page: &str) -> Option<Row> {
    let cells: Vec<&str> = line.iter().collect();
    let [_, quantity, expected, kind, tolerance, start, which, word] = cells.as_slice() else {
        return None;
    };
    let mut shown = page.lines().filter(|line| line.starts_with(start));
    let shown = shown.nth(which.parse::<usize>().ok()? - 1)?;
    let ours = shown.split_whitespace().nth(word.parse::<usize>().ok()? - 1)?;
    let difference = ours.parse::<f64>().ok()? - expected.parse::<f64>().ok()?;
    let (ratio, sign) = match *kind {
        "within" => (Some(difference / tolerance.parse::<f64>().ok()?), ""),
        "at most" => (None, "≤ "),
        "at least" => (None, "≥ "),
        _ => return None,
    };
    let is_met = match sign {
        "≤ " => difference <= 0.0,
        "≥ " => difference >= 0.0,
        _ => ratio.is_some_and(|ratio| ratio.abs() <= 1.0),
    };
    Some(Row {
        quantity: (*quantity).to_owned(),
        expected: format!("{sign}{expected}"),
        ours: ours.to_owned(),
        difference_over_tolerance: ratio,
        status: if is_met { Status::Met } else { Status::Open },
    })
}
