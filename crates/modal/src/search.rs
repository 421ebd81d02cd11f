//! Damped Gauss–Newton steps of poles and participations, with bounded steps of the poles.

use mechid_numerics::time_limit;
use nalgebra::{Complex, DMatrix, DVector};

use crate::limits::{
    COST_TOLERANCE, LEAST_CURVATURE, MAX_DAMPING_INCREASES, MAX_DECAY_STEP,
    MAX_FREQUENCY_STEP_DAMPINGS, MAX_STEPS, MIN_FREQUENCY_STEP, ROUGH_COST_TOLERANCE, ROUGH_STEPS,
};
use crate::lines::Lines;
use crate::model::Model;
use crate::normal::NormalEquations;
use crate::projection::{Projection, Weights};

/// Model with its linear unknowns for given weights.
#[derive(Debug, Clone)]
pub(crate) struct Fit<'a> {
    pub(crate) lines: &'a Lines,
    pub(crate) model: Model,
    pub(crate) weights: Weights,
    pub(crate) projection: Projection,
    /// Steps taken so far.
    pub(crate) steps: usize,
}

impl<'a> Fit<'a> {
    /// Solves for the linear unknowns of a model.
    pub(crate) fn new(lines: &'a Lines, model: Model, weights: Weights) -> Self {
        let mut fit = Self { lines, model, weights, projection: Projection::default(), steps: 0 };
        fit.refresh();
        fit
    }

    /// Returns the sum of the squared whitened residuals.
    pub(crate) fn cost(&self) -> f64 {
        self.projection.cost
    }

    /// Whitens the data again and solves for the linear unknowns, after a change of weights or
    /// model.
    pub(crate) fn refresh(&mut self) {
        self.model.fix_gauge(self.lines);
        self.projection.whiten(self.lines, &self.weights);
        self.projection.solve(self.lines, &self.model);
    }

    /// Takes at most `MAX_STEPS` steps, until a step lowers the cost by less than `COST_TOLERANCE`.
    pub(crate) fn search(&mut self) {
        self.search_until(MAX_STEPS, COST_TOLERANCE, f64::INFINITY);
    }

    /// Takes a few steps; the result is accurate enough to estimate the noise and the number of
    /// modes.
    pub(crate) fn search_roughly(&mut self) {
        self.search_until(ROUGH_STEPS, ROUGH_COST_TOLERANCE, f64::INFINITY);
    }

    /// Takes a few steps, and ends early if the cost is unlikely to fall to `goal`.
    pub(crate) fn search_roughly_to(&mut self, goal: f64) {
        self.search_until(ROUGH_STEPS, ROUGH_COST_TOLERANCE, goal);
    }

    /// Takes at most `limit` steps, until a step lowers the cost by less than `tolerance` or the
    /// time limit is over. The search also ends if the cost would remain above `goal` even if every
    /// further step lowered the cost as much as the last step.
    fn search_until(&mut self, limit: usize, tolerance: f64, goal: f64) {
        if self.model.modes() == 0 {
            return;
        }
        let mut cost = self.cost();
        let mut damping = 1e-3;
        for further in (0..limit).rev() {
            if time_limit::is_over() {
                return;
            }
            let Some(next) = self.step(cost, &mut damping) else {
                self.projection.solve(self.lines, &self.model);
                return;
            };
            self.steps += 1;
            let decrease = cost - next;
            cost = next;
            if decrease < tolerance || cost - goal > further as f64 * decrease {
                return;
            }
        }
    }

    /// Takes one step that does not raise the cost, and returns the cost after the step.
    fn step(&mut self, cost: f64, damping: &mut f64) -> Option<f64> {
        let normal = NormalEquations::new(self.lines, &self.model, &self.projection);
        let before = self.model.clone();
        for _ in 0..MAX_DAMPING_INCREASES {
            if let Some(step) = damped_step(&normal, *damping) {
                self.model = moved(&before, self.lines, &step);
                let next = self.projection.solve(self.lines, &self.model);
                if next < cost * (1.0 + 1e-12) {
                    *damping /= 10.0;
                    return Some(next);
                }
            }
            *damping = damping.max(1e-6) * 8.0;
        }
        self.model = before;
        None
    }
}

/// Solves the damped normal equations, scaled to a unit diagonal.
fn damped_step(normal: &NormalEquations, damping: f64) -> Option<Vec<f64>> {
    let size = normal.size;
    let scale: Vec<f64> = (0..size)
        .map(|k| 1.0 / normal.curvature[k * size + k].max(LEAST_CURVATURE).sqrt())
        .collect();
    let mut scaled = DMatrix::from_fn(size, size, |row, column| {
        normal.curvature[column * size + row] * scale[row] * scale[column]
    });
    scaled.iter().all(|value| value.is_finite()).then_some(())?;
    for k in 0..size {
        scaled[(k, k)] += damping;
    }
    let right = DVector::from_fn(size, |k, _| normal.descent[k] * scale[k]);
    let solution = scaled.cholesky()?.solve(&right);
    Some(solution.iter().zip(&scale).map(|(value, scale)| value * scale).collect())
}

/// Returns the model after a step; the steps of the poles are bounded.
fn moved(model: &Model, lines: &Lines, step: &[f64]) -> Model {
    let mut model = model.clone();
    let loads = lines.loads.len();
    for mode in 0..model.modes() {
        let pole = model.poles[mode];
        let bound = (MAX_FREQUENCY_STEP_DAMPINGS * -pole.re / pole.im).max(MIN_FREQUENCY_STEP);
        let decay = step[2 * mode].clamp(-MAX_DECAY_STEP, MAX_DECAY_STEP).exp();
        let turn = step[2 * mode + 1].clamp(-bound, bound).exp();
        model.poles[mode] = Complex::new(pole.re * decay, pole.im * turn);
        for load in (0..loads).filter(|load| *load != model.gauge[mode]) {
            let pair = 2 * model.pair_of(mode, load, loads);
            model.participation[mode][load] += Complex::new(step[pair], step[pair + 1]);
        }
    }
    model
}
