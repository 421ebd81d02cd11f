//! Names and units above a table: in several rows, below channel numbers, or in comments.

use super::aligned;
use super::comments::{Comments, units_of};
use super::dialect::is_data;
use super::fields::{Fields, Layout, Row, RowIter};
use super::rows::text_of;
use crate::units::{Unit, is_named_quantity};

/// Maximum number of rows in which the beginning of the table is searched for.
const ROWS: usize = 24;

/// Minimum number of consecutive rows of numbers in a table.
const MIN_NUMBERS: usize = 2;

/// Texts above the rows of numbers.
#[derive(Debug, Default)]
pub(super) struct Above {
    /// Names and units; `None` if there are no names, or if the names are in the first row of the
    /// table (the units may then be in the second row).
    pub heading: Option<Heading>,
    /// Further texts for the units of the columns, from comments and other rows. Each list has one
    /// text per column, empty for a column without a unit.
    pub further_units: Vec<Vec<String>>,
    /// Remarks on comments that were not read.
    pub remarks: Vec<String>,
}

/// Names and units above the rows of numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heading {
    /// One name per column.
    pub names: Vec<String>,
    /// Texts for the units of the columns; empty if there is no row of units.
    pub units: Vec<String>,
    /// Row of numbers at which the table begins, counted from 0.
    pub begin: usize,
    /// Row of the names, counted from 0; `None` if they are in a comment.
    pub names_row: Option<usize>,
    /// Number of fields in the first row of numbers, up to the last one that is not empty; a
    /// comment in an extra field does not count.
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
    let has_fields = |row: &Row<'_>| {
        let mut fields = Fields::default();
        fields.split(row.text, layout.delimiter);
        fields.filled() > 0
    };
    let rows: Vec<Row<'_>> = RowIter::new(text, layout).filter(has_fields).take(ROWS).collect();
    let fields = aligned::split(&rows, layout);
    rows.into_iter().zip(fields).map(|(row, fields)| Beginning { row, fields }).collect()
}

/// Numbers of fields in the rows of a table, up to the last field that is not empty.
struct Filled {
    /// Number of fields in the first row; a comment in the row does not count.
    first: usize,
    /// Smallest number of fields in the rows after the first.
    smallest: usize,
    /// `true` if all rows after the first have the same number of fields.
    is_uniform: bool,
}

impl Filled {
    /// Counts the fields of a table below the rows `above`.
    ///
    /// There may be one more name than there are fields in a row. Either all rows lack the last
    /// field, or only the first row has it, as a comment.
    fn new(above: &[Beginning<'_>], table: &[Beginning<'_>]) -> Self {
        let first = table[0].fields.filled();
        let smallest = table[1..].iter().map(|row| row.fields.filled()).min().unwrap_or(first);
        let is_uniform = table[1..].iter().all(|row| row.fields.filled() == smallest);
        let has_comment = smallest + 1 == first
            && above.iter().flat_map(texts).any(|name| name.eq_ignore_ascii_case("comment"));
        let first = if has_comment && is_uniform { smallest } else { first };
        Self { first, smallest, is_uniform }
    }

    /// Returns whether a row has one field more than the rows of numbers.
    fn is_longer(&self, row: &Beginning<'_>) -> bool {
        self.is_uniform && row.fields.filled() == self.smallest + 1
    }
}

impl Above {
    /// Reads the rows and the comments above the numbers. The result has no heading if the first
    /// row of the table names the columns, perhaps with units in the second row, or if no row names
    /// them.
    pub fn new(text: &[u8], rows: &[Beginning<'_>], layout: Layout) -> Self {
        let is_numbers = |row: &Beginning<'_>| 2 * numbers(row, layout) >= row.fields.filled();
        let begin = rows.iter().rposition(|row| !is_numbers(row)).map_or(0, |last| last + 1);
        let table = &rows[begin..];
        if table.len() < MIN_NUMBERS && begin > 0 || table.is_empty() {
            return Self::default();
        }
        let (above, width) = (&rows[..begin], table[0].fields.len());
        let filled = Filled::new(above, table);
        let is_alike = |row: &Beginning<'_>| {
            let count = row.fields.filled();
            count == filled.first || filled.is_longer(row) || row.fields.len() == width
        };
        // A row that contains only numbers is a row of data, except a first row that numbers the
        // channels.
        let is_data_row = |(at, row): (usize, &Beginning<'_>)| {
            numbers(row, layout) == row.fields.filled() && !(at == 0 && is_numbering(row))
        };
        if !above.iter().all(is_alike) || above.iter().enumerate().any(is_data_row) {
            return Self::default();
        }
        let widths = filled.first.min(width)..=width;
        let comments = Comments::new(&text[..table[0].row.at], widths, layout);
        let are_numeric = table.iter().all(|row| numbers(row, layout) == row.fields.filled());
        let names = Names::find(above, &comments, &filled, layout)
            .filter(|_| are_numeric || !above.is_empty());
        let comment = names.as_ref().and_then(|names| names.comment);
        let mut further_units: Vec<Vec<String>> = comments.units(comment).collect();
        let has_names = names.is_some() || !above.is_empty();
        let names_of_columns = match &names {
            Some(names) => names.names.clone(),
            None => above.first().map_or(Vec::new(), texts),
        };
        further_units.push(comments.defined_units(&names_of_columns));
        let remarks = comments.remarks(filled.first, has_names).collect();
        let heading = names.map(|Names { names, units, row, further_units: of_rows, .. }| {
            further_units.extend(of_rows);
            Heading { names, units, begin, names_row: row, filled: filled.first }
        });
        Self { heading, further_units, remarks }
    }
}

