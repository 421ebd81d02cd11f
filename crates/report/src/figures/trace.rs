//! Curves of complex frequency responses with a continuous phase.

use std::f64::consts::TAU;

use mechid_plot::charts::FrequencyResponse;
use nalgebra::Complex;

/// A curve before it is drawn.
pub struct Trace {
    name: String,
    frequency_hz: Vec<f64>,
    magnitude: Vec<f64>,
    phase_deg: Vec<f64>,
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
    pub fn beside(
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

    /// Returns whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.magnitude.is_empty()
    }

    /// Returns the curve as a chart takes it.
    pub fn as_response(&self) -> FrequencyResponse<'_> {
        FrequencyResponse {
            name: &self.name,
            frequency: &self.frequency_hz,
            magnitude: &self.magnitude,
            phase_deg: &self.phase_deg,
        }
    }
}
