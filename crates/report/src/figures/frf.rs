//! Magnitude, phase and coherence of frequency responses.

use std::f64::consts::TAU;

use mechid_analysis::FrfTable;
use mechid_analysis::frf::table::{Coherence, Response};
use mechid_model::ResponseQuantity;
use mechid_plot::{Axis, Curve, Figure, Panel};
use nalgebra::Complex;

use super::style::{FigureStyle, FrequencyScale, derivative, per_force};
use super::trace::Trace;
use crate::page::short_names;

/// Returns the title of the figure.
pub fn title(report: &FrfTable) -> String {
    let files: Vec<String> = report.records.iter().map(|record| record.file.clone()).collect();
    format!("{}, {}", short_names(&files), report.estimator)
}

/// Returns a figure of magnitude, phase and coherence, one below the other, with one curve for
/// every pair of response and force.
pub fn figure(report: &FrfTable, style: FigureStyle) -> Figure {
    let alone = report.responses.len() == 1;
    let name = |response: &Response| if alone { String::new() } else { report.pair(response) };
    let traces: Vec<Trace> = report
        .responses
        .iter()
        .map(|response| trace(report, response, name(response), style))
        .collect();
    let mut panel = coherence_panel(style);
    for coherence in &report.coherence {
        let name = match report.coherence.len() {
            1 => String::new(),
            _ => report.response_names[coherence.motion - 1].clone(),
        };
        panel = panel.curve(coherence_curve(report, coherence, name));
    }
    chart(report, &title(report), &traces, style).panel(panel)
}

/// Returns a separate figure for each pair, by its name, with the coherence of its response.
pub fn figures(report: &FrfTable, style: FigureStyle) -> Vec<(String, Figure)> {
    let of_pair = |response: &Response| {
        let trace = trace(report, response, String::new(), style);
        let figure = chart(report, "", &[trace], style);
        let of_motion = |coherence: &&Coherence| coherence.motion == response.motion;
        let figure = match report.coherence.iter().find(of_motion) {
            Some(coherence) => {
                let curve = coherence_curve(report, coherence, String::new());
                figure.panel(coherence_panel(style).curve(curve))
            }
            None => figure,
        };
        (report.pair(response), figure)
    };
    report.responses.iter().map(of_pair).collect()
}

fn trace(report: &FrfTable, response: &Response, name: String, style: FigureStyle) -> Trace {
    let shown = style.quantity.unwrap_or(measured(report));
    let values = response.real.iter().zip(&response.imaginary);
    let turned = |omega: f64| derivative(shown, omega) / derivative(measured(report), omega);
    let points: Vec<(f64, Complex<f64>)> = report
        .frequency_hz
        .iter()
        .map(|hz| hz * TAU)
        .zip(values)
        .map(|(omega, (re, im))| {
            let h = Complex::new(*re, *im);
            // Measured values are not converted, so that all digits stay.
            (omega, if shown == measured(report) { h } else { h * turned(omega) })
        })
        .collect();
    let errors = points.iter().zip(&response.standard_error);
    let errors = errors.filter(|((omega, h), _)| Trace::is_drawn(style, *omega, *h));
    let scale = |omega: f64| if shown == measured(report) { 1.0 } else { turned(omega).norm() };
    let errors = errors.map(|((omega, _), error)| error * scale(*omega)).collect();
    Trace::line(style, name, points.into_iter()).standard_error(style, errors)
}

fn measured(report: &FrfTable) -> ResponseQuantity {
    match report.quantity.as_str() {
        "displacement" => ResponseQuantity::Displacement,
        "velocity" => ResponseQuantity::Velocity,
        _ => ResponseQuantity::Acceleration,
    }
}

fn chart(report: &FrfTable, title: &str, traces: &[Trace], style: FigureStyle) -> Figure {
    let quantity = per_force(style.quantity.unwrap_or(measured(report)));
    style.chart(title, FrequencyScale::Linear, quantity, [&[], traces])
}

fn coherence_panel(style: FigureStyle) -> Panel {
    let frequency = style.frequency_axis(FrequencyScale::Linear);
    Panel::new(frequency, Axis::linear("Coherence", "").range(0.0, 1.05))
}

fn coherence_curve(report: &FrfTable, coherence: &Coherence, name: String) -> Curve {
    // A logarithmic axis cannot show 0 Hz.
    let hidden = report.frequency_hz.iter().take_while(|hz| **hz <= 0.0).count();
    Curve::line(name, &report.frequency_hz[hidden..], &coherence.values[hidden..])
}
