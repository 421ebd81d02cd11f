//! Fast formatting of numbers as text.

use std::fmt::Write as _;

/// Appends a number with the fewest digits that identify it, in the form of `{:?}`. If two such
/// texts are equally near to the number, this function takes the text with an even last digit,
/// whereas `{:?}` takes the larger number.
pub(crate) fn push_number(text: &mut String, value: f64) {
    if !value.is_finite() {
        let _ = write!(text, "{value:?}");
        return;
    }
    let mut buffer = zmij::Buffer::new();
    let printed = buffer.format_finite(value);
    let size = value.abs();
    if size == 0.0 || (1e-4..1e16).contains(&size) {
        text.push_str(printed);
    } else if let Some((digits, exponent)) = printed.split_once('e') {
        text.extend([digits, "e", exponent.trim_start_matches('+')]);
    } else {
        push_small(text, printed);
    }
}

/// Appends a number below 1e-4 in exponent notation; `printed` is its text in the form 0.0000….
fn push_small(text: &mut String, printed: &str) {
    let (sign, size) = printed.strip_prefix('-').map_or(("", printed), |size| ("-", size));
    let places = size.trim_start_matches("0.");
    let digits = places.trim_start_matches('0');
    let exponent = places.len() - digits.len() + 1;
    let (first, others) = digits.split_at(1);
    text.extend([sign, first, if others.is_empty() { "" } else { "." }, others]);
    let _ = write!(text, "e-{exponent}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pushed(value: f64) -> String {
        let mut text = String::from("x");
        push_number(&mut text, value);
        text.split_off(1)
    }

    #[test]
    fn numbers_are_written_as_the_standard_library_does() {
        let mut values = vec![0.0, -0.0, f64::MAX, f64::MIN_POSITIVE, 5e-324, f64::NAN];
        values.extend([f64::INFINITY, f64::NEG_INFINITY, 0.1 + 0.2, 1e15, 9.999999999999998e15]);
        for exponent in -30..30 {
            let power = 10f64.powi(exponent);
            values.extend([power, power.next_up(), power.next_down(), 1.25 * power, -7.0 * power]);
        }
        for value in values {
            assert_eq!(pushed(value), format!("{value:?}"), "{:016x}", value.to_bits());
        }
    }

    #[test]
    fn any_number_is_read_back_from_as_few_digits() {
        let mut seed = 1_u64;
        for _ in 0..50_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let value = f64::from_bits(seed ^ (seed >> 29));
            let (ours, usual) = (pushed(value), format!("{value:?}"));
            assert_eq!(ours.len(), usual.len(), "{ours} {usual}");
            assert!(value.is_nan() || ours.parse() == Ok(value), "{ours} {usual}");
        }
    }
}
