//! Measured and fitted receptance.

use std::f64::consts::TAU;

use mechid::estimate::frequency_domain::FrequencyData;
use mechid::model::SecondOrderSystem;
use mechid::plot::charts::{FrequencyResponse, Quantity, bode};
use mechid::plot::{Axis, Figure};
use nalgebra::Complex;

use crate::error::CliError;

/// Points of a fitted curve.
const FINE: usize = 800;

/// A force counts as acting alone on a line if the others have less than this part of it.
const ALONE: f64 = 1e-3;

/// A curve before it is drawn.
pub struct Trace {
    name: String,
    frequency_hz: Vec<f64>,
    magnitude: Vec<f64>,
    phase_deg: Vec<f64>,
}

/// Magnitude and phase of x_i / F_j, measured and fitted, for every pair of degrees of freedom that
/// the record shows: on the lines where F_j acts alone.
///
/// # Errors
/// [`CliError::NothingToDraw`] if on every line several forces act at once.
pub fn receptance(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Figure, CliError> {
    let (mut measured, mut fitted) = (Vec::new(), Vec::new());
    for j in 0..data.dof() {
        let rows: Vec<usize> = (0..data.len()).filter(|row| acts_alone(data, *row, j)).collect();
        let omega: Vec<f64> = rows.iter().map(|row| data.omega()[*row]).collect();
        let fine = fine_grid(&omega);
        let receptances = system.receptances(&fine)?;
        for i in 0..data.dof().min(rows.len()) {
            let name = match data.dof() {
                1 => String::new(),
                _ => format!(" x{}/F{}", i + 1, j + 1),
            };
            let model = fine.iter().zip(&receptances).map(|(omega, h)| (*omega, h[(i, j)]));
            let model = Trace::continuous(format!("identified{name}"), model);
            let ratio = |row: usize| data.displacement()[(row, i)] / data.force()[(row, j)];
            let points = omega.iter().zip(&rows).map(|(omega, row)| (*omega, ratio(*row)));
            measured.push(Trace::beside(&model, format!("measured{name}"), points));
            fitted.push(model);
        }
    }
    if measured.is_empty() {
        return Err(CliError::NothingToDraw);
    }
    let [measured, fitted] = [&measured, &fitted]
        .map(|traces| traces.iter().map(Trace::as_response).collect::<Vec<_>>());
    let frequency = Axis::linear("Frequency", "Hz");
    Ok(bode(title, frequency, Quantity::new("Receptance", "m/N"), &measured, &fitted))
}

fn acts_alone(data: &FrequencyData, row: usize, j: usize) -> bool {
    let own = data.force()[(row, j)].norm();
    own > 0.0 && (0..data.dof()).all(|k| k == j || data.force()[(row, k)].norm() <= ALONE * own)
}

fn fine_grid(omega: &[f64]) -> Vec<f64> {
    let low = omega.iter().copied().fold(f64::INFINITY, f64::min);
    let high = omega.iter().copied().fold(0.0, f64::max);
    if low > high {
        return Vec::new();
    }
    (0..=FINE).map(|k| low + (high - low) * k as f64 / FINE as f64).collect()
}

/// The angle on the branch next to another one, both in degrees. Of two that are as near, as there
/// are where a machine without damping turns over, the smaller one, or −180° of ±180°.
fn next_to(other: f64, angle: f64) -> f64 {
    const ALIKE: f64 = 1e-6;
    let near = angle - 360.0 * ((angle - other) / 360.0).round();
    let beyond = near - (near - other).signum() * 360.0;
    let smaller = beyond.abs() < near.abs() - ALIKE;
    let negative = beyond.abs() < near.abs() + ALIKE && beyond < near;
    let as_near = (near - other).abs() > 180.0 - ALIKE;
    if as_near && (smaller || negative) { beyond } else { near }
}

impl Trace {
    /// The curve of points (ω, H) with a phase that never jumps.
    pub fn continuous(name: String, points: impl Iterator<Item = (f64, Complex<f64>)>) -> Self {
        let mut previous = 0.0;
        Self::with_phase(name, points, |_, angle| {
            previous = next_to(previous, angle);
            previous
        })
    }

    /// The points (ω, H) with their phases on the branch next to those of a curve.
    fn beside(
        curve: &Self,
        name: String,
        points: impl Iterator<Item = (f64, Complex<f64>)>,
    ) -> Self {
        Self::with_phase(name, points, |frequency_hz, angle| {
            let right = curve.frequency_hz.partition_point(|f| *f < frequency_hz);
            let at = right.min(curve.phase_deg.len().saturating_sub(1));
            next_to(curve.phase_deg.get(at).copied().unwrap_or(0.0), angle)
        })
    }

    /// Points of no magnitude cannot be drawn on a logarithmic axis and are left out.
    fn with_phase(
        name: String,
        points: impl Iterator<Item = (f64, Complex<f64>)>,
        mut phase: impl FnMut(f64, f64) -> f64,
    ) -> Self {
        let mut trace =
            Self { name, frequency_hz: Vec::new(), magnitude: Vec::new(), phase_deg: Vec::new() };
        for (omega, h) in points.filter(|(_, h)| h.norm() > 0.0) {
            trace.frequency_hz.push(omega / TAU);
            trace.magnitude.push(h.norm());
            trace.phase_deg.push(phase(omega / TAU, h.arg().to_degrees()));
        }
        trace
    }

    pub fn is_empty(&self) -> bool {
        self.magnitude.is_empty()
    }

    pub fn as_response(&self) -> FrequencyResponse<'_> {
        FrequencyResponse {
            name: &self.name,
            frequency: &self.frequency_hz,
            magnitude: &self.magnitude,
            phase_deg: &self.phase_deg,
        }
    }
}
