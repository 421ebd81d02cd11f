//! Texts in brackets, in a row of units, or in a label.

use std::ops::Range;

use super::expression::Expression;
use super::header::{Evidence, StatedUnit};
use super::plain::{
    begins_with_treatment, may_be_factor, number_and_rest, with_restored_signs, without_treatment,
};
use super::vocabulary::{Dimension, G};
use super::words::{is_label, joined_unit};
use super::{Quantity, Unit};

/// Returns the notes in a text, separated by semicolons and commas.
pub(super) fn notes_of(text: &str) -> impl Iterator<Item = &str> {
    text.split([';', ',']).map(bare_note)
}

/// Brackets in a name.
#[derive(Debug, Clone)]
pub(super) struct Bracket {
    /// Range with the brackets.
    pub span: Range<usize>,
    /// Range between the brackets.
    pub inner: Range<usize>,
}

/// Returns the outermost brackets of a name, with their contents; a bracket that is never closed
/// extends to the end.
pub(super) fn brackets(name: &str) -> Vec<Bracket> {
    const PAIRS: [(char, char); 16] = [
        ('[', ']'),
        ('(', ')'),
        ('{', '}'),
        ('<', '>'),
        ('⟨', '⟩'),
        ('⟦', '⟧'),
        ('«', '»'),
        ('‹', '›'),
        ('“', '”'),
        ('‘', '’'),
        ('（', '）'),
        ('［', '］'),
        ('｛', '｝'),
        ('【', '】'),
        ('「', '」'),
        ('﹙', '﹚'),
    ];
    let mut brackets = Vec::new();
    let mut open: Option<(usize, (char, char), usize)> = None;
    for (at, c) in name.char_indices() {
        let Some((start, pair, depth)) = open else {
            // The bracket of `m/(s^2)` belongs to the unit.
            let is_of_unit = name[..at].ends_with(['/', '^', '*', '·']);
            let opening = PAIRS.into_iter().find(|pair| pair.0 == c && !is_of_unit);
            open = opening.map(|pair| (at, pair, 1));
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
pub(super) fn without_spans(name: &str, spans: impl Iterator<Item = Range<usize>>) -> String {
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
pub(super) enum Note {
    /// A unit.
    Unit(Unit),
    /// Unit with further words that make it uncertain: `um pk-pk`.
    Qualified(Unit),
    /// Text that is not understood, and the unit that it may contain.
    Unclear(Option<Unit>),
    /// Place, direction or channel rather than a unit.
    Label,
}

/// Returns the unit that texts in brackets state.
pub(super) fn unit_in_notes(notes: &[&str], wanted: Option<Quantity>) -> Option<StatedUnit> {
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

/// Returns a note without the word `unit` and without quotation marks or brackets that enclose the
/// whole note.
pub(super) fn bare_note(note: &str) -> &str {
    let mut note = note.trim();
    for quote in ['"', '\''] {
        // A quotation mark alone is the sign for inches.
        let unquoted = note.strip_prefix(quote).and_then(|rest| rest.strip_suffix(quote));
        note = unquoted.filter(|rest| !rest.trim().is_empty()).unwrap_or(note).trim();
    }
    for (open, close) in [('[', ']'), ('{', '}'), ('<', '>'), ('(', ')')] {
        let inner = note.strip_prefix(open).and_then(|inner| inner.strip_suffix(close));
        note = inner.filter(|inner| is_balanced(inner, [open, close])).unwrap_or(note).trim();
    }
    without_unit_word(note)
}

/// Returns whether each closing bracket of a text follows its opening bracket; in `m/s²)·(s` it
/// does not.
fn is_balanced(text: &str, [open, close]: [char; 2]) -> bool {
    let mut depth = 0_i32;
    text.chars().all(|c| {
        depth += i32::from(c == open) - i32::from(c == close);
        depth >= 0
    })
}

/// Words before a unit, in lower case; a colon or an equals sign may follow them.
const UNIT_WORDS: [&str; 16] = [
    "units of",
    "units",
    "unit",
    "einheiten",
    "einheit",
    "unités",
    "unité",
    "unite",
    "unidades",
    "unidad",
    "unidade",
    "unità",
    "in",
    "en",
    "em",
    "of",
];

/// Returns a note without the words before its unit: `unit: kN`, `units of g`, `in mm`.
fn without_unit_word(note: &str) -> &str {
    let word_and_rest = UNIT_WORDS.into_iter().find_map(|word| {
        let start = note.get(..word.len()).filter(|start| start.to_lowercase() == word)?;
        let tail = &note[start.len()..];
        (!tail.starts_with(char::is_alphanumeric)).then_some((word, tail))
    });
    let Some((word, rest)) = word_and_rest else { return note };
    let marked = rest.trim_start().strip_prefix([':', '=']).map(str::trim_start);
    // The word `in` of `in mm` is a preposition and not an inch, except before words that cannot be
    // a unit: `in peak`, `in left`.
    let is_of_inches = |rest: &str| {
        let first = rest.split_whitespace().next().unwrap_or_default();
        begins_with_treatment(first) || is_label(rest) && Unit::parse(first).is_none()
    };
    let unmarked = rest.strip_prefix(' ').filter(|rest| !is_of_inches(rest));
    marked.filter(|_| word.len() > 2).or(unmarked).unwrap_or(note).trim()
}

/// Reads one note.
pub(super) fn read_note(note: &str, wanted: Option<Quantity>) -> Note {
    let note = bare_note(note);
    if let Some(unit) = Unit::parse(note) {
        // The unit 1/s is not clearly a frequency, because angular velocities use it, too.
        let is_bare = unit.quantity == Quantity::Frequency
            && note.chars().all(|c| c.is_numeric() || "/s^-⁻".contains(c));
        return if is_bare { Note::Qualified(unit) } else { Note::Unit(unit) };
    }
    if let Some(unit) = wanted.and_then(|wanted| weight(note, wanted)) {
        return Note::Qualified(unit);
    }
    if Expression::parse(note).is_some() {
        return Note::Unclear(None);
    }
    if let Some(unit) = with_number(note) {
        return Note::Unclear(Some(unit));
    }
    if is_sign(note) {
        return Note::Unclear(None);
    }
    if note.is_empty() || is_label(note) {
        return Note::Label;
    }
    let words: Vec<&str> = note.split_whitespace().collect();
    if let Some(unit) = joined_unit(&words) {
        return Note::Unit(unit);
    }
    if let Some(unit) = without_treatment(note).and_then(Unit::parse) {
        return Note::Qualified(Unit { name: note.into(), ..unit });
    }
    for count in (1..words.len()).rev() {
        let (first, last) = (words[..count].join(" "), words[count..].join(" "));
        let parts = [(&first, &last, true), (&last, &first, false)];
        let [at_start, at_end] = parts.map(|(unit, rest, is_after_unit)| {
            let unit = Unit::parse(unit)?;
            if may_be_factor(rest, is_after_unit) {
                return Some(Note::Unclear(None));
            }
            Some(if is_label(rest) { Note::Unit(unit) } else { Note::Qualified(unit) })
        });
        let is_clear = |note: &Note| matches!(note, Note::Unit(_) | Note::Unclear(_));
        if let Some(note) = at_start.or(at_end.filter(is_clear)) {
            return note;
        }
    }
    let restored = with_restored_signs(note).find_map(|note| Unit::parse(&note));
    Note::Unclear(restored.filter(|unit| wanted.is_none_or(|wanted| unit.quantity == wanted)))
}

/// Returns whether a note has a percent sign, or only signs that may mean a unit: `?`, `#`.
fn is_sign(note: &str) -> bool {
    let is_empty_sign = |c: char| "+-–—./_ ".contains(c);
    let is_only_signs = !note.contains(char::is_alphanumeric) && !note.chars().all(is_empty_sign);
    note.contains(['%', '‰']) || is_only_signs
}

/// Reads a mass as the force of its weight: a load cell in kg measures kilograms-force.
pub(super) fn weight(text: &str, wanted: Quantity) -> Option<Unit> {
    let mass = Expression::parse(text).filter(|unit| unit.dimension == Dimension::MASS)?;
    (wanted == Quantity::Force).then(|| Unit {
        name: text.into(),
        quantity: Quantity::Force,
        in_si: mass.in_si * G,
    })
}

/// Reads a unit with a factor or a range: `±50 g`, `0.1 mm`, `1/1000 in`, `% of g`, `x10 N`,
/// `N x 10^3`, `×g`.
fn with_number(note: &str) -> Option<Unit> {
    const SIGNS: [char; 5] = ['*', '×', '·', 'x', 'X'];
    let scaled = |number: f64, unit: &str| {
        let unit = Unit::parse(unit)?;
        let in_si = number * unit.in_si;
        in_si.is_normal().then(|| Unit { name: note.into(), in_si, ..unit })
    };
    let unsigned = note.trim_start_matches(['±', '+', '-', '~', '<', '>', '≤', '*', '×', ' ']);
    let bare = unsigned.strip_prefix('x').unwrap_or(unsigned);
    if let Some(rest) = note.strip_prefix('%') {
        let rest = rest.trim_start();
        return scaled(0.01, rest.strip_prefix("of ").unwrap_or(rest).trim_start());
    }
    let first = match number_and_rest(bare) {
        Some((above, rest)) if rest.starts_with('/') => {
            let (below, rest) = number_and_rest(rest[1..].trim_start())?;
            scaled(above / below, rest)
        }
        Some((number, rest)) => scaled(number, rest.trim_start_matches(SIGNS).trim_start()),
        None if unsigned.len() < note.len() => scaled(1.0, unsigned),
        None => None,
    };
    first.or_else(|| {
        let (unit, number) = note.rsplit_once(SIGNS)?;
        let (number, rest) = number_and_rest(number.trim_start())?;
        scaled(number, unit.trim_end()).filter(|_| rest.is_empty())
    })
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
