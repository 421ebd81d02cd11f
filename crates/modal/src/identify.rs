//! Identification of modes from line data: initial estimate, search, noise and number of modes.

use std::f64::consts::TAU;

use mechid_numerics::time_limit;
use mechid_spectra::LineData;
use nalgebra::Complex;

use crate::ModalError;
use crate::constraint::ModalConstraint;
use crate::covariance::{Covariance, least_determined_mode};
use crate::delays::{OutputDelay, apparent_delays, determined_delays};
use crate::estimate::{ModalEstimate, log_likelihood};
use crate::initial_poles::initial_poles;
use crate::limits::{MAX_DAMPING, MAX_TRIES, NEIGHBOUR_HALF_WIDTHS};
use crate::lines::Lines;
use crate::mode::{DropReason, DroppedCandidate};
use crate::model::{Model, ResidualPowers, first_powers};
use crate::noise::{Noise, shapes};
use crate::order::{
    Candidate, add_best, hidden, is_within_resonance, removal_losses, required_gain,
};
use crate::projection::Weights;
use crate::residues::with_participations;
use crate::rules::drop_reasons;
use crate::search::Fit;

/// Settings of an identification of modes.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalSettings {
    /// Number of modes to report: those that explain most, even if they are weak. Other significant
    /// modes are part of the model, but are not reported. `None` reports all significant modes.
    pub modes: Option<usize>,
    /// Frequencies (Hz) of modes to report (within 2 %), even if they are weak. Other modes are
    /// part of the model, but are not reported. If the list is empty, all modes are reported.
    pub near_hz: Vec<f64>,
    /// Largest number of modes that is tried.
    pub max_modes: usize,
    /// `true` if the noise includes the response of the modes to unmeasured forces.
    pub unmeasured_forces: bool,
    /// Powers of jω that represent modes outside the band; `None` chooses them by Akaike's
    /// criterion.
    pub residual_powers: Option<ResidualPowers>,
    /// Constraints that are imposed on the modes; each is also tested alone
    /// ([`ModalEstimate::constraint_tests`]).
    pub constraints: Vec<ModalConstraint>,
}

impl Default for ModalSettings {
    fn default() -> Self {
        Self {
            modes: None,
            near_hz: Vec::new(),
            max_modes: 100,
            unmeasured_forces: true,
            residual_powers: None,
            constraints: Vec::new(),
        }
    }
}

/// Identifies the modes in the band of the data by maximum likelihood, without a window.
///
/// The search varies the poles and participation factors; the shapes and residual terms follow from
/// linear least squares at each step. The transient of each open record (a record that does not
/// consist of whole periods) is estimated as one more force, common to all outputs. Delays of the
/// outputs relative to the forces are part of the model if the data determine them
/// ([`ModalEstimate::delays`]).
///
/// # Errors
/// [`ModalError`] if the data do not suffice for a mode, or if no mode is significant.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapters 9 and 12; El-Kafafy, Peeters, Guillaume & De Troyer, Mechanical Systems and Signal
/// Processing 70 (2016) 1034 (maximum likelihood of the modal model).
pub fn identify_modes(
    data: &LineData,
    settings: &ModalSettings,
) -> Result<ModalEstimate, ModalError> {
    check_settings(settings)?;
    let lines = Lines::new(data);
    lines.check()?;
    check_near(&settings.near_hz, &lines)?;
    check_constraints(settings, &lines)?;
    let poles = initial_poles(&lines)?;
    let delays = apparent_delays(&lines, &poles);
    let plain = Identification::selected(&lines, settings, poles);
    let Some(delays) = delays.filter(|_| !time_limit::is_over()) else { return plain.finish() };
    let advanced = lines.advanced(delays.iter().copied().map(OutputDelay::exact).collect());
    let Ok(poles) = initial_poles(&advanced) else { return plain.finish() };
    let search = Identification::selected(&advanced, settings, poles);
    // The data may leave the delays undetermined, because many residual terms can represent them.
    let determined = determined_delays(&lines, &search.fit, delays).unwrap_or_default();
    let lines = lines.advanced(determined);
    let search = search.on(&lines);
    let (without, with) = (plain.criterion(), search.criterion());
    log::debug!("information criterion {without:.0}, with delays {with:.0}");
    if with < without { search.finish() } else { plain.finish() }
}

