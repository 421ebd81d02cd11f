//! How a text tells fields, comments and numbers.

use std::io::{self, BufRead, Read};

use csv::{Reader, ReaderBuilder, Trim};

/// What stands between two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// One byte: comma, semicolon or tab.
    Byte(u8),
    /// Any run of blanks.
    Blanks,
}

impl Delimiter {
    /// How a person calls such a text.
    pub fn name(self) -> &'static str {
        match self {
            Delimiter::Byte(b';') => "text, fields between semicolons",
            Delimiter::Byte(b'\t') => "text, fields between tabs",
            Delimiter::Byte(_) => "text, fields between commas",
            Delimiter::Blanks => "text, fields between blanks",
        }
    }
}

/// Lines that start with this are comments.
pub(crate) const COMMENT: u8 = b'#';

/// Lines looked at to find the delimiter.
const SAMPLE_LINES: usize = 8;

/// Bytes read first; then as many again each time, until there are as many lines.
const FIRST: usize = 1 << 14;

/// The beginning of a text, with as many whole lines as [`detect`] looks at, or all of it.
pub(crate) fn first_lines(text: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    // The last line may be cut off, so one more is needed.
    while sample(&start).nth(SAMPLE_LINES).is_none() {
        let more = start.len().max(FIRST) as u64;
        if text.by_ref().take(more).read_to_end(&mut start)? == 0 {
            break;
        }
    }
    Ok(start)
}

/// Lines that are neither empty nor comments.
fn sample(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|b| *b == b'\n')
        .filter(|line| line.trim_ascii().first().is_some_and(|first| *first != COMMENT))
}

/// The delimiter of a text: the first of semicolon, tab and comma that stands outside quotes on
/// most of the first lines (a decimal comma may stand between semicolons or tabs, so comma comes
/// last), otherwise blanks.
pub(crate) fn detect(text: &[u8]) -> Delimiter {
    let sample: Vec<&[u8]> = sample(text).take(SAMPLE_LINES).collect();
    let usual = |byte: u8| {
        2 * sample.iter().filter(|line| outside_quotes(line, byte)).count() > sample.len()
    };
    [b';', b'\t', b',']
        .into_iter()
        .find(|byte| usual(*byte))
        .map_or(Delimiter::Blanks, Delimiter::Byte)
}

/// The fields of a line that stand between blanks.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// The rows of a text whose fields stand between delimiters.
pub(crate) fn fields<R: Read>(text: R, delimiter: u8) -> Reader<R> {
    ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter)
        .comment(Some(COMMENT))
        .trim(Trim::All)
        .from_reader(text)
}

fn outside_quotes(line: &[u8], byte: u8) -> bool {
    let mut quoted = false;
    line.iter().any(|b| {
        quoted ^= *b == b'"';
        *b == byte && !quoted
    })
}

/// The number a field holds; a decimal comma is understood where commas do not separate fields.
pub(crate) fn number(field: &[u8], delimiter: Delimiter) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    let parsed = text.parse().ok();
    if parsed.is_some() || delimiter == Delimiter::Byte(b',') || text.contains('.') {
        return parsed;
    }
    let (whole, fraction) = text.split_once(',')?;
    format!("{whole}.{fraction}").parse().ok()
}
