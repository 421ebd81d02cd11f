//! Names of several words above columns that only blanks separate: `Time (s)   Force (kN)`.

use super::delimiter::Delimiter;
use super::fields::{Fields, Layout, Row};
use super::rows::text_of;

/// Splits rows into their fields. A row may have more words than the last row has fields. The words
/// of a name in this row are then joined, if that gives one name per column.
pub(super) fn split(rows: &[Row<'_>], layout: Layout) -> Vec<Fields> {
    let mut split: Vec<Fields> = Vec::new();
    for row in rows {
        let mut fields = Fields::default();
        fields.split(row.text, layout.delimiter);
        split.push(fields);
    }
    if let (Delimiter::Blanks, Some(width)) = (layout.delimiter, split.last().map(Fields::len)) {
        for (row, fields) in rows.iter().zip(&mut split).filter(|(_, fields)| fields.len() > width)
        {
            let text = text_of(row.text);
            let names = [by_wide_blanks(&text), with_brackets_joined(&text)];
            if let Some(names) = names.into_iter().find(|names| names.len() == width) {
                *fields = Fields::joined(&names);
            }
        }
    }
    split
}

/// Splits a text at two or more blanks.
pub(super) fn by_wide_blanks(text: &str) -> Vec<String> {
    let parts = text.split("  ").map(str::trim).filter(|part| !part.is_empty());
    parts.map(str::to_owned).collect()
}

/// Splits a text at blanks and joins words in brackets with the word before them: `time [s] acc
/// [m/s^2]`.
pub(super) fn with_brackets_joined(text: &str) -> Vec<String> {
    let mut joined: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match joined.last_mut() {
            Some(last) if word.starts_with(['[', '(', '{']) => {
                last.push(' ');
                last.push_str(word);
            }
            _ => joined.push(word.into()),
        }
    }
    joined
}
