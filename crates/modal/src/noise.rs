//! Noise of the outputs: a smooth spectrum for each sensor, and the response of the modes to
//! unmeasured forces.
//!
//! The noise is e(ω) = Σ_r φ_r w_r(ω)/(jω − λ_r) + n(ω), with the unmeasured force w_r on mode r
//! and the noise n_i of sensor i; E|w_r|² = S_r, and E|n_i|² = D_i(ω) is smooth. A resonance is
//! only a few lines wide, so a smooth spectrum cannot describe the first term.
//!
//! # Source
//! Au, *Operational Modal Analysis* (2017), chapter 10 (likelihood of the lines of modal
//! responses); Zhou, Hu, Zhou & Lange, J. Computational and Graphical Statistics 28 (2019) 350
//! (variance components).

use std::ops::Range;

use nalgebra::Complex;
use rayon::prelude::*;

use crate::dense::add_product;
use crate::limits::{LEAST_NOISE, MIN_NOISE_WINDOW, NOISE_WINDOW_SHARE, SCORING_STEPS};
use crate::lines::{Block, Lines};
use crate::model::Model;
use crate::projection::{Projection, Weights};
use crate::search::Fit;
use crate::unmeasured::{ForceModel, ForceSums, Posterior};

type C = Complex<f64>;

/// Noise of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Variance D_i of each sensor's noise on every line.
    pub(crate) sensor: Vec<Vec<f64>>,
    /// Variance S_r of the unmeasured force of each mode.
    pub(crate) process: Vec<f64>,
    /// Degrees of freedom of the estimate of each unmeasured force.
    pub(crate) process_freedom: Vec<f64>,
}

impl Noise {
    /// Estimates the noise from the residuals of a fit; `process` contains initial variances of the
    /// unmeasured forces, `None` ignores unmeasured forces.
    pub(crate) fn from_fit(fit: &Fit<'_>, process: Option<Vec<f64>>) -> Self {
        let (lines, model) = (fit.lines, &fit.model);
        let residuals = Residuals::new(fit);
        let (process_freedom, modes) = (vec![f64::INFINITY; model.modes()], model.modes());
        let mut noise = Self { sensor: Vec::new(), process: vec![0.0; modes], process_freedom };
        noise.sensor = residuals.smooth_power(lines, residuals.power.clone());
        let Some(before) = process.filter(|_| model.modes() > 0) else { return noise };
        let shapes = shapes(&fit.projection, &fit.weights, model.modes());
        noise.process = noise.initial_process(lines, model, &shapes, &residuals);
        if before.len() == model.modes() {
            for (first, before) in noise.process.iter_mut().zip(&before) {
                *first = before.max(LEAST_FIRST_PROCESS * *first);
            }
        }
        for _ in 0..SCORING_STEPS {
            let (sums, power) = noise.expectation(lines, model, &shapes, &residuals);
            let step = noise.improve_process(&sums);
            noise.process_freedom = sums.iter().map(ForceSums::degrees_of_freedom).collect();
            noise.sensor = residuals.smooth_power(lines, power);
            if step < SETTLED {
                break;
            }
        }
        noise
    }

    /// Returns the weights: a level of each output, and a spectral shape that all outputs share.
    ///
    /// The level of an output is the level of its sensor noise. The square of the common spectral
    /// shape is a product of two factors. The first is the mean over the outputs of the sensor
    /// noise power divided by the squared level. The second is 1 + Σ_r S_r |h_r|² φ_rᴴ D⁻¹ φ_r,
    /// where the sum is the noise in the direction of the modes.
    pub(crate) fn weights(&self, lines: &Lines, model: &Model, shapes: &[Vec<C>]) -> Weights {
        let count = lines.len() as f64;
        let directions = self.directions(shapes);
        let level: Vec<f64> =
            self.sensor.iter().map(|d| (d.iter().sum::<f64>() / count).sqrt()).collect();
        let value = |line: usize| {
            let sum: f64 = self.sensor.iter().zip(&level).map(|(d, l)| d[line] / (l * l)).sum();
            let mut factor = 1.0;
            for mode in (0..model.modes()).filter(|mode| self.process[*mode] > 0.0) {
                let gain = modal_gain(model.poles[mode], lines.omega[line]).norm_sqr();
                factor += self.process[mode] * gain * directions[mode * lines.len() + line];
            }
            (sum / level.len() as f64 * factor).sqrt()
        };
        Weights { spectrum_shape: (0..lines.len()).into_par_iter().map(value).collect(), level }
    }

