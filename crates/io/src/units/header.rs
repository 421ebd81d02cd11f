//! Units in the names of columns: in brackets, after a stroke, or as a word.

use std::ops::Range;

use super::expression::Expression;
use super::vocabulary::{Dimension, G};
use super::words::{
    is_ambiguous, is_label, is_prefix, is_quantity_word, quantity_word, split_words,
};
use super::{Quantity, Unit};

/// Maximum number of words of a text for a unit; a longer one that is not a unit is a description.
const MAX_UNIT_WORDS: usize = 2;

/// Reliability of the unit that a header states for its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evidence {
    /// The unit is stated clearly.
    Stated,
    /// The unit is read from the header, but other interpretations are possible.
    Likely,
    /// The text may be a unit; the numbers are read without it.
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

    fn new(text: &str, unit: impl Into<Option<Unit>>, evidence: Evidence) -> Self {
        Self { text: text.trim().into(), unit: unit.into(), evidence }
    }
}

/// Returns what a column states about its unit: in its `name`, or as a separate text `unit` (in a
/// line of units, a label or an attribute). If a quantity is `wanted`, units of it count also as
/// words of the name.
pub(crate) fn stated(name: &str, unit: &str, wanted: Option<Quantity>) -> Option<StatedUnit> {
    let name = without_copy_number(name.trim());
    let brackets = brackets(name);
    let notes: Vec<&str> =
        brackets.iter().flat_map(|one| notes_of(&name[one.inner.clone()])).collect();
    let in_brackets = unit_in_notes(&notes, wanted);
    if let Some(found) = &in_brackets
        && found.evidence != Evidence::Unused
    {
        return in_brackets;
    }
    let outside = without_spans(name, brackets.into_iter().map(|one| one.span));
    // The stroke of `velmm/s` belongs to the unit, and a unit of time alone cannot follow it.
    let is_of_unit = |found: &StatedUnit| {
        let is_time = found.unit.as_ref().is_some_and(|unit| unit.quantity == Quantity::Time);
        is_time && wanted.is_some_and(|wanted| wanted != Quantity::Time)
    };
    let unit_after_stroke = || unit_after_stroke(&outside).filter(|found| !is_of_unit(found));
    let after_stroke = if in_brackets.is_none() { unit_after_stroke() } else { None };
    let of_text = || {
        let notes: Vec<&str> = notes_of(unit).collect();
        // Several words without a unit are a description of the channel.
        let is_description = unit.split_whitespace().count() > MAX_UNIT_WORDS;
        unit_in_notes(&notes, wanted).filter(|found| found.unit.is_some() || !is_description)
    };
    let unit_from_words =
        || in_brackets.is_none().then(|| unit_from_words(&outside, wanted)).flatten();
    let used = |found: &StatedUnit| found.evidence != Evidence::Unused;
    after_stroke
        .filter(used)
        .or_else(|| of_text().filter(used))
        .or_else(unit_from_words)
        .or(in_brackets)
        .or_else(unit_after_stroke)
        .or_else(of_text)
}

