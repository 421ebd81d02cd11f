//! Time columns and their units, identified by their names.

use crate::contents::{Column, Override};
use crate::units::{Evidence, Quantity, StatedUnit, Unit, stated, without_unit};

/// Names of a time column, without its unit and in lower case.
const NAMES: [&str; 8] = [
    "t",
    "timestamp",
    "time stamp",
    "time_stamp",
    "elapsed",
    "x_value",
    "messzeit",
    "versuchszeit",
];

/// Words for time, in lower case.
const WORDS: [&str; 5] = ["time", "zeit", "temps", "tiempo", "tempo"];

/// Words, in lower case, that can be next to a word for time in the name of a time column.
const BESIDE: [&str; 18] = [
    "absolute",
    "acquisition",
    "axis",
    "daq",
    "data",
    "elapsed",
    "measurement",
    "record",
    "recording",
    "rel",
    "relative",
    "run",
    "sample",
    "since",
    "start",
    "test",
    "vector",
    "x",
];

/// Returns the unit of a time column, in s: from its name or else the line of units; seconds if
/// neither states one. Instants of dates and clock times are always in seconds.
pub(super) fn unit(column: &Column) -> f64 {
    if column.has_instants {
        return 1.0;
    }
    unit_of(column).unwrap_or(1.0)
}

/// Returns the unit of a time column, in s; `None` if none is stated.
pub(super) fn unit_of(column: &Column) -> Option<f64> {
    match &column.overriding {
        Some(Override::Unit(unit)) => Some(unit.in_si),
        Some(Override::Scale(factor)) => Some(*factor),
        None => {
            let stated = stated(&column.name, &column.unit, Some(Quantity::Time))?;
            stated.used().filter(|unit| unit.quantity == Quantity::Time).map(|unit| unit.in_si)
        }
    }
}

/// Returns whether a column with this name is a time column: `time`, `t`, `Time_s`, `time [ms]`,
/// `TIME(S)`.
pub(crate) fn is_time(name: &str) -> bool {
    is_called_time(name)
        && stated(name, "", Some(Quantity::Time)).is_none_or(|stated| {
            let is_unit = stated.used().is_some_and(|unit| unit.quantity == Quantity::Time);
            is_unit || is_clock(&stated.text)
        })
}

/// Returns whether a column is called time, in any unit.
pub(super) fn is_called_time(name: &str) -> bool {
    let bare = without_unit(name).to_lowercase();
    // In the path of an HDF5 file or of a struct, the last part is the name.
    let last = bare.rsplit(['/', '.']).next().unwrap_or(&bare);
    let words = last.split([' ', '_', '-', '(', ')', ':']).filter(|word| !word.is_empty());
    let (times, others): (Vec<&str>, Vec<&str>) = words.partition(|word| WORDS.contains(word));
    let is_time = times.len() == 1 && others.iter().all(|word| BESIDE.contains(word));
    is_time || NAMES.contains(&bare.as_str()) || NAMES.contains(&last.trim())
}

/// Returns the text that a time column states as its unit, if this text cannot be read as a unit of
/// time.
pub(super) fn unclear(column: &Column) -> Option<String> {
    let stated = stated(&column.name, &column.unit, Some(Quantity::Time))?;
    let unclear = stated.evidence == Evidence::Unused && !is_clock(&stated.text);
    let is_another = stated.used().is_some_and(|unit| unit.quantity != Quantity::Time);
    (column.overriding.is_none() && (unclear || is_another)).then_some(stated.text)
}

/// Returns what a time column states about its unit, if the statement is doubtful.
pub(super) fn doubtful(column: &Column) -> Option<StatedUnit> {
    if column.overriding.is_some() || column.has_instants {
        return None;
    }
    let stated = stated(&column.name, &column.unit, Some(Quantity::Time))?;
    let is_time = |unit: &Unit| unit.quantity == Quantity::Time;
    match stated.used() {
        Some(unit) if is_time(unit) => {
            let is_clear = stated.evidence == Evidence::Stated;
            // A column called `s` is not doubtful: a time without a unit is read in seconds, too.
            let is_second = unit.in_si == 1.0 && stated.text == unit.name;
            (!is_clear && !is_second).then_some(stated)
        }
        Some(_) => Some(StatedUnit { unit: None, evidence: Evidence::Unused, ..stated }),
        None => Some(stated).filter(|stated| !is_clock(&stated.text)),
    }
}

/// Returns whether a text is a pattern for clock times or dates, such as `hh:mm:ss.fff`, a time
/// zone, or a word for the reference of the time, such as `relative`.
fn is_clock(text: &str) -> bool {
    let lower = text.to_lowercase();
    let pattern = lower.contains(':') && lower.chars().all(|c| "hmsf0yd:./- t'".contains(c));
    pattern
        || ["utc", "gmt", "local", "iso", "iso 8601", "iso8601"].contains(&lower.as_str())
        || ["relative", "rel", "absolute", "abs", "elapsed"].contains(&lower.as_str())
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
            ("Time (msec)", 1e-3),
            ("TIME(S)", 1.0),
            ("Zeit [s]", 1.0),
            ("time_usec", 1e-6),
            ("time [h]", 3600.0),
            ("Time (days)", 86_400.0),
            ("Time [hh:mm:ss]", 1.0),
            ("X_Value", 1.0),
            ("Relative Time [ms]", 1e-3),
            ("Elapsed (s)", 1.0),
            ("elapsed_time_ms", 1e-3),
            ("Time (relative)", 1.0),
            ("Test Time, s", 1.0),
            ("time since start [s]", 1.0),
        ] {
            assert!(is_time(name), "{name}");
            assert_eq!(unit(&Column::from_numbers(name.into(), vec![0.0])), seconds, "{name}");
        }
        for name in [
            "",
            "force",
            "times",
            "time_of_flight",
            "t_ref",
            "ms",
            "time [mm]",
            "time [samples]",
            "rise time [s]",
            "response_time",
            "dead time",
            "relative",
            "start",
        ] {
            assert!(!is_time(name), "{name}");
        }
        let samples = Column::from_numbers("time [samples]".into(), vec![0.0]);
        assert_eq!(unclear(&samples).as_deref(), Some("samples"));
    }
}
