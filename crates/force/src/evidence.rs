//! Marginal likelihood of force and noise, before any parameter is chosen.
//!
//! Each component is y_i = s_i f_i + e_i, with noise e of variance σ². Of the strongest components,
//! whose number is the `reach`, a share π carries a force of variance τ² g_i; all other components
//! carry none. A force in a band has a certain reach. A force of single lines has a small share. A
//! white force has the reach of all components and π = 1. The colour g_i = (ω_i/ω₁)^(−2a) describes
//! a force of falling spectrum: a = 1 is a random walk. The result is averaged over all parameter
//! values that are about as likely as the best ones: a force with a standard error must not depend
//! on parameters that the measurement does not determine.

use crate::components::Components;
use crate::error::ForceError;
use crate::limits;
use crate::posterior_points::posterior_points;

/// Parameters of force and noise: share, variances, reach and colour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    share: f64,
    force: f64,
    /// Noise variance σ², per real datum.
    noise: f64,
    reach: usize,
    /// Exponent a of the amplitude, (ω_i/ω₁)^(−a).
    colour: i32,
    likelihood: f64,
}

/// Posterior of the parameters: their values with weights.
pub(crate) struct Posterior {
    best: Evidence,
    parts: Vec<(f64, Evidence)>,
}

impl Posterior {
    /// Computes the posterior: the likely values of reach and colour, for each of them the likely
    /// values of share and variances, and the weight of each combination. If the noise is known,
    /// the noise variance is 1.
    pub fn from_components(components: &Components, noise_known: bool) -> Result<Self, ForceError> {
        let noise = noise_known.then_some(1.0);
        let white = Evidence::most_likely(components, limits::COLOURS[0], noise);
        let few = white.share * (white.reach as f64) < limits::COLOUR_COMPONENTS;
        let least = if few { white.likelihood + limits::COLOUR_GAIN } else { f64::NEG_INFINITY };
        let mut bests = vec![white];
        if components.transmitted() as f64 >= limits::COLOUR_COMPONENTS {
            let coloured = limits::COLOURS[1..].iter();
            let coloured = coloured.map(|colour| Evidence::most_likely(components, *colour, noise));
            bests.extend(coloured.filter(|coloured| coloured.likelihood > least));
        }
        let best = bests[1..].iter().fold(bests[0], |best, other| best.better(*other));
        let greatest = best.likelihood;
        let mut near = Vec::new();
        for best in
            bests.iter().filter(|best| best.likelihood > greatest - limits::NEGLIGIBLE_LIKELIHOOD)
        {
            best.add_neighbouring_reaches(components, noise, greatest, &mut near);
        }
        let weight =
            |(steps, evidence): &(f64, Evidence)| steps * (evidence.likelihood - greatest).exp();
        let sum: f64 = near.iter().map(weight).sum();
        let mut parts = Vec::new();
        for part in &near {
            let share = weight(part) / sum;
            for (weight, evidence) in part.1.posterior_points(components, noise)? {
                parts.push((share * weight, evidence));
            }
        }
        Ok(Self { best, parts })
    }

    /// Returns the mean of the noise variance, per real datum.
    pub fn noise(&self) -> f64 {
        self.parts.iter().map(|(weight, evidence)| weight * evidence.noise).sum()
    }

    /// Returns the factor φ_i of the posterior mean f̄_i = φ_i y_i / s_i for the most likely
    /// parameters.
    pub fn best_factor(&self, components: &Components, i: usize) -> f64 {
        self.best.factor(components, i)
    }

    /// Returns the factor φ_i of the posterior mean f̄_i = φ_i y_i / s_i, averaged over the
    /// parameters.
    pub fn factor(&self, components: &Components, i: usize) -> f64 {
        self.parts.iter().map(|(weight, evidence)| weight * evidence.factor(components, i)).sum()
    }

