//! Noise of the outputs: a smooth spectrum per sensor, and unmeasured forces through the modes.
//!
//! e(ω) = Σ_r φ_r w_r(ω)/(jω − λ_r) + n(ω), with E|w_r|² = S_r and E|n_i|² = D_i(ω) smooth. A resonance is
//! a few lines wide, so that no smooth spectrum can follow the first term.
//!
//! # Source
//! Au, *Operational Modal Analysis* (2017), chapter 10 (likelihood of the lines of modal responses);
//! Harville, J. American Statistical Association 72 (1977) 320 (scoring of variance components).

use std::ops::Range;

use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use crate::dense::add_product;
use crate::limits::{
    EXPECTATION_STEPS, MIN_NOISE_WINDOW, NEGLIGIBLE_PROCESS_POWER, NOISE_WINDOW_SHARE,
};
use crate::lines::Lines;
use crate::model::Model;
use crate::projection::{Projection, Weights};
use crate::search::Fit;

type C = Complex<f64>;

/// Spectra of the noise of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Variance D_i of each sensor's noise on every line.
    pub(crate) sensor: Vec<Vec<f64>>,
    /// Variance S_r of the unmeasured force of each mode.
    pub(crate) process: Vec<f64>,
}

impl Noise {
    /// Estimates the noise from the residuals of a fit; `with_process` includes unmeasured forces.
    pub(crate) fn from_fit(fit: &Fit<'_>, with_process: bool) -> Self {
        let (lines, model) = (fit.lines, &fit.model);
        let residuals = Residuals::new(fit);
        let mut noise = Self { sensor: Vec::new(), process: vec![0.0; model.modes()] };
        noise.sensor = residuals.smooth_power(lines, residuals.power.clone());
        if with_process && model.modes() > 0 {
            let shapes = shapes(&fit.projection, &fit.weights, model.modes());
            for _ in 0..EXPECTATION_STEPS {
                let before = noise.process.clone();
                noise.score(lines, model, &shapes, &residuals);
                let power = noise.sensor_power(lines, model, &shapes, &residuals);
                noise.sensor = residuals.smooth_power(lines, power);
                if settled(&before, &noise.process) {
                    break;
                }
            }
        }
        noise
    }

    /// Returns the weights that one matrix for all outputs allows.
    ///
    /// The level of each output is that of its sensor; the common shape is the mean of the sensors'
    /// times 1 + Σ_r S_r |h_r|² φ_rᴴ D⁻¹ φ_r, the noise in the direction of the modes.
    pub(crate) fn weights(&self, lines: &Lines, model: &Model, shapes: &[Vec<C>]) -> Weights {
        let count = lines.len() as f64;
        let level: Vec<f64> =
            self.sensor.iter().map(|d| (d.iter().sum::<f64>() / count).sqrt()).collect();
        let value = |line: usize| {
            let sum: f64 = self.sensor.iter().zip(&level).map(|(d, l)| d[line] / (l * l)).sum();
            let mut factor = 1.0;
            for mode in (0..model.modes()).filter(|mode| self.process[*mode] > 0.0) {
                let gain = modal_gain(model.poles[mode], lines.omega[line]).norm_sqr();
                factor += self.process[mode] * gain * self.direction(&shapes[mode], line);
            }
            (sum / level.len() as f64 * factor).sqrt()
        };
        Weights { shape: (0..lines.len()).into_par_iter().map(value).collect(), level }
    }

    /// Returns φᴴ D⁻¹ φ on a line.
    pub(crate) fn direction(&self, shape: &[C], line: usize) -> f64 {
        shape.iter().zip(&self.sensor).map(|(z, d)| z.norm_sqr() / d[line]).sum()
    }

    /// Takes one scoring step of the variances of the unmeasured forces.
    fn score(&mut self, lines: &Lines, model: &Model, shapes: &[Vec<C>], residuals: &Residuals) {
        let modes = model.modes();
        let parts: Vec<(DVector<f64>, DMatrix<f64>)> = lines
            .blocks
            .par_iter()
            .map(|block| {
                let mut sums = (DVector::zeros(modes), DMatrix::zeros(modes, modes));
                for line in block.rows.clone() {
                    if let Some(local) = self.posterior(lines, model, shapes, residuals, line) {
                        local.add_score(&mut sums.0, &mut sums.1);
                    }
                }
                sums
            })
            .collect();
        let (mut score, mut information) = (DVector::zeros(modes), DMatrix::zeros(modes, modes));
        for (part, square) in &parts {
            score += part;
            information += square;
        }
        self.process = bounded_step(&self.process, &score, &information);
    }

