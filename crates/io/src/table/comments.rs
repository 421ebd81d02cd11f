//! Names and units of columns in the comment lines above the numbers of a table.

use std::ops::RangeInclusive;

use mechid_signal::message;

use super::aligned::{by_wide_blanks, with_brackets_joined};
use super::definitions::{Definitions, is_by_number, is_numbered_with_unit};
use super::delimiter::{Delimiter, is_comment};
use super::dialect::is_data;
use super::fields::{Fields, Layout};
use super::heading::are_units;
use super::rows::text_of;
use crate::escaped;
use crate::units::{is_named_quantity, is_unit, unit_text};

/// Maximum number of lines above a table that are searched for names and units; names further up
/// are not read.
const MOST_LINES: usize = 64;

/// Signs at the beginning of a comment.
const COMMENT_SIGNS: [char; 6] = ['#', '%', '!', ';', ' ', '\t'];

/// Words, in lower case, before the names in a comment; a colon or an equals sign follows them.
const NAMES: [&str; 6] = ["columns", "column names", "channels", "fields", "names", "spalten"];

/// Words, in lower case, before the units in a comment; a colon or an equals sign follows them.
const UNITS: [&str; 6] = ["units", "unit", "einheiten", "einheit", "unités", "unidades"];

/// Comment lines above a table that have one field per column, the nearest first.
#[derive(Debug, Default)]
pub(super) struct Comments {
    lines: Vec<CommentLine>,
    /// Comments whose number of names or units differs from the number of columns, the nearest
    /// first.
    unfitting: Vec<Unfitting>,
    definitions: Definitions,
    /// Names of the columns, if each has a definition with a unit.
    defined_names: Option<Vec<String>>,
}

/// Comment whose number of names or units differs from the number of columns.
#[derive(Debug)]
struct Unfitting {
    text: String,
    fields: usize,
    /// `true` if the fields are units.
    has_units: bool,
}

/// Comment line with one field per column.
#[derive(Debug)]
struct CommentLine {
    fields: Vec<String>,
    /// `true` if the fields are units.
    are_units: bool,
    /// `true` if no other comment is between this line and the table, except units and lines
    /// without words.
    is_adjacent: bool,
}

impl Comments {
    /// Reads the comments in the text above a table with this number of columns.
    pub fn new(above: &[u8], widths: RangeInclusive<usize>, layout: Layout) -> Self {
        let mut lines = above.split(|b| *b == layout.terminator).rev().map(<[u8]>::trim_ascii_end);
        // The text ends with a terminator, after which there is no line.
        lines.next();
        let lines = lines.take(MOST_LINES).filter(|line| is_comment(line, layout.delimiter));
        let without_sign = |text: String| text.trim_matches(COMMENT_SIGNS).to_owned();
        let texts: Vec<String> = lines.map(|line| without_sign(text_of(line))).collect();
        let definitions = Definitions::new(texts.iter().rev().map(String::as_str));
        let numbered = definitions.numbered(&widths);
        let names = definitions.names(&widths);
        let is_complete = [names.is_some(), numbered.is_some()];
        let is_read =
            |text: &str| is_by_number(text).is_some_and(|number| is_complete[usize::from(number)]);
        let (mut comments, mut is_adjacent) = (Self::default(), true);
        comments.lines.extend(numbered.map(|fields| CommentLine {
            are_units: are_units(&fields),
            fields,
            is_adjacent,
        }));
        for text in texts {
            if !text.contains(char::is_alphanumeric) || is_read(&text) {
                continue;
            }
            let fitting = CommentLine::new(&text, &widths, layout, is_adjacent);
            if fitting.is_none() {
                comments.unfitting.extend(Unfitting::new(&text, layout, is_adjacent));
            }
            is_adjacent &= fitting.as_ref().is_some_and(|line| line.are_units);
            comments.lines.extend(fitting);
        }
        Self { definitions, defined_names: names, ..comments }
    }

    /// Returns the names of the columns, if each has a definition with a unit in a line of its own.
    pub fn defined_names(&self) -> Option<Vec<String>> {
        self.defined_names.clone()
    }

    /// Returns the units that the columns with these names have in their definitions.
    pub fn defined_units(&self, names: &[String]) -> Vec<String> {
        self.definitions.units(names)
    }

    /// Returns the index of the line with the names: the line in which most fields name a quantity
    /// or a unit, otherwise the line directly above the table or above its units.
    pub fn names_line(&self) -> Option<usize> {
        let lines = || self.lines.iter().enumerate().filter(|(_, line)| !line.are_units);
        let quantities = |line: &CommentLine| {
            line.fields.iter().filter(|field| is_named_quantity(field)).count()
        };
        let best = lines().rev().max_by_key(|(_, line)| quantities(line));
        best.filter(|(_, line)| quantities(line) > 0)
            .or_else(|| lines().find(|(_, line)| line.is_adjacent))
            .map(|(at, _)| at)
    }

    /// Returns the fields of a comment line, by the index of the line.
    pub fn fields(&self, line: usize) -> Vec<String> {
        self.lines[line].fields.clone()
    }