/// Fits the modes of an estimate to other data of the same structure: a part of the record, or a
/// record of another day.
///
/// The search starts from the poles of the estimate, and uses the residual terms and delays of the
/// estimate. The result has only modes that the data determine.
///
/// # Errors
/// [`ModalError`] as for [`identify_modes`].
pub fn refit_modes(
    data: &LineData,
    estimate: &ModalEstimate,
    settings: &ModalSettings,
) -> Result<ModalEstimate, ModalError> {
    let residual_powers = Some(estimate.residual_powers().clone());
    let settings = ModalSettings { residual_powers, modes: None, ..settings.clone() };
    let lines = Lines::new(data);
    lines.check()?;
    check_constraints(&settings, &lines)?;
    let known = estimate.delays();
    if !known.is_empty() && known.len() != lines.outputs.len() {
        let (inputs, outputs) = (lines.inputs(), lines.outputs.len());
        let (model_inputs, model_outputs) = (estimate.model().inputs(), known.len());
        return Err(ModalError::Size { inputs, outputs, model_inputs, model_outputs });
    }
    let known = known.iter().map(|delay| OutputDelay::exact(delay.seconds));
    let lines = lines.advanced(known.collect());
    let mut search = Identification::from_poles(&lines, &settings, estimate.poles());
    search.apply_rules();
    search.finish()
}

fn check_constraints(settings: &ModalSettings, lines: &Lines) -> Result<(), ModalError> {
    let (outputs, inputs) = (lines.outputs.len(), lines.inputs());
    settings.constraints.iter().try_for_each(|constraint| constraint.check(outputs, inputs))
}

fn check_settings(settings: &ModalSettings) -> Result<(), ModalError> {
    if settings.modes == Some(0) || settings.max_modes == 0 {
        let required = "at least 1";
        return Err(ModalError::Setting { setting: "modes", value: 0.0, required });
    }
    let bad = settings.near_hz.iter().find(|hz| !(hz.is_finite() && **hz > 0.0));
    bad.map_or(Ok(()), |value| {
        let required = "a positive and finite frequency";
        Err(ModalError::Setting { setting: "near_hz", value: *value, required })
    })
}

/// Checks that stated frequencies (Hz) are in the band of the lines.
fn check_near(near_hz: &[f64], lines: &Lines) -> Result<(), ModalError> {
    let (low, high) = lines.band();
    let [from_hz, to_hz] = [low / TAU, high / TAU];
    match near_hz.iter().find(|hz| !(from_hz..=to_hz).contains(*hz)) {
        Some(&value) => Err(ModalError::OutsideBand { value, from_hz, to_hz }),
        None => Ok(()),
    }
}

/// State of an identification.
struct Identification<'a> {
    lines: &'a Lines,
    settings: &'a ModalSettings,
    fit: Fit<'a>,
    noise: Noise,
    dropped: Vec<DroppedCandidate>,
    /// `true` after the first choice of the residual terms. The noise is then known well enough to
    /// choose these terms again after a mode is removed.
    has_chosen_powers: bool,
}

impl<'a> Identification<'a> {
    /// Searches from given poles and from the requested frequencies, and chooses modes and residual
    /// terms.
    fn selected(
        lines: &'a Lines,
        settings: &'a ModalSettings,
        mut poles: Vec<Complex<f64>>,
    ) -> Self {
        log::debug!("{} poles to start with", poles.len());
        if !settings.near_hz.is_empty() {
            poles.extend(missing_poles(&poles, &settings.near_hz));
        }
        poles.truncate(settings.max_modes);
        let mut search = Self::from_poles(lines, settings, poles);
        search.choose_modes();
        search.choose_powers(AKAIKE);
        search.apply_rules();
        // The chosen residual terms may only have been needed because of a mode that is now
        // removed.
        while search.remove_replaceable() {
            search.choose_powers(lines.schwarz());
            search.apply_rules();
        }
        search
    }

