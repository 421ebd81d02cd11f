//! Dialect of a text: delimiter and decimal sign, detected from its first lines.

use memchr::memchr_iter;

use super::delimiter::{COMMENTS, Delimiter};
use super::fields::Fields;
use super::instant::Instant;
use crate::contents::DecimalSign;

/// Number of lines that are used to detect the delimiter and the decimal sign.
const SAMPLE_LINES: usize = 8;

/// Returns whether the beginning of a text has enough whole lines for [`detect`].
pub(crate) fn is_sample(start: &[u8], terminator: u8) -> bool {
    // One more line is needed, because the last one may be incomplete.
    sample(start, terminator).nth(SAMPLE_LINES).is_some()
}

/// Returns the lines that are neither empty nor comments.
fn sample(text: &[u8], terminator: u8) -> impl Iterator<Item = &[u8]> {
    text.split(move |b| *b == terminator).filter(|line| {
        // A semicolon at the beginning of a line may be a delimiter after an empty field.
        let first = line.trim_ascii().first();
        first.is_some_and(|first| *first == b';' || !COMMENTS.contains(first))
    })
}

/// Returns the delimiter of a text: the first of semicolon, tab and comma that occurs outside
/// quotes on most of the first lines, otherwise blanks. Comma comes last because it may be the
/// decimal sign of numbers between semicolons or tabs.
pub(crate) fn detect(text: &[u8], terminator: u8) -> Delimiter {
    let sample: Vec<&[u8]> = sample(text, terminator).take(SAMPLE_LINES).collect();
    let usual = |byte: u8| {
        2 * sample.iter().filter(|line| outside_quotes(line, byte)).count() > sample.len()
    };
    [b';', b'\t', b',']
        .into_iter()
        .find(|byte| usual(*byte))
        .map_or(Delimiter::Blanks, Delimiter::Byte)
}

/// Returns the decimal sign of most numbers on the first lines; `None` if no number has one, or if
/// points and commas are equally frequent.
pub(crate) fn decimal_sign(
    text: &[u8],
    terminator: u8,
    delimiter: Delimiter,
) -> Option<DecimalSign> {
    if !delimiter.allows_decimal_comma() {
        return Some(DecimalSign::Point);
    }
    let (mut points, mut commas) = (0, 0);
    let (mut fields, mut with_point) = (Fields::default(), String::new());
    for line in sample(text, terminator).take(SAMPLE_LINES) {
        fields.split(line, delimiter);
        for field in fields.iter() {
            match number(field, delimiter, &mut with_point).and_then(|number| number.sign) {
                Some(DecimalSign::Point) => points += 1,
                Some(DecimalSign::Comma) => commas += 1,
                None => {}
            }
        }
    }
    match points.cmp(&commas) {
        std::cmp::Ordering::Greater => Some(DecimalSign::Point),
        std::cmp::Ordering::Less => Some(DecimalSign::Comma),
        std::cmp::Ordering::Equal => None,
    }
}

fn outside_quotes(line: &[u8], byte: u8) -> bool {
    let mut quotes = memchr_iter(b'"', line).peekable();
    let mut quoted = false;
    memchr_iter(byte, line).any(|at| {
        while quotes.next_if(|quote| *quote < at).is_some() {
            quoted = !quoted;
        }
        !quoted
    })
}

/// Number in a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Number {
    pub value: f64,
    /// Decimal sign; `None` for a number without decimal places.
    pub sign: Option<DecimalSign>,
}

/// Returns the number in a field; `with_point` is a buffer for a number with a comma.
pub(crate) fn number(
    field: &[u8],
    delimiter: Delimiter,
    with_point: &mut String,
) -> Option<Number> {
    let text = std::str::from_utf8(field).ok()?;
    let point = text.contains('.').then_some(DecimalSign::Point);
    if let Ok(value) = text.parse() {
        return Some(Number { value, sign: point });
    }
    if point.is_some() || !delimiter.allows_decimal_comma() {
        return None;
    }
    let (whole, places) = text.split_once(',')?;
    with_point.clear();
    with_point.extend([whole, ".", places]);
    let value = with_point.parse().ok()?;
    Some(Number { value, sign: Some(DecimalSign::Comma) })
}

/// Returns whether a field is data: a number, or an instant of a date or a clock.
pub(crate) fn is_data(field: &[u8], delimiter: Delimiter) -> bool {
    is_number(field, delimiter) || Instant::parse(field).is_some()
}

/// Returns whether a field is a number.
pub(crate) fn is_number(field: &[u8], delimiter: Delimiter) -> bool {
    number(field, delimiter, &mut String::new()).is_some()
}
