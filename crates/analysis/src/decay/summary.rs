//! Result of an analysis of a free decay.

use std::fmt::{self, Write as _};

use mechid_checks::limits::SIGNIFICANCE;
use mechid_estimate::IdentifiedMode;
use mechid_modal::free_decay::{DecayChannel, DecayMode, FreeDecayEstimate};
use mechid_model::ResponseQuantity;
use mechid_signal::message;
use serde::Serialize;

use super::DecaySettings;
use super::nonlinear::{BackboneRow, Harmonic};
use crate::AnalysisError;
use crate::identify::rows::{CONFIDENCE, ModeRow, Uncertain};
use crate::measurement::{Block, Measurement};
use crate::modal::{ShapedMode, shape_table};
use crate::text::{compact, significant, text_table};

/// Minimum number of cycles in the record for a reliable frequency and damping of a mode.
const FEW_CYCLES: f64 = 2.0;
/// Maximum ratio of the frequency of a mode to half the sampling rate; a mode above it may be an
/// alias.
const HIGH: f64 = 0.8;
/// Maximum damping ratio of an oscillation; a mode with a larger ratio may represent an overdamped
/// mode.
const HEAVY: f64 = 0.5;
/// Minimum share of the variance of a channel that the modes explain; a smaller share gets a
/// remark.
const EXPLAINED: f64 = 0.9;

/// Modes of a free response: numbers and remarks.
#[derive(Debug, Serialize)]
pub struct DecaySummary {
    /// The record.
    pub file: String,
    /// Kind of response.
    pub quantity: ResponseQuantity,
    /// SI unit of the response.
    pub unit: &'static str,
    /// First sample used, counted from 1.
    pub first_sample: usize,
    /// Last sample used, counted from 1.
    pub last_sample: usize,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
    /// `true` if the beginning was detected in the record and not given.
    pub release_found: bool,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Modes by rising frequency.
    pub modes: Vec<DecayModeRow>,
    /// Frequency and damping over amplitude of the strongest mode; `None` if linear modes describe
    /// the response better.
    pub backbone: Option<BackboneRow>,
    /// Time at which the response is excited again, in s from the first sample of the window;
    /// `None` if it is not.
    pub excited_again_s: Option<f64>,
    /// Fit of each channel.
    pub channels: Vec<DecayChannelRow>,
    /// Point of each channel, such as `12+Z`; empty if they are not stated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub response_names: Vec<String>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: DecaySettings,
}

/// One mode of a free response.
#[derive(Debug, Serialize)]
pub struct DecayModeRow {
    /// Frequencies, damping, pole and shape.
    #[serde(flatten)]
    pub mode: ShapedMode,
    /// Amplitude at the first sample, in the channel with the largest entry of the shape, in the
    /// unit of the response.
    pub amplitude: Uncertain,
    /// Phase at the first sample, in the channel with the largest entry of the shape, in degrees.
    pub phase_deg: f64,
    /// Ratio of the sum of squares of this mode to the sum of squares of all modes.
    pub energy_share: f64,
    /// `true` if the whole 95 % interval of the growth rate is below zero.
    pub decays: bool,
    /// Mode that has this mode as a harmonic; `None` if this mode is not a harmonic.
    pub harmonic: Option<Harmonic>,
}

/// Fit of one channel.
#[derive(Debug, Serialize)]
pub struct DecayChannelRow {
    /// Name of the column.
    pub column: String,
    /// Share of the variance that the modes explain, a ratio.
    pub explained: f64,
    /// Standard deviation of the residual, in the unit of the response.
    pub noise: f64,
    /// Order of the autoregression of the noise, 0 for white noise.
    pub noise_order: usize,
    /// Constant component of the channel, in the unit of the response.
    pub offset: f64,
    /// P-value, a probability, of the test that the residual is white, adjusted for the number of
    /// tests.
    pub whiteness_p_value: f64,
    /// Ratio of the mean square residual of the first samples to that of the other samples.
    pub onset_ratio: f64,
    /// P-value of `onset_ratio`: probability of a larger ratio by chance, adjusted for the number
    /// of tests.
    pub onset_p_value: f64,
}

impl DecaySummary {
    /// Returns the names of the entries of the shapes: the stated points, otherwise the columns.
    pub fn points(&self) -> Vec<String> {
        if self.response_names.is_empty() {
            self.channels.iter().map(|channel| channel.column.clone()).collect()
        } else {
            self.response_names.clone()
        }
    }

