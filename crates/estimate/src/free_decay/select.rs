//! The number of decays in a record, and the colour of its noise.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::autoregression::Autoregression;
use super::fit::{COARSE, Data, Fit};
use super::poles::{Pole, linear_columns};
use super::start::{Subspace, strongest};

/// Probability that noise alone gains as much as a further decay must.
pub(super) const FALSE_DECAY: f64 = 1e-3;
/// Numbers of decays that may gain nothing before the search for more ends.
const PATIENCE: usize = 2;
/// Rounds in which the colour of the noise and the poles follow one another.
const COLOUR_ROUNDS: usize = 3;

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

    /// Noise alone.
    pub(super) fn nothing(&self) -> Option<Candidate> {
        Some(self.candidate(self.data.refined(&[], &self.white(), COARSE)?))
    }

    /// The number of decays of least cost, of at most `most`.
    pub(super) fn best(&self, nothing: Candidate, most: usize) -> Candidate {
        let per_decay = least_gain(self.data.len(), self.data.channels());
        let cost = |of: &Candidate| of.cost + per_decay * of.fit.poles.len() as f64;
        let (mut best, mut last, mut idle) = (nothing.clone(), nothing, 0);
        while last.fit.poles.len() < most && idle < PATIENCE {
            let Some(next) = self.one_more(&last) else { break };
            if cost(&next) < cost(&best) {
                (best, idle) = (next.clone(), 0);
            } else {
                idle += 1;
            }
            last = next;
        }
        best
    }

    /// Decrease of minus twice the log likelihood that one decay brings, from noise alone of cost `alone`.
    pub(super) fn first_gain(&self, nothing: &Candidate) -> f64 {
        self.one_more(nothing).map_or(0.0, |one| nothing.cost - one.cost)
    }

    /// So many decays.
    pub(super) fn exactly(&self, nothing: Candidate, decays: usize) -> Option<Candidate> {
        let mut last = nothing;
        while last.fit.poles.len() < decays {
            last = self.one_more(&last)?;
        }
        Some(last)
    }

    fn white(&self) -> Vec<Autoregression> {
        vec![Autoregression::default(); self.data.channels()]
    }

    /// The most likely fit with one decay more: from the poles there are with the strongest decay in the
    /// residual, and from the Hankel matrix; both as the record is and with its noise made white.
    fn one_more(&self, last: &Candidate) -> Option<Candidate> {
        let wanted = last.fit.poles.len() + 1;
        let residual = self.data.residual(&last.fit);
        let white = self.white();
        let coloured = last.fit.noise.iter().any(|noise| noise.order() > 0);
        let mut starts: Vec<(Vec<Pole>, &[Autoregression])> = Vec::new();
        for noise in [&white, &last.fit.noise].into_iter().take(1 + usize::from(coloured)) {
            if let Some(pole) = strongest(&normalised(&residual, noise)) {
                starts.push(([&last.fit.poles[..], &[pole]].concat(), noise));
            }
        }
        if let Some(raw) = &self.raw {
            starts.push((raw.poles(wanted), &white));
        }
        if coloured {
            let samples = scaled(&self.data.samples, &last.fit, self.data.constant);
            if let Some(subspace) = Subspace::of(&samples) {
                starts.push((subspace.poles(wanted), &last.fit.noise));
            }
        }
        // Of the starts with either noise the best goes on.
        let mut fits: [Option<Fit>; 2] = [None, None];
        for (poles, noise) in starts {
            let fit = self.completed(poles, noise, wanted);
            let fit = fit.and_then(|poles| self.data.refined(&poles, noise, COARSE));
            let best = &mut fits[usize::from(!std::ptr::eq(noise, &white[..]))];
            let misfit = |fit: &Option<Fit>| {
                fit.as_ref().map_or(f64::INFINITY, |fit| fit.misfit(self.data.len()))
            };
            if misfit(&fit) < misfit(best) {
                *best = fit;
            }
        }
        let candidates = fits.into_iter().flatten().map(|fit| self.candidate(fit));
        candidates.min_by(|a, b| a.cost.total_cmp(&b.cost))
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
