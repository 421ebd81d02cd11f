//! Where the table begins in a text that has something else above it.

use csv::ByteRecord;

use super::dialect::{Delimiter, detect, fields, number, words};

/// Rows looked at: a header, units, and numbers.
const ROWS: usize = 4;

/// Lines that may stand above a table.
const LONGEST: usize = 200;

/// Where a table begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Beginning {
    /// Line of its first row, counted from 1.
    pub line: u64,
    /// Fields of each of its rows.
    pub fields: usize,
}

/// The first line from which on rows have the same number of fields, two or more, and are numbers
/// below at most two rows of words.
pub(crate) fn table(text: &[u8]) -> Option<Beginning> {
    let mut rest = text;
    for line in (1..).take(LONGEST) {
        if let Some(fields) = begins(rest) {
            return Some(Beginning { line, fields });
        }
        let end = rest.iter().position(|b| *b == b'\n')?;
        rest = &rest[end + 1..];
    }
    None
}

/// How many fields the rows have, if a table begins here.
fn begins(text: &[u8]) -> Option<usize> {
    let delimiter = detect(text);
    let rows = first_rows(text, delimiter);
    let filled = |row: &ByteRecord| row.iter().rposition(|f| !f.is_empty()).map_or(0, |at| at + 1);
    let width = rows.first().map(filled).filter(|width| *width > 1)?;
    let numbers = |row: &ByteRecord| {
        let count = row.iter().filter(|field| number(field, delimiter).is_some()).count();
        2 * count >= filled(row)
    };
    let words = rows.iter().take_while(|row| !numbers(row)).count();
    let table = words <= 2
        && rows.len() >= words + 2
        && rows[words..].iter().all(numbers)
        && rows.iter().all(|row| filled(row) == width);
    table.then_some(width)
}

/// The first rows; none if the first line is empty or a comment.
fn first_rows(text: &[u8], delimiter: Delimiter) -> Vec<ByteRecord> {
    let first = text.split(|b| *b == b'\n').next().unwrap_or_default().trim_ascii();
    if first.is_empty() || first.starts_with(b"#") {
        return Vec::new();
    }
    match delimiter {
        Delimiter::Byte(byte) => {
            fields(text, byte).into_byte_records().flatten().take(ROWS).collect()
        }
        Delimiter::Blanks => {
            let lines = text.split(|b| *b == b'\n').map(|line| words(line).collect());
            lines.filter(|row: &ByteRecord| !row.is_empty()).take(ROWS).collect()
        }
    }
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
        ] {
            assert_eq!(table(text.as_bytes()), Some(Beginning { line, fields }), "{text}");
        }
        for text in ["", "only words\n", "x\n1\n2\n", "t,f\n0,1\n", "a,b\nc,d\ne,f\ng,h\n"] {
            assert_eq!(table(text.as_bytes()), None, "{text}");
        }
    }
}
