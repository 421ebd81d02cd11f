//! The page of the book that compares our numbers with published ones.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::{Judge, Row, Status};

/// Maximum difference between a ratio on the page and the computed ratio that counts as rounding on
/// another processor.
const ROUNDING: f64 = 0.2;

/// Returns the path of the page.
pub(super) fn place(root: &Path) -> PathBuf {
    root.join("docs/book/src/studies/conformance.md")
}

/// Returns the page, in Markdown.
pub(super) fn markdown(judges: &[Judge]) -> String {
    let mut text = String::from(
        "# Comparison with published numbers\n\n\
         This page compares numbers of this workspace with numbers that others have printed, or that have a closed \
         form. No number is judged by a simulator of this workspace.\n\
         Made by `cargo xtask conformance`, and compared by `cargo xtask conformance --check`; do not edit.\n\n\
         *Met* means that the difference is at most the tolerance. A printed number counts as a *misprint* only if the \
         corrected number is the one computed here. A difference is *open* if its reason is not known.\n\n\
         | Judge | Rows | Met | Misprints | Open |\n|---|---|---|---|---|\n",
    );
    let mut sum = [0; 3];
    for judge in judges {
        let counts = judge.counts();
        for (sum, count) in sum.iter_mut().zip(counts) {
            *sum += count;
        }
        let [met, misprints, open] = counts;
        let _ = writeln!(
            text,
            "| {} | {} | {met} | {misprints} | {open} |",
            judge.name,
            judge.rows.len()
        );
    }
    let [met, misprints, open] = sum;
    let _ =
        writeln!(text, "| **all** | {} | {met} | {misprints} | {open} |", met + misprints + open);
    text.push_str(
        "\nMeasured records are not part of this repository. Our numbers for them are those that the [gallery](../gallery/index.md) \
         shows. Its test compares them with the program if the records are present; this page is the same with and without them.\n\n\
         The coverage of the intervals needs thousands of seeded experiments, so it is judged on other pages: \
         [estimators](estimators.md), [checks](checks.md), [modes](modes.md), [forces](force.md).\n",
    );
    for judge in judges {
        section(&mut text, judge);
    }
    text
}

fn section(text: &mut String, judge: &Judge) {
    let _ = write!(
        text,
        "\n## {}\n\n- Source: {}\n- Tolerance: {}\n- Test: `{}`\n\n\
         | Quantity | Expected | Ours | Difference / tolerance | |\n|---|---|---|---|---|\n",
        judge.name, judge.source, judge.tolerance, judge.test
    );
    for Row { quantity, expected, ours, difference_over_tolerance, status } in &judge.rows {
        let ratio = match difference_over_tolerance {
            // A ratio that rounds to zero is shown without a sign, because rounding may decide its
            // sign.
            Some(ratio) if ratio.abs() < 0.005 => "0.00".to_owned(),
            Some(ratio) => format!("{ratio:.2}"),
            None => "–".to_owned(),
        };
        let status = match status {
            Status::Met => "met".to_owned(),
            Status::Misprint(reason) => format!("misprint: {reason}"),
            Status::Open => "**open**".to_owned(),
        };
        let _ = writeln!(text, "| {quantity} | {expected} | {ours} | {ratio} | {status} |");
    }
}

/// Differences of two pages, line by line: texts must be the same, ratios the same to rounding; the
/// numbers themselves are judged by their ratios.
pub(super) fn differences(committed: &str, computed: &str) -> Vec<String> {
    let (old, new): (Vec<&str>, Vec<&str>) =
        (committed.lines().collect(), computed.lines().collect());
    if old.len() != new.len() {
        return vec![format!("{} lines, and {} computed", old.len(), new.len())];
    }
    old.iter()
        .zip(&new)
        .filter(|(old, new)| !are_same(old, new))
        .map(|(old, new)| format!("{old}\n{new}"))
        .collect()
}

fn are_same(old: &str, new: &str) -> bool {
    let cells = |line: &str| line.split(" | ").map(str::to_owned).collect::<Vec<_>>();
    let (a, b) = (cells(old), cells(new));
    let (Some(x), Some(y)) = (ratio(&a), ratio(&b)) else { return old == new };
    a.len() == b.len() && a[0] == b[0] && a[4] == b[4] && (x - y).abs() <= ROUNDING
}

fn ratio(cells: &[String]) -> Option<f64> {
    if cells.len() == 5 { cells[3].parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_moved_is_told() {
        let line = |ratio: &str, status: &str| format!("| k | 1.0 | 1.1 | {ratio} | {status} |");
        let judge = |old: (&str, &str), new: (&str, &str)| {
            differences(&line(old.0, old.1), &line(new.0, new.1)).len()
        };
        assert_eq!(judge(("0.10", "met"), ("0.21", "met")), 0);
        assert_eq!(judge(("0.10", "met"), ("0.50", "met")), 1);
        assert_eq!(judge(("0.95", "met"), ("1.05", "**open**")), 1);
        assert_eq!(differences("text", "other text").len(), 1);
    }
}