    /// Returns φᴴ D⁻¹ φ on a line.
    fn direction(&self, shape: &[C], line: usize) -> f64 {
        shape.iter().zip(&self.sensor).map(|(z, d)| z.norm_sqr() / d[line]).sum()
    }

    /// Takes one scoring step of the logarithms of the variances of the unmeasured forces, and
    /// returns the largest change of a logarithm.
    ///
    /// The information about a force includes the part that it shares with other forces, so that
    /// the estimates of the forces on close modes do not overshoot together.
    fn improve_process(&mut self, sums: &[ForceSums]) -> f64 {
        let mut largest: f64 = 0.0;
        for (process, sum) in self.process.iter_mut().zip(sums) {
            if sum.information > 0.0 {
                let step = (sum.score / sum.information).clamp(-MAX_SCORING_STEP, MAX_SCORING_STEP);
                *process *= step.exp();
                largest = largest.max(step.abs());
            }
        }
        largest
    }

    /// Returns φ_rᴴ D⁻¹ φ_r of every mode and line: `[mode · lines + line]`.
    fn directions(&self, shapes: &[Vec<C>]) -> Vec<f64> {
        let (modes, lines) = (shapes.len(), self.sensor.first().map_or(0, Vec::len));
        let precision: Vec<f64> = self.sensor.iter().flatten().map(|d| 1.0 / d).collect();
        let outputs = self.sensor.len();
        let power = |k: usize| shapes[k / outputs][k % outputs].norm_sqr();
        let powers: Vec<f64> = (0..modes * outputs).map(power).collect();
        let mut directions = vec![0.0; modes * lines];
        add_product(&mut directions, &precision, &powers, lines, outputs, 1.0);
        directions
    }

    /// Returns the score and information of each unmeasured force, and the expected power of each
    /// sensor's noise, given the residuals.
    fn expectation(
        &self,
        lines: &Lines,
        model: &Model,
        shapes: &[Vec<C>],
        residuals: &Residuals,
    ) -> (Vec<ForceSums>, Vec<Vec<f64>>) {
        let directions = self.directions(shapes);
        let directions = directions.as_slice();
        let forces = ForceModel { noise: self, lines, model, shapes, residuals, directions };
        let block_expectation = |block: &Block| {
            let mut sums = vec![ForceSums::default(); model.modes()];
            let mut power: Vec<Vec<f64>> =
                residuals.power.iter().map(|power| power[block.rows.clone()].to_vec()).collect();
            let mut posterior = Posterior::default();
            for (k, line) in block.rows.clone().enumerate() {
                if posterior.move_to(&forces, line) {
                    posterior.add_powers(&mut sums);
                    for (output, power) in power.iter_mut().enumerate() {
                        let error = residuals.error[output][line];
                        power[k] = posterior.remaining_power(shapes, output, error);
                    }
                }
            }
            (sums, power)
        };
        let parts: Vec<_> = lines.blocks.par_iter().map(block_expectation).collect();
        let mut total = vec![ForceSums::default(); model.modes()];
        let mut powers = vec![Vec::with_capacity(lines.len()); self.sensor.len()];
        for (sums, power) in parts {
            for (total, part) in total.iter_mut().zip(&sums) {
                total.add(part);
            }
            powers.iter_mut().zip(&power).for_each(|(to, part)| to.extend_from_slice(part));
        }
        (total, powers)
    }