    /// Returns the identification with the same model, weights and noise for `lines`: the same
    /// lines after the removal of other delays from the outputs.
    fn on<'b>(self, lines: &'b Lines) -> Identification<'b>
    where
        'a: 'b,
    {
        let steps = self.fit.steps;
        let fit = Fit { steps, ..Fit::new(lines, self.fit.model, self.fit.weights) };
        Identification { lines, fit, ..self }
    }

    /// Returns Schwarz's criterion: −2 log L and the penalty of all unknowns.
    fn criterion(&self) -> f64 {
        let (model, lines) = (&self.fit.model, self.lines);
        let linear = model.columns(lines) * lines.outputs.len();
        let unknowns = linear + model.parameters(lines) + lines.delays.len();
        -2.0 * log_likelihood(&self.fit) + lines.schwarz() * unknowns as f64
    }

    /// Searches from given poles.
    fn from_poles(lines: &'a Lines, settings: &'a ModalSettings, poles: Vec<Complex<f64>>) -> Self {
        let powers = settings.residual_powers.clone().unwrap_or_else(|| first_powers(lines));
        let level = |output: &Vec<Complex<f64>>| {
            let power = output.iter().map(|z| z.norm_sqr()).sum::<f64>();
            0.1 * (power / output.len() as f64).sqrt()
        };
        let level = lines.outputs.iter().map(level).collect();
        let weights = Weights { spectrum_shape: vec![1.0; lines.len()], level };
        let model = with_participations(lines, poles, &powers, &weights);
        let mut fit = Fit::new(lines, model, weights);
        fit.search_roughly();
        let noise = Noise::from_fit(&fit, None);
        let mut identification =
            Self { lines, settings, fit, noise, dropped: Vec::new(), has_chosen_powers: false };
        identification.remove_impossible();
        // The first search is unweighted; unmeasured forces are estimated after a search with
        // weights.
        identification.noise = Noise::from_fit(&identification.fit, None);
        identification.search_with_noise();
        identification.remove_impossible();
        identification.update_noise();
        identification
    }

    /// Estimates the noise from the current fit and searches again with its weights.
    fn update_noise(&mut self) {
        let process = self.settings.unmeasured_forces.then(|| self.noise.process.clone());
        self.noise = Noise::from_fit(&self.fit, process);
        self.search_with_noise();
    }

    /// Searches with the weights of the current noise estimate.
    fn search_with_noise(&mut self) {
        weigh(&mut self.fit, &self.noise);
        self.fit.search_roughly();
        log::debug!(
            "{} modes, {} steps, cost {:.1}",
            self.fit.model.modes(),
            self.fit.steps,
            self.fit.cost(),
        );
    }

    /// Removes modes whose gain is less than the penalty of their parameters, and adds candidates
    /// whose gain is larger.
    fn choose_modes(&mut self) {
        let required = required_gain(self.lines);
        self.remove_impossible();
        self.remove_insignificant(required);
        let most = self.settings.max_modes.max(self.settings.modes.unwrap_or(0));
        while self.modes_in_band() < most && !time_limit::is_over() {
            let is_stated = self.settings.modes.is_some_and(|least| self.modes_in_band() < least);
            let least = if is_stated { 0.0 } else { required };
            let before = self.fit.model.modes();
            match add_best(&mut self.fit, least) {
                Ok(()) => {
                    self.update_noise();
                    self.remove_impossible();
                    // If the number of modes did not rise, the candidate only replaced another
                    // mode, and the loop would never end.
                    if self.fit.model.modes() <= before {
                        break;
                    }
                }
                Err(tried) => {
                    let reason = |one: &Candidate| match one.gain {
                        gain if gain <= required => DropReason::Insignificant { gain, required },
                        _ if self.lines.reaches(one.pole) => DropReason::TooDamped,
                        _ => DropReason::OutsideBand,
                    };
                    let rejected =
                        tried.iter().map(|one| DroppedCandidate::new(one.pole, reason(one)));
                    self.dropped.extend(rejected);
                    break;
                }
            }
        }
        self.add_hidden(required, most);
    }

    /// Adds modes whose response the fit attributes to the unmeasured force on a nearby mode. A
    /// mode is added if the likelihood of fit and noise together rises by at least the penalty of
    /// its parameters.
    fn add_hidden(&mut self, required: f64, most: usize) {
        while self.settings.unmeasured_forces
            && self.modes_in_band() < most
            && !time_limit::is_over()
        {
            let mut trial = self.fit.clone();
            weigh(&mut trial, &Noise::from_fit(&self.fit, None));
            let Some(candidate) = hidden(&trial, required) else { return };
            trial.model.push(&candidate);
            trial.refresh();
            trial.search_roughly();
            let noise = Noise::from_fit(&trial, Some(Vec::new()));
            weigh(&mut trial, &noise);
            trial.search_roughly();
            let gain = 2.0 * (log_likelihood(&trial) - log_likelihood(&self.fit));
            let hz = candidate.pole.im / TAU;
            log::debug!("hidden mode {hz:.3} Hz, gain {gain:.0}, required {required:.0}");
            let modes = &trial.model.poles;
            let stays =
                modes.split_last().is_some_and(|(one, others)| is_within_resonance(*one, others));
            if gain < required || !stays {
                return;
            }
            (self.fit, self.noise) = (trial, noise);
            self.update_noise();
            if self.remove_impossible() {
                return;
            }
        }
    }

    /// Returns the number of modes in the band.
    fn modes_in_band(&self) -> usize {
        self.fit.model.poles.iter().filter(|pole| self.lines.contains(**pole)).count()
    }

    /// Removes roots that are damped too much for a resonance, and roots outside the band whose
    /// gain is less than the penalty of their parameters; returns whether a root was removed.
    ///
    /// A strong mode outside the band remains in the model: with residual terms alone, modes near
    /// the edge would be biased.
    fn remove_impossible(&mut self) -> bool {
        let required = required_gain(self.lines);
        let losses = removal_losses(&self.fit);
        let reason = |(pole, loss): (&Complex<f64>, &f64)| {
            if -pole.re / pole.norm() > MAX_DAMPING {
                Some(DropReason::TooDamped)
            } else if !self.lines.reaches(*pole) || !self.lines.contains(*pole) && *loss < required
            {
                Some(DropReason::OutsideBand)
            } else {
                None
            }
        };
        let reasons: Vec<Option<DropReason>> =
            self.fit.model.poles.iter().zip(&losses).map(reason).collect();
        self.remove(&reasons);
        reasons.iter().any(Option::is_some)
    }

    /// Removes modes whose removal costs less likelihood than the penalty of their parameters,
    /// until all remaining modes are significant; returns whether a mode was removed.
    fn remove_insignificant(&mut self, required: f64) -> bool {
        let mut removed = false;
        loop {
            let losses = removal_losses(&self.fit);
            let protected = self.protected();
            let reason = |mode: usize| {
                let gain = losses[mode];
                let is_insignificant = gain < required && !protected[mode];
                is_insignificant.then_some(DropReason::Insignificant { gain, required })
            };
            let reasons: Vec<_> = (0..losses.len()).map(reason).collect();
            let reasons = weakest_of_neighbours(&self.fit.model.poles, &losses, reasons);
            if reasons.iter().all(Option::is_none) {
                break;
            }
            self.remove(&reasons);
            self.remove_impossible();
            removed = true;
        }
        removed
    }

    /// Removes the weakest modes if the likelihood, maximised again without them, falls by less
    /// than the penalty of their parameters; returns whether a mode was removed.
    ///
    /// If other modes can represent the response of a mode, the fall at fixed poles and
    /// participations is larger than the fall after the new search.
    fn remove_replaceable(&mut self) -> bool {
        let required = required_gain(self.lines);
        let mut removed = false;
        let mut tried = 0;
        while tried < MAX_TRIES && !time_limit::is_over() {
            let losses = removal_losses(&self.fit);
            let protected = self.protected();
            let mut order: Vec<usize> = (0..losses.len())
                .filter(|mode| {
                    !protected[*mode] && self.lines.contains(self.fit.model.poles[*mode])
                })
                .collect();
            order.sort_by(|a, b| losses[*a].total_cmp(&losses[*b]));
            let Some(&mode) = order.get(tried) else { break };
            let mut trial = self.fit.clone();
            let retained: Vec<usize> = (0..losses.len()).filter(|other| *other != mode).collect();
            trial.model.select(&retained);
            trial.refresh();
            trial.search_roughly_to(self.fit.cost() + required);
            // In the new search another mode may move towards the pole of the removed mode, and so
            // leave the band or the permitted range of damping. The other mode would then be lost,
            // too.
            let is_lost = |(before, after): (&usize, &Complex<f64>)| -> bool {
                self.is_possible(self.fit.model.poles[*before]) && !self.is_possible(*after)
            };
            let loses = retained.iter().zip(&trial.model.poles).any(is_lost);
            let gain = trial.cost() - self.fit.cost();
            log::debug!(
                "mode {:.3} Hz removed: cost +{:.0} at fixed poles, +{gain:.0} after {} steps; limit +{required:.0}",
                self.fit.model.poles[mode].im / TAU,
                losses[mode],
                trial.steps - self.fit.steps,
            );
            if gain < required && !loses {
                let mut reasons = vec![None; losses.len()];
                reasons[mode] = Some(DropReason::Insignificant { gain, required });
                self.reject(&reasons);
                self.fit = trial;
                self.update_noise();
                (removed, tried) = (true, 0);
            } else {
                tried += 1;
            }
        }
        removed
    }

    /// Returns whether a pole may belong to a resonance in the band or near it.
    fn is_possible(&self, pole: Complex<f64>) -> bool {
        -pole.re / pole.norm() <= MAX_DAMPING && self.lines.reaches(pole)
    }

    /// Returns which modes the settings request, by frequency or by a number of modes; no rule
    /// removes these modes.
    fn protected(&self) -> Vec<bool> {
        let ModalSettings { modes, near_hz, .. } = self.settings;
        match modes {
            None if near_hz.is_empty() => vec![false; self.fit.model.modes()],
            None => stated_modes(&self.fit.model.poles, near_hz),
            Some(_) => self.requested(),
        }
    }

    /// Returns which modes in the band were requested: the modes nearest to the stated frequencies,
    /// or all modes if no frequency is stated. If a number of modes is stated, only this number of
    /// these modes is requested: those with the largest gains.
    fn requested(&self) -> Vec<bool> {
        let poles = &self.fit.model.poles;
        let mut requested = stated_modes(poles, &self.settings.near_hz);
        for (requested, pole) in requested.iter_mut().zip(poles) {
            *requested &= self.lines.contains(*pole);
        }
        if let Some(number) = self.settings.modes {
            let losses = removal_losses(&self.fit);
            let mut order: Vec<usize> = (0..poles.len()).filter(|mode| requested[*mode]).collect();
            order.sort_by(|a, b| losses[*b].total_cmp(&losses[*a]));
            order.into_iter().skip(number).for_each(|mode| requested[mode] = false);
        }
        requested
    }

    /// Removes the modes for which there is a reason in `reasons`, and searches again.
    ///
    /// A removed mode may have taken the place of residual terms. Their powers are therefore chosen
    /// again, with the weights of the fit that contained the mode.
    fn remove(&mut self, reasons: &[Option<DropReason>]) {
        if reasons.iter().all(Option::is_none) {
            return;
        }
        let retained = self.reject(reasons);
        self.fit.model.select(&retained);
        self.fit.refresh();
        if self.has_chosen_powers {
            self.choose_powers(self.lines.schwarz());
        }
        self.fit.search_roughly();
    }

    /// Records the rejected modes, each with its reason, and returns the indices of the other
    /// modes.
    fn reject(&mut self, reasons: &[Option<DropReason>]) -> Vec<usize> {
        for (pole, reason) in self.fit.model.poles.iter().zip(reasons) {
            if let Some(reason) = reason {
                log::debug!("{:.3} Hz removed: {}", pole.im / TAU, reason.words());
                self.dropped.push(DroppedCandidate::new(*pole, *reason));
            }
        }
        let retained: Vec<usize> =
            (0..reasons.len()).filter(|mode| reasons[*mode].is_none()).collect();
        self.noise.process = retained
            .iter()
            .map(|mode| self.noise.process.get(*mode).copied().unwrap_or(0.0))
            .collect();
        retained
    }

    /// Chooses the residual terms by Akaike's criterion: too few terms bias the poles, too many
    /// terms only add variance. Each unknown beyond the current number has the given `penalty`
    /// instead of Akaike's.
    fn choose_powers(&mut self, penalty: f64) {
        if self.settings.residual_powers.is_some() {
            return;
        }
        let unknowns =
            |model: &Model| (model.columns(self.lines) * self.lines.outputs.len()) as f64;
        let current = unknowns(&self.fit.model);
        let mut best = (f64::INFINITY, self.fit.model.powers.clone());
        self.has_chosen_powers = true;
        for powers in power_sets(self.lines.inputs()) {
            let mut trial = self.fit.clone();
            trial.model.powers = powers.clone();
            trial.refresh();
            let count = unknowns(&trial.model);
            let criterion =
                trial.cost() + AKAIKE * count.min(current) + penalty * (count - current).max(0.0);
            log::debug!(
                "{} residual terms for forces, {} for transients: criterion {criterion:.1}",
                powers.forces.len(),
                powers.transients.len()
            );
            if criterion < best.0 {
                best = (criterion, powers);
            }
        }
        if best.1 != self.fit.model.powers {
            self.fit.model.powers = best.1;
            self.fit.refresh();
            self.fit.search_roughly();
            self.update_noise();
        }
    }

    /// Removes modes that are significant but are not resonances of the structure.
    fn apply_rules(&mut self) {
        while self.fit.model.modes() > 0 {
            let Some(covariance) = self.covariance_of_all() else { return };
            let mut reasons = drop_reasons(&self.fit, &self.noise, &covariance);
            for (reason, protected) in reasons.iter_mut().zip(self.protected()) {
                *reason = reason.filter(|reason| !protected && !is_sinusoid(reason));
            }
            let losses = removal_losses(&self.fit);
            let reasons = weakest_of_neighbours(&self.fit.model.poles, &losses, reasons);
            if reasons.iter().all(Option::is_none) {
                return;
            }
            self.remove(&reasons);
            self.remove_impossible();
            self.update_noise();
        }
    }

    /// Returns the covariance of the last fit. If the curvature of the fit is singular, the modes
    /// outside the band are removed first, then one mode at a time: the mode that the data
    /// determine least. `None` if the curvature is still singular with one mode.
    fn covariance_of_all(&mut self) -> Option<Covariance> {
        loop {
            let covariance = Covariance::new(&self.fit, &self.noise);
            let modes = self.fit.model.modes();
            if covariance.is_some() || modes < 2 {
                return covariance;
            }
            let mut reasons = vec![None; modes];
            if self.modes_in_band() < modes {
                for (reason, pole) in reasons.iter_mut().zip(&self.fit.model.poles) {
                    *reason = (!self.lines.contains(*pole)).then_some(DropReason::OutsideBand);
                }
            } else {
                reasons[least_determined_mode(&self.fit)?] = Some(DropReason::Undetermined);
            }
            self.remove(&reasons);
            self.update_noise();
            self.fit.search();
        }
    }

    fn no_mode(&self) -> ModalError {
        let (low, high) = self.lines.band();
        let dropped = self.dropped.clone();
        ModalError::NoMode { from_hz: low / TAU, to_hz: high / TAU, dropped }
    }

    fn finish(mut self) -> Result<ModalEstimate, ModalError> {
        self.fit.model.sort();
        self.noise.process = Vec::new();
        self.fit.refresh();
        self.update_noise();
        self.update_noise();
        self.fit.search();
        // The last search can move a mode out of the band, or make a mode insignificant.
        let required = required_gain(self.lines);
        while self.remove_impossible() || self.remove_insignificant(required) {
            self.update_noise();
            self.fit.search();
        }
        let size = self.fit.model.parameters(self.lines);
        let failed = ModalError::Decomposition { what: "the curvature of the likelihood", size };
        let covariance = self.covariance_of_all().ok_or(failed)?;
        let (mut stated, protected) = (self.requested(), self.protected());
        let reasons = drop_reasons(&self.fit, &self.noise, &covariance);
        for (mode, pole) in self.fit.model.poles.iter().enumerate() {
            let sinusoid = reasons[mode].filter(is_sinusoid).filter(|_| !protected[mode]);
            stated[mode] &= sinusoid.is_none();
            if !stated[mode] && self.lines.contains(*pole) {
                let reason = sinusoid.unwrap_or(DropReason::NotRequested);
                self.dropped.push(DroppedCandidate::new(*pole, reason));
            }
        }
        if !stated.contains(&true) {
            return Err(self.no_mode());
        }
        let constraints = &self.settings.constraints;
        let (fit, noise) = (&self.fit, &self.noise);
        Ok(ModalEstimate::new(fit, noise, &covariance, self.dropped, &stated, constraints))
    }
}

