//! Numbers in messages.

use std::fmt;

/// A number, in any unit, as a message shows it: in full where that is short, otherwise with an
/// exponent, so that 10³⁰⁰ does not take three hundred digits.
///
/// ```
/// use mechid_signal::told;
///
/// assert_eq!(told(0.25).to_string(), "0.25");
/// assert_eq!(told(1e300).to_string(), "1e300");
/// ```
pub fn told(value: f64) -> impl fmt::Display {
    Told(value)
}

struct Told(f64);

/// Magnitudes that are short enough in full.
const IN_FULL: std::ops::Range<f64> = 1e-5..1e15;

impl fmt::Display for Told {
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
    use super::told;

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
            assert_eq!(told(value).to_string(), text);
        }
    }
}