    /// Returns one list of units for each comment line except the line `names`; a list has one text
    /// per column, empty for a column without a unit.
    pub fn units(&self, names: Option<usize>) -> impl Iterator<Item = Vec<String>> {
        let without_names = self.lines.iter().enumerate().filter(move |(at, _)| Some(*at) != names);
        without_names.map(|(_, line)| units_of(&line.fields, line.are_units))
    }

    /// Returns remarks on comments that were not read because the number of their names or units
    /// differs from the number of `columns`. If the columns already have names, only comments with
    /// units get a remark.
    pub fn remarks(&self, columns: usize, has_names: bool) -> impl Iterator<Item = String> {
        let unread = self.unfitting.iter().filter(move |line| line.has_units || !has_names);
        unread.map(move |Unfitting { text, fields, has_units }| {
            let what = if *has_units { "names or units" } else { "names" };
            format!(
                "not read: the comment \"{}\" has {fields} fields, but the table has {}: if the fields are {what} \
                 of columns, give one field for each column, or the units with `unit`",
                escaped(text),
                message::count(columns, "column")
            )
        })
    }

    /// Returns the index of the nearest line of units.
    pub fn units_line(&self) -> Option<usize> {
        self.lines.iter().position(|line| line.are_units)
    }
}

/// Returns the texts for units in the fields of a line or row; empty for a field without a unit.
pub(super) fn units_of(fields: &[String], are_units: bool) -> Vec<String> {
    let unit = |field: &String| if are_units { field.clone() } else { unit_text(field) };
    fields.iter().map(unit).collect()
}

impl Unfitting {
    /// Detects names or units in a comment whose number of fields differs from the number of
    /// columns. Either a word such as `units` introduces them, or the comment is directly above the
    /// table and its delimiters are not single blanks. In the second case, at least half of the
    /// fields have a unit or the name of a quantity, or all fields are single words.
    fn new(text: &str, layout: Layout, is_adjacent: bool) -> Option<Self> {
        let (names, units) = (after_word(text, &NAMES), after_word(text, &UNITS));
        let stated = names.or(units);
        if stated.is_none() && !is_adjacent {
            return None;
        }
        let any = 2..=usize::MAX;
        let (fields, by_blanks) = fields_of(stated.unwrap_or(text), &any, layout)?;
        let count = |is: &dyn Fn(&str) -> bool| fields.iter().filter(|field| is(field)).count();
        let with_units = count(&|field| !unit_text(field).is_empty() || is_unit(field));
        let named = count(&|field| is_named_quantity(field) || is_unit(field));
        let are_words = fields.iter().all(|field| !field.contains(char::is_whitespace));
        let is_table = 2 * named >= fields.len() || are_words;
        let is_stated = stated.is_some() || is_table && !by_blanks;
        let has_units = units.is_some() || 2 * with_units >= fields.len();
        let fields = fields.len();
        is_stated.then(|| Self { text: text.into(), fields, has_units })
    }
}

impl CommentLine {
    fn new(
        text: &str,
        widths: &RangeInclusive<usize>,
        layout: Layout,
        is_adjacent: bool,
    ) -> Option<Self> {
        let (names, units) = (after_word(text, &NAMES), after_word(text, &UNITS));
        let (fields, by_blanks) = fields_of(names.or(units).unwrap_or(text), widths, layout)?;
        // Words in the definition of one column are not the names of all columns.
        (!by_blanks || !is_numbered_with_unit(text)).then_some(())?;
        // Most words of a sentence may look like units: `in` and `s` in `sampled in s`.
        let are_all_units = || fields.iter().all(|field| are_units(std::slice::from_ref(field)));
        let seem_units = are_units(&fields) && (is_adjacent || !by_blanks || are_all_units());
        Some(Self { are_units: units.is_some() || seem_units, fields, is_adjacent })
    }
}

/// Returns the text after one of the words and a colon or an equals sign.
fn after_word<'a>(text: &'a str, words: &[&str]) -> Option<&'a str> {
    let (word, rest) = text.split_once([':', '='])?;
    words.contains(&word.trim().to_lowercase().as_str()).then(|| rest.trim())
}

/// Returns the fields of a comment, if there is one per column and none is a number, and whether
/// single blanks separate them.
fn fields_of(
    text: &str,
    widths: &RangeInclusive<usize>,
    layout: Layout,
) -> Option<(Vec<String>, bool)> {
    let split = |delimiter: Delimiter| -> Vec<String> {
        let mut fields = Fields::default();
        fields.split(text.as_bytes(), delimiter);
        fields.iter().map(text_of).collect()
    };
    let of_table = match layout.delimiter {
        Delimiter::Byte(byte) => split(Delimiter::Byte(byte)),
        Delimiter::Blanks => Vec::new(),
    };
    let candidates = [
        (of_table, false),
        (split(Delimiter::Byte(b',')), false),
        (split(Delimiter::Byte(b';')), false),
        (split(Delimiter::Byte(b'\t')), false),
        (by_wide_blanks(text), false),
        (with_brackets_joined(text), true),
        (split(Delimiter::Blanks), true),
    ];
    let is_word = |field: &String| !is_data(field.as_bytes(), layout.delimiter);
    candidates.into_iter().find(|(fields, _)| {
        widths.contains(&fields.len())
            && fields.iter().all(is_word)
            && fields.iter().any(|field| !field.is_empty())
    })
}
