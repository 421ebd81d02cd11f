//! Reconstructed forces over time and over frequency.

use mechid_analysis::Reconstructed;
use mechid_analysis::reconstruct::numbered;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

/// Returns every reconstructed force over time, with twice its standard error, above its spectrum.
pub fn figure(reconstructed: &Reconstructed) -> Figure {
    let (summary, force, sought) =
        (reconstructed.summary(), reconstructed.force(), reconstructed.forced());
    let (record, spectrum) = (force.record(), force.spectrum());
    let times: Vec<f64> = record.sampling().times().collect();
    let frequencies: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.frequency_hz(n)).collect();
    let mut figure = Figure::new(summary.method).columns(sought.len());
    for &dof in sought {
        let values = record.channel(dof);
        let label = numbered("Force", dof, record.channels());
        let mut panel = Panel::new(Axis::linear("Time", "s"), Axis::linear(label, "N"));
        if let Some(error) = force.standard_error() {
            let error = error.channel(dof);
            let bound = |side: f64| -> Vec<f64> {
                values.iter().zip(error).map(|(f, e)| f + side * 2.0 * e).collect()
            };
            let label = if summary.noise_uncertainty {
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
        let label = numbered("Force amplitude", dof, record.channels());
        let panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear(label, "N"));
        let stems = Curve::stems("", &frequencies, &lines).color(Color::VERMILION);
        figure = figure.panel(panel.curve(stems));
    }
    figure
}
