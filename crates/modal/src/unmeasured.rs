//! What the residuals of one line say of the unmeasured forces of the modes near it.

use nalgebra::Complex;

use crate::limits::{NEAR_PROCESS_POWER, NEAR_RESONANCE};
use crate::lines::Lines;
use crate::model::Model;
use crate::noise::{Noise, Residuals, modal_gain};

type C = Complex<f64>;

/// Sums over the lines for the unmeasured force of one mode.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ForceSums {
    /// Σ |b_rᴴV⁻¹e|².
    pub(crate) seen: f64,
    /// Σ b_rᴴV⁻¹b_r, what the first is on average.
    pub(crate) expected: f64,
}

/// Modes near a line, with BᴴV⁻¹B and BᴴV⁻¹e for B = φ_r h_r and V the covariance of the line.
pub(crate) struct Posterior {
    active: Vec<usize>,
    gains: Vec<C>,
    process: Vec<f64>,
    /// `[a · size + b]`.
    information: Vec<C>,
    seen: Vec<C>,
}

impl Posterior {
    /// Returns what the residuals of a line say of the unmeasured forces of the modes near it;
    /// `None` if none is near.
    pub(crate) fn new(
        noise: &Noise,
        lines: &Lines,
        model: &Model,
        shapes: &[Vec<C>],
        residuals: &Residuals,
        line: usize,
    ) -> Option<Self> {
        let omega = lines.omega[line];
        let is_near = |mode: &usize| {
            let gain = modal_gain(model.poles[*mode], omega).norm_sqr();
            let process = noise.process[*mode];
            gain * model.poles[*mode].re.powi(2) > NEAR_RESONANCE
                || process > 0.0
                    && process * gain * noise.direction(&shapes[*mode], line) > NEAR_PROCESS_POWER
        };
        let active: Vec<usize> = (0..model.modes()).filter(is_near).collect();
        if active.is_empty() {
            return None;
        }
        let gains = active.iter().map(|mode| modal_gain(model.poles[*mode], omega)).collect();
        let process = active.iter().map(|mode| noise.process[*mode]).collect();
        let size = active.len();
        let information = vec![C::default(); size * size];
        let mut posterior =
            Self { active, gains, process, information, seen: vec![C::default(); size] };
        posterior.add_sensors(noise, shapes, residuals, line);
        posterior.add_forces();
        Some(posterior)
    }

    /// Sums BᴴD⁻¹B and BᴴD⁻¹e over the sensors.
    fn add_sensors(
        &mut self,
        noise: &Noise,
        shapes: &[Vec<C>],
        residuals: &Residuals,
        line: usize,
    ) {
        let size = self.active.len();
        for (sensor, (error, output)) in noise.sensor.iter().zip(residuals.error.iter().zip(0..)) {
            let (precision, error): (f64, C) = (1.0 / sensor[line], error[line]);
            for (a, mode) in self.active.iter().enumerate() {
                let from = shapes[*mode][output].conj() * precision;
                self.seen[a] += from * error;
                for (b, other) in self.active[..=a].iter().enumerate() {
                    self.information[a * size + b] += from * shapes[*other][output];
                }
            }
        }
        for a in 0..size {
            let gain = self.gains[a].conj();
            self.seen[a] *= gain;
            for b in 0..=a {
                let value = self.information[a * size + b] * gain * self.gains[b];
                self.information[a * size + b] = value;
                self.information[b * size + a] = value.conj();
            }
        }
    }

    /// Goes from V = D to V = D + Σ S_r b_r b_rᴴ, one force after the other (Sherman & Morrison).
    fn add_forces(&mut self) {
        let size = self.active.len();
        let mut row = vec![C::default(); size];
        for (r, process) in self.process.iter().enumerate().filter(|(_, process)| **process > 0.0) {
            row.copy_from_slice(&self.information[r * size..(r + 1) * size]);
            let factor = process / (1.0 + process * row[r].re);
            let seen = self.seen[r];
            for a in 0..size {
                let along = row[a].conj() * factor;
                self.seen[a] -= along * seen;
                let to = &mut self.information[a * size..(a + 1) * size];
                to.iter_mut().zip(&row).for_each(|(to, value)| *to -= along * value);
            }
        }
    }

    /// Adds what this line says of each force.
    pub(crate) fn add_powers(&self, sums: &mut [ForceSums]) {
        let size = self.active.len();
        for (a, mode) in self.active.iter().enumerate() {
            let (seen, expected) = (self.seen[a].norm_sqr(), self.information[a * size + a].re);
            let sum = &mut sums[*mode];
            sum.seen += seen;
            sum.expected += expected;
        }
    }

    /// Returns the expected power of what remains of an error when the unmeasured forces are taken
    /// off.
    pub(crate) fn remaining_power(
        &self,
        shapes: &[Vec<C>],
        output: usize,
        error: C,
        parts: &mut Vec<C>,
    ) -> f64 {
        let size = self.active.len();
        parts.clear();
        let forces = self.active.iter().zip(&self.gains).zip(&self.process);
        parts.extend(forces.map(|((mode, gain), process)| shapes[*mode][output] * gain * *process));
        let explained: C = parts.iter().zip(&self.seen).map(|(part, seen)| part * seen).sum();
        let mut variance = 0.0;
        for (a, part) in parts.iter().enumerate() {
            if self.process[a] > 0.0 {
                variance += part.norm_sqr() / self.process[a];
                let row = &self.information[a * size..(a + 1) * size];
                let sum: C = row.iter().zip(parts.iter()).map(|(i, b)| i * b.conj()).sum();
                variance -= (part * sum).re;
            }
        }
        (error - explained).norm_sqr() + variance.max(0.0)
    }
}
