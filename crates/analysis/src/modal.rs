//! Natural frequencies, damping ratios and mode shapes of a machine.

use std::f64::consts::TAU;
use std::fmt;

use mechid_estimate::IdentifiedMode;
use mechid_io::SystemMatrices;
use mechid_model::{ModelError, Terms};
use serde::{Deserialize, Serialize};

use crate::AnalysisError;
use crate::identify::rows::{CONFIDENCE, ModeRow, Uncertain, mode_cells};
use crate::machine::Machine;
use crate::modes::saved_errors;
use crate::text::{compact, significant, text_table};

/// Modes of a machine, with standard errors and intervals if its parameters have them.
#[derive(Debug, Clone, Serialize)]
pub struct ModalSummary {
    /// The machine.
    pub file: String,
    /// Degrees of freedom of the system.
    pub degrees_of_freedom: usize,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Nonlinear terms, which the modes of the linear part ignore; `None` for a linear system.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear_terms: Option<Terms>,
    /// Names of the responses, one per degree of freedom; empty if they are not known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub response_names: Vec<String>,
    /// Modes of the system, by rising frequency.
    pub modes: Vec<ShapedMode>,
    /// Natural frequency of each undamped mode as a function of amplitude, up to the largest
    /// amplitude in the data that determined the nonlinear terms; empty for a linear system.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub backbone: Vec<BackboneRow>,
    /// M, C and K.
    pub system: SystemMatrices,
}

/// One mode with its shape.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ShapedMode {
    /// Frequencies, damping, poles.
    #[serde(flatten)]
    pub row: ModeRow,
    /// Real and imaginary part of the eigenvalue, in rad/s.
    pub eigenvalue: [f64; 2],
    /// One entry per degree of freedom; the largest is 1.
    pub shape: Vec<ShapeEntry>,
}

/// Frequency of a mode at one amplitude.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BackboneRow {
    /// Number of the mode of the undamped system, counted from 1 by rising frequency.
    pub mode: usize,
    /// Amplitude of the fundamental at the point of largest motion, in m.
    pub amplitude: f64,
    /// Frequency of the free vibration, in Hz.
    pub frequency_hz: Uncertain,
}

/// One entry of a mode shape: real and imaginary part.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ShapeEntry {
    /// Real and imaginary part.
    pub value: [f64; 2],
    /// Standard errors of real and imaginary part, in the unit of the entry; `None` for an exactly
    /// known machine.
    #[serde(default, deserialize_with = "saved_errors")]
    pub standard_error: Option<[f64; 2]>,
}

impl ModalSummary {
    /// Computes the modes of a machine.
    ///
    /// # Errors
    /// As [`Machine::modes`].
    pub fn from_machine(machine: &Machine) -> Result<Self, AnalysisError> {
        let known = machine.is_exact();
        let modes = machine.modes()?;
        Ok(Self {
            file: machine.name.clone(),
            degrees_of_freedom: machine.system().dof(),
            confidence: CONFIDENCE,
            nonlinear_terms: machine.nonlinear.as_ref().map(|p| p.system().terms().clone()),
            response_names: machine.response_names(),
            modes: ShapedMode::all(&modes, known)?,
            backbone: machine.backbone()?,
            system: SystemMatrices::from(machine.system()),
        })
    }
}

impl Machine {
    /// Returns the names of the responses, one per degree of freedom; empty if they are unknown.
    fn response_names(&self) -> Vec<String> {
        let of =
            |kind| (0..self.system().dof()).map(move |dof| self.names.response_name(kind, dof));
        self.names.first_response().map(of).into_iter().flatten().collect()
    }
}

/// Number of amplitudes of a backbone curve.
const AMPLITUDES: usize = 10;

impl Machine {
    /// Returns the natural frequency of each undamped mode as a function of amplitude, up to the
    /// largest displacement in the data of the identification; empty for a linear machine or
    /// without data.
    ///
    /// # Errors
    /// [`AnalysisError::Model`] if parameter values within the covariance give an invalid machine.
    pub fn backbone(&self) -> Result<Vec<BackboneRow>, AnalysisError> {
        let mut rows = Vec::new();
        let Some(part) = &self.nonlinear else { return Ok(rows) };
        let Some(largest) = part.largest_displacement.filter(|x| *x > 0.0) else { return Ok(rows) };
        let amplitudes: Vec<f64> =
            (1..=AMPLITUDES).map(|k| largest * k as f64 / AMPLITUDES as f64).collect();
        for mode in 0..self.system().dof() {
            let points = match part.uncertain.backbone(mode, &amplitudes) {
                Err(ModelError::NoSuchMode { .. }) => break,
                points => points?,
            };
            for point in points {
                let frequency = mechid_numerics::Uncertain {
                    value: point.omega / TAU,
                    standard_error: point.standard_error / TAU,
                    degrees_of_freedom: self.degrees_of_freedom,
                };
                let frequency_hz = if part.uncertain.parameters().is_empty() {
                    Uncertain::known(frequency.value)
                } else {
                    Uncertain::from_estimate(&frequency)?
                };
                rows.push(BackboneRow { mode: mode + 1, amplitude: point.amplitude, frequency_hz });
            }
        }
        Ok(rows)
    }
}

impl ShapedMode {
    /// Returns the modes of an identified system, or of an exactly `known` system.
    pub(crate) fn all(modes: &[IdentifiedMode], known: bool) -> Result<Vec<Self>, AnalysisError> {
        let rows = ModeRow::all(modes, known)?.into_iter().zip(modes);
        Ok(rows.map(|(row, mode)| Self::new(row, mode, known)).collect())
    }

