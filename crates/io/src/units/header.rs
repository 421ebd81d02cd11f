//! Units in the names of columns: in brackets, after a slash, or as a word.

use std::ops::Range;

use super::expression::Expression;
use super::notes::{
    Bracket, Note, bare_note, brackets, notes_of, read_note, unit_in_notes, without_spans,
};
use super::other_unit::is_numbered;
use super::plain::{multiplier, number_and_rest, with_plain_signs};
use super::unit_words::{unit_from_words, unit_words};
use super::words::{is_ambiguous, split_words};
use super::{Quantity, Unit};

/// Maximum number of words in the text of a unit; a longer text that is not a unit is a
/// description.
const MAX_UNIT_WORDS: usize = 2;

/// Reliability of the unit that a header states for its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evidence {
    /// The unit is stated clearly.
    Stated,
    /// The unit is read from the header, but other interpretations are possible.
    Likely,
    /// The text may be a unit, but this unit is not applied to the numbers.
    Unused,
}

/// Text in the header of a column that is or may be its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedUnit {
    /// Text in its original form.
    pub text: String,
    /// Unit that the text is or may be; `None` if it is not understood.
    pub unit: Option<Unit>,
    /// Reliability of the statement.
    pub evidence: Evidence,
}

impl StatedUnit {
    /// Returns the unit in which the numbers of the column are read; `None` means SI units.
    pub fn used(&self) -> Option<&Unit> {
        self.unit.as_ref().filter(|_| self.evidence != Evidence::Unused)
    }

    pub(super) fn new(text: &str, unit: impl Into<Option<Unit>>, evidence: Evidence) -> Self {
        Self { text: text.trim().into(), unit: unit.into(), evidence }
    }
}

/// Returns what a column states about its unit: in its `name`, or as a separate text `unit` (in a
/// line of units, a label or an attribute). If a quantity is `wanted`, its units are also
/// recognised as words of the name.
pub(crate) fn stated(name: &str, unit: &str, wanted: Option<Quantity>) -> Option<StatedUnit> {
    let [name, unit] = [name, unit].map(with_plain_signs);
    let name = without_copy_number(name.trim());
    let brackets = brackets(name);
    let outside = without_spans(name, brackets.iter().map(|one| one.span.clone()));
    let notes = brackets.iter().flat_map(|one| notes_of(&name[one.inner.clone()]));
    let notes: Vec<&str> = notes.collect();
    let in_brackets = unit_in_notes(&notes, wanted);
    let stated = first_stated(in_brackets, &outside, &unit, wanted);
    let stated = stated.map(|stated| {
        let others = other_units(&notes, &outside, &unit, wanted);
        with_contradiction(stated, others)
    });
    // A factor in a name does not say whether the numbers include it or still need it.
    let factor = multiplier(&outside).or_else(|| {
        let mut notes = notes.iter().copied().chain(notes_of(&unit));
        notes.find(|note| multiplier(note) == Some(*note))
    });
    match factor.filter(|_| wanted.is_some()) {
        Some(factor) => {
            let unit = stated.and_then(|stated| stated.used().cloned());
            let evidence = if unit.is_some() { Evidence::Likely } else { Evidence::Unused };
            Some(StatedUnit::new(factor, unit, evidence))
        }
        None => stated,
    }
}

/// Maximum relative difference between two sizes of one unit, from the rounding of factors.
const SAME_SIZE: f64 = 1e-9;