/// Returns a name without the unit that it states in brackets, after a stroke or as its last words.
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
    if let Some((before, _)) = stroke(name) {
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

/// Returns the notes in a text, separated by semicolons and commas.
fn notes_of(text: &str) -> impl Iterator<Item = &str> {
    text.split([';', ',']).map(bare_note)
}

/// Brackets in a name.
#[derive(Debug, Clone)]
struct Bracket {
    /// Range with the brackets.
    span: Range<usize>,
    /// Range between them.
    inner: Range<usize>,
}

/// Returns the outermost brackets of a name, with their contents; one that is never closed extends
/// to the end.
fn brackets(name: &str) -> Vec<Bracket> {
    const PAIRS: [(char, char); 5] = [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>'), ('（', '）')];
    let mut brackets = Vec::new();
    let mut open: Option<(usize, (char, char), usize)> = None;
    for (at, c) in name.char_indices() {
        let Some((start, pair, depth)) = open else {
            open = PAIRS.into_iter().find(|pair| pair.0 == c).map(|pair| (at, pair, 1));
            continue;
        };
        let depth = match c {
            c if c == pair.1 => depth - 1,
            c if c == pair.0 => depth + 1,
            _ => depth,
        };
        if depth == 0 {
            let inner = start + pair.0.len_utf8()..at;
            brackets.push(Bracket { span: start..at + c.len_utf8(), inner });
        }
        open = (depth > 0).then_some((start, pair, depth));
    }
    brackets.extend(open.filter(|(start, ..)| *start > 0).map(|(start, pair, _)| Bracket {
        span: start..name.len(),
        inner: start + pair.0.len_utf8()..name.len(),
    }));
    brackets
}

/// Returns a name without some of its parts and the blanks around them.
fn without_spans(name: &str, spans: impl Iterator<Item = Range<usize>>) -> String {
    let (mut parts, mut from) = (Vec::new(), 0);
    for span in spans {
        parts.push(&name[from..span.start]);
        from = span.end;
    }
    parts.push(&name[from..]);
    let parts = parts.into_iter().map(str::trim).filter(|part| !part.is_empty());
    let joined = parts.collect::<Vec<_>>().join(" ");
    joined.trim_end_matches(['/', '_', ',', '-', ':', '=', ' ']).to_owned()
}

/// Meaning of a text in brackets.
#[derive(Debug, Clone, PartialEq)]
enum Note {
    /// A unit.
    Unit(Unit),
    /// Unit with further words that make it uncertain: `um pk-pk`.
    Qualified(Unit),
    /// Text that is not understood; with the unit that it may contain.
    Unclear(Option<Unit>),
    /// Place, direction or channel rather than a unit.
    Label,
}

/// Returns the unit that texts in brackets state.
fn unit_in_notes(notes: &[&str], wanted: Option<Quantity>) -> Option<StatedUnit> {
    if let Some(unit) = unit_from_sensitivity(notes) {
        return Some(StatedUnit::new(&notes.join("; "), unit, Evidence::Stated));
    }
    let notes: Vec<(&str, Note)> =
        notes.iter().map(|note| (bare_note(note), read_note(bare_note(note), wanted))).collect();
    let fits = |unit: &Unit| wanted.is_none_or(|wanted| unit.quantity == wanted);
    let unit = |only_fitting: bool| {
        notes.iter().find_map(|(text, note)| match note {
            Note::Unit(unit) if fits(unit) || !only_fitting => {
                Some(StatedUnit::new(text, unit.clone(), Evidence::Stated))
            }
            _ => None,
        })
    };
    let qualified = || {
        notes.iter().find_map(|(text, note)| match note {
            Note::Qualified(unit) => Some(StatedUnit::new(text, unit.clone(), Evidence::Likely)),
            _ => None,
        })
    };
    let unclear = || {
        notes.iter().find_map(|(text, note)| match note {
            Note::Unclear(unit) => Some(StatedUnit::new(text, unit.clone(), Evidence::Unused)),
            _ => None,
        })
    };
    unit(true).or_else(|| unit(false)).or_else(qualified).or_else(unclear)
}

/// Returns a note without brackets around all of it and without the word `unit`.
fn bare_note(note: &str) -> &str {
    let unquoted = note.trim().trim_matches('"').trim();
    // The quotation mark alone is that of inches.
    let mut note = if unquoted.is_empty() { note.trim() } else { unquoted };
    for (open, close) in [('[', ']'), ('{', '}'), ('<', '>'), ('(', ')')] {
        let inner = note.strip_prefix(open).and_then(|inner| inner.strip_suffix(close));
        // The brackets of `(m/s²)·(s)` do not enclose all of it.
        note = inner.filter(|inner| !inner.contains(close)).unwrap_or(note).trim();
    }
    let lower = note.to_lowercase();
    let prefix = ["units", "unit", "einheit"].into_iter().find(|word| {
        lower.strip_prefix(word).is_some_and(|rest| rest.trim_start().starts_with([':', '=']))
    });
    match prefix {
        Some(word) => note[word.len()..].trim_start().trim_start_matches([':', '=']).trim(),
        None => note,
    }
}

/// Reads one note.
fn read_note(note: &str, wanted: Option<Quantity>) -> Note {
    let note = bare_note(note);
    if let Some(unit) = Unit::parse(note) {
        return Note::Unit(unit);
    }
    if let Some(Expression { dimension, .. }) = Expression::parse(note) {
        // A load cell in kg measures kilograms-force.
        return if dimension == Dimension::MASS && wanted == Some(Quantity::Force) {
            let in_si = Expression::parse(note).map_or(1.0, |mass| mass.in_si) * G;
            Note::Qualified(Unit { name: note.into(), quantity: Quantity::Force, in_si })
        } else {
            Note::Unclear(None)
        };
    }
    if note.is_empty() || is_label(note) {
        return Note::Label;
    }
    // The word `in` of `in mm` is a preposition and not an inch.
    if let Some(unit) = note.strip_prefix("in ").and_then(Unit::parse) {
        return Note::Unit(unit);
    }
    if let Some(unit) = with_number(note) {
        return Note::Unclear(Some(unit));
    }
    let words: Vec<&str> = note.split_whitespace().collect();
    for count in (1..words.len()).rev() {
        let (first, last) = (words[..count].join(" "), words[count..].join(" "));
        let [at_start, at_end] = [(&first, &last), (&last, &first)].map(|(unit, rest)| {
            let unit = Unit::parse(unit)?;
            Some(if is_label(rest) { Note::Unit(unit) } else { Note::Qualified(unit) })
        });
        if let Some(note) = at_start.or(at_end.filter(|note| matches!(note, Note::Unit(_)))) {
            return note;
        }
    }
    Note::Unclear(None)
}

/// Reads a number with a unit, such as a range: `±50 g`, `0.1 mm`, `x10 N`.
fn with_number(note: &str) -> Option<Unit> {
    let unsigned = note.trim_start_matches(['±', '+', '-', '~', '<', '>', '≤', '*', '×', ' ']);
    let unsigned = unsigned.strip_prefix('x').unwrap_or(unsigned);
    let (number, unit) = number_and_rest(unsigned)?;
    let unit = Unit::parse(unit)?;
    Some(Unit { name: note.into(), in_si: number * unit.in_si, ..unit })
}

/// Splits a positive number from the text after it.
pub(crate) fn number_and_rest(text: &str) -> Option<(f64, &str)> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let end = text.find(|c| !is_part(c)).unwrap_or(text.len());
    let number: f64 = text[..end].parse().ok()?;
    (number > 0.0 && number.is_finite()).then(|| (number, text[end..].trim()))
}

/// Reads a sensitivity together with the unit of the converter: `mV; 11.2 mV/N` is 1/11.2 N.
fn unit_from_sensitivity(notes: &[&str]) -> Option<Unit> {
    let notes: Vec<&str> = notes.iter().map(|note| bare_note(note)).collect();
    let raw = notes
        .iter()
        .find_map(|note| Expression::parse(note).filter(|unit| unit.dimension.is_electric()))?;
    let (text, (number, per_unit)) = notes.iter().find_map(|note| {
        let note = note.trim_start_matches(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, rest) = number_and_rest(note)?;
        Some((note, (number, Expression::parse(rest).filter(|e| e.dimension.is_electric())?)))
    })?;
    let dimension = raw.dimension.times(per_unit.dimension, -1)?;
    let quantity = Quantity::from_dimension(dimension)?;
    let in_si = raw.in_si / (number * per_unit.in_si);
    in_si.is_normal().then(|| Unit { name: format!("1/({text})"), quantity, in_si })
}

/// Splits a name at the stroke before its unit: `F / kN`, `v / mm/s`.
fn stroke(name: &str) -> Option<(&str, Expression)> {
    let (before, after) = name.split_once('/')?;
    let unit = Expression::parse(after)?;
    // The stroke of `vel_m/s` belongs to the unit.
    let is_unit_word = |span: &Range<usize>| {
        let word = &name[span.clone()];
        word.contains('/') && word.len() < name.len() && Unit::parse(word).is_some()
    };
    if split_words(name).iter().any(is_unit_word) {
        return None;
    }
    // `v/mm/s` is not a voltage divided by a velocity.
    let is_unit_alone = Expression::parse(name).is_some_and(|unit| !unit.dimension.is_electric());
    let is_name = !is_unit_alone && !before.trim().is_empty();
    let is_unit = Quantity::from_dimension(unit.dimension).is_some();
    (is_name && is_unit).then_some((before, unit))
}

fn unit_after_stroke(name: &str) -> Option<StatedUnit> {
    if stroke(name).is_some() {
        let (_, text) = name.split_once('/')?;
        return Some(StatedUnit::new(text, Unit::parse(text), Evidence::Stated));
    }
    let (_, after) = name.split_once('/')?;
    let unit = Expression::parse(after)?;
    unit.dimension.is_electric().then(|| StatedUnit::new(after, None, Evidence::Unused))
}

/// Words of a name that are or may be a unit.
struct UnitWords {
    span: Range<usize>,
    text: String,
    unit: Option<Unit>,
    evidence: Evidence,
}

fn unit_from_words(name: &str, wanted: Option<Quantity>) -> Option<StatedUnit> {
    let words = unit_words(name, wanted)?;
    Some(StatedUnit::new(&words.text, words.unit, words.evidence))
}

/// Returns the words of a name that are a unit of the quantity wanted, or of the quantity that the
/// name states.
fn unit_words(name: &str, wanted: Option<Quantity>) -> Option<UnitWords> {
    if let (Some(wanted), Some(unit)) = (wanted, Unit::parse(name))
        && unit.quantity == wanted
    {
        let evidence = if is_ambiguous(name) { Evidence::Likely } else { Evidence::Stated };
        return Some(UnitWords {
            span: 0..name.len(),
            text: name.into(),
            unit: Some(unit),
            evidence,
        });
    }
    let words = split_words(name);
    let text_of = |span: &Range<usize>| &name[span.clone()];
    let implied = || words.iter().find_map(|span| quantity_word(text_of(span)));
    let quantity = wanted.or_else(implied);
    for first in (1..words.len()).rev() {
        for count in (1..=4.min(words.len() - first)).rev() {
            let span = words[first].start..words[first + count - 1].end;
            let parts: Vec<&str> = words[first..first + count].iter().map(text_of).collect();
            let Some(unit) = joined_unit(&parts) else { continue };
            if quantity.is_some_and(|quantity| unit.quantity != quantity) {
                continue;
            }
            // The words of `milli-g` are one unit.
            if is_prefix(text_of(&words[first - 1])) {
                continue;
            }
            let is_short = parts.len() == 1 && is_ambiguous(parts[0]);
            let named =
                words[..first].iter().any(|word| is_quantity_word(text_of(word), unit.quantity));
            let after = &words[first + count..];
            // `in` before other words is a preposition.
            let labels = after.iter().all(|word| is_label(text_of(word)))
                && (after.is_empty() || !parts[0].eq_ignore_ascii_case("in"));
            let evidence = match (labels, is_short && !named && unit.in_si != 1.0) {
                (true, false) if quantity.is_some() || !is_short => Evidence::Stated,
                _ if quantity.is_some() => Evidence::Unused,
                _ => continue,
            };
            let text = text_of(&span).to_owned();
            return Some(UnitWords { span, text, unit: Some(unit), evidence });
        }
    }
    wanted.and_then(|wanted| {
        leading_unit(name, &words, wanted)
            .or_else(|| glued(name, &words, wanted))
            .or_else(|| electric(name, &words))
    })
}

/// Reads a unit before the name: `lbf: Hammer`, `mm displacement`. It is used if it has no other
/// meaning and the name is that of its quantity.
fn leading_unit(name: &str, words: &[Range<usize>], wanted: Quantity) -> Option<UnitWords> {
    let text_of = |span: &Range<usize>| &name[span.clone()];
    (1..words.len().min(4)).rev().find_map(|count| {
        let parts: Vec<&str> = words[..count].iter().map(text_of).collect();
        let unit =
            joined_unit(&parts).filter(|unit| unit.quantity == wanted && unit.in_si != 1.0)?;
        let named = words[count..].iter().any(|word| is_quantity_word(text_of(word), wanted));
        let is_clear = named && !is_ambiguous(parts[0]);
        let evidence = if is_clear { Evidence::Stated } else { Evidence::Unused };
        let span = words[0].start..words[count - 1].end;
        Some(UnitWords { text: text_of(&span).into(), span, unit: Some(unit), evidence })
    })
}

/// Reads words as a unit: `mm`, `m_s2`, `mm_per_s`.
fn joined_unit(words: &[&str]) -> Option<Unit> {
    if let [prefix, unit] = words
        && is_prefix(prefix)
    {
        return Unit::parse(&format!("{prefix}{unit}"));
    }
    match words {
        [one] => Unit::parse(one),
        [length, "per", time] => Unit::parse(&format!("{length}/{time}")),
        [length, "per", time, "2" | "squared"] => Unit::parse(&format!("{length}/{time}^2")),
        ["rad" | "radians", "s" | "sec"] => Unit::parse("rad/s"),
        [length, time @ ("s" | "sec" | "s2" | "sec2" | "s^2" | "s²")] => {
            Unit::parse(&format!("{length}/{time}"))
        }
        [length, time @ ("s-1" | "s^-1" | "s⁻¹" | "s-2" | "s^-2" | "s⁻²")] => {
            Unit::parse(&format!("{length} {time}"))
        }
        [length, time @ ("s" | "sec"), "2"] => Unit::parse(&format!("{length}/{time}^2")),
        _ => None,
    }
    .filter(|unit| {
        words.len() == 1 || matches!(unit.quantity, Quantity::Response(_) | Quantity::Frequency)
    })
}

/// Reads a unit that is appended to the name without a separator: `accG`, `forcekN`, `xmm`.
fn glued(name: &str, words: &[Range<usize>], wanted: Quantity) -> Option<UnitWords> {
    words.iter().find_map(|span| {
        let word = &name[span.clone()];
        word.char_indices().skip(1).find_map(|(at, _)| {
            let (stem, text) = word.split_at(at);
            let unit =
                Unit::parse(text).filter(|unit| unit.quantity == wanted && unit.in_si != 1.0)?;
            let is_symbol = stem.len() == 1 && "xyzfav".contains(&stem.to_lowercase());
            let is_named = is_quantity_word(stem, wanted) || is_symbol;
            let span = span.start + at..span.end;
            let is_doubtful = is_symbol && is_ambiguous(text);
            let evidence = if is_doubtful { Evidence::Unused } else { Evidence::Likely };
            is_named.then(|| UnitWords { span, text: text.into(), unit: Some(unit), evidence })
        })
    })
}

/// Returns the word that names the output of a converter or an amplifier: `force_mV`, `acc counts`.
fn electric(name: &str, words: &[Range<usize>]) -> Option<UnitWords> {
    let span = words.iter().skip(1).rev().find(|span| {
        let word = &name[(*span).clone()];
        word.chars().count() > 1
            && Expression::parse(word).is_some_and(|unit| unit.dimension.is_electric())
    })?;
    let text = name[span.clone()].to_owned();
    Some(UnitWords { span: span.clone(), text, unit: None, evidence: Evidence::Unused })
}
