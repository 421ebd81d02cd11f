//! System and forces as one state space, and the force model of maximum likelihood.

use std::f64::consts::{PI, TAU};

use mechid_model::{ResponseQuantity, SecondOrderSystem, StateTransition};
use mechid_numerics::linear_algebra::exponential;
use mechid_numerics::nelder_mead::minimise;
use mechid_signal::Sampling;
use nalgebra::DMatrix;

use crate::error::ForceError;
use crate::force_information::ForceInformation;
use crate::force_model::{ForceModel, LowPass, step_noise};
use crate::limits;
use crate::measurement::{Measurement, Start};
use crate::posterior_points::posterior_points;
use crate::smoother::StateSpace;
use crate::state_space::Machine;

/// State space of the system together with its forces, for any force model. The state of a force is
/// scaled to the contribution of the force to x + ½ẍΔt² over a step. No entry is then large, in any
/// units of the system.
pub(crate) struct Augmented {
    machine: Machine,
    rate: DMatrix<f64>,
    /// Force that corresponds to one unit of each force state, in N.
    units: Vec<f64>,
    start: Start,
    /// Largest displacement, and velocity times Δt, that the measurement allows.
    spreads: [f64; 2],
    /// Samples, channels side by side, divided by their scale.
    data: Vec<f64>,
    sampling: Sampling,
    information: ForceInformation,
}

/// Force model with its likelihood and the remaining noise, which is relative to the channel
/// scales.
#[derive(Debug, Clone)]
pub(crate) struct Tuned {
    pub model: ForceModel,
    pub noise: f64,
    pub log_likelihood: f64,
    /// Logarithms of the signal-to-noise ratio of each force and of the corner frequency in radians
    /// per sample; empty for a given model.
    free: Vec<f64>,
}