    /// Returns frequencies, damping and poles of modes, without their shapes.
    pub fn rows(modes: &[Self]) -> Vec<ModeRow> {
        modes.iter().map(|mode| mode.row.clone()).collect()
    }

    /// Returns a mode that oscillates, identified by frequency (Hz) and damping ratio.
    pub(crate) fn from_pole(
        eigenvalue: [f64; 2],
        [natural_frequency_hz, damped_frequency_hz, damping_ratio]: [Uncertain; 3],
        shape: Vec<ShapeEntry>,
    ) -> Self {
        let row = ModeRow {
            oscillates: true,
            is_rigid_body: false,
            natural_frequency_hz,
            damped_frequency_hz,
            damping_ratio,
            pole: None,
            partner: None,
            growth_rate: None,
        };
        Self { row, eigenvalue, shape }
    }

    pub(crate) fn new(row: ModeRow, mode: &IdentifiedMode, known: bool) -> Self {
        let eigenvalue = mode.mode.eigenvalue();
        let entries = mode.mode.shape().iter().zip(mode.shape_standard_error.iter());
        Self {
            row,
            eigenvalue: [eigenvalue.re, eigenvalue.im],
            shape: entries
                .map(|(value, error)| ShapeEntry {
                    value: [value.re, value.im],
                    standard_error: (!known).then_some([error.re, error.im]),
                })
                .collect(),
        }
    }
}

impl fmt::Display for ModalSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

impl ModalSummary {
    fn text(&self) -> String {
        let (dof, modes) = (self.degrees_of_freedom, self.modes.len());
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        let freedom = if dof == 1 { "degree" } else { "degrees" };
        let linear_part = self
            .nonlinear_terms
            .iter()
            .map(|terms| format!("\nmodes of the linear part; the nonlinear terms are {terms}"));
        format!(
            "{}: {dof} {freedom} of freedom, {modes} mode{}{}\n\n{}{}\n{}",
            self.file,
            plural(modes),
            linear_part.collect::<String>(),
            self.mode_table(),
            self.instability(),
            shape_table(&self.modes, |at| self.name(at))
        ) + &self.backbone_table()
    }

    /// Returns the name of a degree of freedom, counted from 0.
    fn name(&self, dof: usize) -> String {
        let name = self.response_names.get(dof);
        name.map_or_else(|| format!("direction {}", dof + 1), Clone::clone)
    }

    /// Returns a line for each unstable mode, with a note if the interval of its growth rate
    /// contains zero.
    fn instability(&self) -> String {
        let line = |(number, mode): (usize, &ShapedMode)| {
            let rate = mode.row.growth_rate?;
            let [seconds, growth] = [rate.value.recip(), rate.value].map(|v| significant(v, 3));
            let error = rate.standard_error.map(|error| format!(" ± {}", significant(error, 2)));
            let doubt = if rate.interval.is_some_and(|[low, _]| low <= 0.0) {
                "; the interval of its growth rate contains zero"
            } else {
                ""
            };
            Some(format!(
                "mode {number} is unstable: its free response grows e-fold every {seconds} s, at \
                 {growth}{} 1/s{doubt}\n",
                error.unwrap_or_default()
            ))
        };
        let lines: String = (1..).zip(&self.modes).filter_map(line).collect();
        if lines.is_empty() { lines } else { format!("\n{lines}") }
    }

    fn backbone_table(&self) -> String {
        if self.backbone.is_empty() {
            return String::new();
        }
        let interval = format!("{} % interval", compact(100.0 * self.confidence, 3));
        let header = ["backbone: mode", "amplitude, m", "frequency", "standard error", &interval];
        let mut rows = vec![header.map(String::from).to_vec()];
        for row in &self.backbone {
            let mut cells = vec![row.mode.to_string(), significant(row.amplitude, 3)];
            cells.extend(row.frequency_hz.cells());
            cells.push("Hz".into());
            rows.push(cells);
        }
        rows[0].push("unit".into());
        format!("\n{}", text_table(&rows))
    }

    fn mode_table(&self) -> String {
        let interval = format!("{} % interval", compact(100.0 * self.confidence, 3));
        let header = ["mode", "value", "standard error", &interval, "unit"];
        let mut rows = vec![header.map(String::from).to_vec()];
        rows.extend(mode_cells(&ShapedMode::rows(&self.modes), true));
        text_table(&rows)
    }
}

/// Returns the entries of shapes as a table; `name` returns the channel of an entry, counted from
/// 0.
pub(crate) fn shape_table<'a>(
    modes: impl IntoIterator<Item = &'a ShapedMode>,
    name: impl Fn(usize) -> String,
) -> String {
    let header = ["shape", "modulus", "phase, °", "real part", "±", "imaginary part", "±"];
    let mut rows = vec![header.map(String::from).to_vec()];
    for (number, mode) in (1..).zip(modes) {
        for (at, entry) in mode.shape.iter().enumerate() {
            let [re, im] = entry.value;
            let error = |part: usize| {
                entry.standard_error.map_or("–".into(), |e| significant(e[part], 2))
            };
            rows.push(vec![
                format!("{number} {}", name(at)),
                significant(re.hypot(im), 5),
                format!("{:.1}", im.atan2(re).to_degrees()),
                format!("{re:.5}"),
                error(0),
                format!("{im:.5}"),
                error(1),
            ]);
        }
    }
    text_table(&rows)
}
