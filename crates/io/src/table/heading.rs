//! Names and units above a table: in several rows, below channel numbers, or in comments.

use super::delimiter::{Delimiter, is_comment};
use super::dialect::is_data;
use super::fields::{Fields, Layout, Row, RowIter};
use super::rows::text_of;
use crate::units::Unit;

/// Maximum number of rows in which the beginning of the table is searched for.
const ROWS: usize = 24;

/// Minimum number of consecutive rows of numbers in a table.
const MIN_NUMBERS: usize = 2;

/// Names and units above the rows of numbers, if they are not just in the first row and perhaps the
/// second.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heading {
    /// One name per column.
    pub names: Vec<String>,
    /// Texts for the units of the columns; empty if there is no such row.
    pub units: Vec<String>,
    /// Row of numbers at which the table begins, counted from 0.
    pub begin: usize,
    /// Row of the names, counted from 0; `None` if they are in a comment.
    pub names_row: Option<usize>,
    /// Smallest number of fields, up to the last one that is not empty, in the first rows.
    pub filled: usize,
}

/// A row at the beginning of a text.
#[derive(Debug)]
pub(super) struct Beginning<'a> {
    pub row: Row<'a>,
    pub fields: Fields,
}

/// Returns the first rows of a text.
pub(super) fn first_rows(text: &[u8], layout: Layout) -> Vec<Beginning<'_>> {
    let rows = RowIter::new(text, layout).map(|row| {
        let mut fields = Fields::default();
        fields.split(row.text, layout.delimiter);
        Beginning { row, fields }
    });
    rows.filter(|row| row.fields.filled() > 0).take(ROWS).collect()
}

/// Numbers of fields in the rows of a table that are not empty.
struct Filled {
    /// Number in the first row, without a comment.
    first: usize,
    /// Smallest number in the rows after the first.
    usual: usize,
    /// `true` if all rows after the first have this number.
    is_uniform: bool,
}

impl Filled {
    /// Counts the fields of a table below the rows `above`.
    ///
    /// There may be one name more than fields: in all rows the last field is missing, or in all but
    /// the first row, whose extra field is a comment.
    fn new(above: &[Beginning<'_>], table: &[Beginning<'_>]) -> Self {
        let first = table[0].fields.filled();
        let usual = table[1..].iter().map(|row| row.fields.filled()).min().unwrap_or(first);
        let is_uniform = table[1..].iter().all(|row| row.fields.filled() == usual);
        let has_comment = usual + 1 == first
            && above.iter().flat_map(texts).any(|name| name.eq_ignore_ascii_case("comment"));
        let first = if has_comment && is_uniform { usual } else { first };
        Self { first, usual, is_uniform }
    }
}

impl Heading {
    /// Detects names and units above the numbers; `None` if the first row names the columns,
    /// perhaps with units in the second row, or if no row does.
    pub fn find(text: &[u8], rows: &[Beginning<'_>], layout: Layout) -> Option<Self> {
        let is_numbers = |row: &Beginning<'_>| 2 * numbers(row, layout) >= row.fields.filled();
        let begin = rows.iter().rposition(|row| !is_numbers(row)).map_or(0, |last| last + 1);
        let table = &rows[begin..];
        if table.len() < MIN_NUMBERS && begin > 0 || table.is_empty() {
            return None;
        }
        let (above, width) = (&rows[..begin], table[0].fields.len());
        let Filled { first: filled, usual, is_uniform } = Filled::new(above, table);
        let is_longer = |row: &Beginning<'_>| is_uniform && row.fields.filled() == usual + 1;
        let is_alike = |row: &Beginning<'_>| {
            let count = row.fields.filled();
            count == filled || is_longer(row) || row.fields.len() == width
        };
        // A row of numbers only is a row of data, unless it numbers the channels.
        let is_data_row = |(at, row): (usize, &Beginning<'_>)| {
            numbers(row, layout) == row.fields.filled() && !(at == 0 && is_numbering(row))
        };
        if !above.iter().all(is_alike) || above.iter().enumerate().any(is_data_row) {
            return None;
        }
        let heading = |names: Vec<String>, units: Vec<String>, names_row: Option<usize>| {
            Some(Self { names, units, begin, names_row, filled })
        };
        let comment = || names_in_comments(&text[..rows[0].row.at], width, layout);
        match above {
            [] => {
                let are_numeric =
                    table.iter().all(|row| numbers(row, layout) == row.fields.filled());
                let (names, units) = comment().filter(|_| are_numeric)?;
                heading(names, units, None)
            }
            [units] if is_units(units, layout) => {
                let (names, _) = comment()?;
                heading(names, texts(units), Some(0))
            }
            [names] if is_longer(names) && usual == filled && numbers(names, layout) == 0 => {
                heading(texts(names), Vec::new(), Some(0))
            }
            [first, second] if !is_channels(first, layout) || is_units(second, layout) => {
                let longer = is_longer(first) && is_units(second, layout);
                longer.then(|| heading(texts(first), texts(second), Some(0)))?
            }
            [_, _, ..] => {
                let (last, before) = (begin - 1, begin - 2);
                let words = |at: usize| numbers(&rows[at], layout) == 0;
                if is_units(&rows[last], layout) && words(before) {
                    heading(texts(&rows[before]), texts(&rows[last]), Some(before))
                } else if words(last) {
                    heading(texts(&rows[last]), Vec::new(), Some(last))
                } else {
                    None
                }
            }
            _ => None,
        }
    }
}