    /// Returns initial variances of the unmeasured forces: the power of the residuals along the
    /// shape of each mode near its resonance.
    fn initial_process(
        &self,
        lines: &Lines,
        model: &Model,
        shapes: &[Vec<C>],
        residuals: &Residuals,
    ) -> Vec<f64> {
        let initial_variance = |mode: usize| {
            let (pole, shape) = (model.poles[mode], &shapes[mode]);
            if !lines.contains(pole) {
                // If a mode is outside the band, its response in the band is smooth; the sensor
                // noise includes this response.
                return 0.0;
            }
            let nearest = lines.omega.iter().map(|w| (w - pole.im).abs()).fold(f64::MAX, f64::min);
            let half_width = (-pole.re).max(nearest);
            let (mut sum, mut count) = (0.0, 0.0);
            for line in 0..lines.len() {
                if (lines.omega[line] - pole.im).abs() <= half_width {
                    let along: C = (0..shape.len())
                        .map(|k| shape[k].conj() * residuals.error[k][line] / self.sensor[k][line])
                        .sum();
                    let gain = modal_gain(pole, lines.omega[line]).norm_sqr();
                    sum += along.norm_sqr() / self.direction(shape, line).powi(2) / gain;
                    count += 1.0;
                }
            }
            sum / count
        };
        (0..model.modes()).into_par_iter().map(initial_variance).collect()
    }
}

/// Residuals in the units of the outputs, corrected for the fraction of the noise that the fit
/// absorbs.
pub(crate) struct Residuals {
    pub(crate) error: Vec<Vec<C>>,
    power: Vec<Vec<f64>>,
}

impl Residuals {
    fn new(fit: &Fit<'_>) -> Self {
        let (lines, outputs) = (fit.lines, fit.lines.outputs.len());
        let leverage = leverage(&fit.projection);
        let searched = fit.model.parameters(lines) as f64 / (2 * lines.len() * outputs) as f64;
        let mut error = vec![vec![C::default(); lines.len()]; outputs];
        for (block, arrays) in lines.blocks.iter().zip(&fit.projection.blocks) {
            let n = block.len();
            for (output, column) in arrays.residual.chunks_exact(2 * n).enumerate() {
                let (real, imaginary) = column.split_at(n);
                for line in 0..n {
                    let row = block.rows.start + line;
                    let remaining = (1.0 - leverage[row] - searched).max(0.05).sqrt();
                    let scale = fit.weights.level[output] / (arrays.weight[line] * remaining);
                    error[output][row] = C::new(real[line], imaginary[line]) * scale;
                }
            }
        }
        let powers = |error: &Vec<C>| error.iter().map(|z| z.norm_sqr()).collect();
        let power = error.iter().map(powers).collect();
        Self { error, power }
    }

    /// Returns the noise spectrum of each output: a smooth spectrum or, if a spectrum is stated and
    /// more likely, the stated spectrum times a smooth factor.
    fn smooth_power(&self, lines: &Lines, power: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let records = record_rows(lines);
        let smoothed = |(at, power): (usize, Vec<f64>)| {
            let output = &lines.outputs[at];
            let level = output.iter().map(|z| z.norm_sqr()).sum::<f64>() / output.len() as f64;
            let floor = level * LEAST_NOISE * LEAST_NOISE;
            let plain = smooth(&power, &records, floor);
            let Some(stated) = lines.stated_noise.get(at) else { return plain };
            let ratios: Vec<f64> = power.iter().zip(stated).map(|(p, stated)| p / stated).collect();
            let factor = smooth(&ratios, &records, 0.0);
            let shaped = factor.iter().zip(stated).map(|(factor, stated)| factor * stated);
            let shaped: Vec<f64> = shaped.map(|variance| variance.max(floor)).collect();
            if deviance(&power, &shaped) < deviance(&power, &plain) { shaped } else { plain }
        };
        power.into_par_iter().enumerate().map(smoothed).collect()
    }
}

/// Returns −2 log L of circular normal noise with these powers and variances, up to a constant.
fn deviance(power: &[f64], variance: &[f64]) -> f64 {
    2.0 * power
        .iter()
        .zip(variance)
        .map(|(power, variance)| variance.ln() + power / variance)
        .sum::<f64>()
}