/// Returns the texts in a header that clearly state a unit: in brackets, in the name outside of
/// brackets, and in a separate text. An electric unit (voltage, charge, counts) in the separate
/// text is the output of an amplifier; its text is returned with the unit `None`.
fn other_units(
    notes: &[&str],
    outside: &str,
    text: &str,
    wanted: Option<Quantity>,
) -> Vec<(String, Option<Unit>)> {
    let read = |note: &str| match read_note(note, wanted) {
        Note::Unit(unit) | Note::Qualified(unit) => Some((note.to_owned(), Some(unit))),
        _ => None,
    };
    let is_clear = |words: &StatedUnit| {
        words.evidence == Evidence::Stated && !is_ambiguous(&words.text) && words.unit.is_some()
    };
    let words = unit_from_words(outside, wanted).filter(is_clear);
    let words = unit_after_slash(outside).filter(is_clear).or(words);
    let texts: Vec<&str> = notes_of(text).collect();
    // If the separate text has both a sensitivity and the unit of the output of an amplifier, the
    // sensitivity states the unit of the numbers.
    let is_sensitivity = |note: &&str| number_and_rest(note).is_some();
    let is_electric =
        |note: &str| Expression::parse(note).is_some_and(|unit| unit.dimension.is_electric());
    let amplifier = texts.iter().copied().filter(|note| is_electric(note));
    let amplifier = amplifier.filter(|_| !texts.iter().any(is_sensitivity));
    let units = notes.iter().chain(&texts).filter_map(|note| read(note));
    let of_words = words.map(|words| (words.text, words.unit));
    units.chain(of_words).chain(amplifier.map(|note| (note.to_owned(), None))).collect()
}

/// Returns the statement `stated`. If another text of the header contradicts the unit, the returned
/// statement is doubtful and names both texts.
fn with_contradiction(stated: StatedUnit, others: Vec<(String, Option<Unit>)>) -> StatedUnit {
    let Some(used) = stated.used() else { return stated };
    let is_other = |unit: &Option<Unit>| {
        unit.as_ref().is_none_or(|unit| {
            let is_same_size = (unit.in_si / used.in_si - 1.0).abs() <= SAME_SIZE;
            unit.quantity != used.quantity || !is_same_size
        })
    };
    match others.into_iter().find(|(_, unit)| is_other(unit)) {
        Some((text, _)) => StatedUnit {
            text: format!("{} and {}", stated.text, text.trim()),
            evidence: Evidence::Likely,
            ..stated
        },
        None => stated,
    }
}

/// Returns the clearest statement of a unit: in brackets, in the name `outside` of brackets, or in
/// a separate text.
fn first_stated(
    in_brackets: Option<StatedUnit>,
    outside: &str,
    text: &str,
    wanted: Option<Quantity>,
) -> Option<StatedUnit> {
    let is_used = |statement: &StatedUnit| statement.evidence != Evidence::Unused;
    if in_brackets.as_ref().is_some_and(is_used) {
        return in_brackets;
    }
    // The slash of `velmm/s` is part of the unit mm/s, so the `s` after the slash is not the unit
    // of the column.
    let is_of_unit = |statement: &StatedUnit| {
        let is_time = statement.unit.as_ref().is_some_and(|unit| unit.quantity == Quantity::Time);
        is_time && wanted.is_some_and(|wanted| wanted != Quantity::Time)
    };
    let after_slash = unit_after_slash(outside).filter(|statement| !is_of_unit(statement));
    let notes: Vec<&str> = notes_of(text).collect();
    // Several words without a unit are a description of the channel.
    let is_description = text.split_whitespace().count() > MAX_UNIT_WORDS;
    let of_text = unit_in_notes(&notes, wanted)
        .filter(|statement| statement.unit.is_some() || !is_description);
    let is_unclear = in_brackets.as_ref().is_some_and(|statement| statement.unit.is_none());
    let from_words = || {
        let words = unit_from_words(outside, wanted);
        words.filter(|words| in_brackets.is_none() || is_unclear && words.unit.is_some())
    };
    after_slash
        .clone()
        .filter(|statement| in_brackets.is_none() && is_used(statement))
        .or_else(|| of_text.clone().filter(is_used))
        .or_else(from_words)
        .or(in_brackets.clone())
        .or(after_slash)
        .or(of_text)
}