    /// Returns the posterior variance of f_i, per real unknown, averaged over the parameters.
    pub fn variance(&self, components: &Components, i: usize) -> f64 {
        let (s, mean) = (components.singular[i], self.factor(components, i));
        let energy = components.energy[i] / components.weight[i];
        let square = if s > 0.0 { energy / (s * s) } else { 0.0 };
        let weighted = self.parts.iter().map(|(weight, evidence)| {
            let apart = evidence.factor(components, i) - mean;
            weight * (evidence.variance(components, i) + apart * apart * square)
        });
        weighted.sum()
    }

    /// Returns the frequency, in Hz, below which noise hides the force, if the force is as strong
    /// in every component as in the driven components; `None` if noise hides the force in every
    /// component.
    pub fn lowest_hz(&self, components: &Components) -> Option<f64> {
        let endless = Evidence { reach: components.singular.len(), ..self.best };
        components.lowest_hz(|i| {
            endless.force_variance(components, i) * components.singular[i].powi(2)
                >= self.best.noise
        })
    }
}

impl Evidence {
    /// Returns the parameters with the most likely reach (number of the strongest components that
    /// may carry a force). The search takes coarse steps down from all components, then smaller
    /// steps around the best reach.
    fn most_likely(components: &Components, colour: i32, noise: Option<f64>) -> Self {
        let most = components.transmitted();
        let mut reach = most;
        let mut best = Self::at_reach(components, most, colour, noise);
        // The reach, the number of components that may carry a force, is searched only for a white
        // force. A coloured force has a spectrum that falls, but does not end, so it reaches all
        // components.
        while colour == 0 && reach > 2 {
            reach = ((reach as f64 * limits::REACH_RATIO) as usize).max(2);
            best = best.better(Self::at_reach(components, reach, colour, noise));
        }
        let mut step = best.reach / 10;
        while colour == 0 && step > 0 {
            for reach in [best.reach.saturating_sub(step).max(2), best.reach + step] {
                if reach <= most {
                    best = best.better(Self::at_reach(components, reach, colour, noise));
                }
            }
            step /= 2;
        }
        best
    }

    fn better(self, other: Self) -> Self {
        if other.likelihood > self.likelihood { other } else { self }
    }

    /// Adds this reach (number of the strongest components that may carry a force) and the
    /// neighbouring reaches whose likelihood is not negligible. The weight of a reach is the number
    /// of reaches that it represents.
    fn add_neighbouring_reaches(
        self,
        components: &Components,
        noise: Option<f64>,
        greatest: f64,
        near: &mut Vec<(f64, Self)>,
    ) {
        let most = components.transmitted();
        if self.colour > 0 {
            near.push((most as f64, self));
            return;
        }
        let stride = (self.reach / limits::NEIGHBOURING_REACHES).max(1);
        near.push((stride as f64, self));
        if self.share < limits::BAND_SHARE
            || limits::BAND_COMPONENTS > self.share * self.reach as f64
        {
            return;
        }
        if self.reach < most {
            let widest = Self::at_reach(components, most, 0, noise);
            near.push((limits::ENDLESS_PRIOR * most as f64, widest));
        }
        for up in [false, true] {
            let mut last = self;
            for _ in 0..limits::NEIGHBOURING_REACHES {
                let reach =
                    if up { last.reach + stride } else { last.reach.saturating_sub(stride) };
                if !(1..=most).contains(&reach) {
                    break;
                }
                last = Self { reach, likelihood: f64::NEG_INFINITY, ..last }
                    .maximised(components, noise);
                if last.likelihood.is_nan()
                    || last.likelihood <= greatest - limits::NEGLIGIBLE_LIKELIHOOD
                {
                    break;
                }
                near.push((stride as f64, last));
            }
        }
    }

