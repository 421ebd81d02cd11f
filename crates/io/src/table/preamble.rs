//! Detection of the line at which a table begins below other text.

use super::aligned;
use super::delimiter::is_comment;
use super::dialect::{detect, is_data};
use super::fields::{Fields, Layout, Row, RowIter};

/// Number of rows that are checked: a header, units, and numbers.
const ROWS: usize = 4;

/// Maximum number of lines above a table; a table further down is not detected.
const MOST_LINES: usize = 5000;

/// Beginning of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Beginning {
    /// Line of the first row of the table, counted from 1.
    pub line: u64,
    /// Number of fields of each row of the table.
    pub fields: usize,
}

/// Returns the first line at which a table begins. A table has at most two rows of words, then at
/// least two rows of numbers, and all these rows have the same number of fields, at least two.
pub(crate) fn table(text: &[u8], terminator: u8) -> Option<Beginning> {
    let mut remaining = text;
    for line in (1..).take(MOST_LINES) {
        if let Some(fields) = begins(remaining, terminator) {
            return Some(Beginning { line, fields });
        }
        let end = remaining.iter().position(|b| *b == terminator)?;
        remaining = &remaining[end + 1..];
    }
    None
}

/// Returns the number of fields of the rows, if a table begins at this line.
fn begins(text: &[u8], terminator: u8) -> Option<usize> {
    let delimiter = detect(text, terminator);
    let rows = first_rows(text, Layout { delimiter, terminator });
    let width = rows.first().map(Fields::filled).filter(|width| *width > 1)?;
    let numbers = |row: &Fields| {
        let count = row.iter().filter(|field| is_data(field, delimiter)).count();
        2 * count >= row.filled()
    };
    let words = rows.iter().take_while(|row| !numbers(row)).count();
    let table = words <= 2
        && rows.len() >= words + 2
        && rows[words..].iter().all(numbers)
        && rows.iter().all(|row| row.filled() == width);
    table.then_some(width)
}

/// Returns the first rows; none if the first line is empty or a comment.
fn first_rows(text: &[u8], layout: Layout) -> Vec<Fields> {
    let first = text.split(|b| *b == layout.terminator).next().unwrap_or_default();
    if first.trim_ascii().is_empty() || is_comment(first.trim_ascii(), layout.delimiter) {
        return Vec::new();
    }
    let rows: Vec<Row<'_>> = RowIter::new(text, layout).take(ROWS).collect();
    aligned::split(&rows, layout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_found_below_what_is_none() {
        for (text, line, fields) in [
            ("t,f\n0,1\n1,2\n", 1, 2),
            ("0 1\n1 2\n", 1, 2),
            ("Rig 4\nt,f\n0,1\n1,2\n", 2, 2),
            ("Rig: 4, left\nGain;3\n\nt;f;x\ns;N;m\n0;1,5;2\n1;2,5;3\n", 4, 3),
            ("Serial 1\nRate 100 Hz\n\n0 1 2 3\n1 2 3 4\n", 4, 4),
            ("Rig 4\nTime (s)  Force (kN)\n  0  1\n  1  2\n", 2, 2),
            ("Rig 4\nTime  Hammer force\n  s  kN\n  0  1\n  1  2\n", 2, 2),
        ] {
            assert_eq!(table(text.as_bytes(), b'\n'), Some(Beginning { line, fields }), "{text}");
        }
        for text in ["", "only words\n", "x\n1\n2\n", "t,f\n0,1\n", "a,b\nc,d\ne,f\ng,h\n"] {
            assert_eq!(table(text.as_bytes(), b'\n'), None, "{text}");
        }
    }
}
