//! Choice of the number of modes by the likelihood, with rules for poles that are significant but
//! are not modes.

use std::f64::consts::TAU;

use mechid_numerics::time_limit;

use super::initial::{initial_fit, match_amplitudes, scan};
use super::limits::{
    DAMPING_SIGNIFICANCE, MAX_DAMPING, NUISANCE_POLES, POOLING, REFUSALS, STRONG_EVIDENCE,
};
use super::lines::BandLines;
use super::noise_order::with_more_noise_terms;
use super::parameters::Parameters;
use super::result::{DropReason, DroppedCandidate};
use super::search::{Effort, Fit, search_pooled};
use super::transient::{FitWithTransient, search_with_transient};
use crate::stabilisation::Pole;

/// Requested number of modes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Number of modes, if it is stated.
    pub exactly: Option<usize>,
    /// Largest number of modes, if the likelihood decides.
    pub most: usize,
}

/// Selected modes.
pub(super) struct Chosen {
    pub fitted: FitWithTransient,
    /// Indices of the poles that are modes; the other poles explain a background or noise.
    pub accepted: Vec<usize>,
}

struct Choice<'a> {
    band: &'a BandLines,
    wanted: Wanted,
    dropped: Vec<DroppedCandidate>,
}

/// Selects the modes that explain the lines, starting from `candidates` (most certain first), and
/// lists the rejected candidates.
///
/// Poles that explain lines without being modes (a harmonic, a background, a mode outside the band)
/// stay in the fit: without them the modes would be biased.
pub(super) fn choose(
    candidates: &[Pole],
    band: &BandLines,
    wanted: Wanted,
) -> (Option<Chosen>, Vec<DroppedCandidate>) {
    let mut choice = Choice { band, wanted, dropped: Vec::new() };
    let limit = wanted.most.max(wanted.exactly.unwrap_or(0));
    for pole in candidates.iter().skip(limit) {
        choice.drop_pole(pole, DropReason::NumberReached { number: limit });
    }
    let mut first: Vec<Pole> = candidates.iter().take(limit).cloned().collect();
    first.sort_by(|a, b| a.pole.norm().total_cmp(&b.pole.norm()));
    let fit = initial_fit(&first, band)
        .map(|fit| choice.pruned(fit))
        .map(|fit| choice.extended(fit, limit))
        .and_then(|fit| search_pooled(fit.parameters, band, Effort::FULL))
        .and_then(|fit| search_with_transient(fit, band))
        .and_then(|known| match with_more_noise_terms(&known.fit, &known.lines) {
            Some(fit) => search_with_transient(fit, band),
            None => Some(known),
        })
        .map(|known| choice.confirmed(known));
    let chosen =
        fit.map(|fit| choice.select_modes(fit)).filter(|chosen| !chosen.accepted.is_empty());
    (chosen, choice.dropped)
}

