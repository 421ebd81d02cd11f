//! The number of decays in a record, and the colour of its noise.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::autoregression::Autoregression;
use super::fit::{Data, Fit};
use super::initial_poles::{Subspace, strongest};
use super::limits::{COARSE, COLOUR_ROUNDS, FALSE_DECAY, SELECTION_PATIENCE};
use super::poles::{Pole, linear_columns};

/// Decrease of minus twice the log likelihood that a further decay must bring.
///
/// A decay has two unknowns of its own and two per channel. Among noise, the best of as many places as there
/// are samples gains more than this with the probability [`FALSE_DECAY`].
pub(super) fn least_gain(len: usize, channels: usize) -> f64 {
    let level = FALSE_DECAY / len as f64;
    let distribution = ChiSquared::new(2.0 * channels as f64 + 2.0);
    distribution.map_or(f64::INFINITY, |chi| bisected(|x| chi.sf(x) - level))
}

/// Zero of a falling function from 0 on.
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

/// Fit with a number of decays, and what speaks for it.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub fit: Fit,
    /// Minus twice the log likelihood, and what the colour of the noise costs.
    pub cost: f64,
}

/// Fits with one number of decays, side by side: a colour of high order can pass for decays that are not
/// found yet, and then hide them.
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
    /// Bayesian information criterion.
    pub(super) fn criterion(&self, data: &Data) -> f64 {
        let unknowns = self.fit.poles.len() * (2 + 2 * data.channels());
        self.cost + unknowns as f64 * (data.len() as f64).ln()
    }
}

/// Result of a search.
#[derive(Debug)]
pub(super) struct Selected {
    pub best: Candidate,
    /// The best one with white noise.
    pub white: Candidate,
    /// Decrease of minus twice the log likelihood by the first decay.
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
        Self { data, raw: Subspace::of(&centred) }
    }

    /// The number of decays of least cost, of at most `most`.
    pub(super) fn best(&self, most: usize) -> Option<Selected> {
        let per_decay = least_gain(self.data.len(), self.data.channels());
        let cost = |of: &Candidate| of.cost + per_decay * of.fit.poles.len() as f64;
        let nothing = self.nothing()?;
        let (mut last, mut best) = (nothing.clone(), nothing.clone());
        let (mut idle, mut first_gain) = ([0; 2], 0.0);
        while last.decays() < most && idle.iter().any(|idle| *idle < SELECTION_PATIENCE) {
            let Some(next) = self.one_more(&last) else { break };
            if last.decays() == 0 {
                first_gain = nothing.better().cost - next.better().cost;
            }
            let tracks = [(&next.white, &mut best.white), (&next.coloured, &mut best.coloured)];
            for ((next, best), idle) in tracks.into_iter().zip(&mut idle) {
                match cost(next) < cost(best) {
                    true => (*best, *idle) = (next.clone(), 0),
                    false => *idle += 1,
                }
            }
            last = next;
        }
        let Pair { white, coloured } = best;
        let best = if cost(&coloured) < cost(&white) { coloured } else { white.clone() };
        Some(Selected { best, white, first_gain })
    }

    /// So many decays, those of the record as it is: with the number given, an autoregression must not
    /// stand for some of them.
    pub(super) fn exactly(&self, decays: usize) -> Option<Candidate> {
        let raw = |wanted: usize| self.raw.as_ref().map(|raw| raw.poles(wanted));
        let mut fit = self.data.refined(&[], &self.white(), COARSE)?;
        while fit.poles.len() < decays {
            fit = self.extended(&fit, raw(fit.poles.len() + 1))?;
        }
        Some(self.candidate(fit))
    }

    fn nothing(&self) -> Option<Pair> {
        let fit = self.data.refined(&[], &self.white(), COARSE)?;
        Some(Pair { white: self.rated(&fit), coloured: self.candidate(fit) })
    }

    fn white(&self) -> Vec<Autoregression> {
        vec![Autoregression::default(); self.data.channels()]
    }

    /// The most likely fits with one decay more: from the poles there are with the strongest decay in the
    /// residual, and from the Hankel matrix; both as the record is and with its noise made white.
    fn one_more(&self, last: &Pair) -> Option<Pair> {
        let wanted = last.decays() + 1;
        let raw = self.raw.as_ref().map(|raw| raw.poles(wanted));
        let white = self.rated(&self.extended(&last.white.fit, raw)?);
        let mut coloured = self.candidate(white.fit.clone());
        if last.coloured.fit.noise.iter().any(|noise| noise.order() > 0) {
            let samples = scaled(&self.data.samples, &last.coloured.fit, self.data.constant);
            let hankel = Subspace::of(&samples).map(|subspace| subspace.poles(wanted));
            let other = self.extended(&last.coloured.fit, hankel).map(|fit| self.candidate(fit));
            if let Some(other) = other.filter(|other| other.cost < coloured.cost) {
                coloured = other;
            }
        }
        Some(Pair { white, coloured })
    }

    /// The most likely fit with one decay more than `last` and its noise, from the strongest decay in its
    /// residual or from `poles`.
    fn extended(&self, last: &Fit, poles: Option<Vec<Pole>>) -> Option<Fit> {
        let wanted = last.poles.len() + 1;
        let starts = [Some(last.poles.clone()), poles].into_iter().flatten();
        let fits = starts.filter_map(|poles| {
            let poles = self.completed(poles, &last.noise, wanted)?;
            self.data.refined(&poles, &last.noise, COARSE)
        });
        let misfit = |fit: &Fit| fit.misfit(self.data.len());
        fits.min_by(|a, b| misfit(a).total_cmp(&misfit(b)))
    }

    /// Adds the strongest decays of the residual until there are as many as wanted.
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

    /// A fit, or better one with the colour that its residual has.
    fn candidate(&self, mut fit: Fit) -> Candidate {
        let mut best = self.rated(&fit);
        for _ in 0..COLOUR_ROUNDS {
            let residual = self.data.residual(&fit);
            let noise: Vec<Autoregression> =
                residual.column_iter().map(|e| Autoregression::of(e.as_slice())).collect();
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
        let cost = fit.misfit(len) + coefficients as f64 * (len as f64).ln();
        Candidate { cost, fit: fit.clone() }
    }
}

/// Samples × channels with white noise of unit variance.
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

/// The record without its constants, its noise white and of unit variance.
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
    // The first samples are whitened otherwise than those that follow.
    let most = fit.noise.iter().map(Autoregression::order).max().unwrap_or(0);
    scaled.rows_range(most..).into_owned()
}
