//! Rows of the tables of a result: samples and lines used, parameters, modes.

use mechid_estimate::{Estimate, IdentifiedMode, Unknowns};
use mechid_io::ParameterCovariance;
use mechid_model::{EIGENVALUE_ROUNDING, Parameter};
use serde::{Deserialize, Serialize};

use super::Unscaled;
use crate::AnalysisError;
use crate::measurement::Block;
use crate::modes::SavedValue;
use crate::text::{compact, significant, text_table};

/// Level of the confidence intervals, a pure number such as 0.95.
pub const CONFIDENCE: f64 = 0.95;

/// The samples used, counted from 1.
#[derive(Debug, Clone, Serialize)]
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
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(from = "SavedValue")]
pub struct Uncertain {
    /// Value, in its unit.
    pub value: f64,
    /// Standard error, in the same unit; `None` for a known value.
    pub standard_error: Option<f64>,
    /// Confidence interval, in the same unit; `None` for a known value.
    pub interval: Option<[f64; 2]>,
}

/// One entry of M, C or K.
#[derive(Debug, Serialize)]
pub struct ParameterRow {
    /// Name.
    pub name: String,
    /// Matrix of the parameter: mass, damping or stiffness.
    pub matrix: String,
    /// Row of the entry in its matrix, counted from 1.
    pub row: usize,
    /// Column of the entry in its matrix, counted from 1.
    pub column: usize,
    /// SI unit.
    pub unit: &'static str,
    /// `true` if the entry was given and not estimated.
    pub known: bool,
    #[serde(flatten)]
    /// Estimate with its uncertainty.
    pub estimate: Uncertain,
}

/// Factors of a damping C = αM + βK.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ProportionalDamping {
    /// α, in 1/s.
    pub alpha: Uncertain,
    /// β, in s.
    pub beta: Uncertain,
}

/// One mode of a system.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ModeRow {
    /// `true` if the mode is underdamped.
    pub oscillates: bool,
    /// `true` for a mode without restoring force: the interval of its natural frequency contains
    /// zero.
    pub is_rigid_body: bool,
    /// Natural frequency, in Hz; for an overdamped pair, the value that both modes share.
    pub natural_frequency_hz: Uncertain,
    /// Damped frequency, in Hz.
    pub damped_frequency_hz: Uncertain,
    /// Damping ratio, a pure number; for an overdamped pair, the value that both modes share, above
    /// 1.
    pub damping_ratio: Uncertain,
    /// Eigenvalue of a mode that does not oscillate, in 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pole: Option<Uncertain>,
    /// Number of the other mode of an overdamped pair, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partner: Option<usize>,
    /// Rate at which the free response of an unstable mode grows, in 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth_rate: Option<Uncertain>,
}

