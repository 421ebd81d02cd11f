//! Text of numbers, counts and ordinals in messages.

use std::fmt;

/// Displays a number, in any unit: in full if that is short, otherwise with an exponent, so that
/// 10³⁰⁰ does not take three hundred digits.
///
/// ```
/// use mechid_signal::message;
///
/// assert_eq!(message::number(0.25).to_string(), "0.25");
/// assert_eq!(message::number(1e300).to_string(), "1e300");
/// ```
pub fn number(value: f64) -> impl fmt::Display {
    Number(value)
}

/// Displays a number, in any unit, as [`number`] does, with a fixed number of decimals if written
/// in full.
///
/// ```
/// use mechid_signal::message;
///
/// assert_eq!(message::number_to(0.25, 6).to_string(), "0.250000");
/// assert_eq!(message::number_to(1e300, 6).to_string(), "1e300");
/// ```
pub fn number_to(value: f64, decimals: usize) -> impl fmt::Display {
    NumberTo(value, decimals)
}

/// Returns a count with its noun, in the plural unless the count is one.
///
/// ```
/// use mechid_signal::message;
///
/// assert_eq!(message::count(1, "sample"), "1 sample");
/// assert_eq!(message::count(0, "entry"), "0 entries");
/// assert_eq!(message::count(2, "decay"), "2 decays");
/// assert_eq!(message::count(2, "degree of freedom"), "2 degrees of freedom");
/// ```
pub fn count(count: usize, thing: &str) -> String {
    if count == 1 {
        return format!("1 {thing}");
    }
    let (first, rest) = thing.find(" of ").map_or((thing, ""), |at| thing.split_at(at));
    let stem = first.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'o', 'u']));
    match stem {
        Some(stem) => format!("{count} {stem}ies{rest}"),
        None => format!("{count} {first}s{rest}"),
    }
}

/// Returns the ordinal, counted from 1: `1st`, `2nd`, `3rd`, `4th`.
///
/// ```
/// use mechid_signal::message;
///
/// assert_eq!(message::ordinal(3), "3rd");
/// ```
pub fn ordinal(place: usize) -> String {
    let ending = match (place % 10, place % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    };
    format!("{place}{ending}")
}

/// Returns the first items of a list, and the number of further ones.
///
/// ```
/// use mechid_signal::message;
///
/// assert_eq!(message::list(["k11", "k12"], ", ", 3), "k11, k12");
/// assert_eq!(message::list(["k11", "k12", "k22"], ", ", 1), "k11, … (2 more)");
/// ```
pub fn list<T: fmt::Display>(
    items: impl IntoIterator<Item = T>,
    separator: &str,
    most: usize,
) -> String {
    let mut items = items.into_iter();
    let mut shown: Vec<String> = items.by_ref().take(most).map(|item| item.to_string()).collect();
    match items.count() {
        0 => {}
        more => shown.push(format!("… ({more} more)")),
    }
    shown.join(separator)
}

struct Number(f64);

struct NumberTo(f64, usize);

impl fmt::Display for NumberTo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, decimals) = self;
        if IN_FULL.contains(&value.abs()) || *value == 0.0 {
            write!(f, "{value:.decimals$}")
        } else {
            Number(*value).fmt(f)
        }
    }
}

/// Range of the magnitudes that are written without an exponent.
const IN_FULL: std::ops::Range<f64> = 1e-5..1e15;

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = self;
        if *value == 0.0 || !value.is_finite() || IN_FULL.contains(&value.abs()) {
            write!(f, "{value}")
        } else {
            write!(f, "{value:e}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{count, number, number_to, ordinal};

    #[test]
    fn places_end_as_they_are_spoken() {
        let places = [1, 2, 3, 4, 10, 11, 12, 13, 21, 22, 23, 24, 101, 111, 112, 113, 1002, 1013];
        assert_eq!(
            places.map(ordinal).join(" "),
            "1st 2nd 3rd 4th 10th 11th 12th 13th 21st 22nd 23rd 24th 101st 111th 112th 113th \
             1002nd 1013th"
        );
    }

    #[test]
    fn one_thing_is_no_plural() {
        let text =
            |n| ["line", "frequency", "degree of freedom"].map(|thing| count(n, thing)).join(", ");
        assert_eq!(text(1), "1 line, 1 frequency, 1 degree of freedom");
        assert_eq!(text(0), "0 lines, 0 frequencies, 0 degrees of freedom");
        assert_eq!(text(21), "21 lines, 21 frequencies, 21 degrees of freedom");
    }

    #[test]
    fn short_numbers_in_full_and_long_ones_with_an_exponent() {
        for (value, text) in [
            (0.0, "0"),
            (-3.0, "-3"),
            (0.1 + 0.2, "0.30000000000000004"),
            (1e-5, "0.00001"),
            (9.9e-6, "9.9e-6"),
            (-1e300, "-1e300"),
            (123456789012345.0, "123456789012345"),
            (1e15, "1e15"),
            (f64::MAX, "1.7976931348623157e308"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(number(value).to_string(), text);
        }
    }

    #[test]
    fn decimals_only_where_the_number_is_shown_in_full() {
        for (value, text) in [
            (0.0, "0.000"),
            (-23.4375, "-23.438"),
            (1e300, "1e300"),
            (2e-9, "2e-9"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number_to(value, 3).to_string(), text);
        }
    }
}
