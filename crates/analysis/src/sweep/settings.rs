//! The settings of a sweep.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Maximum number of settings in a sweep.
const LONGEST: usize = 100_000;

/// Quantity that is swept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Cycles of the natural frequency in a period.
    #[default]
    Npi,
    /// Sampling rate, in Hz.
    RateHz,
    /// Every n-th sample.
    Decimation,
}

impl Kind {
    /// Returns name and unit for a column or an axis.
    pub fn label(self) -> (&'static str, &'static str) {
        match self {
            Kind::Npi => ("NPI", ""),
            Kind::RateHz => ("rate", "Hz"),
            Kind::Decimation => ("decimation", ""),
        }
    }
}

/// Returns a setting (a pure number) as a whole number of at least 1; `None` if it differs from a
/// whole number by more than rounding.
pub(crate) fn whole(value: f64) -> Option<usize> {
    let nearest = value.round();
    // Rates read from files differ by rounding.
    let is_whole = nearest >= 1.0 && (value - nearest).abs() <= 1e-6 * nearest;
    is_whole.then_some(nearest as usize)
}

/// Settings of a sweep, a list of positive numbers: rates in Hz, or pure numbers such as samples
/// per period; written as numbers and ranges first:step:last, separated by commas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Settings(
    /// Values, one per point: rates in Hz, or pure numbers such as samples per period.
    pub Vec<f64>,
);

impl FromStr for Settings {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut settings = Vec::new();
        for part in text.split(',') {
            let numbers: Vec<f64> = part
                .split(':')
                .map(|n| n.trim().parse().map_err(|_| format!("\"{n}\" is not a number")))
                .collect::<Result<_, _>>()?;
            let [first, step, last] = match numbers[..] {
                [one] => [one, 1.0, one],
                [first, step, last] => [first, step, last],
                _ => return Err("a range is written first:step:last, such as 1:0.5:16".into()),
            };
            // The small addition prevents that rounding of the steps removes the last setting.
            let steps = ((last - first) / step + 1e-9).floor();
            let positive = |v: f64| v > 0.0 && v.is_finite();
            if !(positive(first) && positive(step) && positive(last) && steps >= 0.0) {
                return Err(format!(
                    "settings must be positive and ranges must increase, got {part}"
                ));
            }
            if steps >= (LONGEST - settings.len().min(LONGEST)) as f64 {
                return Err(format!("a sweep has at most {LONGEST} settings"));
            }
            settings.extend((0..=steps as usize).map(|k| first + k as f64 * step));
        }
        Ok(Self(settings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_numbers_and_ranges() {
        let settings = |text: &str| text.parse::<Settings>().map(|Settings(all)| all);
        assert_eq!(settings("1:0.5:3"), Ok(vec![1.0, 1.5, 2.0, 2.5, 3.0]));
        assert_eq!(settings("8, 2:2:4"), Ok(vec![8.0, 2.0, 4.0]));
        // 0.1 has no exact binary form. Rounding must not remove the last setting.
        assert_eq!(settings("0.1:0.1:0.3").map(|s| s.len()), Ok(3));
        for text in ["", "a", "0", "-1", "1:2", "3:1:1", "1:0:2", "1:1:inf", "1:1e-9:2", "NaN"] {
            assert!(settings(text).is_err(), "{text}");
        }
    }

    #[test]
    fn decimations_are_whole() {
        assert_eq!(
            (whole(3.0), whole(610.3515625 / 305.1758), whole(1.0)),
            (Some(3), Some(2), Some(1))
        );
        assert_eq!((whole(2.5), whole(0.4), whole(f64::INFINITY)), (None, None, None));
    }
}