impl WindowRow {
    /// Creates the row of the samples of a measurement.
    pub(crate) fn from_block(measured: &Block) -> Self {
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
    /// Returns frequencies and damping of the modes of an identified system, or of an exactly
    /// `known` system.
    pub(crate) fn all(modes: &[IdentifiedMode], known: bool) -> Result<Vec<Self>, AnalysisError> {
        let largest = modes.iter().map(|mode| mode.mode.natural_frequency()).fold(0.0, f64::max);
        let rounding = EIGENVALUE_ROUNDING * largest;
        modes.iter().map(|mode| Self::new(mode, known, rounding)).collect()
    }

    /// Creates the row of a mode; growth rates up to `rounding` (1/s) count as rounding errors.
    fn new(mode: &IdentifiedMode, known: bool, rounding: f64) -> Result<Self, AnalysisError> {
        let uncertain = |value: &mechid_numerics::Uncertain| {
            if known { Ok(Uncertain::known(value.value)) } else { Uncertain::from_estimate(value) }
        };
        let grows = !mode.is_rigid_body && mode.growth_rate.value > rounding;
        // Two real eigenvalues of opposite sign have no common natural frequency.
        let shared = mode.is_rigid_body || mode.squared_frequency.value > 0.0;
        let rate = uncertain(&mode.growth_rate)?;
        let frequency = &mode.natural_frequency_hz;
        Ok(Self {
            oscillates: mode.mode.oscillates(),
            is_rigid_body: mode.is_rigid_body,
            natural_frequency_hz: if known {
                Uncertain::known(frequency.value)
            } else {
                let interval = mode.natural_frequency_interval_hz(CONFIDENCE)?;
                Uncertain::new(frequency.value, frequency.standard_error, interval)
            },
            damped_frequency_hz: uncertain(&mode.damped_frequency_hz)?,
            damping_ratio: uncertain(&mode.damping_ratio)?,
            pole: (!mode.mode.oscillates()).then_some(rate),
            partner: mode.partner.filter(|_| shared).map(|at| at + 1),
            growth_rate: grows.then_some(rate),
        })
    }

    /// Returns whether the mode at an index, counted from 0, belongs to a pair that an earlier mode
    /// already reports.
    pub(super) fn is_reported_before(&self, at: usize) -> bool {
        self.partner.is_some_and(|number| number <= at)
    }

    /// Returns the quantities of modes, with name and unit: natural frequency, damped frequency if
    /// `damped`, damping ratio, and the poles of modes that do not oscillate. An overdamped pair is
    /// reported once.
    pub fn quantities(modes: &[Self], damped: bool) -> Vec<(String, Uncertain, &'static str)> {
        let mut quantities = Vec::new();
        for (at, mode) in
            modes.iter().enumerate().filter(|(at, mode)| !mode.is_reported_before(*at))
        {
            let this_mode = (at + 1, mode.pole);
            let partner = mode.partner.map(|number| (number, modes[number - 1].pole));
            let numbers = [Some(this_mode), partner].into_iter().flatten();
            for (number, pole) in numbers.clone() {
                quantities.extend(pole.map(|pole| (format!("{number} real pole"), pole, "1/s")));
            }
            let name: Vec<String> = numbers.map(|(number, _)| number.to_string()).collect();
            let mut add = |what: &str, value: Uncertain, unit| {
                quantities.push((format!("{} {what}", name.join(", ")), value, unit));
            };
            if mode.is_rigid_body {
                add("rigid-body mode, frequency", mode.natural_frequency_hz, "Hz");
            } else if mode.oscillates || mode.partner.is_some() {
                add("natural frequency", mode.natural_frequency_hz, "Hz");
                // A mode that does not oscillate has no damped frequency.
                if damped && mode.oscillates {
                    add("damped frequency", mode.damped_frequency_hz, "Hz");
                }
                add("damping ratio", mode.damping_ratio.percent(), "%");
            }
        }
        quantities
    }
}

impl LinesUsed {
    /// Creates the row of the lines used: the first, the last and their number.
    pub(crate) fn from_lines(used: &mechid_spectra::Lines) -> Self {
        let (lines, spacing_hz) = (used.as_slice(), used.sampling().line_spacing_hz());
        let first = lines.iter().copied().min().unwrap_or(0);
        let last = lines.iter().copied().max().unwrap_or(0);
        let (first_hz, last_hz) = (first as f64 * spacing_hz, last as f64 * spacing_hz);
        Self { count: lines.len(), first, last, first_hz, last_hz }
    }
}

impl Uncertain {
    /// Creates an estimated value.
    pub(crate) fn new(value: f64, standard_error: f64, interval: [f64; 2]) -> Self {
        Self { value, standard_error: Some(standard_error), interval: Some(interval) }
    }

    /// Creates a value derived from the estimate.
    pub(crate) fn from_estimate(
        uncertain: &mechid_numerics::Uncertain,
    ) -> Result<Self, AnalysisError> {
        Ok(Self::new(uncertain.value, uncertain.standard_error, uncertain.interval(CONFIDENCE)?))
    }

    /// Returns a pure number in per cent.
    pub fn percent(&self) -> Self {
        Self {
            value: 100.0 * self.value,
            standard_error: self.standard_error.map(|error| 100.0 * error),
            interval: self.interval.map(|interval| interval.map(|limit| 100.0 * limit)),
        }
    }

    /// Creates a known value, without standard error and interval.
    pub(crate) fn known(value: f64) -> Self {
        Self { value, standard_error: None, interval: None }
    }

