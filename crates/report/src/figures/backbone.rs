//! Frequency of the modes of a nonlinear system as a function of their amplitude.

use mechid_analysis::identify::rows::CONFIDENCE;
use mechid_analysis::modal::BackboneRow;
use mechid_analysis::text::compact;
use mechid_plot::{Axis, Curve, Figure, Panel};

/// Returns a panel for each mode: its frequency with the confidence interval.
pub fn figure(file: &str, rows: &[BackboneRow]) -> Figure {
    let modes = rows.last().map_or(0, |row| row.mode);
    let panels = (1..=modes).map(|mode| {
        let of_mode: Vec<&BackboneRow> = rows.iter().filter(|row| row.mode == mode).collect();
        let amplitude: Vec<f64> = of_mode.iter().map(|row| row.amplitude).collect();
        let of = |value: &dyn Fn(&BackboneRow) -> f64| -> Vec<f64> {
            of_mode.iter().map(|row| value(row)).collect()
        };
        let mut panel = Panel::new(
            Axis::linear("Amplitude of the fundamental", "m"),
            Axis::linear(format!("Frequency of mode {mode}"), "Hz"),
        );
        if of_mode.iter().all(|row| row.frequency_hz.interval.is_some()) {
            let bound = |end: usize| {
                of(&|row| row.frequency_hz.interval.map_or(row.frequency_hz.value, |i| i[end]))
            };
            let name = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
            panel = panel.curve(Curve::band(name, &amplitude, &bound(0), &bound(1)));
        }
        let values = of(&|row| row.frequency_hz.value);
        panel.curve(Curve::marked_line("free vibration without damping", &amplitude, &values))
    });
    panels.fold(Figure::new(format!("Backbone: {file}")), Figure::panel)
}