impl Augmented {
    pub fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        start: Start,
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let sampling = measured.sampling();
        let (channels, dt) = (scale.len(), sampling.dt());
        let machine = Machine::new(system, measured, forced, scale)?;
        let units = machine.input.column_iter().map(|column| column.amax().recip()).collect();
        let sizes = Sizes::from_measurement(measured);
        let data = (0..sampling.len() * channels)
            .map(|at| {
                measured.record().data()[(at / channels, at % channels)] / scale[at % channels]
            })
            .collect();
        Ok(Self {
            rate: StateTransition::rate(system, dt),
            units,
            start,
            spreads: [sizes.displacement, sizes.velocity * dt],
            data,
            sampling,
            information: ForceInformation::new(system, measured, forced, scale)?,
            machine,
        })
    }

    pub fn data(&self) -> &[f64] {
        &self.data
    }

    pub fn information(&self) -> &ForceInformation {
        &self.information
    }

    /// Returns the force that corresponds to one unit of each force state, in N.
    pub fn units(&self) -> &[f64] {
        &self.units
    }

    /// Returns the state space under a model. `noise` is relative to the channel scales; `spread`,
    /// the standard deviation of the initial state, is relative to the largest response that the
    /// measurement allows.
    pub fn space(
        &self,
        model: &ForceModel,
        process: &LowPass,
        noise: f64,
        spread: f64,
    ) -> Result<StateSpace, ForceError> {
        let (states, channels, order) = (self.rate.nrows(), self.machine.out.nrows(), model.order);
        let (n, m) = (states / 2, states + self.units.len() * order);
        let corner = TAU * model.corner_hz * self.sampling.dt();
        let (mut rate, mut driven) = (DMatrix::zeros(m, m), DMatrix::zeros(m, m));
        let mut start = DMatrix::zeros(m, m);
        let mut output = DMatrix::zeros(m, channels);
        rate.view_mut((0, 0), (states, states)).copy_from(&self.rate);
        output.view_mut((0, 0), (states, channels)).copy_from(&self.machine.out.transpose());
        if self.start == Start::InMotion {
            for i in 0..states {
                start[(i, i)] = (spread * self.spreads[i / n]).powi(2);
            }
        }
        for (f, unit) in self.units.iter().enumerate() {
            let at = states + f * order;
            let input = self.machine.input.column(f) * *unit;
            rate.view_mut((n, at), (n, 1)).copy_from(&input);
            rate.view_mut((at, at), (order, order)).copy_from(&(&process.rate * corner));
            let variance = (model.rms[f] / unit).powi(2);
            driven[(at + order - 1, at + order - 1)] = variance * process.intensity * corner;
            start.view_mut((at, at), (order, order)).copy_from(&(&process.covariance * variance));
            let through = self.machine.through.column(f).transpose() * *unit;
            output.view_mut((at, 0), (1, channels)).copy_from(&through);
        }
        let transition = exponential(&rate)?;
        let driven = step_noise(&rate, &[driven])?.remove(0);
        Ok(StateSpace {
            states: m,
            channels,
            transition: transition.transpose().as_slice().to_vec(),
            process: driven.as_slice().to_vec(),
            output: output.as_slice().to_vec(),
            noise_variance: noise * noise,
            start_mean: vec![0.0; m],
            start: start.as_slice().to_vec(),
        })
    }

    /// Returns a model, with its likelihood, for the logarithms of the signal-to-noise ratio of
    /// each force and of the corner frequency in radians per sample. If the noise is unknown, it is
    /// estimated from the innovations, and all variances scale with the noise.
    fn trial(&self, process: &LowPass, noise: Option<f64>, free: &[f64]) -> Option<Tuned> {
        let (corner, ratios) = free.split_last()?;
        let (lowest, forces) = (self.lowest(), ratios.len());
        let outside = |ratio: &f64| !limits::RATIO_RANGE.contains(&ratio.exp());
        if !(lowest.ln()..=limits::HIGHEST_CORNER.ln()).contains(corner)
            || ratios.iter().any(outside)
        {
            return None;
        }
        let order = process.rate.nrows();
        let corner_hz = corner.exp() / (TAU * self.sampling.dt());
        let mut model = ForceModel { order, corner_hz, rms: vec![1.0; forces] };
        let unit = noise.unwrap_or(1.0);
        for (f, ratio) in ratios.iter().enumerate() {
            let gain = self.information.gain(&model, process, f);
            model.rms[f] = unit * ratio.exp() / gain;
        }
        if model.rms.iter().any(|rms| !(*rms > 0.0 && rms.is_finite())) {
            return None;
        }
        let largest = ratios.iter().copied().fold(0.0, f64::max).exp();
        // An initial standard deviation of ten times the measured motion is no constraint, and it
        // does not cost the filter any precision.
        let spread = 10.0 * if noise.is_none() { largest } else { 1.0 };
        let space = self.space(&model, process, unit, spread).ok()?;
        let innovations = space.innovations(&self.data);
        let count = self.data.len() as f64;
        let (noise, log_likelihood) = match noise {
            Some(noise) => (noise, innovations.log_likelihood()),
            None => {
                let variance = innovations.energy / count;
                let log = count * variance.ln() + innovations.log_variance + count;
                (variance.sqrt(), -0.5 * log)
            }
        };
        if noise != unit {
            model.rms.iter_mut().for_each(|rms| *rms *= noise);
        }
        let free = free.to_vec();
        log_likelihood.is_finite().then_some(Tuned { model, noise, log_likelihood, free })
    }

    /// Returns the log-likelihood of a model, without constants. If displacement and velocity of
    /// the first sample are unknown, their most likely values are used.
    pub fn likelihood(&self, tuned: &Tuned, process: &LowPass) -> Result<f64, ForceError> {
        let mut space = self.space(&tuned.model, process, tuned.noise, 10.0)?;
        if self.start == Start::InMotion {
            let (m, machine) = (space.states, self.rate.nrows());
            let (mean, _) = space.smooth(space.filter(&self.data));
            space.start_mean[..machine].copy_from_slice(&mean[..machine]);
            (0..machine).for_each(|i| space.start[i * m + i] = 0.0);
        }
        let likelihood = space.innovations(&self.data).log_likelihood();
        if likelihood.is_finite() { Ok(likelihood) } else { Err(ForceError::NoLikelihood) }
    }

    /// Returns the noise of a record that is a free response; `None` if the Bayesian information
    /// criterion finds a force in the record.
    ///
    /// # Source
    /// Schwarz (1978), Annals of Statistics 6, 461–464.
    pub fn noise_without_force(&self) -> Option<f64> {
        let forces = self.units.len();
        let process = LowPass::new(limits::FORCE_ORDERS[0]).ok()?;
        // The smallest signal-to-noise ratio of a trial is the same at any corner frequency, so
        // that the corner frequency is arbitrary here.
        let mut least = vec![(limits::RATIO_RANGE.start * (1.0 + 1e-9)).ln(); forces];
        least.push((0.1 * limits::HIGHEST_CORNER).ln());
        let without = self.trial(&process, None, &least)?;
        let with = self.most_likely(None).ok()?;
        let penalty = 0.5 * (forces + 1) as f64 * (self.data.len() as f64).ln();
        (with.log_likelihood - without.log_likelihood < penalty).then_some(without.noise)
    }

    /// Number of measured channels.
    pub fn channels(&self) -> usize {
        self.machine.out.nrows()
    }

    /// Returns the innovations divided by their standard deviations, channels of a sample side by
    /// side; `None` if an innovation is not finite.
    pub fn innovations(&self, tuned: &Tuned) -> Option<Vec<f64>> {
        let process = LowPass::new(tuned.model.order).ok()?;
        let space = self.space(&tuned.model, &process, tuned.noise, 10.0).ok()?;
        let passage = self.started(space).filter(&self.data);
        let innovations = passage.innovations().iter().map(|(e, variance)| e / variance.sqrt());
        let innovations: Vec<f64> = innovations.collect();
        innovations.iter().all(|e| e.is_finite()).then_some(innovations)
    }

    /// Returns, for each sample, the squared innovations divided by their variances, summed over
    /// the channels.
    pub fn energies(&self, tuned: &Tuned) -> Option<Vec<f64>> {
        let innovations = self.innovations(tuned)?;
        let samples = innovations.chunks_exact(self.channels());
        Some(samples.map(|sample| sample.iter().map(|e| e * e).sum()).collect())
    }

    /// Returns a given model with its likelihood; the channel scales are the standard deviations of
    /// the noise.
    pub fn given(&self, model: &ForceModel) -> Result<Tuned, ForceError> {
        let process = LowPass::new(model.order)?;
        let space = self.space(model, &process, 1.0, 10.0)?;
        let log_likelihood = space.innovations(&self.data).log_likelihood();
        Ok(Tuned { model: model.clone(), noise: 1.0, log_likelihood, free: Vec::new() })
    }

    /// Returns the lowest corner frequency, in radians per sample: its period is forty times the
    /// length of the record.
    fn lowest(&self) -> f64 {
        0.05 * PI / self.sampling.len() as f64
    }

    /// Returns the model of maximum likelihood over all orders.
    pub fn most_likely(&self, noise: Option<f64>) -> Result<Tuned, ForceError> {
        let forces = self.units.len();
        let mut best: Option<Tuned> = None;
        let mut from: Option<(f64, Vec<f64>)> = None;
        for order in limits::FORCE_ORDERS {
            if order > 2 && order * forces > limits::FORCE_STATES {
                break;
            }
            let process = LowPass::new(order)?;
            let cost = |free: &[f64]| {
                self.trial(&process, noise, free).map_or(f64::INFINITY, |t| -t.log_likelihood)
            };
            let start = match &from {
                Some((_, point)) if order > 2 => sharper(point, &cost),
                _ => match self.coarse(forces, &cost) {
                    Some(point) => point,
                    None => continue,
                },
            };
            // The search ends at a difference of 0.01 in the log-likelihood, which moves no
            // parameter by more than a seventh of its uncertainty.
            let step = if order > 2 { 0.3 } else { 1.0 };
            let point = minimise(cost, &start, step, 0.01, 60 * (forces + 1));
            let Some(tuned) = self.trial(&process, noise, &point) else { continue };
            from = Some((tuned.log_likelihood, point));
            let gain = best.as_ref().map(|best| tuned.log_likelihood - best.log_likelihood);
            if gain.is_none_or(|gain| gain > 0.0) {
                best = Some(tuned);
            }
            // Higher orders do not bring more if an order brings too little gain over the lower
            // orders.
            if order > 4 && gain.is_some_and(|gain| gain < limits::ORDER_GAIN) {
                break;
            }
        }
        best.ok_or(ForceError::NoLikelihood)
    }

    /// Returns posterior models with their weights; if the model was given, only this model.
    pub fn posterior_points(
        &self,
        best: &Tuned,
        noise: Option<f64>,
    ) -> Result<Vec<(f64, Tuned)>, ForceError> {
        if best.free.is_empty() {
            return Ok(vec![(1.0, best.clone())]);
        }
        let process = LowPass::new(best.model.order)?;
        let points = posterior_points(&best.free, |point| {
            Some(self.trial(&process, noise, point)?.log_likelihood)
        })?;
        let tuned =
            |(weight, point): (f64, Vec<f64>)| Some((weight, self.trial(&process, noise, &point)?));
        Ok(points.into_iter().filter_map(tuned).collect())
    }

    /// Returns the best point of a grid on which all forces have the same signal-to-noise ratio.
    fn coarse(&self, forces: usize, cost: &dyn Fn(&[f64]) -> f64) -> Option<Vec<f64>> {
        let mut best = (f64::INFINITY, None);
        let mut corner = PI / self.sampling.len() as f64;
        while corner < limits::HIGHEST_CORNER {
            for ratio in limits::GRID_RATIOS {
                let mut point = vec![ratio.ln(); forces];
                point.push(corner.ln());
                let value = cost(&point);
                if value < best.0 {
                    best = (value, Some(point));
                }
            }
            corner *= limits::CORNER_RATIO;
        }
        best.1
    }

    /// Returns the state space with the initial state from a first pass. The standard deviations of
    /// this state are at most a hundred times those of the converged filter.
    ///
    /// With the wide initial covariance of the first pass, the variances of the first samples lose
    /// digits. The narrower covariance avoids this loss and changes the estimates by only a
    /// ten-thousandth of their standard error.
    pub fn started(&self, mut space: StateSpace) -> StateSpace {
        let (m, machine) = (space.states, self.rate.nrows());
        let first = space.filter(&self.data);
        let settled = (3 * m).min(self.sampling.len() - 1);
        let variances: Vec<f64> = first.variances(settled, m).take(machine).collect();
        let (mean, _) = space.smooth(first);
        for (i, variance) in variances.iter().enumerate() {
            let start = &mut space.start[i * m + i];
            if *start > 0.0 {
                *start = start.min(1e4 * variance);
                space.start_mean[i] = mean[i];
            }
        }
        space
    }
}