    /// Returns the expected power of each sensor's own noise, given the residuals.
    fn sensor_power(
        &self,
        lines: &Lines,
        model: &Model,
        shapes: &[Vec<C>],
        residuals: &Residuals,
    ) -> Vec<Vec<f64>> {
        let outputs = self.sensor.len();
        let of_line = |line: usize| -> Vec<f64> {
            let Some(local) = self.posterior(lines, model, shapes, residuals, line) else {
                return (0..outputs).map(|output| residuals.power[output][line]).collect();
            };
            let (mean, spread) = local.forces();
            let value = |output: usize| {
                let gains: Vec<C> = local
                    .active
                    .iter()
                    .zip(&local.gains)
                    .map(|(mode, gain)| shapes[*mode][output] * gain)
                    .collect();
                let explained: C = gains.iter().zip(mean.iter()).map(|(g, w)| g * w).sum();
                let mut variance = 0.0;
                for (a, ga) in gains.iter().enumerate() {
                    for (b, gb) in gains.iter().enumerate() {
                        variance += (ga * spread[(a, b)] * gb.conj()).re;
                    }
                }
                (residuals.error[output][line] - explained).norm_sqr() + variance
            };
            (0..outputs).map(value).collect()
        };
        let rows: Vec<Vec<f64>> = (0..lines.len()).into_par_iter().map(of_line).collect();
        (0..outputs).map(|output| rows.iter().map(|row| row[output]).collect()).collect()
    }

    /// Returns what the residuals of a line say of the unmeasured forces of the modes near it.
    fn posterior(
        &self,
        lines: &Lines,
        model: &Model,
        shapes: &[Vec<C>],
        residuals: &Residuals,
        line: usize,
    ) -> Option<Posterior> {
        let omega = lines.omega[line];
        let is_near = |mode: &usize| {
            let gain = modal_gain(model.poles[*mode], omega).norm_sqr();
            let relative = gain * model.poles[*mode].re.powi(2);
            let process = self.process[*mode];
            relative > NEGLIGIBLE_PROCESS_POWER
                || process > 0.0
                    && process * gain * self.direction(&shapes[*mode], line)
                        > 10.0 * NEGLIGIBLE_PROCESS_POWER
        };
        let active: Vec<usize> = (0..model.modes()).filter(is_near).collect();
        if active.is_empty() {
            return None;
        }
        let gains: Vec<C> =
            active.iter().map(|mode| modal_gain(model.poles[*mode], omega)).collect();
        let size = active.len();
        let mut information = DMatrix::zeros(size, size);
        let mut seen = DVector::zeros(size);
        for (output, sensor) in self.sensor.iter().enumerate() {
            let precision = 1.0 / sensor[line];
            for a in 0..size {
                let left = (shapes[active[a]][output] * gains[a]).conj() * precision;
                seen[a] += left * residuals.error[output][line];
                for b in 0..size {
                    information[(a, b)] += left * shapes[active[b]][output] * gains[b];
                }
            }
        }
        let process = active.iter().map(|mode| self.process[*mode]).collect();
        Some(Posterior { active, gains, process, information, seen })
    }
}

/// Modes near a line, with BᴴD⁻¹B and BᴴD⁻¹e for B = φ_r h_r.
struct Posterior {
    active: Vec<usize>,
    gains: Vec<C>,
    process: Vec<f64>,
    information: DMatrix<C>,
    seen: DVector<C>,
}

impl Posterior {
    /// Returns I + (BᴴD⁻¹B) S.
    fn mixing(&self) -> DMatrix<C> {
        let size = self.active.len();
        let mut mixing = self.information.clone();
        for (mut column, process) in mixing.column_iter_mut().zip(&self.process) {
            column *= C::from(*process);
        }
        mixing + DMatrix::identity(size, size)
    }

    /// Adds |b_rᴴV⁻¹e|² − b_rᴴV⁻¹b_r and |b_rᴴV⁻¹b_s|², V the covariance of the line.
    fn add_score(&self, score: &mut DVector<f64>, information: &mut DMatrix<f64>) {
        let factor = self.mixing().lu();
        let (Some(square), Some(along)) =
            (factor.solve(&self.information), factor.solve(&self.seen))
        else {
            return;
        };
        for (a, r) in self.active.iter().enumerate() {
            score[*r] += along[a].norm_sqr() - square[(a, a)].re;
            for (b, s) in self.active.iter().enumerate() {
                information[(*r, *s)] += square[(a, b)].norm_sqr();
            }
        }
    }

