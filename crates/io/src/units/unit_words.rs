//! Words of the name of a column that are or may be its unit.

use std::ops::Range;

use super::expression::Expression;
use super::header::{Evidence, StatedUnit};
use super::notes::weight;
use super::other_unit::{is_preposition, other_unit};
use super::plain::{with_restored_signs, without_treatment};
use super::words::{
    is_ambiguous, is_label, is_prefix, is_quantity_word, is_unclear, joined_unit, quantity_word,
    split_words,
};
use super::{Quantity, Unit};

/// Maximum number of words of a unit: `m per s squared`.
const MAX_WORDS: usize = 4;

/// Words of a name that are or may be a unit.
pub(super) struct UnitWords {
    pub span: Range<usize>,
    text: String,
    unit: Option<Unit>,
    pub evidence: Evidence,
}

impl UnitWords {
    fn new(
        name: &str,
        span: Range<usize>,
        unit: impl Into<Option<Unit>>,
        evidence: Evidence,
    ) -> Self {
        Self { text: name[span.clone()].into(), span, unit: unit.into(), evidence }
    }
}

/// Returns the unit in the words of a name.
pub(super) fn unit_from_words(name: &str, wanted: Option<Quantity>) -> Option<StatedUnit> {
    let words = unit_words(name, wanted)?;
    Some(StatedUnit::new(&words.text, words.unit, words.evidence))
}

/// Returns the words of a name that are a unit of the quantity `wanted`, or of the quantity that
/// the name states.
pub(super) fn unit_words(name: &str, wanted: Option<Quantity>) -> Option<UnitWords> {
    if let (Some(wanted), Some(unit)) = (wanted, Unit::parse(name))
        && unit.quantity == wanted
    {
        let evidence = if is_ambiguous(name) { Evidence::Likely } else { Evidence::Stated };
        return Some(UnitWords::new(name, 0..name.len(), unit, evidence));
    }
    let words = split_words(name);
    let quantity =
        wanted.or_else(|| words.iter().find_map(|span| quantity_word(&name[span.clone()])));
    let of_quantity = unit_of_quantity(name, &words, quantity);
    let Some(wanted) = wanted else { return of_quantity };
    let is_stated = |words: &&UnitWords| words.evidence == Evidence::Stated;
    if of_quantity.as_ref().filter(is_stated).is_some() {
        return of_quantity;
    }
    let other = other_unit(name, &words, wanted);
    other
        .map(|(span, unit)| UnitWords::new(name, span, unit, Evidence::Unused))
        .or(of_quantity)
        .or_else(|| leading_unit(name, &words, wanted))
        .or_else(|| qualified(name, &words, wanted))
        .or_else(|| glued(name, &words, wanted))
        .or_else(|| unclear(name, &words))
}

/// Returns the words at the end of a name, after its first word, that are a unit of this quantity.
/// If no quantity is given, the words are a unit of any quantity and have no other meaning.
fn unit_of_quantity(
    name: &str,
    words: &[Range<usize>],
    quantity: Option<Quantity>,
) -> Option<UnitWords> {
    let text_of = |span: &Range<usize>| &name[span.clone()];
    for first in (1..words.len()).rev() {
        let before = text_of(&words[first - 1]);
        for count in (1..=MAX_WORDS.min(words.len() - first)).rev() {
            let span = words[first].start..words[first + count - 1].end;
            let parts: Vec<&str> = words[first..first + count].iter().map(text_of).collect();
            let fits = |unit: &Unit| quantity.is_none_or(|quantity| unit.quantity == quantity);
            let Some(unit) = joined_unit(&parts).filter(fits) else { continue };
            // The words of `milli-g` are one unit.
            if is_prefix(before) {
                continue;
            }
            let after = &words[first + count..];
            // The last word of `x in in` can only be a unit.
            let follows_in = after.is_empty() && first > 1 && is_preposition(before);
            let is_short = parts.len() == 1 && is_ambiguous(parts[0]) && !follows_in;
            let named =
                words[..first].iter().any(|word| is_quantity_word(text_of(word), unit.quantity));
            // `in` before other words is a preposition.
            let labels = after.iter().all(|word| is_label(text_of(word)))
                && (after.is_empty() || !parts[0].eq_ignore_ascii_case("in"));
            let evidence = match (labels, is_short && !named && unit.in_si != 1.0) {
                (true, false) if quantity.is_some() || !is_short => Evidence::Stated,
                _ if quantity.is_some() => Evidence::Unused,
                _ => continue,
            };
            return Some(UnitWords::new(name, span, unit, evidence));
        }
    }
    None
}