    /// Summarises an estimate that begins at `first_sample` of the record, counted from 1.
    pub(super) fn new(
        measurement: &Measurement,
        whole: &Block,
        kind: ResponseQuantity,
        first_sample: usize,
        estimate: &FreeDecayEstimate,
        how: &DecaySettings,
    ) -> Result<Self, AnalysisError> {
        let identified: Vec<IdentifiedMode> =
            estimate.modes().iter().map(|mode| mode.mode.clone()).collect();
        let rows = ModeRow::all(&identified, false)?;
        let modes = rows.into_iter().zip(estimate.modes()).map(|(row, mode)| {
            Ok(DecayModeRow {
                mode: ShapedMode::new(row, &mode.mode, false),
                amplitude: Uncertain::from_estimate(&mode.amplitude)?,
                phase_deg: mode.phase.to_degrees(),
                energy_share: mode.energy_share,
                decays: mode.decays(),
                harmonic: None,
            })
        });
        let columns = whole.names.response(kind);
        // The residual of missing modes must not be reported as a second hit.
        let may_be_more = how.modes.is_none() && estimate.modes().len() == how.max_modes;
        let mut summary = Self {
            file: whole.file.clone(),
            quantity: kind,
            unit: kind.unit(),
            first_sample,
            last_sample: first_sample + estimate.fitted().len() - 1,
            sample_rate_hz: measurement.sampling().rate_hz(),
            release_found: how.from_s.is_none(),
            confidence: CONFIDENCE,
            modes: modes.collect::<Result<_, AnalysisError>>()?,
            backbone: estimate.backbone().map(BackboneRow::new).transpose()?,
            excited_again_s: estimate.restart().filter(|_| !may_be_more).map(|at| {
                (first_sample - whole.first_sample + at) as f64 / measurement.sampling().rate_hz()
                    + how.from_s.unwrap_or(0.0)
            }),
            channels: channel_rows(columns, estimate.channels()),
            response_names: Vec::new(),
            remarks: whole.unit_notes(),
            analysis: *how,
        };
        summary.name_harmonics(&identified);
        summary.remarks.extend(summary.model_remarks());
        summary.remarks.extend(summary.channel_remarks());
        for (number, mode) in (1..).zip(estimate.modes()) {
            summary.remarks.extend(summary.mode_remarks(number, mode));
        }
        Ok(summary)
    }

