//! The force that was found, for people, for programs and as files.

use std::fmt::Write as _;
use std::path::Path;

use mechid::force::IdentifiedForce;
use mechid::io::{BegunFile, IoError};
use mechid::plot::{Axis, Color, Curve, Figure, Panel};
use mechid::signal::counted;
use serde::Serialize;

use super::method::{How, told};
use super::unexplained::Measured;
use crate::text_table::{compact, significant, text_table};

/// Everything `mechid force` has to say.
#[derive(Debug, Serialize)]
pub struct Report {
    pub file: String,
    pub machine: String,
    pub method: &'static str,
    pub why: String,
    pub samples: usize,
    /// Periods averaged; nothing for an open record.
    pub periods: Option<usize>,
    pub sample_rate_hz: f64,
    /// Whether the standard errors count the machine's own uncertainty.
    pub machine_uncertainty: bool,
    /// Whether they count the noise of the record.
    pub noise_uncertainty: bool,
    pub chosen: Vec<Chosen>,
    pub channels: Vec<Measured>,
    pub forces: Vec<Force>,
    pub remarks: Vec<String>,
}

/// A parameter that the method chose.
#[derive(Debug, Serialize)]
pub struct Chosen {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
}

/// The force on one degree of freedom.
#[derive(Debug, Serialize)]
pub struct Force {
    /// Counted from 1.
    pub dof: usize,
    pub sought: bool,
    pub rms: f64,
    pub peak: f64,
    /// RMS of the standard error over the record; nothing where it is not known.
    pub standard_error: Option<f64>,
    pub strongest_hz: f64,
    /// Amplitude of the strongest line, in N.
    pub strongest_amplitude: f64,
}

impl Report {
    fn counts_machine_alone(&self) -> bool {
        self.machine_uncertainty && !self.noise_uncertainty
    }

    /// The report as a person reads it.
    pub fn text(&self) -> String {
        let rate = compact(self.sample_rate_hz, 8);
        let extent = match self.periods {
            None => "open record".into(),
            Some(1) => "one period".into(),
            Some(n) => format!("mean of {n} periods"),
        };
        let mut text =
            format!("{}: {} at {rate} Hz, {extent}\n", self.file, counted(self.samples, "sample"));
        let _ = writeln!(text, "machine: {}", self.machine);
        let _ = writeln!(text, "method: {}\n  because: {}", self.method, self.why);
        for Chosen { name, value, unit } in &self.chosen {
            let _ = writeln!(text, "  {name}: {}", told(*value, unit));
        }
        for channel in self.channels.iter().filter_map(Measured::text) {
            let _ = writeln!(text, "  {channel}");
        }
        let error = if self.counts_machine_alone() {
            "standard error of machine (N)"
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
                vec![format!("{}", force.dof), rms, error, peak, strongest]
            } else {
                vec![format!("{}", force.dof), "taken as zero".into()]
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

/// `base`, or `base_1`, `base_2` … where there are several.
fn name(base: &str, dof: usize, dofs: usize) -> String {
    if dofs == 1 { base.into() } else { format!("{base}_{}", dof + 1) }
}

/// The record as columns: force and, where known, its standard error, which without the noise is
/// that of the machine alone.
pub fn columns(force: &IdentifiedForce, counts_noise: bool) -> Vec<(String, &[f64])> {
    let dofs = force.record().channels();
    let mut columns: Vec<(String, &[f64])> =
        (0..dofs).map(|dof| (name("force", dof, dofs), force.record().channel(dof))).collect();
    if let Some(error) = force.standard_error() {
        let base = if counts_noise { "standard_error" } else { "standard_error_of_machine" };
        columns.extend((0..dofs).map(|dof| (name(base, dof, dofs), error.channel(dof))));
    }
    columns
}

/// Lines of a spectrum whose text is gathered before it is written.
const GATHERED: usize = 1024;

/// The file of the spectrum: frequency in Hz, then amplitude in N and phase in degrees of each
/// force; of the lines asked for, or of all.
pub fn spectrum_file(
    path: &Path,
    force: &IdentifiedForce,
    lines: Option<&[usize]>,
) -> Result<BegunFile, IoError> {
    let spectrum = force.spectrum();
    let all: Vec<usize> = (0..spectrum.len()).collect();
    let dofs = spectrum.channels();
    let mut file = BegunFile::begin(path)?;
    let mut text = String::from("frequency_hz");
    for dof in 0..dofs {
        let [amplitude, phase] = ["amplitude", "phase_deg"].map(|base| name(base, dof, dofs));
        let _ = write!(text, ",{amplitude},{phase}");
    }
    text.push('\n');
    for gathered in lines.unwrap_or(&all).chunks(GATHERED) {
        for &n in gathered {
            let _ = write!(text, "{:?}", spectrum.frequency_hz(n));
            for dof in 0..dofs {
                let line = spectrum.line(n, dof);
                let _ = write!(text, ",{:?},{:?}", line.norm(), line.arg().to_degrees());
            }
            text.push('\n');
        }
        file.append(&text)?;
        text.clear();
    }
    Ok(file)
}

/// Every sought force against time, with twice its standard error, above its spectrum.
pub fn figure(how: &How, force: &IdentifiedForce, sought: &[usize]) -> Figure {
    let (record, spectrum) = (force.record(), force.spectrum());
    let times: Vec<f64> = record.sampling().times().collect();
    let frequencies: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.frequency_hz(n)).collect();
    let mut figure = Figure::new(how.method).columns(sought.len());
    for &dof in sought {
        let values = record.channel(dof);
        let label = name("Force", dof, record.channels());
        let mut panel = Panel::new(Axis::linear("Time", "s"), Axis::linear(label, "N"));
        if let Some(error) = force.standard_error() {
            let error = error.channel(dof);
            let bound = |side: f64| -> Vec<f64> {
                values.iter().zip(error).map(|(f, e)| f + side * 2.0 * e).collect()
            };
            let label = if how.counts_noise {
                "± 2 standard errors"
            } else {
                "± 2 standard errors of the machine"
            };
            panel = panel.curve(Curve::band(label, &times, &bound(-1.0), &bound(1.0)));
        }
        figure = figure.panel(panel.curve(Curve::line("", &times, values).width(1.2)));
    }
    for &dof in sought {
        let lines: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.line(n, dof).norm()).collect();
        let label = name("Force amplitude", dof, record.channels());
        let panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear(label, "N"));
        let stems = Curve::stems("", &frequencies, &lines).color(Color::VERMILION);
        figure = figure.panel(panel.curve(stems));
    }
    figure
}