    /// Returns posterior values of share and variances with their weights; the prior of the share
    /// is uniform.
    fn posterior_points(
        self,
        components: &Components,
        noise: Option<f64>,
    ) -> Result<Vec<(f64, Self)>, ForceError> {
        let reach = self.reach as f64;
        let odds = (self.share * reach + 1.0) / ((1.0 - self.share) * reach + 1.0);
        let mut best = vec![odds.ln(), self.force.ln()];
        best.extend(noise.is_none().then(|| self.noise.ln()));
        let at = |point: &[f64]| Self {
            share: (1.0 + (-point[0]).exp()).recip().clamp(1e-12, 1.0 - 1e-12),
            force: point[1].exp(),
            noise: point.get(2).map_or(self.noise, |log| log.exp()),
            ..self
        };
        let points = posterior_points(&best, |point| {
            let trial = at(point);
            // The prior is uniform in the share. Its density in the logarithm of the odds is
            // share·(1 − share).
            let prior = trial.share.ln() + (1.0 - trial.share).ln();
            Some(trial.log_likelihood(components) + prior).filter(|value| value.is_finite())
        })?;
        Ok(points.into_iter().map(|(weight, point)| (weight, at(&point))).collect())
    }

    /// Returns the variance τ² g_i of the force in component i, if this component carries a force.
    fn force_variance(&self, components: &Components, i: usize) -> f64 {
        if i >= self.reach {
            return 0.0;
        }
        self.force * components.frequency[i].powi(-2 * self.colour)
    }

    fn factor(&self, components: &Components, i: usize) -> f64 {
        if i >= self.reach {
            return 0.0;
        }
        let shown = self.force_variance(components, i) * components.singular[i].powi(2);
        let (_, probability) = self.component(components, i);
        probability * shown / (shown + self.noise)
    }

    fn variance(&self, components: &Components, i: usize) -> f64 {
        if i >= self.reach {
            return 0.0;
        }
        let (s, energy) = (components.singular[i], components.energy[i] / components.weight[i]);
        let force = self.force_variance(components, i);
        let shown = force * s * s;
        let gain = shown / (shown + self.noise);
        let (_, probability) = self.component(components, i);
        let mean = (gain / s).powi(2) * energy;
        probability * (force * (1.0 - gain) + (1.0 - probability) * mean)
    }

