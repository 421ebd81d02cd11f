//! Numbers with few digits, and lists of words, for sentences.

use mechid_signal::message;

/// Returns words as `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(words: &[String]) -> String {
    match words {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        _ => words.concat(),
    }
}

/// Returns a number with enough digits to name a line.
pub(crate) fn line_hz(value: f64) -> String {
    message::number(format!("{value:.5e}").parse().unwrap_or(value)).to_string()
}

/// Returns a number with three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    message::number(format!("{value:.2e}").parse().unwrap_or(value)).to_string()
}

/// Returns a number with at most six significant digits, without zeros at its end.
pub(crate) fn up_to_six_digits(value: f64) -> String {
    let text = six_digits(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// Returns a number with six significant digits.
pub(crate) fn six_digits(value: f64) -> String {
    let exponent = value.abs().log10().floor();
    match exponent {
        e if (-4.0..6.0).contains(&e) => format!("{value:.0$}", (5.0 - e) as usize),
        _ => format!("{value:.5e}"),
    }
}