/// Returns a name without the unit that it states in brackets, after a slash or as its last words.
/// Brackets at the end are always removed.
pub(crate) fn without_unit(name: &str) -> String {
    let name = name.trim();
    let is_removed = |one: &Bracket| {
        let notes: Vec<&str> = notes_of(&name[one.inner.clone()]).collect();
        one.span.end == name.len() || unit_in_notes(&notes, None).is_some()
    };
    let removed = brackets(name).into_iter().filter(is_removed).map(|one| one.span);
    let removed: Vec<Range<usize>> = removed.collect();
    if !removed.is_empty() {
        return without_spans(name, removed.into_iter());
    }
    if let Some((before, _)) = split_at_slash(name) {
        return before.trim_end().into();
    }
    if Expression::parse(name).is_some() {
        return name.into();
    }
    match unit_words(name, None) {
        Some(words) if words.evidence == Evidence::Stated => {
            let before =
                name[..words.span.start].trim_end_matches([' ', '_', '.', ',', '-', '=', ':', '/']);
            let after = name[words.span.end..].trim_start_matches('.');
            format!("{before}{after}")
        }
        _ => name.into(),
    }
}

/// Returns shorter forms of a name with which a user may choose the column: without its unit, and
/// without brackets that contain only a unit.
pub(crate) fn names_without_unit(name: &str) -> [String; 2] {
    let is_unit = |one: &Bracket| {
        let note = read_note(&name[one.inner.clone()], None);
        matches!(note, Note::Unit(_) | Note::Qualified(_))
    };
    let units = brackets(name).into_iter().filter(is_unit).map(|one| one.span);
    [without_unit(name), without_spans(name, units)]
}

/// Returns the notes in the brackets of a name.
pub(crate) fn label_notes(name: &str) -> Vec<String> {
    let brackets = brackets(name);
    brackets.into_iter().map(|one| bare_note(&name[one.inner]).to_owned()).collect()
}

/// Returns a name without its brackets.
pub(crate) fn name_without_brackets(name: &str) -> String {
    without_spans(name, brackets(name).into_iter().map(|one| one.span))
}

/// Removes the number that pandas appends to a name that occurs twice: `Force [N].1`.
fn without_copy_number(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((before, number))
            if before.ends_with([']', ')', '}', '>'])
                && !number.is_empty()
                && number.bytes().all(|b| b.is_ascii_digit()) =>
        {
            before
        }
        _ => name,
    }
}

/// Splits a name at the slash before its unit: `F / kN`, `v / mm/s`.
fn split_at_slash(name: &str) -> Option<(&str, Expression)> {
    let (before, after) = name.split_once('/')?;
    let unit = Expression::parse(after)?;
    // The slash of `vel_m/s` belongs to the unit.
    let is_unit_word = |span: &Range<usize>| {
        let word = &name[span.clone()];
        word.contains('/') && word.len() < name.len() && Unit::parse(word).is_some()
    };
    if split_words(name).iter().any(is_unit_word) {
        return None;
    }
    // The slash of `acc 100 mV/g` belongs to a sensitivity.
    let last_word = before.rsplit_once([' ', '_']).and_then(|(_, word)| Expression::parse(word));
    if last_word.is_some_and(|unit| unit.dimension.is_electric()) {
        return None;
    }
    // In `v/mm/s`, `v` is the name and mm/s the unit; it is not a voltage divided by a velocity.
    let is_unit_alone = Expression::parse(name).is_some_and(|unit| !unit.dimension.is_electric());
    let is_name = !is_unit_alone && !before.trim().is_empty();
    let is_unit = Quantity::from_dimension(unit.dimension).is_some();
    (is_name && is_unit).then_some((before, unit))
}

fn unit_after_slash(name: &str) -> Option<StatedUnit> {
    if split_at_slash(name).is_some() {
        let (_, text) = name.split_once('/')?;
        return Some(StatedUnit::new(text, Unit::parse(text), Evidence::Stated));
    }
    let (_, after) = name.split_once('/')?;
    let unit = Expression::parse(after)?;
    let is_other = !unit.dimension.is_number() && !is_numbered(after.trim());
    let is_stated = unit.dimension.is_electric() || is_other;
    is_stated.then(|| StatedUnit::new(after, Unit::parse(after), Evidence::Unused))
}