/// Returns the rows of each record; neighbouring records with the same loads count as one.
fn record_rows(lines: &Lines) -> Vec<Range<usize>> {
    let mut records: Vec<Range<usize>> = Vec::new();
    for (index, block) in lines.blocks.iter().enumerate() {
        let same = index > 0 && lines.blocks[index - 1].active == block.active;
        match records.last_mut().filter(|_| same) {
            Some(rows) => rows.end = block.rows.end,
            None => records.push(block.rows.clone()),
        }
    }
    records
}

/// Returns the minimum number of lines in the averaging window of a noise spectrum.
pub(crate) fn noise_window(lines: &Lines) -> usize {
    let window = |rows: Range<usize>| (2 * half_window(rows.len()) + 1).min(rows.len());
    record_rows(lines).into_iter().map(window).min().unwrap_or(0)
}

/// Returns the half-width, in lines, of the averaging window of a record.
fn half_window(lines: usize) -> usize {
    ((lines as f64 * NOISE_WINDOW_SHARE) as usize).max(MIN_NOISE_WINDOW)
}

/// Returns the moving mean within each record. Values below `floor` are raised to `floor`; the
/// window is cut at the ends of the record.
fn smooth(power: &[f64], records: &[Range<usize>], floor: f64) -> Vec<f64> {
    let mut mean = vec![0.0; power.len()];
    for rows in records {
        let (values, count) = (&power[rows.clone()], rows.len());
        let side = half_window(count);
        let mut sums = vec![0.0; count + 1];
        for (k, value) in values.iter().enumerate() {
            sums[k + 1] = sums[k] + value;
        }
        for k in 0..count {
            let (from, to) = (k.saturating_sub(side), (k + side + 1).min(count));
            mean[rows.start + k] = ((sums[to] - sums[from]) / (to - from) as f64).max(floor);
        }
    }
    mean
}

/// Returns the share of the noise that the fit absorbs on every line.
fn leverage(projection: &Projection) -> Vec<f64> {
    let size = projection.triangle.size;
    let mut inverse = vec![0.0; size * size];
    (0..size).for_each(|k| inverse[k * size + k] = 1.0);
    projection.triangle.solve(&mut inverse);
    let absorbed_share = |arrays: &crate::projection::BlockArrays| -> Vec<f64> {
        let n = arrays.weight.len();
        let mut local = Vec::with_capacity(arrays.columns.len() * size);
        for column in inverse.chunks_exact(size.max(1)) {
            local.extend(arrays.columns.iter().map(|index| column[*index]));
        }
        let mut directions = vec![0.0; 2 * n * size];
        add_product(&mut directions, &arrays.design, &local, 2 * n, arrays.columns.len(), 1.0);
        let mut share = vec![0.0; n];
        for column in directions.chunks_exact(n) {
            share.iter_mut().zip(column).for_each(|(share, q)| *share += q * q / 2.0);
        }
        share
    };
    let parts: Vec<Vec<f64>> = projection.blocks.par_iter().map(absorbed_share).collect();
    parts.concat()
}

/// Returns the shapes of the modes in the units of the outputs, `[mode][output]`.
pub(crate) fn shapes(projection: &Projection, weights: &Weights, modes: usize) -> Vec<Vec<C>> {
    let outputs = weights.level.len();
    let mut shapes = vec![vec![C::default(); outputs]; modes];
    for output in 0..outputs {
        let unknowns = projection.unknowns_of(output, weights);
        for (mode, shape) in shapes.iter_mut().enumerate() {
            shape[output] = C::new(unknowns[2 * mode], unknowns[2 * mode + 1]);
        }
    }
    shapes
}

/// Returns 1/(jω − λ).
pub(crate) fn modal_gain(pole: C, omega: f64) -> C {
    1.0 / (C::new(0.0, omega) - pole)
}

/// Largest step of the log variances of the unmeasured forces below which the scoring iteration
/// ends.
const SETTLED: f64 = 0.05;
/// Maximum step of the log variance of an unmeasured force. The variance of a force that does not
/// exist shrinks by the factor e in each step.
const MAX_SCORING_STEP: f64 = 1.0;
/// Minimum initial variance of an unmeasured force, relative to the estimate of this variance from
/// the residuals.
const LEAST_FIRST_PROCESS: f64 = 0.01;
