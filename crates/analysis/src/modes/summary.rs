//! Result of a modal test with measured forces.

use std::fmt;

use mechid_io::FrequencyResponses;
use mechid_modal::ModalModel;
use mechid_signal::{Window, message};
use serde::Serialize;

use super::diagrams::Diagrams;
use super::settings::{ModalTest, ModesSettings};
use crate::hits::{self, HitRow};
use crate::identify::rows::{CONFIDENCE, Uncertain, WindowRow};
use crate::measurement::Block;
use crate::modal::{ShapeEntry, ShapedMode};
use crate::text::{compact, paged_table, significant, text_table};

/// Maximum damping ratio of a rejected candidate that has its own line in the printed result; a
/// candidate with a larger ratio represents modes outside the band.
const LIGHT: f64 = 0.3;

/// Decimal places of a phase, in degrees.
const PHASE_DECIMALS: usize = 0;

/// Modes of a structure under measured forces: numbers, checks and notes.
#[derive(Debug, Serialize)]
pub struct ModesSummary {
    /// Records, in the order in which they were given.
    pub records: Vec<RecordRow>,
    /// Hits of the records, if these were cut into hits.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hits: Vec<HitRow>,
    /// Names of the forces: their points if these are stated.
    pub inputs: Vec<String>,
    /// Responses.
    pub outputs: Vec<OutputRow>,
    /// Lowest and highest frequency used, in Hz.
    pub band_hz: [f64; 2],
    /// Number of spectral lines of all records together.
    pub lines: usize,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Modes by rising frequency.
    pub modes: Vec<ModalModeRow>,
    /// Modal assurance criterion of every pair of shapes, a pure number from 0 to 1; one row per
    /// mode.
    pub mac: Vec<Vec<f64>>,
    /// Standard error of each modal assurance criterion, a pure number; one row per mode.
    pub mac_standard_error: Vec<Vec<f64>>,
    /// Rejected candidates for modes.
    pub dropped: Vec<DroppedRow>,
    /// Sinusoids of nearby machines in the records of ambient tests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub harmonics: Vec<HarmonicRow>,
    /// Share of the variance that the model explains, averaged over the responses; `None` without
    /// forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance_explained: Option<f64>,
    /// Share of the variance that is predicted, averaged over the responses: at the end of the
    /// records by a fit to their beginning, or in other records; `None` without a validation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance_predicted: Option<f64>,
    /// Checks of the data and of the fit.
    pub checks: Vec<ModalCheck>,
    /// Stabilisation diagram and mode indicator, if they were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagrams: Option<Diagrams>,
    /// Frequency responses of modes and residual terms with the covariance of the modes, in SI
    /// units of outputs and forces; `None` without forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModalModel>,
    /// Notes to read before using the numbers.
    pub notes: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: ModesSettings,
}

/// A record of a modal test, or a table of frequency responses.
#[derive(Debug, Serialize)]
pub struct RecordRow {
    /// Name of the file.
    pub file: String,
    /// Samples used; `None` for a table.
    #[serde(flatten)]
    pub window: Option<WindowRow>,
    /// Frequencies of a table and their segments; `None` for a record.
    #[serde(flatten)]
    pub table: Option<TableRow>,
}

/// Frequencies and segments of a table of frequency responses.
#[derive(Debug, Serialize)]
pub struct TableRow {
    /// Number of frequencies.
    pub frequencies: usize,
    /// Segments over which the frequency responses were averaged; `None` if the table does not
    /// state them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<SegmentsRow>,
    /// Decay rate, in 1/s, that an exponential window adds to every mode, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub added_decay: Option<f64>,
}

/// Segments over which the frequency responses of a table were averaged.
#[derive(Debug, Serialize)]
pub struct SegmentsRow {
    /// Number of segments.
    pub count: usize,
    /// Number of samples of a segment.
    pub samples: usize,
    /// Window that weights the samples; `None` for whole periods.
    pub window: Option<Window>,
}

impl RecordRow {
    /// Returns the row of a record.
    pub(super) fn from_block(block: &Block) -> Self {
        Self { file: block.file.clone(), window: Some(WindowRow::from_block(block)), table: None }
    }

    /// Returns the row of a table.
    pub(super) fn from_table(table: &FrequencyResponses) -> Self {
        let segments = table.segments.map(|stated| SegmentsRow {
            count: stated.count,
            samples: stated.samples,
            window: stated.window,
        });
        let frequencies = table.frequency_hz.len();
        let row = TableRow { frequencies, segments, added_decay: table.added_decay };
        Self { file: table.file.clone(), window: None, table: Some(row) }
    }

