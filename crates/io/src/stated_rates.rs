//! Sample rates that a file states in a number beside its vectors, such as `Fs` or `dt`.

use crate::contents::{Axis, Contents};

/// Names of a sample rate in Hz, in lower case and without `_`.
const RATES: [&str; 12] = [
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
];

/// Names of a time step in s, likewise.
const STEPS: [&str; 10] = [
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
];

/// Steps are the same if they differ by this part at most.
const SAME_STEP: f64 = 1e-5;

/// Gives every column the rate that is stated beside it, or beside the struct that holds it.
pub(crate) fn with_stated_rates(mut contents: Contents) -> Contents {
    let stated: Vec<(&str, f64)> = contents
        .scalars
        .iter()
        .filter_map(|(name, value)| Some((enclosing(name), step(name, *value)?)))
        .collect();
    for column in &mut contents.columns {
        let mut within = Some(enclosing(&column.name));
        while let Some(place) = within {
            let mut steps = stated.iter().filter(|(at, _)| *at == place).map(|(_, step)| *step);
            if let Some(first) = steps.next() {
                // Two that contradict each other state nothing.
                if steps.all(|step| (step - first).abs() <= SAME_STEP * first) {
                    column.axis = Axis::Stated { step: first };
                }
                break;
            }
            within = (!place.is_empty()).then(|| enclosing(place));
        }
    }
    contents
}

/// Name of the struct that holds a variable, empty for one that stands alone.
fn enclosing(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(place, _)| place)
}

/// The time step, in s, that a number states.
fn step(name: &str, value: f64) -> Option<f64> {
    let own = name.rsplit_once('.').map_or(name, |(_, own)| own);
    let own = own.to_lowercase().replace('_', "");
    let step = match own.as_str() {
        rate if RATES.contains(&rate) => 1.0 / value,
        step if STEPS.contains(&step) => value,
        _ => return None,
    };
    (step > 0.0 && step.is_normal()).then_some(step)
}
