//! Where the time axis of a table comes from.

use mechid_signal::Sampling;

use crate::{IoError, Table};

/// The time axis of a [`Table`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeAxis<'a> {
    /// A column of instants, in seconds, chosen by name or number.
    Column(&'a str),
    /// A known sampling rate, in Hz.
    RateHz(f64),
}

/// Steps may differ from the median step by this part of it: printed times are rounded, and a
/// hundredth of a step is a phase error of 1.8° at the Nyquist frequency.
const STEP_TOLERANCE: f64 = 0.01;

impl TimeAxis<'_> {
    pub(crate) fn sampling(&self, table: &Table) -> Result<Sampling, IoError> {
        let signal = |source| IoError::Signal { file: table.file().into(), source };
        match *self {
            TimeAxis::RateHz(rate_hz) if rate_hz > 0.0 && (1.0 / rate_hz).is_normal() => {
                Sampling::from_rate_hz(rate_hz, table.len()).map_err(signal)
            }
            TimeAxis::RateHz(rate_hz) => Err(IoError::SampleRate { rate_hz }),
            TimeAxis::Column(column) => {
                let dt = uniform_step(table, &table.column(column)?)?;
                Sampling::new(dt, table.len()).map_err(signal)
            }
        }
    }
}

/// The mean step of instants that are equally spaced.
fn uniform_step(table: &Table, times: &[f64]) -> Result<f64, IoError> {
    let file = || table.file().to_owned();
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(&usual) = sorted.get(sorted.len() / 2) else {
        return Err(IoError::SingleSample { file: file() });
    };
    let off = |step: f64| (step - usual).abs();
    let worst = (0..steps.len()).max_by(|a, b| off(steps[*a]).total_cmp(&off(steps[*b])));
    let worst = worst.unwrap_or_default();
    // Also refuses time that stands still or runs backwards, and steps that overflow.
    if usual > 0.0 && off(steps[worst]) <= STEP_TOLERANCE * usual {
        return Ok((times[times.len() - 1] - times[0]) / steps.len() as f64);
    }
    Err(IoError::NonUniformTime {
        file: file(),
        line: table.line(worst + 1),
        step: steps[worst],
        usual,
    })
}
