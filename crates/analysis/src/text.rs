//! Aligned columns of text, and numbers with a given number of digits.

/// Formats rows of cells in aligned columns, separated by two blanks; the first row is the header.
///
/// The first column is aligned to the left, the others to the right.
pub fn text_table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|c| width(c).unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (c, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let blanks = " ".repeat(width - cell.chars().count());
            line += &if c == 0 { format!("{cell}{blanks}") } else { format!("  {blanks}{cell}") };
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// Maximum width of a table on a page, in characters.
const PAGE: usize = 100;

/// Formats a table like [`text_table`]; a table that is too wide is divided into several tables,
/// one below the other. Each of them begins with the first column, and omits rows without further
/// content. The first table contains at least the first `together` columns.
pub fn paged_table(rows: &[Vec<String>], together: usize) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let part = |chosen: &[usize]| {
        let pick = |row: &Vec<String>| -> Vec<String> {
            chosen.iter().map(|c| row.get(*c).cloned().unwrap_or_default()).collect()
        };
        let says = |row: &Vec<String>| row.iter().skip(1).any(|cell| !cell.is_empty());
        text_table(&rows.iter().map(pick).filter(says).collect::<Vec<_>>())
    };
    let fits = |chosen: &[usize]| part(chosen).lines().all(|line| line.chars().count() <= PAGE);
    if fits(&(0..columns).collect::<Vec<_>>()) {
        return text_table(rows);
    }
    let mut pages = vec![(0..together.min(columns)).collect::<Vec<usize>>()];
    for column in together..columns {
        let last = pages.len() - 1;
        let wider = [pages[last].as_slice(), &[column]].concat();
        if last > 0 && fits(&wider) {
            pages[last] = wider;
        } else {
            pages.push(vec![0, column]);
        }
    }
    pages.iter().map(|page| part(page)).collect::<Vec<_>>().join("\n")
}

/// Smallest exponent of ten that is written in scientific notation.
const PLAIN: i32 = 6;

/// Formats a number, in any unit, with a number of significant digits; in scientific notation if
/// plain notation would be long.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    // The exponent after rounding, which may exceed the exponent of the value by one.
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    if !(-4..PLAIN).contains(&exponent) {
        return scientific;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}")
}

/// Formats a number like [`significant`], without trailing zeros: for numbers that were given and
/// not measured, in any unit.
pub fn compact(value: f64, digits: usize) -> String {
    if value.fract() == 0.0 && value.abs() < 10f64.powi(digits as i32) {
        return format!("{value}");
    }
    let text = significant(value, digits);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// Returns an empty line followed by the lines; an empty text if there are no lines.
pub fn paragraph(lines: impl Iterator<Item = String>) -> String {
    let lines: String = lines.map(|line| line + "\n").collect();
    if lines.is_empty() { lines } else { format!("\n{lines}") }
}

/// Returns the note on standard errors that are scaled by `factor`, with the reasons from `checks`.
pub(crate) fn scaled_errors(factor: f64, checks: &str) -> String {
    format!(
        "standard errors and intervals are {} times those of the noise alone, because model and \
         data disagree by more than noise (see {checks}); the intervals do not cover a wrong model",
        significant(factor, 3)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let rows = [["a", "value"], ["long name", "1"]].map(|r| r.map(String::from).to_vec());
        assert_eq!(text_table(&rows), "a          value\nlong name      1\n");
    }

    #[test]
    fn a_table_too_wide_for_a_page_goes_on_below() {
        let row = |of: &str| (0..9).map(|c| format!("{of}{c} of twenty letters")).collect();
        let rows: Vec<Vec<String>> = vec![row("a"), row("b")];
        let text = paged_table(&rows, 2);
        let pages: Vec<&str> = text.split("\n\n").collect();
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
        assert_eq!(pages.len(), 4, "{text}");
        assert!(pages.iter().all(|page| page.starts_with("a0 of ")), "{text}");
        for cell in rows.concat() {
            let times = if cell.contains("0 of") { 4 } else { 1 };
            assert_eq!(text.matches(&cell).count(), times, "{cell}");
        }
        // A table that is narrow enough for the page is not changed.
        let narrow: Vec<Vec<String>> = rows.iter().map(|row| row[..4].to_vec()).collect();
        assert_eq!(paged_table(&narrow, 2), text_table(&narrow));
    }

    #[test]
    fn significant_digits() {
        for (value, digits, expected) in [
            (123.456, 4, "123.5"),
            (0.047_12, 3, "0.0471"),
            (9.999_9, 3, "10.0"),
            (-5000.0, 3, "-5000"),
            (1.5e-9, 2, "1.5e-9"),
            (2.5e12, 3, "2.50e12"),
            (0.0, 3, "0"),
            (4e7, 12, "4.00000000000e7"),
            (610_351.562_5, 9, "610351.562"),
            (f64::NAN, 3, "NaN"),
        ] {
            assert_eq!(significant(value, digits), expected);
        }
        assert_eq!(
            [compact(128.0, 8), compact(610.3515625, 8), compact(1_024_000.0, 8)],
            ["128", "610.35156", "1024000"]
        );
    }
}
