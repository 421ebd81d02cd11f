//! Geometry and shapes as datasets 164, 15, 82 and 55.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::geometry::{Geometry, PointShape};

/// Number of nodes per line of dataset 82.
const ON_LINE: usize = 8;

/// Returns points, lines and complex modes in SI units as datasets.
pub(crate) fn write_shapes(geometry: &Geometry, shapes: &[PointShape]) -> String {
    let mut text = String::new();
    let numbers = node_numbers(geometry);
    let one = "  1.00000000000000000D+00";
    let _ = writeln!(text, "    -1\n   164\n{:10}{:20}{:10}", 1, "SI: Meter (newton)", 2);
    let _ = writeln!(text, "{one}{one}{one}\n  2.73150000000000000D+02\n    -1");
    let _ = writeln!(text, "    -1\n    15");
    for (point, node) in geometry.points.iter().zip(&numbers) {
        let [x, y, z] = point.position.map(field);
        let _ = writeln!(text, "{node:10}{:10}{:10}{:10}{x}{y}{z}", 0, 0, 11);
    }
    let _ = writeln!(text, "    -1");
    if !geometry.lines.is_empty() {
        let chain = chain(geometry, &numbers);
        let _ = writeln!(text, "    -1\n    82\n{:10}{:10}{:10}\nNONE", 1, chain.len(), 11);
        for some in chain.chunks(ON_LINE) {
            let line: String = some.iter().map(|node| format!("{node:10}")).collect();
            let _ = writeln!(text, "{line}");
        }
        let _ = writeln!(text, "    -1");
    }
    for (number, shape) in (1..).zip(shapes) {
        mode(&mut text, number, shape, &numbers);
    }
    text
}

/// Appends one complex mode: structural model (1), complex eigenvalue (3), translations (2),
/// displacement (8), complex (5), three values at each node.
fn mode(text: &mut String, number: usize, shape: &PointShape, numbers: &[u32]) {
    let _ = writeln!(text, "    -1\n    55\nmode shape\nNONE\nNONE");
    let _ = writeln!(
        text,
        "mode {number}, {:.6e} Hz, damping ratio {:.6e}",
        shape.frequency_hz, shape.damping_ratio
    );
    let _ = writeln!(text, "NONE");
    let _ = writeln!(text, "{:10}{:10}{:10}{:10}{:10}{:10}", 1, 3, 2, 8, 5, 3);
    let _ = writeln!(text, "{:10}{:10}{:10}{number:10}", 2, 6, 1);
    let omega = TAU * shape.frequency_hz;
    let damped = omega * (1.0 - shape.damping_ratio.powi(2)).max(0.0).sqrt();
    let eigenvalue = [-shape.damping_ratio * omega, damped, 0.0, 0.0, 0.0, 0.0];
    let _ = writeln!(text, "{}", eigenvalue.map(field).concat());
    for (node, moved) in numbers.iter().zip(&shape.displacement) {
        let values: String = moved.iter().flatten().map(|value| field(*value)).collect();
        let _ = writeln!(text, "{node:10}\n{values}");
    }
    let _ = writeln!(text, "    -1");
}

/// Returns the numbers of the nodes: the names of the points if all names are positive whole
/// numbers, otherwise 1, 2, 3, ….
fn node_numbers(geometry: &Geometry) -> Vec<u32> {
    let named: Option<Vec<u32>> =
        geometry.points.iter().map(|point| point.name.parse().ok().filter(|n| *n > 0)).collect();
    named.unwrap_or_else(|| (1..).take(geometry.points.len()).collect())
}

/// Returns the lines as one trace line, interrupted by 0.
fn chain(geometry: &Geometry, numbers: &[u32]) -> Vec<u32> {
    let mut chain: Vec<u32> = Vec::new();
    for [a, b] in &geometry.lines {
        let (Some(a), Some(b)) = (numbers.get(*a), numbers.get(*b)) else { continue };
        if chain.last() != Some(a) {
            if !chain.is_empty() {
                chain.push(0);
            }
            chain.push(*a);
        }
        chain.push(*b);
    }
    chain
}

/// Returns a number in a field of 13 columns, in Fortran format E13.5.
fn field(value: f64) -> String {
    let text = format!("{value:.5e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or_default();
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{:>13}", format!("{digits}E{sign}{:02}", exponent.abs()))
}
