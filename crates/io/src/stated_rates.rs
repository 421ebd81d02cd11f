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
    let stated: Vec<(usize, &str, f64)> = (0..)
        .zip(&contents.scalars)
        .filter_map(|(at, (name, value))| Some((at, enclosing(name), step(name, *value)?)))
        .collect();
    for column in &mut contents.columns {
        let mut within = Some(enclosing(&column.name));
        while let Some(place) = within {
            let mut here = stated.iter().filter(|(_, at, _)| *at == place);
            if let Some((scalar, _, step)) = here.next() {
                let other = here.find(|(_, _, other)| (other - step).abs() > SAME_STEP * step);
                column.axis = match other {
                    None => Axis::Stated { step: *step, scalar: *scalar },
                    Some((second, _, other)) => {
                        Axis::Contradiction { scalars: [*scalar, *second], steps: [*step, *other] }
                    }
                };
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
    let key = name.rsplit_once('.').map_or(name, |(_, key)| key);
    let key = key.to_lowercase().replace('_', "");
    let step = match key.as_str() {
        rate if RATES.contains(&rate) => 1.0 / value,
        step if STEPS.contains(&step) => value,
        _ => return None,
    };
    (step > 0.0 && step.is_normal()).then_some(step)
}
