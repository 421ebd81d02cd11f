//! Dynamic stiffness of a bearing, and its coefficients as functions of speed.

use std::f64::consts::TAU;

use mechid_analysis::bearing::{BearingSummary, BearingTable};
use mechid_plot::{Axis, Curve, Figure, Panel, Reference};

use crate::page::short_names;

/// Half-width of a 95 % interval, in standard errors.
const NORMAL: f64 = 1.96;

/// Legend label of the confidence bands.
const INTERVAL: &str = "95 % interval";

/// Number of N/m in 1 MN/m.
const MEGA: f64 = 1e6;

/// Names of the entries of a 2×2 matrix.
const ENTRIES: [&str; 4] = ["xx", "xy", "yx", "yy"];

/// Returns a figure of the dynamic stiffness H: Re H against ω² and Im H against ω, direct and
/// cross-coupled entries, measured line by line with 95 % intervals, and fitted.
pub fn dynamic_stiffness(bearing: &BearingSummary) -> Figure {
    let omega: Vec<f64> =
        bearing.dynamic_stiffness.iter().map(|line| TAU * line.frequency_hz).collect();
    let coefficient = |kind: usize, entry: usize| {
        bearing.coefficients.get(4 * kind + entry).map_or(0.0, |row| row.estimate.value)
    };
    let mut panels = Vec::new();
    for (is_real, x_name, x_unit, y_name) in
        [(true, "ω²", "10⁶ rad²/s²", "Re H"), (false, "ω", "rad/s", "Im H")]
    {
        let x: Vec<f64> = omega.iter().map(|w| if is_real { w * w / 1e6 } else { *w }).collect();
        for (title, entries) in [("direct", [0, 3]), ("cross-coupled", [1, 2])] {
            let mut panel =
                Panel::new(Axis::linear(x_name, x_unit), Axis::linear(y_name, "MN/m")).title(title);
            for (slot, entry) in entries.into_iter().enumerate() {
                let lines = || bearing.dynamic_stiffness.iter();
                let y: Vec<f64> = lines()
                    .map(|line| if is_real { line.real[entry] } else { line.imaginary[entry] } / MEGA)
                    .collect();
                let errors: Option<Vec<f64>> = lines()
                    .map(|line| {
                        let of = if is_real {
                            line.standard_error_real
                        } else {
                            line.standard_error_imaginary
                        };
                        of.map(|errors| NORMAL * errors[entry] / MEGA)
                    })
                    .collect();
                if let Some(errors) = errors {
                    let edge = |sign: f64| -> Vec<f64> {
                        y.iter().zip(&errors).map(|(y, error)| y + sign * error).collect()
                    };
                    let label = if slot == 0 { INTERVAL } else { "" };
                    panel = panel.curve(Curve::band(label, &x, &edge(-1.0), &edge(1.0)).slot(slot));
                }
                let fit: Vec<f64> = omega
                    .iter()
                    .map(|w| {
                        let value = if is_real {
                            coefficient(0, entry) - w * w * coefficient(2, entry)
                        } else {
                            w * coefficient(1, entry)
                        };
                        value / MEGA
                    })
                    .collect();
                let name = ENTRIES[entry];
                panel = panel
                    .curve(Curve::points(format!("{name} measured"), &x, &y).slot(slot))
                    .curve(Curve::line(format!("{name} fitted"), &x, &fit).slot(slot));
            }
            panels.push(panel);
        }
    }
    let title = format!("Dynamic stiffness: {}", short_names(&bearing.tests));
    panels.into_iter().fold(Figure::new(title).columns(2), Figure::panel)
}

/// Returns stiffness, damping and, if it was identified, mass over the speed of rotation, with 95 %
/// intervals.
pub fn over_speed(table: &BearingTable) -> Figure {
    let speed = |row: &BearingSummary| row.rotation_hz.unwrap_or(0.0);
    let kinds = [("Stiffness", "MN/m", MEGA), ("Damping", "kN·s/m", 1e3), ("Mass", "kg", 1.0)];
    let mut figure = Figure::new("Bearing coefficients over speed");
    for (kind, (name, unit, scale)) in kinds.into_iter().enumerate() {
        let mut panel = Panel::new(Axis::linear("Rotation", "Hz"), Axis::linear(name, unit));
        let mut is_empty = true;
        for entry in 0..4 {
            let of = table
                .rows
                .iter()
                .filter_map(|row| Some((speed(row), row.coefficients.get(4 * kind + entry)?)));
            let (x, rows): (Vec<f64>, Vec<_>) = of.unzip();
            let Some(first) = rows.first() else { continue };
            is_empty = false;
            let label = first.name;
            let y: Vec<f64> = rows.iter().map(|row| row.estimate.value / scale).collect();
            let ends: Option<Vec<[f64; 2]>> =
                rows.iter().map(|row| row.estimate.interval).collect();
            if let Some(ends) = ends {
                let edge = |at: usize| -> Vec<f64> { ends.iter().map(|e| e[at] / scale).collect() };
                let label = if entry == 0 { INTERVAL } else { "" };
                panel = panel.curve(Curve::band(label, &x, &edge(0), &edge(1)).slot(entry));
            }
            panel = panel.curve(Curve::marked_line(label, &x, &y).slot(entry));
        }
        if !is_empty {
            figure = figure.panel(panel.reference(Reference::horizontal("", 0.0)));
        }
    }
    figure.share_x()
}
