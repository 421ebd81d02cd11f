//! The page of the book about the coverage of intervals, and tables of studies in other pages.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::binomial::{FALSE_ALARM, LOSS, Limits, STATED};
use super::{Coverage, SHORT, short_power};

/// Maximum number of intervals that contain the true value here but, because of rounding, not on
/// another processor.
const ROUNDING: u64 = 3;

fn place(root: &Path) -> PathBuf {
    root.join("docs/book/src/studies/coverage.md")
}

/// The table of coverages, in Markdown.
pub(super) fn table(coverages: &[Coverage]) -> Result<String, String> {
    let mut text = String::from(
        "| Experiment | Parameter | Experiments | Hold | Hold, % | Alarm below | Wide above | Failed |\n|---|---|---|---|---|---|---|---|\n",
    );
    for Coverage { kind, parameter, experiments, containing_truth, failed } in coverages {
        let limits = Limits::new(*experiments)?;
        let _ = writeln!(
            text,
            "| {kind} | {parameter} | {experiments} | {containing_truth} | {:.2} | {} | {} | {failed} |",
            100.0 * *containing_truth as f64 / *experiments as f64,
            limits.fewest,
            limits.most
        );
    }
    Ok(text)
}

fn power_sentence() -> Result<String, String> {
    Ok(format!(
        "If the coverage of the intervals is the stated one, {:.0} %, a parameter raises an alarm with a probability of {FALSE_ALARM}. \
         If it is {:.0} percentage points lower, {SHORT} experiments detect this with a probability of {:.1} %.\n",
        100.0 * STATED,
        100.0 * LOSS,
        100.0 * short_power()?
    ))
}

/// Writes the table of coverages, and the sentence about the power of the test, into the page.
pub(super) fn write(root: &Path, coverages: &[Coverage]) -> Result<(), String> {
    rewrite(&place(root), "coverage", &table(coverages)?)?;
    rewrite(&place(root), "power", &power_sentence()?)
}

/// Replaces the tables of a page that have the header of a new table; returns the number of
/// replaced tables.
///
/// # Errors
/// The message of the file that fails; a page without any of these tables.
pub(super) fn rewrite_tables<'a>(
    page: &Path,
    tables: impl Iterator<Item = &'a str>,
) -> Result<usize, String> {
    let words = |e: &dyn std::fmt::Display| format!("{}: {e}", page.display());
    let mut text = std::fs::read_to_string(page).map_err(|e| words(&e))?;
    let mut written = 0;
    for table in tables {
        if let Some(range) = table_like(&text, table) {
            text.replace_range(range, table);
            written += 1;
        }
    }
    if written == 0 {
        return Err(words(&"no table has the header of those of the study"));
    }
    std::fs::write(page, text).map_err(|e| words(&e))?;
    Ok(written)
}

/// Returns the range, in `text`, of the table that has the header of `table`.
fn table_like(text: &str, table: &str) -> Option<std::ops::Range<usize>> {
    let header = format!("\n{}\n", table.lines().next()?);
    let start = text.find(&header)? + 1;
    let rows = text[start..].split_inclusive('\n').take_while(|line| line.starts_with('|'));
    Some(start..start + rows.map(str::len).sum::<usize>())
}

/// Replaces the text between the two marks that contain `name`; a page without these marks is an
/// error.
fn rewrite(page: &Path, name: &str, content: &str) -> Result<(), String> {
    let words = |e: &dyn std::fmt::Display| format!("{}: {e}", page.display());
    let text = std::fs::read_to_string(page).map_err(|e| words(&e))?;
    let marked = marked(&text, name).ok_or_else(|| words(&format!("no mark {name}")))?;
    let rewritten = format!("{}\n{content}{}", &text[..marked.start], &text[marked.end..]);
    std::fs::write(page, rewritten).map_err(|e| words(&e))
}

/// Range between the marks `<!-- NAME -->` and `<!-- end of NAME -->`.
fn marked(text: &str, name: &str) -> Option<std::ops::Range<usize>> {
    let begin = format!("<!-- {name} -->");
    let start = text.find(&begin)? + begin.len();
    let end = start + text[start..].find(&format!("<!-- end of {name} -->"))?;
    Some(start..end)
}

/// Returns the differences between the committed page and these coverages.
///
/// # Errors
/// The message of the file that fails.
pub fn differences(root: &Path, coverages: &[Coverage]) -> Result<Vec<String>, String> {
    let page = place(root);
    let words = |e: &dyn std::fmt::Display| format!("{}: {e}", page.display());
    let text = std::fs::read_to_string(&page).map_err(|e| words(&e))?;
    let between = |name| marked(&text, name).map(|range| text[range].trim().to_owned());
    let mut differences = Vec::new();
    if between("power").as_deref() != Some(power_sentence()?.trim()) {
        differences.push("the sentence about the power".to_owned());
    }
    let committed = between("coverage").ok_or_else(|| words(&"no mark coverage"))?;
    let rows: Vec<&str> = committed.lines().skip(2).collect();
    if rows.len() != coverages.len() {
        return Ok(vec![format!("{} rows, and {} computed", rows.len(), coverages.len())]);
    }
    for (row, Coverage { kind, parameter, experiments, containing_truth, .. }) in
        rows.iter().zip(coverages)
    {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let is_same = cells.len() == 8
            && [cells[0], cells[1]] == [*kind, *parameter]
            && cells[2].parse() == Ok(*experiments)
            && cells[3]
                .parse()
                .is_ok_and(|committed: u64| committed.abs_diff(*containing_truth) <= ROUNDING);
        if !is_same {
            differences.push(format!("{row}\n{containing_truth} of {experiments} computed"));
        }
    }
    Ok(differences)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_found_and_kept() {
        let text = "a\n<!-- x -->\nold\n<!-- end of x -->\nb\n";
        assert_eq!(&text[marked(text, "x").unwrap()], "\nold\n");
        assert!(marked(text, "y").is_none() && marked("<!-- x -->", "x").is_none());
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page.md");
        std::fs::write(&page, text).unwrap();
        rewrite(&page, "x", "new\n").unwrap();
        let now = std::fs::read_to_string(&page).unwrap();
        assert_eq!(now, text.replace("old", "new"));
        assert!(rewrite(&page, "y", "").unwrap_err().ends_with("no mark y"));
    }

    #[test]
    fn a_table_takes_the_place_of_that_with_its_header() {
        let text = "a\n\n| x | y |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n\n| x |\n|---|\n| 5 |\n";
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page.md");
        std::fs::write(&page, text).unwrap();
        let new = "| x | y |\n|---|---|\n| 6 | 7 |\n";
        assert_eq!(rewrite_tables(&page, [new, "| z |\n"].into_iter()), Ok(1));
        let now = std::fs::read_to_string(&page).unwrap();
        assert_eq!(now, "a\n\n| x | y |\n|---|---|\n| 6 | 7 |\n\n| x |\n|---|\n| 5 |\n");
        assert!(rewrite_tables(&page, ["| z |\n"].into_iter()).is_err());
    }
}
