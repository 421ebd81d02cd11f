//! Frequency and damping of the modes of a nonlinear response as functions of their amplitude.

use mechid_analysis::decay;
use mechid_analysis::identify::rows::{CONFIDENCE, Uncertain};
use mechid_analysis::modal::BackboneRow;
use mechid_analysis::text::compact;
use mechid_plot::{Axis, Curve, Figure, Panel};

/// Returns a figure with one panel for each mode of a machine: the frequency against the amplitude,
/// with the confidence interval.
pub fn of_machine(title: &str, rows: &[BackboneRow]) -> Figure {
    let modes = rows.last().map_or(0, |row| row.mode);
    let panels = (1..=modes).map(|mode| {
        let of_mode: Vec<&BackboneRow> = rows.iter().filter(|row| row.mode == mode).collect();
        let amplitude: Vec<f64> = of_mode.iter().map(|row| row.amplitude).collect();
        let values: Vec<Uncertain> = of_mode.iter().map(|row| row.frequency_hz).collect();
        let axes = (
            Axis::linear("Amplitude of the fundamental", "m"),
            Axis::linear(format!("Frequency of mode {mode}"), "Hz"),
        );
        panel(axes, "free vibration without damping", &amplitude, &values)
    });
    panels.fold(Figure::new(title), Figure::panel)
}

/// Returns a figure of the frequency and the damping ratio of a free decay against the amplitude
/// (in `unit`), with confidence intervals.
pub fn of_decay(title: &str, row: &decay::BackboneRow, unit: &str) -> Figure {
    let amplitude: Vec<f64> = row.points.iter().map(|point| point.amplitude).collect();
    let frequency: Vec<Uncertain> = row.points.iter().map(|point| point.frequency_hz).collect();
    let damping: Vec<Uncertain> =
        row.points.iter().map(|point| point.damping_ratio.percent()).collect();
    let axis = || Axis::linear("Amplitude", unit);
    Figure::new(title)
        .panel(panel((axis(), Axis::linear("Frequency", "Hz")), "estimate", &amplitude, &frequency))
        .panel(panel((axis(), Axis::linear("Damping ratio", "%")), "", &amplitude, &damping))
        .share_x()
}

/// Returns a panel of values against the amplitude; it shows the intervals only if all intervals
/// are finite.
fn panel((x, y): (Axis, Axis), name: &str, amplitude: &[f64], values: &[Uncertain]) -> Panel {
    let panel = Panel::new(x, y);
    let finite = |value: &Uncertain| {
        value.interval.filter(|[low, high]| low.is_finite() && high.is_finite())
    };
    let intervals: Option<Vec<[f64; 2]>> = values.iter().map(finite).collect();
    let panel = match intervals {
        Some(intervals) => {
            let end = |at: usize| -> Vec<f64> { intervals.iter().map(|ends| ends[at]).collect() };
            let label = match name {
                "" => String::new(),
                _ => format!("{} % interval", compact(100.0 * CONFIDENCE, 3)),
            };
            panel.curve(Curve::band(label, amplitude, &end(0), &end(1)))
        }
        None => panel,
    };
    let values: Vec<f64> = values.iter().map(|value| value.value).collect();
    panel.curve(Curve::marked_line(name, amplitude, &values))
}