    fn text(&self) -> String {
        let file = &self.file;
        match (&self.window, &self.table) {
            (Some(WindowRow { first_sample, last_sample, sample_rate_hz, .. }), _) => {
                let rate = compact(*sample_rate_hz, 6);
                format!("{file}: samples {first_sample} to {last_sample}, {rate} Hz\n")
            }
            (None, Some(TableRow { frequencies, segments: Some(segments), .. })) => {
                let SegmentsRow { count, samples, .. } = segments;
                let frequencies = message::count(*frequencies, "frequency");
                let segments = message::count(*count, "segment");
                format!("{file}: {frequencies}, averages of {segments} of {samples} samples\n")
            }
            (None, Some(TableRow { frequencies, .. })) => {
                format!("{file}: {}\n", message::count(*frequencies, "frequency"))
            }
            (None, None) => format!("{file}\n"),
        }
    }
}

/// One response.
#[derive(Debug, Serialize)]
pub struct OutputRow {
    /// Name of the column.
    pub column: String,
    /// SI unit; `None` if a table does not state the quantity.
    pub unit: Option<&'static str>,
    /// Share of the variance that the model explains in the band, a ratio; `None` without forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance_explained: Option<f64>,
    /// Share of the variance that a fit to the beginning of the records predicts at their end, a
    /// ratio; `None` without a validation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance_predicted: Option<f64>,
    /// Ratio of the RMS of the sensor noise to the RMS of the response, both in the band; `None`
    /// without forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_share: Option<f64>,
}

/// One mode.
#[derive(Debug, Clone, Serialize)]
pub struct ModalModeRow {
    /// Frequencies, damping, pole, and the shape with one entry per response.
    #[serde(flatten)]
    pub mode: ShapedMode,
    /// Participation of each force, scaled to 1 for the largest; empty without forces.
    pub participation: Vec<ShapeEntry>,
    /// Modal phase collinearity of the shape, a pure number: 1 if all entries are in phase or in
    /// opposite phase.
    pub phase_collinearity: f64,
    /// Standard error of the phase collinearity, a pure number; `None` if the errors of the shape
    /// are not known.
    pub phase_collinearity_standard_error: Option<f64>,
    /// Share of the motion of this mode due to the measured forces, a ratio; the rest is due to
    /// unmeasured forces. `None` without measured forces.
    pub driven_share: Option<f64>,
    /// Modal mass for the shape scaled to 1 at its largest entry, in kg; `None` without a driving
    /// point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modal_mass: Option<f64>,
    /// Standard error of the modal mass, in kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modal_mass_standard_error: Option<f64>,
    /// Shape with one entry per response, divided by the root of the modal mass, in kg^(−1/2);
    /// empty without a positive modal mass.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mass_normalised_shape: Vec<ShapeEntry>,
    /// Mass-normalised shape with one entry per force, at the point and in the direction of this
    /// force, in kg^(−1/2): by reciprocity, the shape at the points of a roving hammer. Empty
    /// without a positive modal mass.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mass_normalised_shape_at_forces: Vec<ShapeEntry>,
    /// Length of an ambient record in decay times of the mode, ζωT, a pure number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decay_times: Option<f64>,
}

/// A sinusoid in an ambient record.
#[derive(Debug, Clone, Serialize)]
pub struct HarmonicRow {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Probability that a record without a sinusoid has a line at least as strong as this one.
    pub p_value: f64,
}

/// A candidate that did not become a mode.
#[derive(Debug, Clone, Serialize)]
pub struct DroppedRow {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio, a pure number.
    pub damping_ratio: f64,
    /// Reason, in a sentence.
    pub reason: String,
}

/// One check of a modal test.
#[derive(Debug, Clone, Serialize)]
pub struct ModalCheck {
    /// Name of the check, in snake case.
    pub code: &'static str,
    /// `true` if the check passed.
    pub passed: bool,
    /// Number that decides the verdict, a ratio or a probability.
    pub value: f64,
    /// The finding, in a sentence.
    pub text: String,
}

impl ModesSummary {
    /// Returns the modes with their shapes and the names of the entries. The entries belong to the
    /// responses or, if there are more forces than responses, to the forces (by reciprocity).
    pub fn shapes(&self) -> (Vec<ShapedMode>, Vec<String>) {
        if self.inputs.len() <= self.outputs.len() {
            let modes = self.modes.iter().map(|row| row.mode.clone()).collect();
            return (modes, self.outputs.iter().map(|output| output.column.clone()).collect());
        }
        let at_forces = |row: &ModalModeRow| {
            let shape = row.participation.clone();
            ShapedMode { shape, ..row.mode.clone() }
        };
        (self.modes.iter().map(at_forces).collect(), self.inputs.clone())
    }

    fn heading(&self) -> String {
        let text = if self.hits.is_empty() {
            self.records.iter().map(RecordRow::text).collect()
        } else {
            let window = self.records.first().and_then(|record| record.window.as_ref());
            hits::heading(&self.hits, &compact(window.map_or(0.0, |w| w.sample_rate_hz), 6))
        };
        let [low, high] = self.band_hz.map(|hz| compact(hz, 5));
        let forces = match self.inputs.len() {
            0 if matches!(self.analysis.test, ModalTest::Decay { .. }) => {
                message::count(self.records.len(), "free decay")
            }
            0 => "forces not measured".into(),
            count => message::count(count, "force"),
        };
        text + &format!(
            "{forces}, {}; maximum likelihood, {} lines, {low} to {high} Hz; ± is one standard error\n",
            message::count(self.outputs.len(), "response"),
            self.lines
        )
    }

