//! Aligned columns of text, and numbers with a given number of digits.

/// Rows of cells in aligned columns, two blanks apart; the first row is the header.
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

/// `value` with so many significant digits; scientific where plain notation would be long.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    // The exponent after rounding, which may be one above that of the value.
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    if !(-4..6.max(digits as i32)).contains(&exponent) {
        return scientific;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}")
}

/// As [`significant`], without zeros at the end: for numbers that were chosen, not measured.
pub fn compact(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
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
    fn significant_digits() {
        for (value, digits, expected) in [
            (123.456, 4, "123.5"),
            (0.047_12, 3, "0.0471"),
            (9.999_9, 3, "10.0"),
            (-5000.0, 3, "-5000"),
            (1.5e-9, 2, "1.5e-9"),
            (2.5e12, 3, "2.50e12"),
            (0.0, 3, "0"),
            (f64::NAN, 3, "NaN"),
        ] {
            assert_eq!(significant(value, digits), expected);
        }
        assert_eq!(
            (compact(128.0, 8), compact(610.3515625, 8)),
            ("128".into(), "610.35156".into())
        );
    }
}
