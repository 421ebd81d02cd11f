//! Magnitude, phase and coherence.

use std::f64::consts::TAU;

use mechid_analysis::FrfTable;
use mechid_plot::charts::Quantity;
use mechid_plot::{Axis, Curve, Figure, Panel};
use nalgebra::Complex;

use super::style::{FigureStyle, FrequencyScale};
use super::trace::Trace;

/// Magnitude above phase above coherence, one curve for every pair of motion and force.
pub fn figure(report: &FrfTable, style: FigureStyle) -> Figure {
    let alone = report.responses.len() == 1;
    let traces: Vec<Trace> = report
        .responses
        .iter()
        .map(|r| {
            let name = match alone {
                true => String::new(),
                false => report.pair(r),
            };
            let values = r.real.iter().zip(&r.imaginary).map(|(re, im)| Complex::new(*re, *im));
            let omega = report.frequency_hz.iter().map(|hz| hz * TAU);
            let points: Vec<(f64, Complex<f64>)> = omega.zip(values).collect();
            let errors = points.iter().zip(&r.standard_error);
            let errors = errors.filter(|((omega, h), _)| Trace::is_drawn(style, *omega, *h));
            let errors = errors.map(|(_, error)| *error).collect();
            Trace::line(style, name, points.into_iter()).standard_error(style, errors)
        })
        .collect();
    let name = match report.quantity.as_str() {
        "displacement" => "Receptance",
        "velocity" => "Mobility",
        _ => "Accelerance",
    };
    let title = format!("{}, {}", report.file, report.estimator);
    let frequency = style.frequency_axis(FrequencyScale::Linear);
    let mut coherence = Panel::new(frequency, Axis::linear("Coherence", "").range(0.0, 1.0));
    for c in &report.coherence {
        let name = match report.coherence.len() {
            1 => String::new(),
            _ => report.response_names[c.motion - 1].clone(),
        };
        // 0 Hz has no place on a logarithmic axis.
        let hidden = report.frequency_hz.iter().take_while(|hz| **hz <= 0.0).count();
        let (hz, values) = (&report.frequency_hz[hidden..], &c.values[hidden..]);
        coherence = coherence.curve(Curve::line(name, hz, values));
    }
    let quantity = Quantity::new(name, report.unit);
    style.chart(&title, FrequencyScale::Linear, quantity, [&[], &traces]).panel(coherence)
}
