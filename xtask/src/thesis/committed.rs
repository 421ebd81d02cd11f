//! Tables, figures and pages as they are in the repository.

use std::collections::BTreeSet;
use std::path::Path;

/// Maximum difference of two coordinates, in px, that rounding on another processor explains.
const PIXELS: f64 = 0.1;

/// Returns whether two texts are equal, or two drawings differ only by rounding of their
/// coordinates.
pub fn agree(ours: &str, committed: &str) -> bool {
    if ours == committed || !ours.starts_with("<svg") {
        return ours == committed;
    }
    let (a, b) = (parts(ours), parts(committed));
    a.len() == b.len()
        && a.iter().zip(&b).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            // A number without a decimal point may be part of a word, so it must be equal.
            (Ok(x), Ok(y)) if a.contains('.') || b.contains('.') => (x - y).abs() < PIXELS,
            _ => a == b,
        })
}

/// Returns a drawing as numbers and the text between them.
fn parts(svg: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut remaining = svg;
    let number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    while let Some(first) = remaining.chars().next() {
        let numeric = number(first);
        let end = remaining.find(|c| number(c) != numeric).unwrap_or(remaining.len());
        parts.push(&remaining[..end]);
        remaining = &remaining[end..];
    }
    parts
}

/// Returns a sentence for each file of these kinds in a folder of the repository that is not in
/// `made`, the files that the tasks write.
///
/// # Errors
/// A message with the folder that cannot be read.
pub fn strays(
    root: &Path,
    folder: &str,
    endings: &[&str],
    made: &BTreeSet<String>,
) -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(root.join(folder)).map_err(|e| format!("{folder}: {e}"))?;
    let mut files: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| endings.iter().any(|ending| name.ends_with(&format!(".{ending}"))))
        .filter(|name| !made.contains(name))
        .map(|name| format!("{folder}/{name} belongs to no table, figure or page"))
        .collect();
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_may_move_a_little_and_words_not_at_all() {
        assert!(!agree("in 1950", "in 1938"));
        let drawing = "<svg><path d=\"M1.50 -2.25L3 4\"/><text>12 Hz</text></svg>";
        assert!(agree(drawing, &drawing.replace("1.50", "1.51")));
        for (from, to) in [("1.50", "1.70"), ("L3", "L4"), ("Hz", "N"), ("12", "13"), ("L3 4", "")]
        {
            assert!(!agree(drawing, &drawing.replace(from, to)), "{from} {to}");
        }
    }

    #[test]
    fn files_that_nothing_makes_are_found() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let made = BTreeSet::from(["main.rs".to_owned()]);
        let found = strays(root, "src", &["rs"], &made).unwrap();
        assert!(found.iter().all(|words| !words.contains("main.rs")), "{found:?}");
        assert!(strays(root, "no such folder", &["rs"], &made).is_err());
    }
}
