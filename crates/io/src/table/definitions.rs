//! Definitions of columns in comments, one line each: `# 2: force [kN]`, `# F: force in kN`.

use std::ops::RangeInclusive;

use crate::units::{names_without_unit, unit_text};

/// Words, in lower case, before the number of a column.
const COLUMN_WORDS: [&str; 10] =
    ["column", "col", "channel", "chan", "ch", "field", "spalte", "kanal", "colonne", "coluna"];

/// Signs of a list before a definition.
const BULLETS: [char; 5] = ['-', '*', '•', ' ', '\t'];

/// Signs between the number of a column and its definition.
const AFTER_NUMBER: [char; 9] = [':', '=', '.', ')', '-', '–', '|', ' ', '\t'];

/// Definition of one column.
#[derive(Debug)]
struct Definition {
    /// Number of the column, or its name.
    key: Key,
    text: String,
}

#[derive(Debug, PartialEq)]
enum Key {
    Number(usize),
    Name(String),
}

/// Comment lines that may define one column each, in their order.
#[derive(Debug, Default)]
pub(super) struct Definitions(Vec<Definition>);

impl Definitions {
    /// Reads the definitions among comments whose comment signs are removed.
    pub fn new<'a>(comments: impl Iterator<Item = &'a str>) -> Self {
        Self(comments.filter_map(Definition::parse).collect())
    }

    /// Returns the definitions of columns that are numbered from 0 or 1 on without a gap, in the
    /// order of the columns.
    pub fn numbered(&self, widths: &RangeInclusive<usize>) -> Option<Vec<String>> {
        let number = |definition: &Definition| match definition.key {
            Key::Number(number) if number <= *widths.end() => {
                Some((number, definition.text.clone()))
            }
            _ => None,
        };
        let mut numbered: Vec<(usize, String)> = self.0.iter().filter_map(number).collect();
        numbered.sort_by_key(|(number, _)| *number);
        let first = numbered.first()?.0;
        let is_complete = numbered.iter().enumerate().all(|(at, (n, _))| *n == first + at);
        let is_usable = first <= 1 && is_complete && widths.contains(&numbered.len());
        is_usable.then(|| numbered.into_iter().map(|(_, text)| text).collect())
    }

    /// Returns the names in the definitions that have a unit; `None` if their number differs from
    /// the number of columns.
    pub fn names(&self, widths: &RangeInclusive<usize>) -> Option<Vec<String>> {
        let name = |definition: &Definition| match &definition.key {
            Key::Name(name) if !definition.unit().is_empty() => Some(name.clone()),
            _ => None,
        };
        let names: Vec<String> = self.0.iter().filter_map(name).collect();
        widths.contains(&names.len()).then_some(names)
    }

    /// Returns the texts for units of the columns with these names, empty for a column without a
    /// unit.
    pub fn units(&self, names: &[String]) -> Vec<String> {
        let unit = |name: &String| {
            let [bare, other] = names_without_unit(name);
            let is_of_column = |definition: &&Definition| match &definition.key {
                Key::Name(key) => [name, &bare, &other].contains(&key),
                Key::Number(_) => false,
            };
            self.0.iter().find(is_of_column).map_or(String::new(), Definition::unit)
        };
        names.iter().map(unit).collect()
    }
}

/// Returns whether a comment, without its comment sign, defines a column by its number and states a
/// unit.
pub(super) fn is_numbered_with_unit(comment: &str) -> bool {
    let definition = Definition::parse(comment);
    definition.is_some_and(|one| matches!(one.key, Key::Number(_)) && !one.unit().is_empty())
}

/// Returns whether a comment, without its comment sign, defines a column by its number and not by
/// its name; `None` if the comment defines no column.
pub(super) fn is_by_number(comment: &str) -> Option<bool> {
    Definition::parse(comment).map(|definition| matches!(definition.key, Key::Number(_)))
}

impl Definition {
    fn parse(comment: &str) -> Option<Self> {
        let text = comment.trim_start_matches(BULLETS).trim_end();
        let (key, text) = match numbered(text) {
            Some((number, rest)) => (Key::Number(number), rest),
            None => {
                let (name, rest) = text.split_once([':', '=']).or(text.split_once(" - "))?;
                (Key::Name(name.trim().into()), rest)
            }
        };
        let text = text.trim();
        let has_words = text.contains(char::is_alphabetic) && key != Key::Name(String::new());
        has_words.then(|| Self { key, text: text.into() })
    }

    /// Returns the text of the unit that the definition states, read as a header with the name and
    /// the text of the definition. The result is empty if the definition has no unit, or only the
    /// unit of a range or a sensitivity (`5 kN`, `10 mV/g`).
    fn unit(&self) -> String {
        let text = match &self.key {
            Key::Name(name) => format!("{name} {}", self.text),
            Key::Number(_) => self.text.clone(),
        };
        let unit = unit_text(&text);
        let before = text.rfind(&unit).map_or("", |at| text[..at].trim_end());
        let is_of_number = before.ends_with(|c: char| c.is_ascii_digit() || c == '/');
        if is_of_number { String::new() } else { unit }
    }
}

/// Splits a definition into the number of its column and the rest: `2: force`, `Column 2 = force`.
fn numbered(text: &str) -> Option<(usize, &str)> {
    let letters = text.len() - text.trim_start_matches(char::is_alphabetic).len();
    let is_known = COLUMN_WORDS.contains(&text[..letters].to_lowercase().as_str());
    let rest = if letters == 0 || is_known {
        text[letters..].trim_start_matches([' ', '_', '.', '#', '-'])
    } else {
        return None;
    };
    let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let (number, rest) = (rest[..digits].parse().ok()?, &rest[digits..]);
    rest.starts_with(AFTER_NUMBER).then(|| (number, rest.trim_start_matches(AFTER_NUMBER)))
}
