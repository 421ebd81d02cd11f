//! Golden files: our own numbers with many digits, to detect changes; they are not evidence.

use std::path::{Path, PathBuf};

/// Relative difference above which two numbers differ.
const TOLERANCE: f64 = 1e-9;

/// Largest difference, relative to the largest number of its column, that counts as rounding.
const NOISE: f64 = 1e-12;

/// Largest difference of errors in per cent that counts as rounding: a relative change of a value
/// by 1e-9 changes its error by this number.
const PERCENT_NOISE: f64 = 100.0 * TOLERANCE;

/// Path of the golden file of a table or figure.
pub fn path(root: &Path, name: &str) -> PathBuf {
    root.join("tests/golden").join(format!("{name}.csv"))
}

/// Rewrites a golden file.
///
/// # Errors
/// A message with the file that cannot be written.
pub fn bless(root: &Path, name: &str, csv: &str) -> Result<(), String> {
    let path = path(root, name);
    let words = |e: std::io::Error| format!("{}: {e}", path.display());
    std::fs::create_dir_all(root.join("tests/golden")).map_err(words)?;
    std::fs::write(&path, csv).map_err(words)
}

/// Returns every difference between the data of a table or figure and its golden file, a sentence
/// each.
pub fn differences(root: &Path, name: &str, csv: &str) -> Vec<String> {
    let path = path(root, name);
    let golden = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) => {
            return vec![format!("{name}: no golden file ({}: {e})", path.display())];
        }
    };
    compare(name, &cells(&golden), &cells(csv))
}

type Grid = Vec<Vec<String>>;

fn cells(text: &str) -> Grid {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
    reader.records().map_while(Result::ok).map(|r| r.iter().map(str::to_owned).collect()).collect()
}

fn compare(name: &str, golden: &Grid, ours: &Grid) -> Vec<String> {
    if golden.len() != ours.len() {
        return vec![format!("{name}: {} rows where golden has {}", ours.len(), golden.len())];
    }
    let columns = golden.iter().map(Vec::len).max().unwrap_or(0);
    let noise: Vec<f64> = (0..columns).map(|c| noise(golden, c)).collect();
    let mut differences = Vec::new();
    for (row, (g, o)) in golden.iter().zip(ours).enumerate() {
        if g.len() != o.len() {
            differences.push(format!(
                "{name}, row {row}: {} cells where golden has {}",
                o.len(),
                g.len()
            ));
            continue;
        }
        for (column, (g, o)) in g.iter().zip(o).enumerate() {
            if !same(g, o, noise[column]) {
                let head = golden[0].get(column).map_or("", String::as_str);
                differences
                    .push(format!("{name}, row {row}, column {head}: golden {g:?}, now {o:?}"));
            }
        }
    }
    differences
}

/// The absolute difference allowed for the numbers of a column.
fn noise(grid: &Grid, column: usize) -> f64 {
    let head = grid.first().and_then(|r| r.get(column)).map_or("", String::as_str);
    if head.ends_with("_percent") {
        return PERCENT_NOISE;
    }
    let numbers = grid.iter().filter_map(|r| r.get(column)?.parse::<f64>().ok());
    NOISE * numbers.map(f64::abs).filter(|v| v.is_finite()).fold(0.0, f64::max)
}

fn same(golden: &str, ours: &str, noise: f64) -> bool {
    match (golden.parse::<f64>(), ours.parse::<f64>()) {
        (Ok(g), Ok(o)) => (g - o).abs() <= (TOLERANCE * g.abs().max(o.abs())).max(noise),
        _ => golden == ours,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn differences_of(golden: &str, ours: &str) -> Vec<String> {
        compare("t", &cells(golden), &cells(ours))
    }

    #[test]
    fn rounding_passes_and_a_moved_number_is_named() {
        let golden = "npi,k\n2,5000.0\n4,0.0\n";
        assert!(differences_of(golden, "npi,k\n2,5000.000000001\n4,1e-12\n").is_empty());
        assert!(differences_of("e_percent\n1e-7\n", "e_percent\n1.5e-7\n").is_empty());
        assert_eq!(differences_of("e_percent\n1e-7\n", "e_percent\n3e-7\n").len(), 1);
        assert_eq!(
            differences_of(golden, "npi,k\n2,5000.1\n4,0.0\n"),
            ["t, row 1, column k: golden \"5000.0\", now \"5000.1\""]
        );
    }

    #[test]
    fn words_and_shapes_must_agree() {
        assert_eq!(differences_of("v\nto the digit\n", "v\nunexplained\n").len(), 1);
        assert_eq!(differences_of("v\n1\n", "v\n1\n2\n").len(), 1);
        assert_eq!(differences_of("v\n1\n", "v\n1,2\n").len(), 1);
    }
}