/// Returns an initial estimate for a higher order: the corner frequency of the previous order, and
/// the signal-to-noise ratio that suits the steeper roll-off. A band with a gradual roll-off would
/// model noise as force.
fn sharper(point: &[f64], cost: &dyn Fn(&[f64]) -> f64) -> Vec<f64> {
    let mut best = (cost(point), point.to_vec());
    let last = point.len() - 1;
    for ratio in limits::GRID_RATIOS {
        let mut trial = vec![ratio.ln(); last];
        trial.push(point[last]);
        let value = cost(&trial);
        if value < best.0 {
            best = (value, trial);
        }
    }
    best.1
}

/// Upper bounds of the motion, from the measurement. A displacement channel gives velocities from
/// the differences of its samples (including noise). Channels of velocity and acceleration give
/// displacements as if all motion had the period of the record.
#[derive(Default)]
struct Sizes {
    displacement: f64,
    velocity: f64,
}

impl Sizes {
    fn from_measurement(measured: &Measurement) -> Self {
        let sampling = measured.sampling();
        let (fast, slow) = (1.0 / sampling.dt(), 1.0 / sampling.omega0());
        let mut largest = Self::default();
        for (channel, column) in
            measured.channels().iter().zip(measured.record().data().column_iter())
        {
            let size = column.amax();
            let step =
                column.as_slice().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            let [x, v] = match channel.quantity {
                ResponseQuantity::Displacement => [size, step * fast],
                ResponseQuantity::Velocity => [size * slow, size],
                ResponseQuantity::Acceleration => [size * slow * slow, size * slow],
            };
            largest.displacement = largest.displacement.max(x);
            largest.velocity = largest.velocity.max(v);
        }
        largest
    }
}
