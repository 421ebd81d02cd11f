//! The time axis of a table.

use mechid_signal::Sampling;

use super::printed::PrintedInstants;
use super::{Table, time_unit};
use crate::IoError;
use crate::contents::{Axis, Place};

/// Time axis of the columns of a [`Table`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeAxis<'a> {
    /// Time column, chosen by name or number: in the unit that its name or the line of units
    /// states, otherwise in seconds.
    Column(&'a str),
    /// A known sampling rate, in Hz.
    RateHz(f64),
    /// The time axis of the columns in the file.
    OfFile,
}

/// Maximum deviation of a step from the median step, as a fraction of the median: a hundredth of a
/// step is a phase error of 1.8° at the Nyquist frequency.
const STEP_TOLERANCE: f64 = 0.01;

/// Maximum relative difference between two steps or rates that count as equal: universal files
/// print them with six digits.
const SAME_STEP: f64 = 1e-5;

/// Sampling instants of one column.
#[derive(Debug, Clone, Copy)]
struct Instants {
    /// First instant (s).
    start: f64,
    /// Time step (s).
    step: f64,
}

impl TimeAxis<'_> {
    /// Returns the time axis of columns, by their indices.
    pub(super) fn sampling(&self, table: &Table, columns: &[usize]) -> Result<Sampling, IoError> {
        let signal = |source| IoError::Signal { file: table.file().into(), source };
        match *self {
            TimeAxis::RateHz(rate_hz) => {
                let sampling = at_rate(table.file(), rate_hz, 1)?;
                for column in columns {
                    check_rate(table, *column, rate_hz)?;
                }
                sampling.with_len(common_length(table, columns)?).map_err(signal)
            }
            TimeAxis::Column(column) => {
                let column = table.find(column)?;
                let unit = time_unit::unit(&table.contents.columns[column]);
                let dt = uniform_step(table, table.values(column)?, unit)?;
                let all_columns: Vec<usize> = [&[column], columns].concat();
                Sampling::new(dt, common_length(table, &all_columns)?).map_err(signal)
            }
            TimeAxis::OfFile => {
                let step = common_instants(table, columns)?.step;
                Sampling::new(step, common_length(table, columns)?).map_err(signal)
            }
        }
    }
}

/// Returns the common number of samples of the columns.
pub(super) fn common_length(table: &Table, columns: &[usize]) -> Result<usize, IoError> {
    let mut lengths = Vec::new();
    for column in columns {
        lengths.push((*column, table.values(*column)?.len()));
    }
    Ok(same_length(table, &lengths)?.unwrap_or(table.len()))
}

/// Returns the common length of columns, each given as its index and its number of samples; `None`
/// without columns.
pub(super) fn same_length(
    table: &Table,
    lengths: &[(usize, usize)],
) -> Result<Option<usize>, IoError> {
    let len = lengths.first().map(|(_, len)| *len);
    if lengths.iter().all(|(_, other)| Some(*other) == len) {
        return Ok(len);
    }
    let descriptions = lengths.iter().map(|(c, len)| format!("{} has {len}", table.label(*c)));
    let lengths = descriptions.collect::<Vec<_>>().join(", ");
    Err(IoError::Lengths { file: table.file().into(), lengths })
}

/// Returns the common instants of the columns in the file.
fn common_instants(table: &Table, columns: &[usize]) -> Result<Instants, IoError> {
    let mut common: Option<(usize, Instants)> = None;
    for column in columns {
        let Some(own) = own_instants(table, *column)? else {
            let column = table.label(*column);
            return Err(IoError::NoTimeAxis { file: table.file().into(), column });
        };
        let Some((first, instants)) = common else {
            common = Some((*column, own));
            continue;
        };
        // The tolerance for the first instants is the same as for the steps.
        let together = (own.start - instants.start).abs() <= STEP_TOLERANCE * instants.step
            && same(own.step, instants.step);
        if !together {
            return Err(IoError::TimeAxes {
                file: table.file().into(),
                first: table.label(first),
                first_start: instants.start,
                first_step: instants.step,
                second: table.label(*column),
                second_start: own.start,
                second_step: own.step,
            });
        }
    }
    common
        .map(|(_, instants)| instants)
        .ok_or_else(|| IoError::NoTimeAxis { file: table.file().into(), column: table.available() })
}