/// Reads a unit before the name: `lbf: Hammer`, `mm displacement`. The unit is used if it has no
/// other meaning and the name states the quantity of the unit.
fn leading_unit(name: &str, words: &[Range<usize>], wanted: Quantity) -> Option<UnitWords> {
    let text_of = |span: &Range<usize>| &name[span.clone()];
    (1..words.len().min(MAX_WORDS)).rev().find_map(|count| {
        let parts: Vec<&str> = words[..count].iter().map(text_of).collect();
        let unit =
            joined_unit(&parts).filter(|unit| unit.quantity == wanted && unit.in_si != 1.0)?;
        let named = words[count..].iter().any(|word| is_quantity_word(text_of(word), wanted));
        let is_clear = named && !is_ambiguous(parts[0]);
        let evidence = if is_clear { Evidence::Stated } else { Evidence::Unused };
        let span = words[0].start..words[count - 1].end;
        Some(UnitWords::new(name, span, unit, evidence))
    })
}

/// Reads words after the first one as a unit with a treatment of the signal (`mmpk`), as a mass
/// (`kg` of a force), or with a sign that was lost (`mm/s?`).
fn qualified(name: &str, words: &[Range<usize>], wanted: Quantity) -> Option<UnitWords> {
    words.iter().skip(1).find_map(|span| {
        let word = &name[span.clone()];
        let fits = |unit: &Unit| unit.quantity == wanted;
        let treated = without_treatment(word).and_then(Unit::parse).filter(fits);
        if let Some(unit) = treated.or_else(|| weight(word, wanted)) {
            return Some(UnitWords::new(name, span.clone(), unit, Evidence::Likely));
        }
        let restored = with_restored_signs(word).find_map(|word| Unit::parse(&word));
        let restored = restored.filter(fits)?;
        Some(UnitWords::new(name, span.clone(), restored, Evidence::Unused))
    })
}

/// Reads a unit that is appended to the name without a separator: `accG`, `forcekN`, `LDVµm/s`,
/// `CH1kN`.
fn glued(name: &str, words: &[Range<usize>], wanted: Quantity) -> Option<UnitWords> {
    let ends = |at: usize| words[at..].iter().take(2).rev().map(|word| word.end);
    words.iter().enumerate().find_map(|(at, span)| {
        let word = &name[span.clone()];
        word.char_indices().skip(1).find_map(|(offset, _)| {
            let stem = &word[..offset];
            let start = span.start + offset;
            ends(at).find_map(|end| {
                let text = &name[start..end];
                let unit = Unit::parse(text)
                    .filter(|unit| unit.quantity == wanted && unit.in_si != 1.0)?;
                let evidence = glued_evidence(stem, text, wanted)?;
                Some(UnitWords::new(name, start..end, unit, evidence))
            })
        })
    })
}

/// Returns the reliability of a unit that follows `stem` without a separator; `None` if the letters
/// are more likely the end of a word.
fn glued_evidence(stem: &str, text: &str, wanted: Quantity) -> Option<Evidence> {
    let is_symbol = stem.len() == 1 && "xyzfav".contains(&stem.to_lowercase());
    if is_quantity_word(stem, wanted) {
        return Some(Evidence::Likely);
    }
    if is_symbol {
        let is_doubtful = is_ambiguous(text);
        return Some(if is_doubtful { Evidence::Unused } else { Evidence::Likely });
    }
    let (last, first) = (stem.chars().next_back()?, text.chars().next()?);
    let is_other_case = last.is_uppercase() != first.is_uppercase();
    let is_boundary = !last.is_alphabetic() || !first.is_ascii() || is_other_case;
    let is_compound = text.contains(['/', '^', '²', '-']);
    ((is_boundary && !is_ambiguous(text)) || is_compound).then_some(Evidence::Unused)
}

/// Returns the word that names the output of a converter or an amplifier, or a unit that has no
/// single meaning: `force_mV`, `acc counts`, `Load tons`.
fn unclear(name: &str, words: &[Range<usize>]) -> Option<UnitWords> {
    let span = words.iter().skip(1).rev().find(|span| {
        let word = &name[(*span).clone()];
        let is_electric =
            || Expression::parse(word).is_some_and(|unit| unit.dimension.is_electric());
        is_unclear(word) || word.chars().count() > 1 && is_electric()
    })?;
    Some(UnitWords::new(name, span.clone(), None, Evidence::Unused))
}
