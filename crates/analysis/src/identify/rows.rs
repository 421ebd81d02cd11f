//! Rows of the tables that a result is made of: samples and lines used, parameters, modes.

use mechid_estimate::{self as estimate, Estimate, IdentifiedMode, Unknowns, frequency_domain};
use mechid_model::Parameter;
use serde::Serialize;

use crate::AnalysisError;
use crate::measurement::Block;
use crate::text::{compact, significant, text_table};

/// Level of the confidence intervals, a pure number such as 0.95.
pub const CONFIDENCE: f64 = 0.95;

/// The samples used, counted from 1.
#[derive(Debug, Serialize)]
pub struct WindowRow {
    /// First sample, counted from 1.
    pub first_sample: usize,
    /// Last sample, counted from 1.
    pub last_sample: usize,
    /// Number of samples in a period.
    pub period_samples: usize,
    /// Number of periods.
    pub periods: usize,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
}

/// Spectral lines that were used.
#[derive(Debug, Serialize)]
pub struct LinesUsed {
    /// Number of lines.
    pub count: usize,
    /// Lowest line.
    pub first: usize,
    /// Highest line.
    pub last: usize,
    /// Lowest frequency, in Hz.
    pub first_hz: f64,
    /// Highest frequency, in Hz.
    pub last_hz: f64,
}

/// A value with its standard error and confidence interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Uncertain {
    /// Value, in its unit.
    pub value: f64,
    /// Standard error, in the same unit; `None` for a value that is known.
    pub standard_error: Option<f64>,
    /// Confidence interval, in the same unit; `None` for a value that is known.
    pub interval: Option<[f64; 2]>,
}

/// One entry of M, C or K.
#[derive(Debug, Serialize)]
pub struct ParameterRow {
    /// Name.
    pub name: String,
    /// Matrix of the parameter: mass, damping or stiffness.
    pub matrix: String,
    /// Counted from 1.
    pub row: usize,
    /// Counted from 1.
    pub column: usize,
    /// SI unit.
    pub unit: &'static str,
    /// `true` if it was given, not estimated.
    pub known: bool,
    #[serde(flatten)]
    /// Estimate with its uncertainty.
    pub estimate: Uncertain,
}

/// One mode of the identified system.
#[derive(Debug, Serialize)]
pub struct ModeRow {
    /// `true` if the mode is underdamped.
    pub oscillates: bool,
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: Uncertain,
    /// Damped frequency, in Hz.
    pub damped_frequency_hz: Uncertain,
    /// Damping ratio.
    pub damping_ratio: Uncertain,
}

impl WindowRow {
    /// The samples of a measurement.
    pub(crate) fn of(measured: &Block) -> Self {
        Self {
            first_sample: measured.first_sample,
            last_sample: measured.last_sample(),
            period_samples: measured.period,
            periods: measured.periods,
            sample_rate_hz: measured.force.sampling().rate_hz(),
        }
    }
}

impl ModeRow {
    /// Returns frequencies and damping of an identified mode.
    pub(crate) fn of(found: &IdentifiedMode) -> Result<Self, AnalysisError> {
        Ok(Self {
            oscillates: found.mode.oscillates(),
            natural_frequency_hz: Uncertain::of(&found.natural_frequency_hz)?,
            damped_frequency_hz: Uncertain::of(&found.damped_frequency_hz)?,
            damping_ratio: Uncertain::of(&found.damping_ratio)?,
        })
    }
}

impl LinesUsed {
    /// The first, the last and the number of the lines used.
    pub(crate) fn of(used: &frequency_domain::Lines) -> Self {
        let (lines, spacing_hz) = (used.as_slice(), used.sampling().line_spacing_hz());
        let first = lines.iter().copied().min().unwrap_or(0);
        let last = lines.iter().copied().max().unwrap_or(0);
        let (first_hz, last_hz) = (first as f64 * spacing_hz, last as f64 * spacing_hz);
        Self { count: lines.len(), first, last, first_hz, last_hz }
    }
}

impl Uncertain {
    /// Returns a value that was estimated.
    pub(crate) fn new(value: f64, standard_error: f64, interval: [f64; 2]) -> Self {
        Self { value, standard_error: Some(standard_error), interval: Some(interval) }
    }

    /// Returns a value derived from the estimate.
    pub(crate) fn of(found: &estimate::Uncertain) -> Result<Self, AnalysisError> {
        Ok(Self::new(found.value, found.standard_error, found.interval(CONFIDENCE)?))
    }

    /// Returns a value that was given.
    pub(crate) fn known(value: f64) -> Self {
        Self { value, standard_error: None, interval: None }
    }

    /// Value, standard error and interval; the error tells how many digits the value deserves.
    pub fn cells(&self) -> [String; 3] {
        let (Some(error), Some([low, high])) = (self.standard_error, self.interval) else {
            return [significant(self.value, 6), "known".into(), String::new()];
        };
        let digits = digits(self.value, error);
        [
            significant(self.value, digits),
            significant(error, 2),
            format!("{} … {}", significant(low, digits), significant(high, digits)),
        ]
    }
}

/// Significant digits of `value` down to the second of its standard error, 3 to 12.
fn digits(value: f64, error: f64) -> usize {
    let ratio = (value.abs() / error).log10();
    if ratio.is_finite() { (ratio.floor() as i32 + 3).clamp(3, 12) as usize } else { 6 }
}

pub(super) fn parameters(estimate: &Estimate) -> Result<Vec<ParameterRow>, AnalysisError> {
    let mut rows = Vec::new();
    let found = |parameter: Parameter| {
        let at = estimate.parameters().position(|p| p.parameter == parameter);
        at.and_then(|at| estimate.parameters().nth(at))
    };
    for parameter in Unknowns::unknown_mass(estimate.dof())?.free() {
        let (matrix, row, column) = (parameter.matrix(), parameter.row(), parameter.column());
        let value = match found(parameter) {
            Some(p) => Uncertain::new(p.value, p.standard_error, p.interval(CONFIDENCE)?),
            None => {
                Uncertain::known(estimate.unknowns().fixed(matrix, row, column).unwrap_or_default())
            }
        };
        rows.push(ParameterRow {
            name: parameter.to_string(),
            matrix: matrix.to_string(),
            row: row + 1,
            column: column + 1,
            unit: matrix.unit(),
            known: value.standard_error.is_none(),
            estimate: value,
        });
    }
    Ok(rows)
}

/// Returns the header of a table of estimates.
pub(crate) fn header(what: &str) -> Vec<String> {
    let interval = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
    [what, "value", "standard error", &interval, "unit"].map(String::from).to_vec()
}

/// Returns natural frequency and damping ratio of every mode as a table.
pub(super) fn mode_table(what: &str, modes: &[ModeRow]) -> String {
    let mut rows = vec![header(what)];
    for (number, mode) in (1..).zip(modes) {
        let mut add = |name: String, value: &Uncertain, unit: &str| {
            let mut row = vec![name];
            row.extend(value.cells());
            row.push(unit.into());
            rows.push(row);
        };
        add(format!("{number} natural frequency"), &mode.natural_frequency_hz, "Hz");
        add(format!("{number} damping ratio"), &mode.damping_ratio, "–");
    }
    text_table(&rows)
}

impl ParameterRow {
    /// Name, value, standard error, interval and unit.
    pub(super) fn cells(&self) -> Vec<String> {
        let mut row = vec![self.name.clone()];
        row.extend(self.estimate.cells());
        row.push(self.unit.into());
        row
    }
}
