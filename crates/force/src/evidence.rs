//! Marginal likelihood of force and noise, before any parameter is chosen.
//!
//! Each component is y_i = s_i f_i + e_i with e of variance σ². Of the `reach` strongest
//! components a share π carries a force of variance τ², the others and all weaker ones carry none:
//! a band of frequencies is a reach, single lines are a share, a white force is reach = all and
//! π = 1. The four numbers are those under which the measurement is most likely.

use crate::components::Components;

/// Share, variances and reach of greatest likelihood.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    share: f64,
    force: f64,
    /// σ², per real datum.
    pub noise: f64,
    reach: usize,
    likelihood: f64,
}

/// Reaches tried first: all components, then each 0.8 of the one before.
const REACH_RATIO: f64 = 0.8;
/// EM rounds at most; from the starts below it needs a few dozen.
const ROUNDS: usize = 300;
/// The likelihood has settled when a round adds less than this to its logarithm.
const SETTLED: f64 = 1e-3;

impl Evidence {
    /// The most likely of all reaches: a coarse descent, then ever smaller steps about the best.
    pub fn of(components: &Components) -> Self {
        let most = components.transmitted();
        let mut reach = most;
        let mut best = Self::at_reach(components, most);
        while reach > 2 {
            reach = ((reach as f64 * REACH_RATIO) as usize).max(2);
            best = best.better(Self::at_reach(components, reach));
        }
        let mut step = best.reach / 10;
        while step > 0 {
            for reach in [best.reach.saturating_sub(step).max(2), best.reach + step] {
                if reach <= most {
                    best = best.better(Self::at_reach(components, reach));
                }
            }
            step /= 2;
        }
        best
    }

    fn better(self, other: Self) -> Self {
        if other.likelihood > self.likelihood { other } else { self }
    }

    /// Factor φ_i of the mean of f_i given the measurement, f̄_i = φ_i y_i / s_i.
    pub fn factor(&self, components: &Components, i: usize) -> f64 {
        if i >= self.reach {
            return 0.0;
        }
        let driven = self.force * components.singular[i].powi(2);
        let (_, probability) = self.component(components, i);
        probability * driven / (driven + self.noise)
    }

    /// Variance of f_i given the measurement, per real unknown.
    pub fn variance(&self, components: &Components, i: usize) -> f64 {
        if i >= self.reach {
            return 0.0;
        }
        let (s, energy) = (components.singular[i], components.energy[i] / components.weight[i]);
        let driven = self.force * s * s;
        let gain = driven / (driven + self.noise);
        let (_, probability) = self.component(components, i);
        let mean = (gain / s).powi(2) * energy;
        probability * (self.force * (1.0 - gain) + (1.0 - probability) * mean)
    }

