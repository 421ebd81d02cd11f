//! Responses over frequency, measured and explained by modes.

use mechid_analysis::Modes;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

/// Points that a curve shows at most: more than it has dots.
const SHOWN: usize = 4000;

/// Root of the sum over all responses, each over its RMS in the band: measured, explained, and the
/// difference, with the natural frequencies.
pub fn figure(modes: &Modes) -> Figure {
    let spectrum = modes.spectrum();
    let step = spectrum.frequency_hz.len().div_ceil(SHOWN).max(1);
    let every = |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(step).collect() };
    let frequency = every(&spectrum.frequency_hz);
    let summary = modes.summary();
    let natural: Vec<f64> =
        summary.modes.iter().map(|m| m.mode.row.natural_frequency_hz.value).collect();
    let curve = |name: &str, values: &[f64]| Curve::line(name, &frequency, &every(values));
    let mut panel =
        Panel::new(Axis::linear("Frequency", "Hz"), Axis::log10("Responses over their RMS", ""))
            .curve(curve("measured", &spectrum.measured).color(Color::GREY).width(2.4));
    if !spectrum.modelled.is_empty() {
        panel = panel
            .curve(curve("modes", &spectrum.modelled).color(Color::VERMILION))
            .curve(curve("difference", &spectrum.residual));
    }
    let files: Vec<&str> = summary.records.iter().map(|record| record.file.as_str()).collect();
    Figure::new(files.join(", ")).panel(panel).mark_x("natural frequencies", &natural)
}
