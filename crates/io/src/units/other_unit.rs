//! Units of another quantity as the last words of a name: `F_Nm`, `Force, psi`, `acc in kN`.

use std::ops::Range;

use super::expression::Expression;
use super::vocabulary::{Dimension, is_spelling};
use super::words::{is_ambiguous, is_label, is_prefix, joined_unit, quantity_word};
use super::{Quantity, Unit};

/// Maximum number of words of a unit: `m per s squared`.
const MAX_WORDS: usize = 4;

/// Maximum number of letters of a unit that is recognised only in its usual case (`mm`): `MM` may
/// be two initials.
const MAX_CASED: usize = 2;

/// Spellings of units that have another meaning in the name of a column: `force_std`, `acc second`.
const OTHER_WORDS: [&str; 27] = [
    "std",
    "ss",
    "day",
    "days",
    "hour",
    "hours",
    "hr",
    "hrs",
    "second",
    "minute",
    "minutes",
    "rev",
    "revs",
    "cycle",
    "cycles",
    "grav",
    "gravity",
    "gravities",
    "gforce",
    "kilo",
    "kilos",
    "gs",
    "micro",
    "ore",
    "metro",
    "count",
    "digits",
];

/// Spellings that are a unit only if they are the last word and follow a comma or a similar sign:
/// `p, bar` has a unit, but `force_bar` is a mean value, `F_mg` a weight and `acc_lb` a corner.
const MARKED: [&str; 22] = [
    "bar", "psi", "mg", "lb", "oz", "kp", "gf", "tf", "gn", "g0", "g_0", "dm", "km", "mil", "thou",
    "pond", "gal", "ms", "us", "ns", "sec", "gee",
];

/// Spellings that are a unit only after the word `in`: `acc, rad` is radial and `acc, V` vertical.
const AFTER_IN: [&str; 5] = ["V", "N", "rad", "mHz", "C"];

/// Words, in lower case, that precede a number or a unit of a condition: `acc at 50 Hz`, `gain per
/// mm`.
const CONDITIONS: [&str; 11] =
    ["per", "at", "from", "of", "to", "for", "bei", "by", "above", "below", "with"];

/// Signs between a name and its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Separator {
    /// A blank, an underscore or a similar sign, which also separates other words.
    Common,
    /// A comma, colon, semicolon, slash, equals sign, or a dash between blanks.
    Mark,
    /// The word `in`.
    In,
}

/// Returns the words at the end of a name that are a unit of a quantity other than `wanted`. The
/// unit itself is returned if it measures a [`Quantity`]. Places, directions and numbers may follow
/// the words.
pub(super) fn other_unit(
    name: &str,
    words: &[Range<usize>],
    wanted: Quantity,
) -> Option<(Range<usize>, Option<Unit>)> {
    let text_of = |span: &Range<usize>| &name[span.clone()];
    (1..words.len()).find_map(|first| {
        let separator = Separator::before(name, words, first)?;
        (1..=MAX_WORDS.min(words.len() - first)).rev().find_map(|count| {
            let parts: Vec<&str> = words[first..first + count].iter().map(text_of).collect();
            let after = &words[first + count..];
            let are_labels = after.iter().all(|word| is_label(text_of(word)));
            let moment = || product(&parts, wanted);
            let (dimension, unit) = read(&parts).or_else(moment).filter(|_| are_labels)?;
            let is_named = is_named(text_of(&words[first - 1]), wanted);
            let is_clear = is_clear(&parts, separator, after.is_empty(), is_named);
            let is_other = Quantity::from_dimension(dimension) != Some(wanted)
                && !(wanted == Quantity::Force && dimension == Dimension::MASS);
            let span = words[first].start..words[first + count - 1].end;
            (is_clear && is_other).then_some((span, unit))
        })
    })
}

/// Returns whether the word before a unit names the quantity of the column, so that `force_psi` has
/// a unit, but `x_psi` is an angle.
fn is_named(word: &str, wanted: Quantity) -> bool {
    quantity_word(word) == Some(wanted)
}