/// Returns whether the mode has no measurable damping, like a sinusoid (for example mains hum). The
/// mode stays in the model, so that its response does not count as noise, but it is not reported.
fn is_sinusoid(reason: &DropReason) -> bool {
    matches!(reason, DropReason::UndeterminedDamping { .. })
}

/// Returns the reasons for the removal of modes, except of modes near a weaker mode that is
/// removed. Neighbouring modes may explain the same response, so that the reason against the
/// stronger mode may disappear when the weaker mode is removed.
fn weakest_of_neighbours(
    poles: &[Complex<f64>],
    losses: &[f64],
    reasons: Vec<Option<DropReason>>,
) -> Vec<Option<DropReason>> {
    let mut order: Vec<usize> = (0..poles.len()).filter(|mode| reasons[*mode].is_some()).collect();
    order.sort_by(|a, b| losses[*a].total_cmp(&losses[*b]));
    let mut weakest = vec![None; poles.len()];
    for mode in order {
        let is_near = |other: usize| {
            let width = (-poles[mode].re).max(-poles[other].re);
            (poles[mode].im - poles[other].im).abs() < NEIGHBOUR_HALF_WIDTHS * width
        };
        if !(0..poles.len()).any(|other| weakest[other].is_some() && is_near(other)) {
            weakest[mode] = reasons[mode];
        }
    }
    weakest
}