    fn mode_table(&self) -> String {
        let header = ["mode", "frequency (Hz)", "±", "damping ratio (%)", "±", "driven (%)"];
        let columns = if self.inputs.is_empty() { header.len() - 1 } else { header.len() };
        let mut rows = vec![header[..columns].iter().map(|cell| cell.to_string()).collect()];
        for (number, mode) in (1..).zip(&self.modes) {
            let mut row = vec![number.to_string()];
            row.extend(cells(&mode.mode.row.natural_frequency_hz));
            row.extend(cells(&mode.mode.row.damping_ratio.percent()));
            row.push(mode.driven_share.map_or("–".into(), |s| significant(100.0 * s, 4)));
            row.truncate(columns);
            rows.push(row);
        }
        text_table(&rows)
    }

    /// Returns a table of the magnitude and phase of every entry: of shapes by response, of
    /// participations by force.
    fn entries(
        &self,
        what: &str,
        names: &[String],
        of: fn(&ModalModeRow) -> &[ShapeEntry],
    ) -> String {
        let mut header = vec![what.to_owned()];
        header.extend((1..=self.modes.len()).map(|number| format!("mode {number}")));
        let mut rows = vec![header];
        for (at, name) in names.iter().enumerate() {
            let cell = |mode: &ModalModeRow| {
                let [re, im] = of(mode)[at].value;
                let phase = im.atan2(re).to_degrees();
                // A rounded phase of zero has no minus sign.
                let phase = if phase.abs() < 0.5 { 0.0 } else { phase };
                format!("{} ∠{phase:.PHASE_DECIMALS$}°", significant(re.hypot(im), 3))
            };
            rows.push([vec![name.clone()], self.modes.iter().map(cell).collect()].concat());
        }
        paged_table(&rows, 1)
    }

    fn output_table(&self) -> String {
        let predicted = self.variance_predicted.is_some();
        let mut header = vec!["response", "explained (%)", "noise (%)"];
        if predicted {
            header.insert(2, "predicted (%)");
        }
        let mut rows = vec![header.into_iter().map(String::from).collect::<Vec<_>>()];
        for output in &self.outputs {
            let percent = |share: f64, digits| significant(100.0 * share, digits);
            let mut row = vec![output.column.clone()];
            row.extend(output.variance_explained.map(|share| percent(share, 4)));
            row.extend(output.variance_predicted.map(|share| percent(share, 4)));
            row.extend(output.noise_share.map(|share| percent(share, 3)));
            rows.push(row);
        }
        text_table(&rows)
    }

    /// Returns a line for each rejected candidate in the band, and one line for all others, which
    /// are obviously not modes.
    fn dropped_lines(&self) -> String {
        let [low, high] = self.band_hz;
        let (inside, outside): (Vec<_>, Vec<_>) = self.dropped.iter().partition(|row| {
            (low..=high).contains(&row.frequency_hz) && row.damping_ratio <= LIGHT
        });
        let mut text = String::new();
        for DroppedRow { frequency_hz, damping_ratio, reason } in inside {
            let (hz, ratio) =
                (significant(*frequency_hz, 5), significant(100.0 * damping_ratio, 3));
            text += &format!("left out: {hz} Hz, {ratio} %: {reason}\n");
        }
        if !outside.is_empty() {
            text += &format!(
                "left out: {} outside of the band or too heavily damped for a mode\n",
                message::count(outside.len(), "candidate")
            );
        }
        text
    }

    fn check_lines(&self) -> String {
        let passed = self.checks.iter().filter(|check| check.passed).count();
        let mut text =
            format!("{passed} of {} passed\n", message::count(self.checks.len(), "check"));
        for check in self.checks.iter().filter(|check| !check.passed) {
            text += &format!("  warning: {}\n", check.text);
        }
        text
    }
}

impl fmt::Display for ModesSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outputs: Vec<String> =
            self.outputs.iter().map(|output| output.column.clone()).collect();
        write!(f, "{}\n{}", self.heading(), self.mode_table())?;
        if self.outputs.len() > 1 {
            write!(f, "\n{}", self.entries("shape", &outputs, |mode| &mode.mode.shape))?;
        }
        if self.inputs.len() > 1 {
            let inputs = self.entries("participation", &self.inputs, |mode| &mode.participation);
            write!(f, "\n{inputs}")?;
        }
        if self.variance_explained.is_some() {
            write!(f, "\n{}", self.output_table())?;
        }
        write!(f, "\n{}", self.check_lines())?;
        f.write_str(&self.dropped_lines())?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

/// Returns value and standard error; a dash if the record is too short for an interval.
fn cells(value: &Uncertain) -> [String; 2] {
    if value.standard_error.is_none() {
        return [significant(value.value, 4), "–".into()];
    }
    let [value, error, _] = value.cells();
    [value, error]
}

/// Level of the intervals of this result.
pub(super) const LEVEL: f64 = CONFIDENCE;
