//! Reconstructed forces over time and over frequency.

use mechid_analysis::Reconstructed;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use crate::page::short_names;

/// Returns every reconstructed force over time, with twice its standard error, above its spectrum.
pub fn figure(reconstructed: &Reconstructed) -> Figure {
    let (summary, sought) = (reconstructed.summary(), reconstructed.forced());
    let title = format!("{}: {}", short_names(std::slice::from_ref(&summary.file)), summary.method);
    let histories = sought.iter().map(|dof| history(reconstructed, *dof));
    let spectra = sought.iter().map(|dof| spectrum(reconstructed, *dof));
    let empty = Figure::new(title).columns(sought.len());
    histories.chain(spectra).fold(empty, Figure::panel)
}

/// Returns a separate figure for each force, by its name.
pub fn figures(reconstructed: &Reconstructed) -> Vec<(String, Figure)> {
    let of_force = |dof: &usize| {
        let figure = Figure::new("").panel(history(reconstructed, *dof));
        (name(reconstructed, *dof).to_owned(), figure.panel(spectrum(reconstructed, *dof)))
    };
    reconstructed.forced().iter().map(of_force).collect()
}

/// Returns the name of a force.
fn name(reconstructed: &Reconstructed, dof: usize) -> &str {
    reconstructed.summary().forces.get(dof).map_or("", |row| row.name.as_str())
}

fn history(reconstructed: &Reconstructed, dof: usize) -> Panel {
    let (force, summary) = (reconstructed.force(), reconstructed.summary());
    let times: Vec<f64> = force.record().sampling().times().collect();
    let values = force.record().channel(dof);
    let panel = Panel::new(Axis::linear("Time", "s"), Axis::linear(name(reconstructed, dof), "N"));
    let curve = Curve::line("", &times, values).width(1.2);
    let Some(error) = force.standard_error() else { return panel.curve(curve) };
    let error = error.channel(dof);
    let bound = |side: f64| -> Vec<f64> {
        values.iter().zip(error).map(|(f, e)| f + side * 2.0 * e).collect()
    };
    let label = if summary.noise_uncertainty {
        "± 2 standard errors"
    } else {
        "± 2 standard errors (machine only)"
    };
    panel.curve(Curve::band(label, &times, &bound(-1.0), &bound(1.0))).curve(curve)
}

fn spectrum(reconstructed: &Reconstructed, dof: usize) -> Panel {
    let spectrum = reconstructed.force().spectrum();
    let frequencies: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.frequency_hz(n)).collect();
    let lines: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.line(n, dof).norm()).collect();
    let label = format!("Amplitude of {}", name(reconstructed, dof));
    let panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear(label, "N"));
    panel.curve(Curve::stems("", &frequencies, &lines).color(Color::VERMILION))
}