/// Weights a fit by a noise estimate.
fn weigh(fit: &mut Fit<'_>, noise: &Noise) {
    let shapes = shapes(&fit.projection, &fit.weights, fit.model.modes());
    fit.weights = noise.weights(fit.lines, &fit.model, &shapes);
    fit.refresh();
}

/// Penalty of one unknown in −2 log L by Akaike's criterion.
const AKAIKE: f64 = 2.0;

/// Returns the sets of residual terms that are compared, each as powers of jω. In free decays the
/// modes outside the band act only through their transients.
fn power_sets(inputs: usize) -> Vec<ResidualPowers> {
    if inputs == 0 {
        let largest = [None, Some(0), Some(1), Some(2), Some(4), Some(6)];
        let transients = |largest: i32| (-largest..=largest).collect();
        let set = |largest: Option<i32>| ResidualPowers {
            forces: Vec::new(),
            transients: largest.map_or_else(Vec::new, transients),
        };
        return largest.into_iter().map(set).collect();
    }
    let forces = [
        vec![-2, 0, 2],
        vec![-4, -2, 0, 2, 4],
        vec![-6, -4, -2, 0, 2, 4, 6],
        vec![-4, -3, -2, -1, 0, 1, 2, 3, 4],
        vec![-6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6],
    ];
    forces.into_iter().map(|forces| ResidualPowers { forces, transients: vec![0, 1, 2] }).collect()
}