/// Returns the number of fields that are numbers or instants.
fn numbers(row: &Beginning<'_>, layout: Layout) -> usize {
    row.fields.iter().filter(|field| is_data(field, layout.delimiter)).count()
}

fn texts(row: &Beginning<'_>) -> Vec<String> {
    row.fields.iter().map(text_of).collect()
}

/// Returns whether most fields of a row are units, and none is a number.
fn is_units(row: &Beginning<'_>, layout: Layout) -> bool {
    numbers(row, layout) == 0 && are_units(&texts(row))
}

fn are_units(texts: &[String]) -> bool {
    let is_unit = |text: &&String| {
        let bare = text.trim_matches(['[', ']', '(', ')', '{', '}', '<', '>', ' ']);
        Unit::parse(text).or_else(|| Unit::parse(bare)).is_some()
    };
    let filled = texts.iter().filter(|text| !["", "-"].contains(&text.as_str())).count();
    let units = texts.iter().filter(is_unit).count();
    units > 0 && 2 * units >= filled
}

/// Returns whether a row counts its fields: 0, 1, 2 … or 1, 2, 3 ….
fn is_numbering(row: &Beginning<'_>) -> bool {
    let numbers = row.fields.iter().map(|field| text_of(field).parse::<u32>().ok());
    let numbers: Option<Vec<u32>> = numbers.collect();
    numbers.is_some_and(|numbers| {
        numbers[0] <= 1 && numbers.windows(2).all(|pair| pair[1].checked_sub(pair[0]) == Some(1))
    })
}

/// Returns whether a row has channel numbers: `1`, `CH1`, `AI 0`, `Channel 3`.
fn is_channels(row: &Beginning<'_>, layout: Layout) -> bool {
    const WORDS: [&str; 9] = ["", "ch", "chan", "channel", "ai", "col", "column", "kanal", "#"];
    texts(row).iter().filter(|text| !text.is_empty()).all(|text| {
        let stem = text.trim_end_matches(|c: char| c.is_ascii_digit());
        let stem = stem.trim_end_matches([' ', '_', '-', '.']).to_lowercase();
        let is_number = is_data(text.as_bytes(), layout.delimiter);
        is_number || stem.len() < text.len() && WORDS.contains(&stem.as_str())
    })
}

/// Returns names, and perhaps units, in the comments directly above a table of `width` columns.
fn names_in_comments(
    above: &[u8],
    width: usize,
    layout: Layout,
) -> Option<(Vec<String>, Vec<String>)> {
    let mut lines = above.split(|b| *b == layout.terminator).rev().map(<[u8]>::trim_ascii_end);
    // The text ends with a terminator, after which there is no line.
    lines.next();
    let mut next = || {
        let line = lines.next().filter(|line| is_comment(line, layout.delimiter))?;
        fields_of(&text_of(line.trim_ascii()), width, layout)
    };
    let last = next()?;
    if !are_units(&last) {
        return Some((last, Vec::new()));
    }
    Some(match next() {
        Some(names) => (names, last),
        None => (last, Vec::new()),
    })
}

/// Returns the fields of a comment, if there is one per column and none is a number.
fn fields_of(comment: &str, width: usize, layout: Layout) -> Option<Vec<String>> {
    let text = comment.trim_start_matches(['#', '%', '!', ';', ' ']);
    let split = |delimiter: Delimiter| -> Vec<String> {
        let mut fields = Fields::default();
        fields.split(text.as_bytes(), delimiter);
        fields.iter().map(text_of).collect()
    };
    let by_wide_blanks = || -> Vec<String> {
        let parts = text.split("  ").map(str::trim).filter(|part| !part.is_empty());
        parts.map(str::to_owned).collect()
    };
    let candidates = [
        split(layout.delimiter),
        split(Delimiter::Byte(b',')),
        split(Delimiter::Byte(b';')),
        split(Delimiter::Byte(b'\t')),
        by_wide_blanks(),
        with_brackets_joined(split(Delimiter::Blanks)),
        split(Delimiter::Blanks),
    ];
    let is_name =
        |field: &String| !field.is_empty() && !is_data(field.as_bytes(), layout.delimiter);
    candidates.into_iter().find(|fields| fields.len() == width && fields.iter().all(is_name))
}

/// Joins words in brackets with the word before them: `time [s] acc [m/s^2]`.
fn with_brackets_joined(words: Vec<String>) -> Vec<String> {
    let mut joined: Vec<String> = Vec::new();
    for word in words {
        match joined.last_mut() {
            Some(last) if word.starts_with(['[', '(', '{']) => {
                last.push(' ');
                last.push_str(&word);
            }
            _ => joined.push(word),
        }
    }
    joined
}
