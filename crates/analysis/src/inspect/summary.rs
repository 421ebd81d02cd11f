//! Summary of an inspected record: format, columns, time axis and channels.

use std::fmt;

use mechid_io::{Table, escaped};
use mechid_signal::message;
use serde::Serialize;

use super::InspectSettings;
use super::channel::{Channel, Cut, Period, SpectrumPeak};
use super::measured::Span;
use crate::text::{compact, significant, text_table};

/// Inventory of a record.
#[derive(Debug, Serialize)]
pub struct RecordSummary {
    /// The record.
    pub file: String,
    /// Format of the file.
    pub format: String,
    /// Number of columns.
    pub columns: usize,
    /// Number of samples of most columns.
    pub samples: usize,
    /// Window; `None` if no column can be shown.
    pub window: Option<WindowRow>,
    /// Time axis; `None` if it is unknown.
    pub sampling: Option<SamplingRow>,
    /// Channels, one each.
    pub channels: Vec<Channel>,
    /// Single numbers in the file.
    pub scalars: Vec<Scalar>,
    /// Remarks on the file and on its contents.
    pub remarks: Vec<String>,
    /// Columns not shown, each with the reason.
    pub left_out: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: InspectSettings,
}

/// The samples shown, counted from 1.
#[derive(Debug, Serialize)]
pub struct WindowRow {
    /// First sample, counted from 1.
    pub first_sample: usize,
    /// Last sample, counted from 1.
    pub last_sample: usize,
}

/// Time axis of the samples shown.
#[derive(Debug, Serialize)]
pub struct SamplingRow {
    /// Sampling rate, in Hz.
    pub rate_hz: f64,
    /// Sampling interval, in s.
    pub step_s: f64,
    /// Length, in s.
    pub duration_s: f64,
    /// Number in the file that states the rate or the step, such as `Fs = 25600`; `None` if the
    /// time axis has another source.
    pub stated_by: Option<String>,
}

/// A single number in the file.
#[derive(Debug, Serialize)]
pub struct Scalar {
    /// Name.
    pub name: String,
    /// Value, in its unit.
    pub value: f64,
}

impl WindowRow {
    fn new(start: usize, len: usize) -> Self {
        Self { first_sample: start + 1, last_sample: start + len }
    }
}

impl SamplingRow {
    fn new(dt: f64, len: usize, stated_by: Option<String>) -> Self {
        Self { rate_hz: 1.0 / dt, step_s: dt, duration_s: len as f64 * dt, stated_by }
    }
}

impl RecordSummary {
    /// Creates a summary without channels.
    pub(crate) fn begin(
        table: &Table,
        samples: usize,
        window: Option<Span>,
        sampling: Option<(f64, Option<String>)>,
        left_out: Vec<String>,
        settings: &InspectSettings,
    ) -> Self {
        let scalars = table.scalars().iter();
        Self {
            file: table.file().into(),
            format: table.format(),
            columns: table.width(),
            samples,
            window: window.map(|window| WindowRow::new(window.start, window.len)),
            sampling: sampling
                .zip(window)
                .map(|((dt, stated_by), window)| SamplingRow::new(dt, window.len, stated_by)),
            channels: Vec::new(),
            scalars: scalars
                .map(|(name, value)| Scalar { name: name.clone(), value: *value })
                .collect(),
            remarks: table.remarks().to_vec(),
            left_out,
            analysis: settings.clone(),
        }
    }

    fn text(&self) -> String {
        let mut text = format!(
            "{}: {}, {}, {}",
            self.file,
            self.format,
            message::count(self.columns, "column"),
            message::count(self.samples, "sample")
        );
        if let Some(WindowRow { first_sample, last_sample }) = &self.window {
            text += &format!("; shown: samples {first_sample} to {last_sample}");
        }
        text += &match &self.sampling {
            Some(s) => format!(
                "\n{} Hz, a step of {} s, {} s long{}\n",
                compact(s.rate_hz, 8),
                compact(s.step_s, 6),
                compact(s.duration_s, 6),
                s.stated_by.as_ref().map_or(String::new(), |number| format!(
                    "; from {number} in the file, no time column"
                ))
            ),
            None => "\nno time axis: give `time` or `sample_rate`\n".into(),
        };
        text += &self.levels();
        text += &self.lines();
        for (channel, Cut { level, samples }) in
            self.channels.iter().filter_map(|c| c.clipping.as_ref().map(|cut| (c, cut)))
        {
            text += &format!(
                "column {} is clipped at {}: {samples} samples have this value, always three or more in a row\n",
                channel.title(),
                significant(*level, 5)
            );
        }
        for Scalar { name, value } in &self.scalars {
            text += &format!("{} = {value:e}\n", escaped(name));
        }
        for remark in &self.remarks {
            text += &format!("{remark}\n");
        }
        for reason in &self.left_out {
            text += &format!("left out: {reason}\n");
        }
        text
    }

    fn levels(&self) -> String {
        if self.channels.is_empty() {
            return String::new();
        }
        let header = ["column", "mean", "RMS", "peak", "crest factor", "minimum", "maximum"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for c in &self.channels {
            let mut row = vec![c.title()];
            row.extend([c.mean, c.rms, c.peak].map(|v| significant(v, 5)));
            row.push(c.crest_factor.map_or("–".into(), |v| significant(v, 4)));
            row.extend([c.minimum, c.maximum].map(|v| significant(v, 5)));
            rows.push(row);
        }
        format!("\n{}\n", text_table(&rows))
    }

    fn lines(&self) -> String {
        if !self.channels.iter().any(|c| c.spectral) {
            return String::new();
        }
        let unit = if self.sampling.is_some() { "Hz" } else { "cycles/sample" };
        let mut rows = vec![
            [
                "column",
                "period, samples",
                "mismatch",
                &format!("strongest lines, {unit}: amplitude"),
            ]
            .map(String::from)
            .to_vec(),
        ];
        for c in self.channels.iter().filter(|c| c.spectral) {
            let (period, mismatch) = match &c.period {
                Some(Period { samples, mismatch, .. }) => {
                    (samples.to_string(), format!("{} %", significant(100.0 * mismatch, 3)))
                }
                None => ("–".into(), "–".into()),
            };
            let peaks: Vec<String> = c.spectrum_peaks.iter().map(SpectrumPeak::text).collect();
            rows.push(vec![
                format!("{} {}", c.column, escaped(&c.name)),
                period,
                mismatch,
                peaks.join(", "),
            ]);
        }
        format!("{}\n", text_table(&rows)).replace("\n\n\n", "\n\n")
    }
}

impl Channel {
    /// Returns number and name of the column, and its description in the file.
    pub fn title(&self) -> String {
        let about = if self.about.is_empty() {
            String::new()
        } else {
            format!(" ({})", escaped(&self.about))
        };
        format!("{} {}{about}", self.column, escaped(&self.name))
    }
}

impl SpectrumPeak {
    fn text(&self) -> String {
        let frequency = self.frequency_hz.unwrap_or(self.cycles_per_sample);
        format!("{}: {}", compact(frequency, 5), significant(self.amplitude, 3))
    }
}

impl fmt::Display for RecordSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}