/// Maximum distance of a pole from a requested frequency, relative to this frequency, at which the
/// pole matches it.
const STATED_DISTANCE: f64 = 0.02;

/// Returns lightly damped poles at those requested frequencies that have no pole nearby.
fn missing_poles(poles: &[Complex<f64>], near_hz: &[f64]) -> Vec<Complex<f64>> {
    const DAMPING: f64 = 5e-3;
    let omegas = near_hz.iter().map(|hz| TAU * hz);
    let is_missing = |omega: &f64| {
        poles.iter().all(|pole| (pole.norm() - omega).abs() > STATED_DISTANCE * omega)
    };
    omegas.filter(is_missing).map(|omega| Complex::new(-DAMPING, 1.0) * omega).collect()
}

/// Returns which modes are nearest to the requested frequencies; if none is requested, these are
/// all modes.
fn stated_modes(poles: &[Complex<f64>], near_hz: &[f64]) -> Vec<bool> {
    let mut stated = vec![near_hz.is_empty(); poles.len()];
    for omega in near_hz.iter().map(|hz| TAU * hz) {
        let distance = |mode: &usize| (poles[*mode].norm() - omega).abs();
        let nearest = (0..poles.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(mode) = nearest.filter(|mode| distance(mode) < STATED_DISTANCE * omega) {
            stated[mode] = true;
        }
    }
    stated
}