    /// Returns mean and covariance of the unmeasured forces, given the residuals.
    fn forces(&self) -> (DVector<C>, DMatrix<C>) {
        let size = self.active.len();
        let Some(along) = self.mixing().lu().solve(&self.seen) else {
            return (DVector::zeros(size), DMatrix::zeros(size, size));
        };
        let Some(square) = self.mixing().lu().solve(&self.information) else {
            return (DVector::zeros(size), DMatrix::zeros(size, size));
        };
        let mean = DVector::from_fn(size, |a, _| along[a] * self.process[a]);
        let spread = DMatrix::from_fn(size, size, |a, b| {
            let prior = if a == b { self.process[a] } else { 0.0 };
            C::from(prior) - square[(a, b)] * self.process[a] * self.process[b]
        });
        (mean, spread)
    }
}

/// Residuals in the units of the outputs, corrected for what the fit has absorbed of the noise.
struct Residuals {
    error: Vec<Vec<C>>,
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
                    let rest = (1.0 - leverage[row] - searched).max(0.05).sqrt();
                    let scale = fit.weights.level[output] / (arrays.weight[line] * rest);
                    error[output][row] = C::new(real[line], imaginary[line]) * scale;
                }
            }
        }
        let powers = |error: &Vec<C>| error.iter().map(|z| z.norm_sqr()).collect();
        let power = error.iter().map(powers).collect();
        Self { error, power }
    }

    fn smooth_power(&self, lines: &Lines, power: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let records = record_rows(lines);
        power.into_par_iter().map(|power| smooth(&power, &records)).collect()
    }
}

/// Returns the rows of each record, or of neighbouring records with the same loads.
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

/// Moving mean within each record, with a window that shrinks at its ends.
fn smooth(power: &[f64], records: &[Range<usize>]) -> Vec<f64> {
    let mut mean = vec![0.0; power.len()];
    let total = power.iter().sum::<f64>() / power.len().max(1) as f64;
    let floor = total * 1e-12 + f64::MIN_POSITIVE;
    for rows in records {
        let (values, count) = (&power[rows.clone()], rows.len());
        let reach = ((count as f64 * NOISE_WINDOW_SHARE) as usize).max(MIN_NOISE_WINDOW);
        let mut sums = vec![0.0; count + 1];
        for (k, value) in values.iter().enumerate() {
            sums[k + 1] = sums[k] + value;
        }
        for k in 0..count {
            let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(count));
            mean[rows.start + k] = ((sums[to] - sums[from]) / (to - from) as f64).max(floor);
        }
    }
    mean
}

/// Returns the share of its noise that the fit absorbs on every line.
fn leverage(projection: &Projection) -> Vec<f64> {
    let size = projection.triangle.size;
    let mut inverse = vec![0.0; size * size];
    (0..size).for_each(|k| inverse[k * size + k] = 1.0);
    projection.triangle.solve(&mut inverse);
    let of_block = |arrays: &crate::projection::BlockArrays| -> Vec<f64> {
        let n = arrays.weight.len();
        let mut local = Vec::with_capacity(arrays.columns.len() * size);
        for column in inverse.chunks_exact(size.max(1)) {
            local.extend(arrays.columns.iter().map(|place| column[*place]));
        }
        let mut directions = vec![0.0; 2 * n * size];
        add_product(&mut directions, &arrays.design, &local, 2 * n, arrays.columns.len(), 1.0);
        let mut share = vec![0.0; n];
        for column in directions.chunks_exact(n) {
            share.iter_mut().zip(column).for_each(|(share, q)| *share += q * q / 2.0);
        }
        share
    };
    let parts: Vec<Vec<f64>> = projection.blocks.par_iter().map(of_block).collect();
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

/// Scoring step to variances that are not negative; those at zero that would fall stay there.
fn bounded_step(now: &[f64], score: &DVector<f64>, information: &DMatrix<f64>) -> Vec<f64> {
    let free: Vec<usize> = (0..now.len())
        .filter(|r| information[(*r, *r)] > 0.0 && (now[*r] > 0.0 || score[*r] > 0.0))
        .collect();
    let unit: Vec<f64> = free.iter().map(|r| 1.0 / information[(*r, *r)].sqrt()).collect();
    let square = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        information[(free[a], free[b])] * unit[a] * unit[b]
    });
    let right = DVector::from_fn(free.len(), |a, _| score[free[a]] * unit[a]);
    let mut next = now.to_vec();
    let step = square.cholesky().map_or_else(|| right.clone(), |factor| factor.solve(&right));
    for (a, r) in free.iter().enumerate() {
        next[*r] = (now[*r] + step[a] * unit[a]).max(0.0);
    }
    next
}

fn settled(before: &[f64], after: &[f64]) -> bool {
    before.iter().zip(after).all(|(a, b)| (a - b).abs() <= 0.01 * b.abs())
}
