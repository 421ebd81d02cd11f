//! Score and information about the unmeasured forces on the modes near a line, from the residuals
//! of this line.

use nalgebra::Complex;

use crate::limits::{NEAR_PROCESS_POWER, NEAR_RESONANCE};
use crate::lines::Lines;
use crate::model::Model;
use crate::noise::{Noise, Residuals, modal_gain};

type C = Complex<f64>;

/// Sums over the lines for the unmeasured force of one mode.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ForceSums {
    /// Derivative of the log-likelihood with respect to ln S_r: Σ S_r (|b_rᴴV⁻¹e|² − b_rᴴV⁻¹b_r),
    /// with the response b_r to a unit force on mode r, the residual e and its covariance V.
    pub(crate) score: f64,
    /// Information about ln S_r, including the part shared with other forces: Σ_s Σ S_r S_s
    /// |b_rᴴV⁻¹b_s|².
    pub(crate) information: f64,
    /// Largest fraction, over the lines, that the force contributes to the noise in the direction
    /// of its response, from 0 to 1.
    pub(crate) largest_share: f64,
}

impl ForceSums {
    /// Adds the sums of other lines.
    pub(crate) fn add(&mut self, other: &Self) {
        self.score += other.score;
        self.information += other.information;
        self.largest_share = self.largest_share.max(other.largest_share);
    }

    /// Returns the degrees of freedom of the noise estimate at the resonance.
    ///
    /// The variance of ln S_r is 1/information. The logarithm of an estimate with ν degrees of
    /// freedom has the variance 2/ν. Only the part of the noise that the force causes has this
    /// uncertainty.
    ///
    /// # Source
    /// Satterthwaite (1946), Biometrics Bulletin 2, 110–114.
    pub(crate) fn degrees_of_freedom(&self) -> f64 {
        if self.largest_share > 0.0 {
            2.0 * self.information / self.largest_share.powi(2)
        } else {
            f64::INFINITY
        }
    }
}

/// Data that define the posterior distribution of the unmeasured forces on a line.
#[derive(Clone, Copy)]
pub(crate) struct ForceModel<'a> {
    pub(crate) noise: &'a Noise,
    pub(crate) lines: &'a Lines,
    pub(crate) model: &'a Model,
    /// Shapes in the units of the outputs: `[mode][output]`.
    pub(crate) shapes: &'a [Vec<C>],
    pub(crate) residuals: &'a Residuals,
    /// Squared shapes weighted by the noise, φ_rᴴD⁻¹φ_r: `[mode · lines + line]`.
    pub(crate) directions: &'a [f64],
}

/// Modes near a line, with BᴴV⁻¹B and BᴴV⁻¹e. The columns of B are φ_r h_r with h_r = 1/(jω − λ_r),
/// e is the residual on the line, and V is its covariance. The memory is reused from line to line.
#[derive(Default)]
pub(crate) struct Posterior {
    active: Vec<usize>,
    gains: Vec<C>,
    process: Vec<f64>,
    /// Matrix BᴴV⁻¹B, with the entries `[a · size + b]`.
    information: Vec<C>,
    projected_error: Vec<C>,
    row: Vec<C>,
    parts: Vec<C>,
}

impl Posterior {
    /// Moves to a line and returns whether a mode is near this line.
    pub(crate) fn move_to(&mut self, forces: &ForceModel<'_>, line: usize) -> bool {
        let ForceModel { noise, lines, model, .. } = *forces;
        let omega = lines.omega[line];
        self.active.clear();
        self.gains.clear();
        self.process.clear();
        for (mode, (pole, process)) in model.poles.iter().zip(&noise.process).enumerate() {
            let gain = modal_gain(*pole, omega);
            let direction = forces.directions[mode * lines.len() + line];
            let power = gain.norm_sqr();
            if power * pole.re.powi(2) > NEAR_RESONANCE
                || process * power * direction > NEAR_PROCESS_POWER
            {
                self.active.push(mode);
                self.gains.push(gain);
                self.process.push(*process);
            }
        }
        let size = self.active.len();
        self.information.clear();
        self.information.resize(size * size, C::default());
        self.projected_error.clear();
        self.projected_error.resize(size, C::default());
        if size > 0 {
            self.add_sensors(noise, forces.shapes, forces.residuals, line);
            self.add_forces();
        }
        size > 0
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
                self.projected_error[a] += from * error;
                for (b, other) in self.active[..=a].iter().enumerate() {
                    self.information[a * size + b] += from * shapes[*other][output];
                }
            }
        }
        for a in 0..size {
            let gain = self.gains[a].conj();
            self.projected_error[a] *= gain;
            for b in 0..=a {
                let value = self.information[a * size + b] * gain * self.gains[b];
                self.information[a * size + b] = value;
                self.information[b * size + a] = value.conj();
            }
        }
    }

    /// Updates V = D to V = D + Σ S_r b_r b_rᴴ, one force after the other (Sherman & Morrison).
    fn add_forces(&mut self) {
        let size = self.active.len();
        let mut row = std::mem::take(&mut self.row);
        row.resize(size, C::default());
        for (r, process) in self.process.iter().enumerate().filter(|(_, process)| **process > 0.0) {
            row.copy_from_slice(&self.information[r * size..(r + 1) * size]);
            let factor = process / (1.0 + process * row[r].re);
            let projected = self.projected_error[r];
            for a in 0..size {
                let along = row[a].conj() * factor;
                self.projected_error[a] -= along * projected;
                let to = &mut self.information[a * size..(a + 1) * size];
                to.iter_mut().zip(&row).for_each(|(to, value)| *to -= along * value);
            }
        }
        self.row = row;
    }

    /// Adds score and information of this line for each force.
    pub(crate) fn add_powers(&self, sums: &mut [ForceSums]) {
        let size = self.active.len();
        for (a, mode) in self.active.iter().enumerate() {
            let row = &self.information[a * size..(a + 1) * size];
            let (process, sum) = (self.process[a], &mut sums[*mode]);
            sum.score += process * (self.projected_error[a].norm_sqr() - row[a].re);
            let shared = row.iter().zip(&self.process).map(|(i, other)| other * i.norm_sqr());
            sum.information += process * shared.sum::<f64>();
            sum.largest_share = sum.largest_share.max(process * row[a].re);
        }
    }

    /// Returns the expected power of the sensor noise of an output: |`error` − r|² plus the
    /// variance of r, where r is the most likely response to unmeasured forces.
    pub(crate) fn remaining_power(&mut self, shapes: &[Vec<C>], output: usize, error: C) -> f64 {
        let size = self.active.len();
        let parts = &mut self.parts;
        parts.clear();
        let forces = self.active.iter().zip(&self.gains).zip(&self.process);
        parts.extend(forces.map(|((mode, gain), process)| shapes[*mode][output] * gain * *process));
        let explained: C =
            parts.iter().zip(&self.projected_error).map(|(part, projected)| part * projected).sum();
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
