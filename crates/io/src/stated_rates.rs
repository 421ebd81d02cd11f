//! Sample rates that a file states by a named number, such as `Fs` or `dt`.

use crate::contents::{Axis, Contents};
use crate::table::is_time;

/// Lower-case names, without `_`, of a number that is a sample rate in Hz.
const RATES: [&str; 14] = [
    "fs",
    "fshz",
    "fsamp",
    "fsample",
    "samplerate",
    "sampleratehz",
    "samplingrate",
    "samplingratehz",
    "samplefrequency",
    "samplingfrequency",
    "sampfreq",
    "ratehz",
    "samplespersecond",
    "samplefreq",
];

/// Lower-case names, without `_`, of a number that is a time step in s.
const STEPS: [&str; 13] = [
    "dt",
    "dts",
    "ts",
    "deltat",
    "tsample",
    "sampletime",
    "samplingtime",
    "sampleinterval",
    "samplinginterval",
    "samplingperiod",
    "wfincrement",
    "xincrement",
    "deltax",
];

/// Maximum relative difference between two steps that count as equal.
const SAME_STEP: f64 = 1e-5;

/// Assigns to every column the rate that its struct or group states. If this struct or group states
/// none, the nearest struct or group around it is used.
pub(crate) fn with_stated_rates(mut contents: Contents) -> Contents {
    let stated: Vec<(usize, &str, f64)> = (0..)
        .zip(&contents.scalars)
        .filter_map(|(at, (name, value))| Some((at, enclosing(name), step(name, *value)?)))
        .collect();
    for column in &mut contents.columns {
        let mut within = Some(enclosing(&column.name));
        while let Some(place) = within {
            let mut here = stated.iter().filter(|(_, at, _)| *at == place);
            if let Some((scalar, _, step)) = here.next() {
                let contradiction =
                    here.find(|(_, _, second_step)| (second_step - step).abs() > SAME_STEP * step);
                column.axis = match contradiction {
                    None => Axis::Stated { step: *step, scalar: *scalar },
                    Some((second, _, second_step)) => Axis::Contradiction {
                        scalars: [*scalar, *second],
                        steps: [*step, *second_step],
                    },
                };
                break;
            }
            within = (!place.is_empty()).then(|| enclosing(place));
        }
    }
    contents
}

/// Assigns to each column the instants of the time column that is in the same struct or group and
/// has the same number of samples; the top level is also a group. It does so only for files in
/// which a struct or a group has a time column.
pub(crate) fn with_own_times(mut contents: Contents) -> Contents {
    let group = |at: usize| enclosing(&contents.columns[at].name);
    let times: Vec<usize> = (0..contents.columns.len())
        .filter(|at| {
            let name = &contents.columns[*at].name;
            is_time(name.rsplit_once(['.', '/']).map_or(name.as_str(), |(_, name)| name))
        })
        .collect();
    if times.iter().all(|at| group(*at).is_empty()) {
        return contents;
    }
    let len = |at: usize| contents.columns[at].values.as_ref().map_or(0, Vec::len);
    let time_of_column = (0..contents.columns.len()).map(|at| {
        let is_own = |time: &&usize| group(**time) == group(at) && len(**time) == len(at);
        times.iter().find(is_own).copied()
    });
    let time_of_column: Vec<Option<usize>> = time_of_column.collect();
    for (column, time) in contents.columns.iter_mut().zip(time_of_column) {
        // A time column has priority over a sampling rate that the file states as a number.
        if let (Axis::Unknown | Axis::Stated { .. } | Axis::Contradiction { .. }, Some(time)) =
            (column.axis, time)
        {
            column.axis = Axis::Column(time);
        }
    }
    contents
}

/// Returns the name of the struct that contains a variable; empty at the top level.
fn enclosing(name: &str) -> &str {
    name.rsplit_once(['.', '/']).map_or("", |(place, _)| place)
}

/// Returns the time step, in s, that a named number states.
pub(crate) fn step(name: &str, value: f64) -> Option<f64> {
    let key = name.rsplit_once(['.', '/']).map_or(name, |(_, key)| key);
    let key = key.to_lowercase().replace('_', "");
    let step = match key.as_str() {
        rate if RATES.contains(&rate) => 1.0 / value,
        step if STEPS.contains(&step) => value,
        _ => return None,
    };
    (step > 0.0 && step.is_normal()).then_some(step)
}
