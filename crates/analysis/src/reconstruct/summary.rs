//! The result of a force reconstruction.

use std::fmt::{self, Write as _};

use mechid_signal::message;
use serde::Serialize;

use super::options::Reconstruct;
use super::unexplained::Measured;
use crate::text::{compact, significant, text_table};

/// Result of a force reconstruction: numbers and remarks.
#[derive(Debug, Serialize)]
pub struct ForceSummary {
    /// The record.
    pub file: String,
    /// The machine.
    pub machine: String,
    /// Name of the method.
    pub method: &'static str,
    /// Reason for the method.
    pub why: String,
    /// Number of samples.
    pub samples: usize,
    /// Number of averaged periods; `None` for an open record.
    pub periods: Option<usize>,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
    /// `true` if the standard errors include the uncertainty of the machine.
    pub machine_uncertainty: bool,
    /// `true` if the standard errors include the noise of the record.
    pub noise_uncertainty: bool,
    /// Parameters that the method chose.
    pub chosen: Vec<Chosen>,
    /// Channels, one each.
    pub channels: Vec<Measured>,
    /// Lowest and highest frequency, in Hz, at which forces and standard errors are valid; `None`:
    /// all frequencies.
    pub band_hz: Option<[f64; 2]>,
    /// Forces, one per degree of freedom.
    pub forces: Vec<ForceRow>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: Reconstruct,
}

/// A parameter that the method chose.
#[derive(Debug, Serialize)]
pub struct Chosen {
    /// Name.
    pub name: String,
    /// Value, in its unit.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
}

/// The force on one degree of freedom.
#[derive(Debug, Serialize)]
pub struct ForceRow {
    /// Degree of freedom, counted from 1.
    pub dof: usize,
    /// Name of the force in the test that identified the system; without such a name, a number such
    /// as `force 1` for the first degree of freedom.
    pub name: String,
    /// `true` if the reconstruction of this force was requested.
    pub sought: bool,
    /// RMS value, in the unit of the channel.
    pub rms: f64,
    /// Largest magnitude, in the unit of the channel.
    pub peak: f64,
    /// RMS of the standard error over the record, in the unit of the channel; `None` if it is
    /// unknown.
    pub standard_error: Option<f64>,
    /// Frequency of the strongest line, in Hz.
    pub strongest_hz: f64,
    /// Amplitude of the strongest line, in N.
    pub strongest_amplitude: f64,
}

/// Minimum ratio of standard error to force, RMS values, for a remark: the record hardly determines
/// such a force.
const UNSURE: f64 = 0.5;

impl ForceRow {
    /// Returns a remark on a force whose standard error is of the order of the force; `None`
    /// otherwise.
    pub(super) fn doubt(&self) -> Option<String> {
        let share = self.standard_error? / self.rms;
        (self.sought && share > UNSURE).then(|| {
            format!(
                "the record hardly determines the force {}: its standard error is {} % of its RMS value. \
                 Possible causes: noise, sensors that are insensitive to the force, or a model of another machine",
                self.name,
                significant(100.0 * share, 2)
            )
        })
    }
}

impl ForceSummary {
    fn counts_machine_alone(&self) -> bool {
        self.machine_uncertainty && !self.noise_uncertainty
    }

    /// Returns the result as text for a reader.
    fn text(&self) -> String {
        let rate = compact(self.sample_rate_hz, 8);
        let extent = match self.periods {
            None => "open record".into(),
            Some(1) => "one period".into(),
            Some(n) => format!("mean of {n} periods"),
        };
        let mut text = format!(
            "{}: {} at {rate} Hz, {extent}\n",
            self.file,
            message::count(self.samples, "sample")
        );
        let _ = writeln!(text, "machine: {}", self.machine);
        let _ = writeln!(text, "method: {}\n  because: {}", self.method, self.why);
        for Chosen { name, value, unit } in &self.chosen {
            let _ = writeln!(text, "  {name}: {}", with_unit(*value, unit));
        }
        for channel in self.channels.iter().filter_map(Measured::text) {
            let _ = writeln!(text, "  {channel}");
        }
        if let Some(band) = self.band_hz {
            let [low, high] = band.map(|hz| significant(hz, 4));
            let _ = writeln!(text, "  force and standard error: from {low} to {high} Hz");
        }
        let error = if self.counts_machine_alone() {
            "standard error, machine only (N)"
        } else {
            "standard error (N)"
        };
        let header = ["force", "RMS (N)", error, "peak (N)", "strongest line"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for force in &self.forces {
            let error = match force.standard_error {
                Some(error) if force.sought => significant(error, 2),
                _ => "not known".into(),
            };
            let strongest = format!(
                "{} N at {} Hz",
                significant(force.strongest_amplitude, 4),
                compact(force.strongest_hz, 5)
            );
            rows.push(if force.sought {
                let [rms, peak] = [force.rms, force.peak].map(|value| significant(value, 4));
                vec![force.name.clone(), rms, error, peak, strongest]
            } else {
                vec![force.name.clone(), "taken as zero".into()]
            });
        }
        let _ = write!(text, "\n{}", text_table(&rows));
        let notes: String = self.remarks.iter().map(|r| format!("note: {r}\n")).collect();
        if !notes.is_empty() {
            let _ = write!(text, "\n{notes}");
        }
        text
    }
}

impl fmt::Display for ForceSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}

/// Returns a value with its unit, to four significant digits, or in full if it is a whole number.
fn with_unit(value: f64, unit: &str) -> String {
    let number = if value.fract() == 0.0 && value.abs() < 1e6 {
        format!("{value}")
    } else {
        significant(value, 4)
    };
    format!("{number} {unit}").trim_end().into()
}