impl Separator {
    /// Returns the separator before a word. Returns `None` if the previous word shows that this
    /// word is not the unit of the column, but part of a condition (`acc 50 Hz`, `gain per mm`).
    fn before(name: &str, words: &[Range<usize>], word: usize) -> Option<Self> {
        let previous = words[word - 1].clone();
        let between = &name[previous.end..words[word].start];
        let has_name = name[..previous.start].contains(char::is_alphanumeric);
        let previous = &name[previous];
        if is_preposition(previous) {
            return has_name.then_some(Self::In);
        }
        let is_number = previous.chars().all(|c| c.is_ascii_digit() || c == '.');
        if CONDITIONS.contains(&previous.to_lowercase().as_str())
            || is_number && between.trim().is_empty()
            || is_prefix(previous)
        {
            return None;
        }
        let is_dash = between.starts_with(char::is_whitespace) && between.trim() == "-";
        let is_sign = !previous.contains(char::is_alphanumeric);
        let is_mark = between.contains([',', ';', ':', '=']) || is_dash || is_sign;
        Some(if is_mark { Self::Mark } else { Self::Common })
    }
}

/// Returns whether a word is the preposition `in` of one of the languages of headers.
pub(super) fn is_preposition(word: &str) -> bool {
    ["in", "en", "em"].contains(&word)
}

/// Reads words as a unit of any quantity.
fn read(parts: &[&str]) -> Option<(Dimension, Option<Unit>)> {
    // The word `in` of `hits in s` is a preposition, not an inch.
    let is_after_in = parts.len() > 1 && is_preposition(parts[0]);
    if let Some(unit) = joined_unit(parts).filter(|_| !is_after_in) {
        let dimension = Expression::parse(&unit.name).map(|unit| unit.dimension)?;
        return Some((dimension, Some(unit)));
    }
    let [word] = parts else { return None };
    let expression = Expression::parse(word).filter(|_| !is_numbered(word))?;
    Some((expression.dimension, None))
}

/// Reads words as the product of a force and a length, the unit of a moment: `N-m`, `lbf in`. Other
/// products are not usual in names.
fn product(parts: &[&str], wanted: Quantity) -> Option<(Dimension, Option<Unit>)> {
    let moment = Expression::parse(&parts.join(" ")).map(|unit| unit.dimension);
    let moment = moment.filter(|dimension| *dimension == Dimension::MOMENT)?;
    (wanted == Quantity::Force && parts.len() == 2).then_some((moment, None))
}

/// Returns whether the digit at the end of a word is the number of a measurement point rather than
/// an exponent: `m2`.
pub(super) fn is_numbered(word: &str) -> bool {
    word.ends_with(|c: char| c.is_ascii_digit()) && !is_compound(word) && !is_spelling(word)
}

/// Returns whether a word is a unit with an operator or an exponent sign: `m/s²`.
fn is_compound(word: &str) -> bool {
    word.contains(['/', '^', '²', '³', '·', '*'])
}

/// Returns whether words that can be read as a unit have no other meaning in the name of a column.
fn is_clear(parts: &[&str], separator: Separator, is_last: bool, is_named: bool) -> bool {
    let [word] = parts else { return true };
    if is_compound(word) {
        return true;
    }
    let lower = word.to_lowercase();
    let is_cased = word.chars().count() > MAX_CASED || is_spelling(word);
    let is_marked = is_last && separator >= Separator::Mark;
    if OTHER_WORDS.contains(&lower.as_str()) || !is_cased {
        return false;
    }
    if AFTER_IN.contains(word) || lower == "rad" {
        return is_last && separator == Separator::In;
    }
    if is_ambiguous(word) {
        return is_marked && ["g", "m", "s"].contains(word);
    }
    !MARKED.contains(&lower.as_str()) || is_marked || (lower == "psi" && is_named)
}
