//! Texts of headers with one spelling for each sign, and numbers with exponents.

/// Signs of UTF-8 that were read as Latin-1, commands of LaTeX and rare signs, each with its plain
/// spelling.
const SPELLINGS: [(&str, &str); 18] = [
    ("Âµ", "µ"),
    ("Î¼", "µ"),
    ("Â²", "²"),
    ("Â³", "³"),
    ("Â°", "°"),
    ("Â·", "·"),
    ("\\mathrm", ""),
    ("\\text", ""),
    ("\\rm", ""),
    ("\\mu", "µ"),
    ("\\cdot", "·"),
    ("\\^", "^"),
    ("\\,", " "),
    ("$", ""),
    ("−", "-"),
    ("\u{a0}", " "),
    ("\u{202f}", " "),
    ("\u{3000}", " "),
];

/// Returns a text with one spelling for each sign.
pub(super) fn with_plain_signs(text: &str) -> String {
    let replace = |text: String, (from, to): (&str, &str)| text.replace(from, to);
    SPELLINGS.into_iter().fold(text.to_owned(), replace)
}

/// Returns the possible original forms of a text in which a wrong encoding replaced a sign: `?m`
/// and `mm/s?`.
pub(super) fn with_restored_signs(text: &str) -> impl Iterator<Item = String> {
    const LOST: [char; 2] = ['?', '\u{fffd}'];
    let is_lost = text.contains(LOST);
    ["µ", "²"].into_iter().filter(move |_| is_lost).map(|sign| text.replace(LOST, sign))
}

/// Words, in lower case, for values that are not the samples of a signal but peak or effective
/// values.
const TREATMENTS: [&str; 10] =
    ["pk-pk", "0-pk", "pkpk", "peak", "p-p", "0-p", "rms", "pk", "pp", "eff"];

/// Returns a text without the word at its end that states peaks, effective values or the like:
/// `gRMS`, `mm_pk`, `in/s 0-pk`.
pub(super) fn without_treatment(text: &str) -> Option<&str> {
    let lower = text.to_lowercase();
    let treatment = TREATMENTS.into_iter().find(|word| lower.ends_with(word))?;
    let stem = text.get(..text.len().checked_sub(treatment.len())?)?;
    let stem = stem.trim_end_matches(['_', '-', ' ']);
    (!stem.is_empty()).then_some(stem)
}

/// Splits a positive number from the text after it: `0.1 mm`, `1e-3 m`, `10^3 N`.
pub(crate) fn number_and_rest(text: &str) -> Option<(f64, &str)> {
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (mantissa, rest) = text.split_at(end);
    let power_of_ten = ["^", "**"].into_iter().find_map(|sign| rest.strip_prefix(sign));
    let (exponent, rest) = match (mantissa, power_of_ten) {
        ("10", Some(after)) => exponent(after)?,
        _ => rest.strip_prefix(['e', 'E']).and_then(exponent).unwrap_or((0, rest)),
    };
    let mantissa = if power_of_ten.is_some() { "1" } else { mantissa };
    let number: f64 = format!("{mantissa}e{exponent}").parse().ok()?;
    (number > 0.0 && number.is_finite()).then(|| (number, rest.trim()))
}

/// Reads the digits of an exponent, with their sign.
fn exponent(text: &str) -> Option<(i32, &str)> {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let len = unsigned.find(|c: char| !c.is_ascii_digit()).unwrap_or(unsigned.len());
    let end = text.len() - unsigned.len() + len;
    Some((text[..end].parse().ok().filter(|_| len > 0)?, &text[end..]))
}

/// Returns the factor beside a name: `*1000`, `x 1000`, `×10`, `/1000`. The result is `None` for
/// `x10`, which may be the number of a measurement point.
pub(super) fn multiplier(name: &str) -> Option<&str> {
    let starts = name.char_indices().filter(|(_, c)| "*×xX/÷".contains(*c));
    starts.into_iter().find_map(|(at, sign)| {
        let before = name[..at].chars().next_back();
        let after = &name[at + sign.len_utf8()..];
        let (number, rest) = number_and_rest(after.trim_start())?;
        let is_power_of_ten = number.log10().fract() == 0.0;
        let is_factor = match sign {
            // A number after `x` is a factor only if it is at least 100: `x10` may be the number of
            // a measurement point.
            'x' | 'X' => {
                let is_word = !before.is_some_and(char::is_alphanumeric);
                is_word && number >= 100.0 && is_power_of_ten
            }
            // The number of a channel or of a point may follow a slash, too: `rig/10`, `12+Z/1-X`.
            '/' => {
                let is_apart = before.is_none_or(char::is_whitespace);
                let least = if is_apart { 10.0 } else { 1000.0 };
                number >= least && is_power_of_ten && rest.is_empty()
            }
            _ => number != 1.0,
        };
        is_factor.then(|| name[at..].trim())
    })
}

/// Returns whether a text beside a unit begins with a factor: `1/1000`, `%`, `x1000`, `0.1`. After
/// a unit, a number is a factor only if it is a power of ten and at least 10; another number is the
/// number of a channel.
pub(super) fn may_be_factor(text: &str, is_after_unit: bool) -> bool {
    let number = |word: &str| match number_and_rest(word) {
        Some((number, "")) => Some(number),
        _ => None,
    };
    let is_fraction = |word: &str| {
        let parts = word.split_once(['/', '÷']);
        parts.is_some_and(|(_, below)| number(below).is_some_and(|number| number != 1.0))
    };
    let is_number = |word: &str| {
        let is_power_of_ten = |number: f64| number >= 10.0 && number.log10().fract() == 0.0;
        number(word).is_some_and(|number| !is_after_unit || is_power_of_ten(number))
    };
    let is_factor = |word: &str| {
        let inner = word.trim_matches(['(', ')', '[', ']', '{', '}']);
        inner.contains(['%', '‰']) || is_fraction(inner) || is_number(inner)
    };
    text.split_whitespace().next().is_some_and(is_factor) || multiplier(text).is_some()
}

/// Returns whether a text begins with a word for peaks, effective values or the like.
pub(super) fn begins_with_treatment(text: &str) -> bool {
    let lower = text.trim_start_matches(['(', '[', '{']).to_lowercase();
    TREATMENTS.into_iter().any(|word| lower.starts_with(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_exponents_of_any_form() {
        for (text, number, rest) in [
            ("0.1 mm", 0.1, "mm"),
            ("1e-3 m", 1e-3, "m"),
            ("10^3 N", 1e3, "N"),
            ("10^-6 m", 1e-6, "m"),
            ("10**3N", 1e3, "N"),
            ("100mV/g", 100.0, "mV/g"),
            ("2 eV", 2.0, "eV"),
        ] {
            assert_eq!(number_and_rest(text), Some((number, rest)), "{text}");
        }
        for text in ["", "m", "10^", "0 m", "1e999 m"] {
            assert_eq!(number_and_rest(text), None, "{text}");
        }
    }

    #[test]
    fn a_factor_beside_a_name_is_not_the_number_of_a_point() {
        for name in
            ["Force *1000", "Force x1000", "Force x 1e3", "F × 10", "F /1000", "F / 10", "F ÷ 2"]
        {
            assert!(multiplier(name).is_some(), "{name}");
        }
        for name in
            ["acc x10", "x 3", "Max 1000", "force", "x", "a*b", "12+Z/10-X", "Dev1/ai0", "rig/10"]
        {
            assert_eq!(multiplier(name), None, "{name}");
        }
    }
}
