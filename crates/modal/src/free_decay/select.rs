//! Choice of the number of decays in a record and of the noise colour.

use mechid_numerics::time_limit;
use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::autoregression::Autoregression;
use super::fit::{Data, Fit};
use super::initial_poles::{Subspace, strongest};
use super::limits::{COARSE, COLOUR_ROUNDS, FALSE_DECAY, SELECTION_PATIENCE};
use super::poles::{Pole, linear_columns};

/// Returns the minimum decrease of minus twice the log-likelihood for the acceptance of a further
/// decay.
///
/// A decay has two unknowns, and two more per channel. In noise alone, with one independent
/// frequency for each sample, the decrease at the best frequency exceeds this minimum with the
/// probability [`FALSE_DECAY`].
pub(super) fn least_gain(len: usize, channels: usize) -> f64 {
    let level = FALSE_DECAY / len as f64;
    let distribution = ChiSquared::new(2.0 * channels as f64 + 2.0);
    distribution.map_or(f64::INFINITY, |chi| bisected(|x| chi.sf(x) - level))
}

/// Returns the zero of a falling function of a positive variable.
fn bisected(of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while of(high) > 0.0 && high < 1e6 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if of(middle) > 0.0 { low = middle } else { high = middle }
    }
    high
}

/// Fit with a number of decays, and its cost.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub fit: Fit,
    /// Minus twice the log-likelihood plus the penalty of the noise coefficients.
    pub cost: f64,
}

/// Pair of fits with the same number of decays: one with white noise, one with coloured noise. An
/// autoregression of high order may hide decays that are not yet in the model.
#[derive(Debug, Clone)]
struct Pair {
    white: Candidate,
    coloured: Candidate,
}

impl Pair {
    fn decays(&self) -> usize {
        self.white.fit.poles.len()
    }

    fn better(&self) -> &Candidate {
        if self.coloured.cost < self.white.cost { &self.coloured } else { &self.white }
    }
}

impl Candidate {
    /// Returns the Bayesian information criterion.
    pub(super) fn criterion(&self, data: &Data) -> f64 {
        let unknowns = self.fit.poles.len() * (2 + 2 * data.channels());
        self.cost + unknowns as f64 * (data.len() as f64).ln()
    }
}

/// Result of a search.
#[derive(Debug)]
pub(super) struct Selected {
    pub best: Candidate,
    /// Best fit with white noise.
    pub white: Candidate,
    /// Decrease of minus twice the log-likelihood due to the first decay.
    pub first_gain: f64,
}

/// Search for the number of decays.
pub(super) struct Search<'a> {
    data: &'a Data,
    raw: Option<Subspace>,
}

impl<'a> Search<'a> {
    pub(super) fn new(data: &'a Data) -> Self {
        let mut centred = data.samples.clone();
        if data.constant {
            for mut column in centred.column_iter_mut() {
                let mean = column.mean();
                column.add_scalar_mut(-mean);
            }
        }
        Self { data, raw: Subspace::new(&centred) }
    }

    /// Returns the fits with the lowest cost; the number of decays is at most `most`.
    pub(super) fn best(&self, most: usize) -> Option<Selected> {
        let per_decay = least_gain(self.data.len(), self.data.channels());
        let cost = |of: &Candidate| of.cost + per_decay * of.fit.poles.len() as f64;
        let without_decays = self.without_decays()?;
        let (mut last, mut best) = (without_decays.clone(), without_decays.clone());
        let (mut idle, mut first_gain) = ([0; 2], 0.0);
        let is_idle = |idle: &[usize; 2]| idle.iter().all(|idle| *idle >= SELECTION_PATIENCE);
        while last.decays() < most && !is_idle(&idle) && !time_limit::is_over() {
            let Some(next) = self.one_more(&last) else { break };
            if last.decays() == 0 {
                first_gain = without_decays.better().cost - next.better().cost;
            }
            let tracks = [(&next.white, &mut best.white), (&next.coloured, &mut best.coloured)];
            for ((next, best), idle) in tracks.into_iter().zip(&mut idle) {
                if cost(next) < cost(best) {
                    (*best, *idle) = (next.clone(), 0);
                } else {
                    *idle += 1;
                }
            }
            last = next;
        }
        let Pair { white, coloured } = best;
        let best = if cost(&coloured) < cost(&white) { coloured } else { white.clone() };
        Some(Selected { best, white, first_gain })
    }

    /// Fits a given number of decays under white noise; the autoregression of the noise is
    /// estimated last. An autoregression estimated earlier could describe one of the decays as
    /// noise.
    pub(super) fn exactly(&self, decays: usize) -> Option<Candidate> {
        let raw = |wanted: usize| self.raw.as_ref().map(|raw| raw.poles(wanted));
        let mut fit = self.data.refined(&[], &self.white(), COARSE)?;
        while fit.poles.len() < decays {
            fit = self.extended(&fit, raw(fit.poles.len() + 1))?;
        }
        Some(self.candidate(fit))
    }

    fn without_decays(&self) -> Option<Pair> {
        let fit = self.data.refined(&[], &self.white(), COARSE)?;
        Some(Pair { white: self.rated(&fit), coloured: self.candidate(fit) })
    }

