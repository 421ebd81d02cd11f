//! Sample rates that a file states in a number beside its vectors, such as `Fs` or `dt`.

use crate::contents::{Axis, Contents};
use crate::table::is_time;

/// Names of a sample rate in Hz, in lower case and without `_`.
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

/// Names of a time step in s, likewise.
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

/// Gives the columns of a struct or a group, and those beside all of them, the instants of the column of time that stands
/// among them, if there is such a struct.
pub(crate) fn with_own_times(mut contents: Contents) -> Contents {
    let place = |at: usize| enclosing(&contents.columns[at].name);
    let times: Vec<usize> = (0..contents.columns.len())
        .filter(|at| {
            let name = &contents.columns[*at].name;
            is_time(name.rsplit_once(['.', '/']).map_or(name.as_str(), |(_, name)| name))
        })
        .collect();
    if times.iter().all(|at| place(*at).is_empty()) {
        return contents;
    }
    let len = |at: usize| contents.columns[at].values.as_ref().map_or(0, Vec::len);
    let own = (0..contents.columns.len()).map(|at| {
        let is_own = |time: &&usize| place(**time) == place(at) && len(**time) == len(at);
        times.iter().find(is_own).copied()
    });
    let own: Vec<Option<usize>> = own.collect();
    for (column, time) in contents.columns.iter_mut().zip(own) {
        // What a number beside the struct states counts less.
        if let (Axis::Unknown | Axis::Stated { .. } | Axis::Contradiction { .. }, Some(time)) =
            (column.axis, time)
        {
            column.axis = Axis::Column(time);
        }
    }
    contents
}

/// Name of the struct that holds a variable, empty for one that stands alone.
fn enclosing(name: &str) -> &str {
    name.rsplit_once(['.', '/']).map_or("", |(place, _)| place)
}

/// The time step, in s, that a number states.
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
