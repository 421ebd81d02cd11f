//! Numbers as text for the script, with each list written once.

use std::collections::HashMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Maximum length of a list that is written with all decimal digits. A longer list is written as
/// its first value, last value and length if it is evenly spaced, otherwise in single precision.
const EXACT: usize = 100;

/// Maximum deviation of a value from even spacing, in steps, for which a list counts as evenly
/// spaced.
const EVEN: f64 = 1e-9;

/// Lists of numbers for a page, encoded as text; equal lists are stored once.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    texts: Vec<String>,
    known: HashMap<String, usize>,
}

impl Arrays {
    /// Adds a list and returns its index; `None` for an empty list.
    pub fn add(&mut self, values: &[f64]) -> Option<usize> {
        (!values.is_empty()).then(|| self.insert(text(values, 4)))
    }

    /// Adds phases in degrees, for which four digits are sufficient.
    pub fn add_phase(&mut self, degrees: &[f64]) -> Option<usize> {
        (!degrees.is_empty()).then(|| self.insert(text(degrees, 3)))
    }

    /// Adds positive numbers for which two digits are sufficient, such as standard errors.
    pub fn add_rough(&mut self, values: &[f64]) -> Option<usize> {
        (!values.is_empty()).then(|| self.insert(single_precision(values, 1.0, 2)))
    }

    fn insert(&mut self, text: String) -> usize {
        let next = self.texts.len();
        let index = *self.known.entry(text.clone()).or_insert(next);
        if index == next {
            self.texts.push(text);
        }
        index
    }

    /// Returns the texts in the order of their indices.
    pub fn into_texts(self) -> Vec<String> {
        self.texts
    }
}

/// Writes a list. A long list that is not evenly spaced is written in single precision, with this
/// many bytes per number.
fn text(values: &[f64], bytes: usize) -> String {
    let (first, last, len) = (values[0], values[values.len() - 1], values.len());
    if len <= EXACT {
        let digits: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        return format!("t {}", digits.join(" "));
    }
    let step = (last - first) / (len - 1) as f64;
    let is_near =
        |(k, value): (usize, &f64)| (value - (first + step * k as f64)).abs() <= EVEN * step.abs();
    if step.is_finite() && step != 0.0 && values.iter().enumerate().all(is_near) {
        return format!("e {first:?} {last:?} {len}");
    }
    // A power of two preserves the digits and brings the numbers into the range of single
    // precision.
    let largest = values.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let scale =
        if largest > 0.0 { largest.log2().floor().clamp(-1000.0, 1000.0).exp2() } else { 1.0 };
    single_precision(values, scale, bytes)
}

/// Writes values divided by a scale with the first two, three or four bytes of single precision.
fn single_precision(values: &[f64], scale: f64, bytes: usize) -> String {
    let kind = ["h", "m", "f"][bytes.clamp(2, 4) - 2];
    let first = |value: &f64| ((value / scale) as f32).to_le_bytes().into_iter().skip(4 - bytes);
    let bytes_of_all: Vec<u8> = values.iter().flat_map(first).collect();
    format!("{kind} {scale:?} {}", STANDARD.encode(bytes_of_all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_exact_even_or_single_precision() {
        assert_eq!(text(&[0.1, -2.0], 4), "t 0.1 -2.0");
        let even: Vec<f64> = (0..4096).map(|k| 0.25 * f64::from(k)).collect();
        assert_eq!(text(&even, 4), "e 0.0 1023.75 4096");
        let values: Vec<f64> = (0..500).map(|k| 1e-9 * f64::from(k).sin()).collect();
        let coded = text(&values, 4);
        let [kind, scale, coded] = coded.split(' ').collect::<Vec<_>>()[..] else { panic!() };
        let scale: f64 = scale.parse().unwrap();
        let bytes = STANDARD.decode(coded).unwrap();
        let back =
            bytes.chunks(4).map(|b| scale * f64::from(f32::from_le_bytes(b.try_into().unwrap())));
        assert_eq!(kind, "f");
        for (back, value) in back.zip(&values) {
            // Single precision rounds by at most half a unit of the 24th binary digit.
            assert!((back - value).abs() <= 6e-8 * value.abs(), "{back} {value}");
        }
        let mut arrays = Arrays::default();
        assert_eq!(
            [&even, &values, &even].map(|list| arrays.add(list)),
            [Some(0), Some(1), Some(0)]
        );
        assert_eq!(arrays.add(&[]), None);
        assert_eq!(arrays.into_texts().len(), 2);
        // Each phase has the three higher bytes of a number in single precision; the lowest byte is
        // omitted.
        let phases = text(&[vec![-179.99], vec![0.5; 200]].concat(), 3);
        let bytes = STANDARD.decode(phases.split(' ').nth(2).unwrap()).unwrap();
        let first = f32::from_le_bytes([0, bytes[0], bytes[1], bytes[2]]);
        assert_eq!((&phases[..6], bytes.len()), ("m 128.", 603));
        assert!((128.0 * first + 179.99).abs() < 6e-3, "{first}");
    }
}