    /// Returns remarks about the fit of the channels.
    fn channel_remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for channel in &self.channels {
            let column = &channel.column;
            if channel.whiteness_p_value < SIGNIFICANCE {
                remarks.push(format!(
                    "the residual of {column} is not white (p = {}): its standard errors are not \
                     reliable. Possible causes: a missing mode (`modes`), a nonlinearity, a force that \
                     still acts (begin later with `from`)",
                    significant(channel.whiteness_p_value, 2)
                ));
            }
            if channel.onset_p_value < SIGNIFICANCE {
                remarks.push(format!(
                    "the residual of the first samples of {column} has {} × the power of the other \
                     samples (p = {}): a force may still act there; begin later with `from`",
                    significant(channel.onset_ratio, 3),
                    significant(channel.onset_p_value, 2)
                ));
            }
            if channel.explained < EXPLAINED {
                remarks.push(format!(
                    "the modes explain {} % of the variance of {column}; the rest is noise, or a motion \
                     that is not a decaying oscillation, such as the response to forces that were not \
                     measured (`ambient`)",
                    significant(100.0 * channel.explained, 3)
                ));
            }
        }
        let coloured = self.channels.iter().filter(|c| c.noise_order > 0);
        let names = message::list(coloured.map(|c| &c.column), ", ", 6);
        if !names.is_empty() {
            remarks.push(format!(
                "the noise of {names} is coloured; the fit uses an autoregressive \
                 model of this noise, and the standard errors include it"
            ));
        }
        remarks
    }

    /// Returns remarks about a mode.
    fn mode_remarks(&self, number: usize, mode: &DecayMode) -> Vec<String> {
        let (hz, growth) = (mode.mode.damped_frequency_hz.value, mode.mode.growth_rate);
        let name = format!("mode {number} ({} Hz)", significant(hz, 4));
        let mut remarks = Vec::new();
        if !mode.decays() {
            remarks.push(format!(
                "{name} does not decay: its growth rate is {} ± {} 1/s. Possible causes: a steady \
                 disturbance (mains, a running machine), a lightly damped mode in a short record, \
                 or a force that still acts",
                significant(growth.value, 2),
                significant(growth.standard_error, 2)
            ));
        }
        let samples = self.last_sample + 1 - self.first_sample;
        let cycles = hz * samples as f64 / self.sample_rate_hz;
        if cycles < FEW_CYCLES {
            remarks.push(format!(
                "{name} has {} cycles in the record: it may be a drift, or a motion that does not oscillate",
                significant(cycles, 2)
            ));
        }
        if hz > 0.5 * HIGH * self.sample_rate_hz {
            remarks.push(format!(
                "{name} is near half the sampling rate, {} Hz: it may be the alias of a higher mode",
                compact(0.5 * self.sample_rate_hz, 6)
            ));
        }
        let zeta = mode.mode.damping_ratio.value;
        if zeta > HEAVY {
            remarks.push(format!(
                "{name} has a damping ratio of {} % and hardly oscillates: it may represent an overdamped \
                 mode, which is not part of the model",
                significant(100.0 * zeta, 2)
            ));
        }
        remarks
    }

    fn mode_table(&self) -> String {
        let header = [
            "mode",
            "frequency (Hz)",
            "±",
            "damping ratio (%)",
            "±",
            "energy (%)",
            &format!("amplitude ({})", self.unit),
        ];
        let mut rows = vec![header.map(String::from).to_vec()];
        for (number, row) in (1..).zip(&self.modes) {
            let [frequency, frequency_error, _] = row.mode.row.natural_frequency_hz.cells();
            let [damping, damping_error, _] = row.mode.row.damping_ratio.percent().cells();
            let [amplitude, ..] = row.amplitude.cells();
            let energy = significant(100.0 * row.energy_share, 3);
            let cells = [frequency, frequency_error, damping, damping_error, energy, amplitude];
            rows.push([vec![number.to_string()], cells.to_vec()].concat());
        }
        text_table(&rows)
    }

    fn channel_table(&self) -> String {
        let header =
            ["channel", "explained (%)", &format!("noise ({})", self.unit), "noise model (order)"];
        let mut rows = vec![header.map(String::from).to_vec()];
        rows.extend(self.channels.iter().map(|channel| {
            let order = match channel.noise_order {
                0 => "white".into(),
                order => order.to_string(),
            };
            let explained = significant(100.0 * channel.explained, 4);
            vec![channel.column.clone(), explained, significant(channel.noise, 3), order]
        }));
        text_table(&rows)
    }

    /// Returns the result as text for people.
    fn text(&self) -> String {
        let mut text = format!(
            "{}: {} of {}, samples {} to {} at {} Hz",
            self.file,
            self.quantity,
            message::count(self.channels.len(), "channel"),
            self.first_sample,
            self.last_sample,
            compact(self.sample_rate_hz, 8)
        );
        if self.release_found {
            let seconds = (self.first_sample - 1) as f64 / self.sample_rate_hz;
            let _ = write!(text, "; the decay begins at {} s", compact(seconds, 5));
        }
        let modes = message::count(self.modes.len(), "mode");
        let _ = write!(text, "\n{modes}; ± is one standard error\n\n{}\n", self.mode_table());
        if self.channels.len() > 1 {
            let columns: Vec<&str> = self.channels.iter().map(|c| c.column.as_str()).collect();
            let name = |at: usize| columns.get(at).map_or(String::new(), |c| (*c).to_owned());
            let _ = writeln!(text, "{}", shape_table(self.modes.iter().map(|row| &row.mode), name));
        }
        text += &self.backbone_table();
        text += &self.channel_table();
        let notes: String = self.remarks.iter().map(|remark| format!("note: {remark}\n")).collect();
        if !notes.is_empty() {
            let _ = write!(text, "\n{notes}");
        }
        text
    }
}

fn channel_rows(columns: &[String], channels: &[DecayChannel]) -> Vec<DecayChannelRow> {
    // All tests of all channels are one family for the adjustment of Holm.
    let raw = channels.iter().flat_map(|c| [c.whiteness.p_value, c.onset.p_value]);
    let adjusted = adjusted(&raw.collect::<Vec<f64>>());
    let rows = columns.iter().zip(channels).zip(adjusted.chunks_exact(2));
    let row = |((column, channel), p_values): ((&String, &DecayChannel), &[f64])| DecayChannelRow {
        column: column.clone(),
        explained: channel.explained,
        noise: channel.noise,
        noise_order: channel.noise_order,
        offset: channel.offset,
        whiteness_p_value: p_values[0],
        onset_ratio: channel.onset.ratio,
        onset_p_value: p_values[1],
    };
    rows.map(row).collect()
}

/// Returns p-values adjusted for the number of tests.
///
/// # Source
/// Holm (1979), Scandinavian Journal of Statistics 6, 65–70.
fn adjusted(raw: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..raw.len()).collect();
    order.sort_by(|a, b| raw[*a].total_cmp(&raw[*b]));
    let (mut adjusted, mut least) = (vec![1.0; raw.len()], 0.0_f64);
    for (rank, at) in order.into_iter().enumerate() {
        least = least.max((raw.len() - rank) as f64 * raw[at]).min(1.0);
        adjusted[at] = least;
    }
    adjusted
}

impl fmt::Display for DecaySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}