    fn at_reach(components: &Components, reach: usize, colour: i32, noise: Option<f64>) -> Self {
        let blank = Self {
            share: 0.999,
            force: 1.0,
            noise: 1.0,
            reach,
            colour,
            likelihood: f64::NEG_INFINITY,
        };
        let mut starts = vec![blank.white(components, noise)];
        let head = |i: usize| {
            components.weight[i]
                * components.singular[i].powi(2)
                * blank.force_variance(components, i)
        };
        let gain: f64 = (0..reach).map(head).sum();
        let energy: f64 = components.energy[..reach].iter().sum();
        let noises = match noise {
            Some(noise) => vec![noise],
            None => Self::first_noises(components, reach),
        };
        for noise in noises {
            for share in [0.9, 0.3] {
                let force = energy / (gain * share);
                starts.push(Self { share, force, noise, ..blank });
            }
        }
        starts
            .into_iter()
            .map(|start| start.maximised(components, noise))
            .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood))
            .expect("there are starts")
    }

    /// Returns initial noise variances. They are the mean square of the data outside the `reach`
    /// strongest components or, if few such data remain, low quantiles of the mean squares of all
    /// components.
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

    /// Fits a force that drives all of the `reach` strongest components. The ratio of the noise
    /// variance to the force variance is searched on a grid, and gives both variances.
    fn white(self, components: &Components, noise: Option<f64>) -> Self {
        let (data, tail) = (components.data(), tail_energy(components, self.reach));
        let shown = |i: usize| {
            components.singular[i].powi(2) * self.force_variance(components, i) / self.force
        };
        let largest = (0..self.reach).map(shown).fold(0.0, f64::max);
        let within: f64 = components.weight[..self.reach].iter().sum();
        let mut best = (f64::INFINITY, self);
        for step in 0..=80 {
            let ratio = largest * 10f64.powf(-0.2 * f64::from(step));
            let (mut force, mut log) = (tail / ratio, 0.0);
            for i in 0..self.reach {
                let total = shown(i) + ratio;
                force += components.energy[i] / total;
                log += components.weight[i] * total.ln();
            }
            log += (data - within) * ratio.ln();
            force /= data;
            let cost = match noise {
                // If the noise variance is known, it gives the variance of the force, by the ratio
                // of the two variances.
                Some(noise) => {
                    let given = noise / ratio;
                    data * given.ln() + log + data * force / given
                }
                None => data * force.ln() + log + data,
            };
            let force = noise.map_or(force, |noise| noise / ratio);
            if cost < best.0 {
                best = (cost, Self { force, noise: force * ratio, ..self });
            }
        }
        best.1
    }

    /// Alternates expectation and maximisation until the likelihood converges.
    ///
    /// # Source
    /// Dempster, Laird & Rubin (1977), Maximum likelihood from incomplete data via the EM
    /// algorithm.
    fn maximised(mut self, components: &Components, noise: Option<f64>) -> Self {
        for _ in 0..limits::EM_ROUNDS {
            let before = self.likelihood;
            self = self.round(components, noise);
            if (self.likelihood - before).abs() < limits::EM_CHANGE {
                break;
            }
        }
        self
    }

    /// Returns the logarithm of the likelihood of all components.
    fn log_likelihood(&self, components: &Components) -> f64 {
        let within: f64 = components.weight[..self.reach].iter().sum();
        let mut likelihood = -0.5 * (components.data() - within) * self.noise.ln();
        likelihood -= tail_energy(components, self.reach) / (2.0 * self.noise);
        (0..self.reach).for_each(|i| likelihood += self.component(components, i).0);
        likelihood
    }

    /// Performs one round of expectation and maximisation. The returned likelihood is that of the
    /// values before the round.
    fn round(self, components: &Components, known: Option<f64>) -> Self {
        let likelihood = self.log_likelihood(components);
        let (mut driven, mut driven_weight, mut force) = (0.0, 0.0, 0.0);
        let mut noise = tail_energy(components, self.reach);
        for i in 0..self.reach {
            let (s, weight) = (components.singular[i], components.weight[i]);
            let energy = components.energy[i];
            let (_, probability) = self.component(components, i);
            let variance = self.force_variance(components, i);
            let gain = variance * s * s / (variance * s * s + self.noise);
            let spread = variance * (1.0 - gain) * weight;
            driven += probability;
            driven_weight += probability * weight;
            force += probability * ((gain / s).powi(2) * energy + spread) * self.force / variance;
            noise += (1.0 - probability) * energy
                + probability * ((1.0 - gain).powi(2) * energy + s * s * spread);
        }
        Self {
            share: (driven / self.reach as f64).clamp(1e-3, 1.0 - 1e-6),
            force: (force / driven_weight.max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE),
            noise: known.unwrap_or((noise / components.data()).max(f64::MIN_POSITIVE)),
            likelihood,
            ..self
        }
    }

    /// Returns the log-likelihood of y_i, and the probability that component i carries a force.
    fn component(&self, components: &Components, i: usize) -> (f64, f64) {
        let (weight, energy) = (components.weight[i], components.energy[i]);
        let log = |share: f64, variance: f64| {
            share.ln() - 0.5 * weight * variance.ln() - energy / (2.0 * variance)
        };
        let shown = self.force_variance(components, i) * components.singular[i].powi(2);
        let driven = log(self.share, shown + self.noise);
        let silent = log(1.0 - self.share, self.noise);
        let larger = driven.max(silent);
        let sum = (driven - larger).exp() + (silent - larger).exp();
        (larger + sum.ln(), (driven - larger).exp() / sum)
    }
}

fn tail_energy(components: &Components, reach: usize) -> f64 {
    components.energy[reach..].iter().sum::<f64>() + components.outside_energy
}