    /// Returns value, standard error and interval; the standard error decides the number of digits.
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

/// Returns the number of significant digits of `value`, from 3 to 12: the last digit shown is the
/// second significant digit of the standard error.
fn digits(value: f64, error: f64) -> usize {
    let ratio = (value.abs() / error).log10();
    if ratio.is_finite() { (ratio.floor() as i32 + 3).clamp(3, 12) as usize } else { 6 }
}

/// Returns the entries of M, C and K; equations without scale are omitted.
pub(super) fn parameters(
    estimate: &Estimate,
    unscaled: Option<&Unscaled>,
) -> Result<Vec<ParameterRow>, AnalysisError> {
    let mut rows = Vec::new();
    let is_given = |p: &Parameter| unscaled.is_none_or(|unscaled| !unscaled.hides(p.row()));
    // The order of both sequences is that given by `Unknowns::free`.
    let mut estimated = estimate.parameters().peekable();
    for parameter in Unknowns::unknown_mass(estimate.dof())?.free() {
        let (matrix, row, column) = (parameter.matrix(), parameter.row(), parameter.column());
        let estimated_entry = estimated.next_if(|p| p.parameter == parameter);
        if !is_given(&parameter) {
            continue;
        }
        let value = match estimated_entry {
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

/// Returns the covariance of the estimated entries of M, C and K; equations without scale are
/// omitted.
pub(super) fn covariance(estimate: &Estimate, unscaled: Option<&Unscaled>) -> ParameterCovariance {
    let is_given = |p: &Parameter| unscaled.is_none_or(|unscaled| !unscaled.hides(p.row()));
    let parameters = estimate.parameters().map(|p| p.parameter).enumerate();
    let (given, names): (Vec<usize>, Vec<String>) =
        parameters.filter(|(_, p)| is_given(p)).map(|(at, p)| (at, p.to_string())).unzip();
    let mut covariance = estimate.covariance();
    if given.len() < covariance.nrows() {
        covariance = covariance.select_rows(&given).select_columns(&given);
    }
    ParameterCovariance::new(names, &covariance, estimate.degrees_of_freedom())
}

/// Maximum number of parameters for which a result contains their covariance; its size is the
/// square of this number.
pub(crate) const MOST_WITH_COVARIANCE: usize = 2_000;

/// Returns whether a result contains the covariance of its parameters.
pub(super) fn carries_covariance(estimate: &Estimate) -> bool {
    estimate.parameters().len() <= MOST_WITH_COVARIANCE
}

/// Returns the remark on a covariance that a result omits.
pub(super) fn omitted_covariance_remark(estimate: &Estimate) -> Option<String> {
    let count = estimate.parameters().len();
    (!carries_covariance(estimate)).then(|| {
        format!(
            "the result omits the covariance of {count} parameters (at most {MOST_WITH_COVARIANCE} are included): \
             programs that read the machine from this result treat M, C and K as exactly known"
        )
    })
}

/// Returns the header of a table of estimates.
pub(crate) fn header(what: &str) -> Vec<String> {
    let interval = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
    [what, "value", "standard error", &interval, "unit"].map(String::from).to_vec()
}

/// Returns natural frequency and damping ratio of every mode as a table.
pub(super) fn mode_table(what: &str, modes: &[ModeRow]) -> String {
    let mut rows = vec![header(what)];
    rows.extend(mode_cells(modes, false));
    text_table(&rows)
}

/// Returns the rows of a table of modes.
pub(crate) fn mode_cells(modes: &[ModeRow], damped: bool) -> impl Iterator<Item = Vec<String>> {
    ModeRow::quantities(modes, damped).into_iter().map(|(name, value, unit)| {
        let mut row = vec![name];
        row.extend(value.cells());
        row.push(unit.into());
        row
    })
}

impl ProportionalDamping {
    /// Returns the factors of an estimate with proportional damping; `None` for another damping.
    pub(super) fn from_estimate(estimate: &Estimate) -> Result<Option<Self>, AnalysisError> {
        let Some([alpha, beta]) = estimate.proportional_damping() else { return Ok(None) };
        Ok(Some(Self {
            alpha: Uncertain::from_estimate(&alpha)?,
            beta: Uncertain::from_estimate(&beta)?,
        }))
    }

    /// Returns name, value, standard error, interval and unit of both factors.
    pub fn rows(&self) -> [Vec<String>; 2] {
        [("alpha", &self.alpha, "1/s"), ("beta", &self.beta, "s")].map(|(name, factor, unit)| {
            let mut row = vec![name.to_owned()];
            row.extend(factor.cells());
            row.push(unit.into());
            row
        })
    }
}

/// Maximum number of entries known to be zero that a table lists; with more, it states only their
/// number.
const ZEROS_SHOWN: usize = 12;

/// Returns the table of the parameters, followed by other rows. Many entries known to be zero are
/// only counted.
pub(super) fn parameter_table(
    parameters: &[ParameterRow],
    others: impl Iterator<Item = Vec<String>>,
) -> String {
    let is_zero = |p: &&ParameterRow| p.known && p.estimate.value == 0.0;
    let zeros = parameters.iter().filter(is_zero).count();
    let shown = parameters.iter().filter(|p| zeros <= ZEROS_SHOWN || !is_zero(p));
    let mut rows = vec![header("parameter")];
    rows.extend(shown.map(ParameterRow::cells));
    rows.extend(others);
    let mut text = text_table(&rows);
    if zeros > ZEROS_SHOWN {
        text += &format!("{zeros} entries known to be zero are left out\n");
    }
    text
}

impl ParameterRow {
    /// Returns name, value, standard error, interval and unit.
    pub(super) fn cells(&self) -> Vec<String> {
        let mut row = vec![self.name.clone()];
        row.extend(self.estimate.cells());
        row.push(self.unit.into());
        row
    }
}