/// Names of the columns, with their units.
#[derive(Debug, Default)]
struct Names {
    names: Vec<String>,
    units: Vec<String>,
    /// Row of the names; `None` if they are in a comment.
    row: Option<usize>,
    /// Index of the comment with the names.
    comment: Option<usize>,
    /// Units in further rows.
    further_units: Vec<Vec<String>>,
}

impl Names {
    /// Detects names in the rows above the numbers or in comments; `None` if the first row of the
    /// table has the names, perhaps with units in the second row, or if there are no names.
    fn find(
        above: &[Beginning<'_>],
        comments: &Comments,
        filled: &Filled,
        layout: Layout,
    ) -> Option<Self> {
        let of_comment = |line: usize| Self {
            names: comments.fields(line),
            comment: Some(line),
            ..Self::default()
        };
        match above {
            [] => {
                let of_line = comments.names_line().or(comments.units_line()).map(of_comment);
                let defined = || Some(Self { names: comments.defined_names()?, ..Self::default() });
                of_line.or_else(defined)
            }
            [units] if is_units(units, layout) => {
                let names = of_comment(comments.names_line()?);
                Some(Self { units: texts(units), row: Some(0), ..names })
            }
            _ => {
                let rows = NamesAndUnits::find(above, filled, layout)?;
                Some(Self {
                    names: texts(&above[rows.names]),
                    units: rows.units.map_or(Vec::new(), |at| texts(&above[at])),
                    row: Some(rows.names),
                    comment: None,
                    further_units: rows.further_units(above, layout),
                })
            }
        }
    }
}

/// Indices of the rows with the names and with the units.
struct NamesAndUnits {
    names: usize,
    units: Option<usize>,
}

impl NamesAndUnits {
    /// Detects the rows above a table that have names and units; `None` if they are the first and
    /// the second row.
    fn find(above: &[Beginning<'_>], filled: &Filled, layout: Layout) -> Option<Self> {
        match above {
            [names] => {
                let is_longer = filled.is_longer(names) && filled.smallest == filled.first;
                let is_unusual = is_longer || names.fields.is_joined;
                (is_unusual && numbers(names, layout) == 0)
                    .then_some(Self { names: 0, units: None })
            }
            [first, second] if is_units(second, layout) || !is_channels(first, layout) => {
                let is_swapped = is_units(first, layout) && !is_units(second, layout);
                let is_unusual =
                    filled.is_longer(first) || first.fields.is_joined || second.fields.is_joined;
                match (is_swapped, is_unusual && is_units(second, layout)) {
                    (true, _) => Some(Self { names: 1, units: Some(0) }),
                    (_, true) => Some(Self { names: 0, units: Some(1) }),
                    _ if first.fields.is_joined || second.fields.is_joined => {
                        Self::in_several_rows(above, layout)
                    }
                    _ => None,
                }
            }
            _ => Self::in_several_rows(above, layout),
        }
    }

    /// Detects the names and units in rows that may also number or describe the channels.
    fn in_several_rows(above: &[Beginning<'_>], layout: Layout) -> Option<Self> {
        let units = above.iter().rposition(|row| is_units(row, layout));
        let is_names = |at: &usize| {
            let row = &above[*at];
            Some(*at) != units && numbers(row, layout) == 0 && !is_channels(row, layout)
        };
        let before = units.and_then(|units| (0..units).rev().find(is_names));
        let quantities =
            |at: &usize| texts(&above[*at]).iter().filter(|text| is_named_quantity(text)).count();
        // Without a row of units, the row of names is the one that states most quantities.
        let most_quantities = || (0..above.len()).filter(is_names).max_by_key(quantities);
        let names = before
            .or_else(most_quantities)
            .or_else(|| above.iter().rposition(|row| numbers(row, layout) == 0))?;
        Some(Self { names, units: units.filter(|units| *units != names) })
    }

    /// Returns the units in further rows above the table: all rows except `names` and `units`.
    fn further_units(&self, above: &[Beginning<'_>], layout: Layout) -> Vec<Vec<String>> {
        let is_other = |at: &usize| *at != self.names && Some(*at) != self.units;
        let others = (0..above.len()).filter(is_other).map(|at| &above[at]);
        others.map(|row| units_of(&texts(row), is_units(row, layout))).collect()
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

/// Returns whether most of the texts are units.
pub(super) fn are_units(texts: &[String]) -> bool {
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