    fn white(&self) -> Vec<Autoregression> {
        vec![Autoregression::default(); self.data.channels()]
    }

    /// Returns the most likely fits with one more decay. Initial poles are either the current poles
    /// and the strongest decay in the residual, or the poles of the Hankel matrix. Each choice is
    /// tried with the unwhitened record and, if the noise is coloured, with the whitened record.
    fn one_more(&self, last: &Pair) -> Option<Pair> {
        let wanted = last.decays() + 1;
        let raw = self.raw.as_ref().map(|raw| raw.poles(wanted));
        let white = self.rated(&self.extended(&last.white.fit, raw)?);
        let mut coloured = self.candidate(white.fit.clone());
        if last.coloured.fit.noise.iter().any(|noise| noise.order() > 0) {
            let samples = scaled(&self.data.samples, &last.coloured.fit, self.data.constant);
            let hankel = Subspace::new(&samples).map(|subspace| subspace.poles(wanted));
            let whitened = self.extended(&last.coloured.fit, hankel).map(|fit| self.candidate(fit));
            if let Some(whitened) = whitened.filter(|whitened| whitened.cost < coloured.cost) {
                coloured = whitened;
            }
        }
        Some(Pair { white, coloured })
    }

    /// Returns the most likely fit with one more decay than `last` and the same noise, from the
    /// strongest decay in the residual or from `poles`.
    fn extended(&self, last: &Fit, poles: Option<Vec<Pole>>) -> Option<Fit> {
        let wanted = last.poles.len() + 1;
        let starts = [Some(last.poles.clone()), poles].into_iter().flatten();
        let fits = starts.filter_map(|poles| {
            let poles = self.completed(poles, &last.noise, wanted)?;
            self.data.refined(&poles, &last.noise, COARSE)
        });
        let cost = |fit: &Fit| fit.cost(self.data.len());
        fits.min_by(|a, b| cost(a).total_cmp(&cost(b)))
    }

    /// Adds the strongest decay of the residual until the number of poles is `wanted`.
    fn completed(
        &self,
        mut poles: Vec<Pole>,
        noise: &[Autoregression],
        wanted: usize,
    ) -> Option<Vec<Pole>> {
        while poles.len() < wanted {
            let fit = self.data.refined(&poles, noise, COARSE)?;
            poles = fit.poles.clone();
            poles.push(strongest(&normalised(&self.data.residual(&fit), noise))?);
        }
        Some(poles)
    }

    /// Returns the given fit or, if its cost is lower, a fit whose noise is the autoregression of
    /// the residual.
    fn candidate(&self, mut fit: Fit) -> Candidate {
        let mut best = self.rated(&fit);
        for _ in 0..COLOUR_ROUNDS {
            let residual = self.data.residual(&fit);
            let noise: Vec<Autoregression> =
                residual.column_iter().map(|e| Autoregression::from_noise(e.as_slice())).collect();
            if noise == fit.noise {
                break;
            }
            let Some(next) = self.data.refined(&fit.poles, &noise, COARSE) else { break };
            let rated = self.rated(&next);
            let gain = best.cost - rated.cost;
            if rated.cost < best.cost {
                best = rated;
            }
            fit = next;
            if gain < 0.01 {
                break;
            }
        }
        best
    }

    fn rated(&self, fit: &Fit) -> Candidate {
        let len = self.data.len();
        let coefficients: usize = fit.noise.iter().map(Autoregression::order).sum();
        let cost = fit.cost(len) + coefficients as f64 * (len as f64).ln();
        Candidate { cost, fit: fit.clone() }
    }
}

/// Returns the residual (samples × channels) after whitening, scaled to unit variance.
fn normalised(residual: &DMatrix<f64>, noise: &[Autoregression]) -> DMatrix<f64> {
    let mut white = residual.clone();
    for (mut column, noise) in white.column_iter_mut().zip(noise) {
        let whitened = noise.whitened(column.clone_owned().as_slice(), 0, 0);
        column.copy_from_slice(&whitened);
        let rms = (column.norm_squared() / column.len() as f64).sqrt();
        if rms > 0.0 {
            column /= rms;
        }
    }
    white
}

/// Returns the record without its constants, whitened and scaled to noise of unit variance.
fn scaled(samples: &DMatrix<f64>, fit: &Fit, constant: bool) -> DMatrix<f64> {
    let mut scaled = samples.clone();
    let linear = linear_columns(&fit.poles, constant);
    let channels = fit.channels.iter().zip(&fit.noise);
    for (mut column, (of, noise)) in scaled.column_iter_mut().zip(channels) {
        if constant {
            column.add_scalar_mut(-of.linear[linear - 1]);
        }
        let whitened = noise.whitened(column.clone_owned().as_slice(), 0, 0);
        column.copy_from_slice(&whitened);
        column /= (of.square / samples.nrows() as f64).sqrt();
    }
    // The first samples are whitened with lower orders and are therefore excluded.
    let most = fit.noise.iter().map(Autoregression::order).max().unwrap_or(0);
    scaled.rows_range(most..).into_owned()
}