    fn at_reach(components: &Components, reach: usize) -> Self {
        let mut starts = vec![Self::white(components, reach)];
        let head = |i: usize| components.weight[i] * components.singular[i].powi(2);
        let gain: f64 = (0..reach).map(head).sum();
        let energy: f64 = components.energy[..reach].iter().sum();
        for noise in Self::first_noises(components, reach) {
            for share in [0.9, 0.3] {
                let force = energy / (gain * share);
                starts.push(Self { share, force, noise, reach, likelihood: f64::NEG_INFINITY });
            }
        }
        starts
            .into_iter()
            .map(|start| start.maximised(components))
            .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood))
            .expect("there are starts")
    }

    /// Noise variances to start from: that of the tail, or low quantiles where the tail is short.
    fn first_noises(components: &Components, reach: usize) -> Vec<f64> {
        let tail_weight: f64 =
            components.weight[reach..].iter().sum::<f64>() + components.outside_weight;
        if tail_weight > 8.0 {
            return vec![(tail_energy(components, reach) / tail_weight).max(f64::MIN_POSITIVE)];
        }
        let mut per_datum: Vec<f64> =
            components.energy.iter().zip(&components.weight).map(|(e, w)| e / w).collect();
        per_datum.sort_by(f64::total_cmp);
        [50, 5].map(|part| per_datum[per_datum.len() / part].max(f64::MIN_POSITIVE)).to_vec()
    }

    /// Every component within reach driven: the ratio σ/τ on a grid, both variances from it.
    fn white(components: &Components, reach: usize) -> Self {
        let (data, tail) = (components.data(), tail_energy(components, reach));
        let start = Self { share: 0.999, force: 1.0, noise: 1.0, reach, likelihood: f64::MIN };
        let mut best = (f64::INFINITY, start);
        for step in 0..=80 {
            let ratio = (components.singular[0] * 10f64.powf(-0.1 * f64::from(step))).powi(2);
            let (mut force, mut log) = (tail / ratio, 0.0);
            for i in 0..reach {
                let total = components.singular[i].powi(2) + ratio;
                force += components.energy[i] / total;
                log += components.weight[i] * total.ln();
            }
            let within: f64 = components.weight[..reach].iter().sum();
            log += (data - within) * ratio.ln();
            force /= data;
            let cost = data * force.ln() + log;
            if cost < best.0 {
                best = (cost, Self { force, noise: force * ratio, ..start });
            }
        }
        best.1
    }

    /// Expectation and maximisation in turn until the likelihood settles.
    ///
    /// # Source
    /// Dempster, Laird & Rubin (1977), Maximum likelihood from incomplete data via the EM algorithm.
    fn maximised(mut self, components: &Components) -> Self {
        for _ in 0..ROUNDS {
            let before = self.likelihood;
            self = self.round(components);
            if (self.likelihood - before).abs() < SETTLED {
                break;
            }
        }
        self
    }

    /// One round; the likelihood is that of the values before it.
    fn round(self, components: &Components) -> Self {
        let tail = tail_energy(components, self.reach);
        let within: f64 = components.weight[..self.reach].iter().sum();
        let mut likelihood = -0.5 * (components.data() - within) * self.noise.ln();
        likelihood -= tail / (2.0 * self.noise);
        let (mut driven, mut driven_weight, mut force, mut noise) = (0.0, 0.0, 0.0, tail);
        for i in 0..self.reach {
            let (s, weight) = (components.singular[i], components.weight[i]);
            let energy = components.energy[i];
            let (log, probability) = self.component(components, i);
            likelihood += log;
            let gain = self.force * s * s / (self.force * s * s + self.noise);
            let spread = self.force * (1.0 - gain) * weight;
            driven += probability;
            driven_weight += probability * weight;
            force += probability * ((gain / s).powi(2) * energy + spread);
            noise += (1.0 - probability) * energy
                + probability * ((1.0 - gain).powi(2) * energy + s * s * spread);
        }
        Self {
            share: (driven / self.reach as f64).clamp(1e-3, 1.0 - 1e-6),
            force: (force / driven_weight.max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE),
            noise: (noise / components.data()).max(f64::MIN_POSITIVE),
            reach: self.reach,
            likelihood,
        }
    }

    /// Logarithm of the likelihood of y_i, and the probability that it is driven.
    fn component(&self, components: &Components, i: usize) -> (f64, f64) {
        let (weight, energy) = (components.weight[i], components.energy[i]);
        let log = |share: f64, variance: f64| {
            share.ln() - 0.5 * weight * variance.ln() - energy / (2.0 * variance)
        };
        let driven = log(self.share, self.force * components.singular[i].powi(2) + self.noise);
        let silent = log(1.0 - self.share, self.noise);
        let larger = driven.max(silent);
        let sum = (driven - larger).exp() + (silent - larger).exp();
        (larger + sum.ln(), (driven - larger).exp() / sum)
    }
}

fn tail_energy(components: &Components, reach: usize) -> f64 {
    components.energy[reach..].iter().sum::<f64>() + components.outside_energy
}
