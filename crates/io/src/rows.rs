//! Text into rows of fields: delimiter, comments, empty lines, ragged rows.

use csv::{ByteRecord, ReaderBuilder, Trim};

use crate::IoError;

/// What stands between two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// One byte: comma, semicolon or tab.
    Byte(u8),
    /// Any run of blanks.
    Blanks,
}

/// One line of a file.
#[derive(Debug)]
pub(crate) struct Row {
    /// Counted from 1.
    pub line: u64,
    pub fields: ByteRecord,
}

/// Lines that start with this are comments.
const COMMENT: u8 = b'#';

/// Lines looked at to find the delimiter.
const SAMPLE_LINES: usize = 8;

/// The delimiter of a text: the first of semicolon, tab and comma that stands outside quotes on
/// most of the first lines (a decimal comma may stand between semicolons or tabs, so comma comes
/// last), otherwise blanks.
pub(crate) fn detect_delimiter(text: &[u8]) -> Delimiter {
    let sample: Vec<&[u8]> = text
        .split(|b| *b == b'\n')
        .filter(|line| line.trim_ascii().first().is_some_and(|first| *first != COMMENT))
        .take(SAMPLE_LINES)
        .collect();
    let usual = |byte: u8| {
        2 * sample.iter().filter(|line| outside_quotes(line, byte)).count() > sample.len()
    };
    [b';', b'\t', b',']
        .into_iter()
        .find(|byte| usual(*byte))
        .map_or(Delimiter::Blanks, Delimiter::Byte)
}

fn outside_quotes(line: &[u8], byte: u8) -> bool {
    let mut quoted = false;
    line.iter().any(|b| {
        quoted ^= *b == b'"';
        *b == byte && !quoted
    })
}

/// All rows that are neither empty nor comments; empty rows at the end are left out.
pub(crate) fn rows(file: &str, text: &[u8], delimiter: Delimiter) -> Result<Vec<Row>, IoError> {
    let mut rows = match delimiter {
        Delimiter::Byte(byte) => delimited(file, text, byte)?,
        Delimiter::Blanks => blanks(text),
    };
    while rows.last().is_some_and(|row| row.fields.iter().all(<[u8]>::is_empty)) {
        rows.pop();
    }
    Ok(rows)
}

fn delimited(file: &str, text: &[u8], delimiter: u8) -> Result<Vec<Row>, IoError> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter)
        .comment(Some(COMMENT))
        .trim(Trim::All)
        .from_reader(text);
    let mut rows = Vec::new();
    for fields in reader.byte_records() {
        let fields = fields
            .map_err(|e| IoError::Read { file: file.into(), source: std::io::Error::other(e) })?;
        let line = fields.position().map_or(0, |at| line_of_content(text, at));
        rows.push(Row { line, fields });
    }
    Ok(rows)
}

/// The line on which a row starts: the reader tells where it began to look for one, before the empty
/// lines and the comments it skips.
fn line_of_content(text: &[u8], at: &csv::Position) -> u64 {
    let start = usize::try_from(at.byte()).unwrap_or(text.len()).min(text.len());
    let skipped = text[start..]
        .split(|b| *b == b'\n')
        .take_while(|line| line.first().is_none_or(|first| *first == COMMENT) || *line == b"\r");
    at.line() + skipped.count() as u64
}

fn blanks(text: &[u8]) -> Vec<Row> {
    (1..)
        .zip(text.split(|b| *b == b'\n'))
        .map(|(line, content)| {
            let words = content.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
            Row { line, fields: words.map(|word| word.trim_ascii()).collect() }
        })
        .filter(|row| row.fields.get(0).is_some_and(|word| word[0] != COMMENT))
        .collect()
}

/// An error at the first row whose number of fields cannot belong to the first row.
///
/// Fields beyond either end are forgiven where they are empty: rigs end some lines with a delimiter
/// and others not.
pub(crate) fn check_width(file: &str, rows: &[Row]) -> Result<usize, IoError> {
    let filled = |row: &Row| {
        row.fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1)
    };
    let Some(first) = rows.first() else { return Ok(0) };
    let expected = filled(first);
    for row in &rows[1..] {
        let got = row.fields.len();
        if got < expected || filled(row) > first.fields.len() {
            return Err(IoError::Ragged { file: file.into(), line: row.line, got, expected });
        }
    }
    Ok(first.fields.len())
}
