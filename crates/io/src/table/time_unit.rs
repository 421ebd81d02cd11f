//! Time columns and their units, by their names.

use crate::contents::Column;

/// Names of a time column, without its unit and in lower case.
const NAMES: [&str; 2] = ["time", "t"];

/// Units of time, in s.
const UNITS: [(&str, f64); 8] = [
    ("s", 1.0),
    ("sec", 1.0),
    ("seconds", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("µs", 1e-6),
    ("μs", 1e-6),
    ("min", 60.0),
];

/// The unit of a time column, in s: that of its name or else of the line of units; seconds if
/// neither states one.
pub(super) fn unit(column: &Column) -> f64 {
    stated(column).unwrap_or(1.0)
}

/// The same; `None` if neither states one.
pub(super) fn stated(column: &Column) -> Option<f64> {
    let (_, named) = split(&column.name);
    named.or_else(|| known(&column.about))
}

/// Returns whether a name is that of a time column: `time`, `t`, `Time_s`, `time [ms]`, `t (s)`.
pub(super) fn is_time(name: &str) -> bool {
    let (bare, unit) = split(name);
    NAMES.contains(&bare.to_lowercase().as_str()) && (unit.is_some() || bare == name.trim())
}

/// A name without the unit of time at its end.
pub(super) fn without_unit(name: &str) -> &str {
    split(name).0
}

/// A name without the unit at its end, and that unit, in s.
fn split(name: &str) -> (&str, Option<f64>) {
    let name = name.trim();
    let Some(at) = name.rfind(['_', ' ', '[', '(', '/']) else { return (name, None) };
    match known(&name[at..]) {
        Some(unit) => (name[..at].trim_end_matches([' ', '_', '/']), Some(unit)),
        None => (name, None),
    }
}

/// A unit of time, in brackets or not.
fn known(text: &str) -> Option<f64> {
    let bare = text.trim_matches(|c: char| "_ []()/".contains(c));
    UNITS.iter().find(|(name, _)| *name == bare).map(|(_, unit)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_for_time_with_the_unit_they_say() {
        for (name, seconds) in [
            ("time", 1.0),
            ("T", 1.0),
            ("time_s", 1.0),
            ("Time [ms]", 1e-3),
            ("t (µs)", 1e-6),
            ("time/ms", 1e-3),
            ("Time / s", 1.0),
            ("Time_min", 60.0),
        ] {
            assert!(is_time(name), "{name}");
            assert_eq!(unit(&Column::of_numbers(name.into(), vec![0.0])), seconds, "{name}");
        }
        for name in ["", "force", "times", "time_of_flight", "t_ref", "ms", "time [mm]"] {
            assert!(!is_time(name), "{name}");
        }
    }
}