impl Choice<'_> {
    /// Returns the minimum increase of 2 ln L for the acceptance of a mode: ln n per parameter,
    /// where n is twice the number of lines.
    ///
    /// # Source
    /// Schwarz (1978), Annals of Statistics 6, 461–464.
    fn penalty(&self) -> f64 {
        let parameters = 2.0 * self.band.outputs() as f64 + 2.0;
        parameters * self.penalty_of_parameter()
    }

    fn penalty_of_parameter(&self) -> f64 {
        (2.0 * self.band.omega.len() as f64).ln()
    }

    /// Returns the penalty of all noise polynomials of a fit.
    fn penalty_of_noise(&self, fit: &Fit) -> f64 {
        let layout = &fit.parameters.layout;
        (layout.noise_terms * layout.outputs) as f64 * self.penalty_of_parameter()
    }

    fn drop_pole(&mut self, pole: &Pole, reason: DropReason) {
        self.dropped.push(DroppedCandidate {
            natural_frequency_hz: pole.natural_frequency_hz(),
            damping_ratio: pole.damping_ratio(),
            reason,
        });
    }

    fn drop_mode(&mut self, parameters: &Parameters, mode: usize, reason: DropReason) {
        self.dropped.push(DroppedCandidate {
            natural_frequency_hz: parameters.omega(mode) / TAU,
            damping_ratio: parameters.zeta(mode),
            reason,
        });
    }

    /// Separates modes from other poles, and keeps at most the requested number.
    fn select_modes(&mut self, fitted: FitWithTransient) -> Chosen {
        let fit = &fitted.fit;
        let mut accepted = Vec::new();
        for (mode, rule) in self.broken_rules(fit).into_iter().enumerate() {
            match rule {
                Some(reason) => self.drop_mode(&fit.parameters, mode, reason),
                None => accepted.push(mode),
            }
        }
        let number = self.wanted.exactly.unwrap_or(self.wanted.most);
        let covariance = fit.covariance();
        while accepted.len() > number {
            let evidence =
                |mode: &usize| covariance.as_ref().map_or(0.0, |c| wald(&fit.parameters, c, *mode));
            let weakest = (0..accepted.len())
                .min_by(|a, b| evidence(&accepted[*a]).total_cmp(&evidence(&accepted[*b])))
                .unwrap_or(0);
            let mode = accepted.remove(weakest);
            self.drop_mode(&fit.parameters, mode, DropReason::NumberReached { number });
        }
        // After a search, the poles may be in another order of frequency.
        let omega = |mode: &usize| fit.parameters.omega(*mode);
        accepted.sort_by(|a, b| omega(a).total_cmp(&omega(b)));
        Chosen { fitted, accepted }
    }

    fn accepted_modes(&self, fit: &Fit) -> usize {
        self.broken_rules(fit).iter().filter(|rule| rule.is_none()).count()
    }

    /// Removes insignificant modes, one after another.
    fn pruned(&mut self, mut fit: Fit) -> Fit {
        while fit.parameters.layout.modes > 0 && !time_limit::is_over() {
            if self.wanted.exactly.is_some_and(|n| self.accepted_modes(&fit) <= n) {
                break;
            }
            let Some((next, mode, reason)) = self.without_insignificant_mode(&fit) else { break };
            self.drop_mode(&fit.parameters, mode, reason);
            fit = next;
        }
        fit
    }

    /// Returns the modes without strong evidence, those with the least evidence first.
    fn weak_modes(&self, fit: &Fit) -> Option<Vec<usize>> {
        let covariance = fit.covariance()?;
        let evidence = |mode: usize| (wald(&fit.parameters, &covariance, mode), mode);
        let mut weak: Vec<(f64, usize)> = (0..fit.parameters.layout.modes)
            .map(evidence)
            .filter(|(evidence, _)| *evidence < STRONG_EVIDENCE * self.penalty())
            .collect();
        weak.sort_by(|a, b| a.0.total_cmp(&b.0));
        Some(weak.into_iter().map(|(_, mode)| mode).collect())
    }

    /// Returns the fit without an insignificant mode, if there is such a mode; strong modes are not
    /// tested.
    fn without_insignificant_mode(&self, fit: &Fit) -> Option<(Fit, usize, DropReason)> {
        let needed = self.penalty();
        let gain = |next: &Fit| {
            let penalty = self.penalty_of_noise(next) - self.penalty_of_noise(fit);
            2.0 * (next.cost - fit.cost) + penalty
        };
        let mut weak = self.weak_modes(fit)?.into_iter().take_while(|_| !time_limit::is_over());
        weak.find_map(|mode| {
            let mut next = self.without(fit, mode)?;
            if gain(&next) >= needed {
                // Noise that the polynomials of the noise model cannot follow looks like a mode
                // with large damping.
                next = with_more_noise_terms(&next, self.band)?;
            }
            let gain = gain(&next);
            (gain < needed).then_some((next, mode, DropReason::SmallGain { gain, needed }))
        })
    }

    /// Removes modes that are insignificant in the likelihood with the transient. Where the
    /// expected periodogram does not describe the leakage exactly, a chance peak can seem
    /// significant.
    fn confirmed(&mut self, mut known: FitWithTransient) -> FitWithTransient {
        while let Some((next, mode, reason)) = self.unconfirmed(&known) {
            self.drop_mode(&known.fit.parameters, mode, reason);
            known = next;
        }
        known
    }

    /// Returns the fit without an insignificant mode, if there is such a mode.
    fn unconfirmed(
        &self,
        known: &FitWithTransient,
    ) -> Option<(FitWithTransient, usize, DropReason)> {
        if self.wanted.exactly.is_some_and(|n| self.accepted_modes(&known.fit) <= n) {
            return None;
        }
        let needed = self.penalty();
        let mut weak =
            self.weak_modes(&known.fit)?.into_iter().take_while(|_| !time_limit::is_over());
        weak.find_map(|mode| {
            let next = search_with_transient(self.without(&known.fit, mode)?, self.band)?;
            let gain = 2.0 * (next.cost - known.cost);
            (gain < needed).then_some((next, mode, DropReason::SmallGain { gain, needed }))
        })
    }

    /// Returns for each pole the rule that it breaks; `None` for a mode.
    fn broken_rules(&self, fit: &Fit) -> Vec<Option<DropReason>> {
        let (parameters, layout) = (&fit.parameters, &fit.parameters.layout);
        let (first, last) = (self.band.omega[0], self.band.omega[self.band.omega.len() - 1]);
        let covariance = fit.covariance();
        let rule = |mode: usize| {
            let zeta = parameters.zeta(mode);
            let omega = parameters.omega(mode);
            if zeta > MAX_DAMPING {
                return Some(DropReason::OverDamped { damping_ratio: zeta });
            }
            if omega < first || omega > last {
                return Some(DropReason::OutsideBand);
            }
            let index = layout.damping(mode);
            let variance = covariance.as_ref()?[(index, index)];
            let ratio = 1.0 / variance.max(f64::MIN_POSITIVE).sqrt();
            (ratio < DAMPING_SIGNIFICANCE).then_some(DropReason::DampingUndetermined { ratio })
        };
        (0..layout.modes).map(rule).collect()
    }

    fn without(&self, fit: &Fit, mode: usize) -> Option<Fit> {
        let remaining: Vec<usize> =
            (0..fit.parameters.layout.modes).filter(|r| *r != mode).collect();
        search_pooled(fit.parameters.reordered(&remaining), self.band, Effort::TEST)
    }

    /// Adds modes as long as they are significant, and removes the modes that they replace.
    fn extended(&mut self, mut fit: Fit, limit: usize) -> Fit {
        let mut refusals = 0;
        let before = fit.parameters.layout.modes;
        let mut refused: Vec<f64> = Vec::new();
        while refusals < REFUSALS && !time_limit::is_over() {
            let poles = fit.parameters.layout.modes;
            let full = self.accepted_modes(&fit) >= limit || poles >= limit + NUISANCE_POLES;
            let Some(candidates) = scan(&fit.parameters, self.band) else { break };
            let near = |omega: f64, other: &f64| (omega - other).abs() < 0.01 * omega;
            let fresh = candidates.into_iter().find(|candidate| {
                let omega = candidate.pole.pole.norm();
                !refused.iter().any(|other| near(omega, other))
            });
            let Some(candidate) = fresh else { break };
            // The gain from the scan is only an estimate, for one direction at an approximate pole.
            // Half of the penalty is therefore enough for a trial.
            let promising = candidate.gain > 0.5 * self.penalty();
            let is_stated = self.wanted.exactly.is_some_and(|n| self.accepted_modes(&fit) < n);
            if !promising && !is_stated {
                break;
            }
            if full {
                self.drop_pole(&candidate.pole, DropReason::NumberReached { number: limit });
                break;
            }
            match self.with(&fit, &candidate.pole, is_stated) {
                Ok(next) => {
                    // A pole that is not a mode may explain a background, but only a few such poles
                    // are useful.
                    let modes = self.accepted_modes(&next);
                    refusals += usize::from(modes <= self.accepted_modes(&fit));
                    fit = next;
                }
                Err(reason) => {
                    self.drop_pole(&candidate.pole, reason);
                    refused.push(candidate.pole.pole.norm());
                    refusals += 1;
                }
            }
        }
        if fit.parameters.layout.modes > before { self.pruned(fit) } else { fit }
    }

    /// Returns the fit with one more mode, or the reason for which it was rejected. If `is_stated`
    /// is true, the mode may be insignificant.
    fn with(&self, fit: &Fit, pole: &Pole, is_stated: bool) -> Result<Fit, DropReason> {
        let shape = &pole.vector * nalgebra::Complex::from(-pole.pole.re);
        let mut start = fit.parameters.with_mode(pole.pole, &shape);
        let mut order: Vec<usize> = (0..start.layout.modes).collect();
        order.sort_by(|a, b| start.omega(*a).total_cmp(&start.omega(*b)));
        start = start.reordered(&order);
        let added = order.iter().position(|r| *r + 1 == order.len()).unwrap_or(0);
        let pooled = self.band.pooled(&start.poles(), POOLING, start.layout.noise_terms);
        let mut matched = start.clone();
        match_amplitudes(&mut matched, &pooled, self.band.span, self.band.spacing());
        start.set_shape(added, &matched.shape(added));
        let next = search_pooled(start, self.band, Effort::TEST).ok_or(DropReason::NoMaximum)?;
        let (gain, needed) = (2.0 * (fit.cost - next.cost), self.penalty());
        if !is_stated && gain < needed {
            return Err(DropReason::SmallGain { gain, needed });
        }
        Ok(next)
    }
}

/// Returns Wald's statistic of a shape against zero.
fn wald(parameters: &Parameters, covariance: &nalgebra::DMatrix<f64>, mode: usize) -> f64 {
    let (first, len) = (parameters.layout.shape(mode), 2 * parameters.layout.outputs);
    let block = covariance.view((first, first), (len, len)).into_owned();
    let shape = parameters.values.rows(first, len).into_owned();
    block.cholesky().map_or(0.0, |factor| shape.dot(&factor.solve(&shape)))
}