/// Returns the instants of a column in the file.
fn own_instants(table: &Table, column: usize) -> Result<Option<Instants>, IoError> {
    Ok(match table.axis(column) {
        Axis::Unknown => None,
        Axis::Even { start, step } => Some(Instants { start, step }),
        Axis::Stated { step, .. } => Some(Instants { start: 0.0, step }),
        Axis::Contradiction { scalars, steps } => {
            let [(first, first_value), (second, second_value)] =
                scalars.map(|at| table.scalars()[at].clone());
            return Err(IoError::StatedRates {
                file: table.file().into(),
                first,
                first_value,
                first_hz: 1.0 / steps[0],
                second,
                second_value,
                second_hz: 1.0 / steps[1],
            });
        }
        Axis::Column(times) => {
            let unit = time_unit::unit(&table.contents.columns[times]);
            let times = table.values(times)?;
            let start = times.first().map_or(0.0, |first| first * unit);
            Some(Instants { start, step: uniform_step(table, times, unit)? })
        }
    })
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_STEP * a.abs().max(b.abs())
}

/// Returns an error if the file states a rate other than `rate_hz` for the column. A rate that only
/// a named number states may be replaced.
fn check_rate(table: &Table, column: usize, rate_hz: f64) -> Result<(), IoError> {
    if matches!(table.axis(column), Axis::Stated { .. } | Axis::Contradiction { .. }) {
        return Ok(());
    }
    match own_instants(table, column)? {
        Some(own) if !same(1.0 / own.step, rate_hz) => Err(IoError::RateContradicts {
            file: table.file().into(),
            column: table.label(column),
            own_hz: 1.0 / own.step,
            rate_hz,
        }),
        _ => Ok(()),
    }
}

/// Returns a time axis with a known rate.
pub(super) fn at_rate(file: &str, rate_hz: f64, len: usize) -> Result<Sampling, IoError> {
    if !(rate_hz > 0.0 && (1.0 / rate_hz).is_normal()) {
        return Err(IoError::SampleRate { rate_hz });
    }
    Sampling::from_rate_hz(rate_hz, len)
        .map_err(|source| IoError::Signal { file: file.into(), source })
}

/// Returns the mean step, in s, of equally spaced instants given in units of `unit` s.
fn uniform_step(table: &Table, times: &[f64], unit: f64) -> Result<f64, IoError> {
    let mut steps = Steps::default();
    for (k, time) in times.iter().enumerate() {
        steps.push(*time, || table.position(k));
    }
    steps.step(table.file(), unit)
}

/// Number of steps at the beginning of a record whose median is the usual step.
const MEDIAN_STEPS: usize = 1024;

/// Running statistics of the steps between instants.
#[derive(Debug, Default)]
pub(super) struct Steps {
    instants: usize,
    first: f64,
    last: f64,
    /// The first steps.
    beginning: Vec<f64>,
    shortest: Option<(f64, Place)>,
    longest: Option<(f64, Place)>,
    printed: PrintedInstants,
}

impl Steps {
    /// Adds the next instant and its position in the file.
    pub fn push(&mut self, time: f64, place: impl Fn() -> Place) {
        if self.instants == 0 {
            self.first = time;
        } else {
            let step = time - self.last;
            if self.beginning.len() < MEDIAN_STEPS {
                self.beginning.push(step);
            }
            if self.shortest.is_none_or(|(shortest, _)| step < shortest) {
                self.shortest = Some((step, place()));
            }
            if self.longest.is_none_or(|(longest, _)| step > longest) {
                self.longest = Some((step, place()));
            }
        }
        self.printed.push(time);
        self.last = time;
        self.instants += 1;
    }

    /// Returns the mean step, in s, of instants given in units of `unit` s, or an error if the
    /// instants are not equally spaced.
    pub fn step(mut self, file: &str, unit: f64) -> Result<f64, IoError> {
        let (Some(shortest), Some(longest)) = (self.shortest, self.longest) else {
            return Err(IoError::SingleSample { file: file.into() });
        };
        let middle = self.beginning.len() / 2;
        let (_, &mut usual, _) = self.beginning.select_nth_unstable_by(middle, f64::total_cmp);
        let off = |(step, _): (f64, Place)| (step - usual).abs();
        let worst = if off(shortest) > off(longest) { shortest } else { longest };
        // Steps that are zero or negative or that overflow are refused, too.
        let is_uniform = usual > 0.0 && off(worst) <= STEP_TOLERANCE * usual;
        if is_uniform || self.printed.are_uniform() {
            return Ok(unit * (self.last - self.first) / (self.instants - 1) as f64);
        }
        let (step, at) = worst;
        Err(IoError::NonUniformTime {
            file: file.into(),
            at,
            step: unit * step,
            usual: unit * usual,
        })
    }
}
