//! Fits in the time domain, sample by sample.

use mechid_checks::HighestMode;
use mechid_checks::{
    Finding, ModeLimit, before_equation_of_motion, before_fit, claimed_period, delay_at_samples,
    delay_between_samples, fitted_step, noise_on_response, periodicity, periodicity_across,
};
use mechid_estimate::time_domain::{TimeDomain, Transitions};
use mechid_estimate::{EquationOfMotion, Estimate, Unknowns, missing_force};
use mechid_model::Discretisation;
use mechid_signal::{Extent, Interpolation, Record, message};

use super::CONSPICUOUS;
use super::derivatives::Prepared;
use super::fitted::{Fitted, Residual, SampleResidual};
use super::keywords::Domain;
use super::options::{Between, Derivatives, SampleFit};
use super::prediction::Prediction;
use crate::AnalysisError;
use crate::measurement::{Block, CHUNK_SAMPLES, Hold, Windowed};

impl SampleFit {
    /// Returns the part of a record that must be in memory: the whole record if every sample
    /// depends on all others.
    pub(crate) fn hold(&self) -> Hold {
        match (self.derivatives, self.refine.map(|refine| refine.interpolation)) {
            (Some(Derivatives::Spectral), _) => Hold::Whole,
            (_, Some(Between::Spline | Between::BandLimited)) => Hold::Whole,
            (derivatives, _) => Hold::Samples(derivatives.map_or(0, Derivatives::window)),
        }
    }

    /// Fits the samples of one or several windows: the equation of motion at the samples if there
    /// is an acceleration and no other estimator is requested, otherwise the transition from each
    /// sample to the next.
    pub(crate) fn fit(
        &self,
        records: &[Windowed],
        unknowns: &Unknowns,
    ) -> Result<Fitted, AnalysisError> {
        let between = self.between_samples;
        let prepare = |r: &Windowed| Prepared::from_block(&r.held, self.derivatives);
        let prepared: Vec<Prepared> = records.iter().map(prepare).collect::<Result<_, _>>()?;
        if between.is_some() && prepared.iter().any(|p| p.twice_differentiated) {
            return Err(AnalysisError::TwiceDifferentiated);
        }
        match between {
            None if prepared[0].acceleration.is_some() => {
                self.at_samples(records, &prepared, unknowns)
            }
            _ => self.step_by_step(records, &prepared, unknowns, between),
        }
    }

    /// Processes a record in chunks. Each chunk after the first begins with the last sample of the
    /// previous one; the callback receives a flag for the last chunk. If every sample depends on
    /// all others, the record is one chunk.
    fn chunks(
        &self,
        recorded: &Windowed,
        take: &mut dyn FnMut(Prepared, bool) -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        let window = &recorded.held;
        let advance = match self.hold() {
            Hold::Whole => window.force.len(),
            _ => (CHUNK_SAMPLES / self.refine.map_or(1, |refine| refine.factor.max(1))).max(1),
        };
        // A sliding polynomial needs neighbours on both sides of each sample.
        let margin = self.noise_span() / 2;
        recorded.chunks(advance + 1 + 2 * margin, advance, &mut |chunk| {
            let len = chunk.force.len();
            let first = chunk.first_sample == window.first_sample;
            let last = chunk.first_sample + len - 1 == window.last_sample();
            let inside = if first { 0 } else { margin }..if last { len } else { len - margin };
            take(Prepared::from_block(chunk, self.derivatives)?.window(inside)?, last)
        })
    }

    /// Returns the extent of the buffered samples.
    fn extent_of(&self, held: &Block) -> Extent {
        if held.held_to().is_some() { Extent::Open } else { self.extent() }
    }

    /// Checks whether a window stated as one period is periodic; uses only the first and last
    /// samples if the window is not fully buffered.
    fn seam(&self, recorded: &Windowed, p: &Prepared, end: Option<Record>) -> Vec<Finding> {
        match (self.extent(), recorded.held.held_to(), end) {
            (Extent::Open, ..) | (_, Some(_), None) => Vec::new(),
            (Extent::WholePeriod, Some(_), Some(end)) => {
                vec![periodicity_across(&p.displacement, &end)]
            }
            (Extent::WholePeriod, None, _) => {
                let claimed = claimed_period(&p.force, p.force.len());
                std::iter::once(periodicity(&p.displacement)).chain(claimed).collect()
            }
        }
    }

    /// Adds the equations of motion at the samples of a record; returns the displacements of its
    /// last two samples.
    fn push_instants(
        &self,
        recorded: &Windowed,
        rows: &mut EquationOfMotion,
    ) -> Result<Option<Record>, AnalysisError> {
        let mut end = None;
        self.chunks(recorded, &mut |p, last| {
            let Some(response) = p.response()? else {
                return Err(AnalysisError::TimeDomainMotions);
            };
            // The next chunk begins with the last sample of this one.
            let count = if last { p.force.len() } else { p.force.len() - 1 };
            let [a, v, x] = [response.acceleration(), response.velocity(), response.displacement()]
                .map(|r| r.data().rows(0, count));
            rows.push_rows(a, v, x, p.force.data().rows(0, count))?;
            end = last_two(&p)?;
            Ok(())
        })?;
        Ok(end)
    }

    /// Adds the transitions between the samples of a record that begins with `held`; returns the
    /// displacements of its last two samples.
    fn push_steps(
        &self,
        recorded: &Windowed,
        held: &Prepared,
        rows: &mut Transitions,
    ) -> Result<Option<Record>, AnalysisError> {
        let (extent, mut end) = (self.extent(), None);
        self.chunks(recorded, &mut |p, last| {
            end = last_two(&p)?;
            if let Some((factor, interpolation)) = self.refinement() {
                return Ok(rows.push_refined(p.states(), extent, factor, interpolation)?);
            }
            // In a periodic record, the last sample is followed by the first sample.
            let closes = last && extent == Extent::WholePeriod;
            let p = if closes { p.followed_by(held)? } else { p };
            let [x, v, force] = p.states();
            Ok(rows.push(x, v, force, Extent::Open)?)
        })?;
        Ok(end)
    }

    fn at_samples(
        &self,
        records: &[Windowed],
        prepared: &[Prepared],
        unknowns: &Unknowns,
    ) -> Result<Fitted, AnalysisError> {
        let mut rows = EquationOfMotion::new(unknowns.dof());
        let (mut before, mut responses) = (Vec::new(), Vec::new());
        for (recorded, p) in records.iter().zip(prepared) {
            let end = self.push_instants(recorded, &mut rows)?;
            responses.push(p.response()?.ok_or(AnalysisError::TimeDomainMotions)?);
            before.push(self.seam(recorded, p, end));
        }
        let measured = responses.iter().zip(prepared).map(|(response, p)| (response, &p.force));
        let before_all = before_equation_of_motion(&Vec::from_iter(measured), unknowns)?;
        let estimate = rows.solve(unknowns)?;
        // Undetermined parameters are refused before the residuals are computed.
        estimate.system()?;
        let span = self.noise_span();
        let residuals = prepared.iter().filter_map(|p| equation_residual(p, &estimate, span));
        let look = |p: &Prepared| self.at_samples_after(p, &estimate);
        let after = prepared.iter().map(look).collect::<Result<_, _>>()?;
        Ok(Fitted {
            equations: rows.rows(),
            before_all,
            before,
            after,
            residuals: residuals.collect::<Result<_, _>>()?,
            remarks: self.remarks(prepared, &estimate),
            ..Fitted::new(
                Domain::Time,
                "least squares on the equation of motion, sample by sample",
                self.prediction(Discretisation::FirstOrderHold),
                estimate,
            )
        })
    }

    /// Returns the findings other than those on the residual.
    fn at_samples_after(
        &self,
        p: &Prepared,
        estimate: &Estimate,
    ) -> Result<Vec<Finding>, AnalysisError> {
        let Some(response) = p.response()? else { return Ok(Vec::new()) };
        let mut checks = Vec::from_iter(delay_at_samples(&response, &p.force, estimate.unknowns()));
        // Differentiation correlates the noise of neighbouring samples.
        if self.derivatives.is_none() {
            checks.extend(noise_on_response(&response, &p.force, estimate)?);
        }
        Ok(checks)
    }

    fn step_by_step(
        &self,
        records: &[Windowed],
        prepared: &[Prepared],
        unknowns: &Unknowns,
        between: Option<Discretisation>,
    ) -> Result<Fitted, AnalysisError> {
        let discretisation = between.unwrap_or(Discretisation::FirstOrderHold);
        let dt = prepared[0].force.sampling().dt();
        let steps = self.refine.map_or(1, |refine| refine.factor.max(1)) as f64;
        let mut rows = Transitions::new(unknowns.dof(), dt / steps)?;
        let mut before = Vec::new();
        for (recorded, p) in records.iter().zip(prepared) {
            let end = self.push_steps(recorded, p, &mut rows)?;
            before.push(self.seam(recorded, p, end));
        }
        let held_whole = records.iter().all(|recorded| recorded.held.held_to().is_none());
        let extent = if held_whole { self.extent() } else { Extent::Open };
        let states: Vec<[&Record; 3]> = prepared.iter().map(Prepared::states).collect();
        let mut before_all = before_fit(TimeDomain::new(discretisation, extent), &states)?;
        let fit = rows.fit(discretisation, unknowns)?;
        let estimate = fit.into_estimate();
        judge_step_by_modes(&mut before_all, &estimate, dt)?;
        let residual = |(recorded, p): (&Windowed, &Prepared)| -> Result<Residual, AnalysisError> {
            let extent = self.extent_of(&recorded.held);
            let [samples, fitted] =
                missing_force(&estimate, p.states(), discretisation, extent, self.refinement())?;
            let force = p.force.window(0, samples.len())?;
            // An error of a measured state affects the interval before this state and the interval
            // after it.
            let noise_span = self.noise_span() + 1;
            Ok(Residual::Samples(SampleResidual { samples, fitted, force, noise_span }))
        };
        let residuals = records.iter().zip(prepared).map(residual).collect::<Result<_, _>>()?;
        let method = TimeDomain::new(discretisation, Extent::Open);
        let late = |p: &Prepared| {
            let [x, v, force] = p.states();
            Vec::from_iter(delay_between_samples(method, x, v, force, unknowns))
        };
        Ok(Fitted {
            equations: rows.rows(),
            before_all,
            before,
            after: prepared.iter().map(late).collect(),
            residuals,
            remarks: self.remarks(prepared, &estimate),
            ..Fitted::new(
                Domain::Time,
                estimator(discretisation),
                self.prediction(discretisation),
                estimate,
            )
        })
    }

    fn prediction(&self, discretisation: Discretisation) -> Prediction {
        match &self.derivatives {
            // Spectral derivatives assume a periodic response, so the prediction does, too.
            Some(Derivatives::Spectral) => Prediction::Steady,
            _ => Prediction::Sampled { discretisation, extent: self.extent() },
        }
    }

    /// Returns the largest distance, in samples, of two derivatives that contain the noise of the
    /// same sample; 0 without a sliding polynomial.
    fn noise_span(&self) -> usize {
        self.derivatives.map_or(0, Derivatives::window).saturating_sub(1)
    }

    fn remarks(&self, prepared: &[Prepared], estimate: &Estimate) -> Vec<String> {
        let mut remarks = Vec::new();
        if let Some((factor, way)) = self.refinement() {
            let open = way != Interpolation::BandLimited && self.extent() == Extent::WholePeriod;
            remarks.push(format!(
                "the record was interpolated, with {} in every sampling interval; the standard errors count only \
                 measured samples{}",
                message::count(factor, "step"),
                if open { ", and the interpolation treats the window as open" } else { "" }
            ));
        }
        if prepared.iter().any(|p| p.twice_differentiated) {
            remarks.push(
                "the equation of motion was fitted to second derivatives of force and acceleration"
                    .into(),
            );
        } else if self.derivatives.is_some() {
            remarks.push(
                "only one of displacement, velocity and acceleration is measured; \
                 the other two are computed from this one"
                    .into(),
            );
        }
        let residual = estimate.residual_nrmse().iter().copied().fold(0.0, f64::max);
        if self.derivatives == Some(Derivatives::Spectral) && residual > CONSPICUOUS {
            remarks.push(
                "spectral derivatives contain the noise of every line, excited or not; those computed from an \
                 acceleration contain mainly the noise of the low lines. Leave `domain` time and `derivatives` \
                 out to fit the same whole periods on the excited lines only"
                    .into(),
            );
        }
        remarks
    }
}

/// Replaces the warning about a force held between the samples by a more specific check against the
/// identified modes.
fn judge_step_by_modes(
    findings: &mut [Finding],
    estimate: &Estimate,
    dt: f64,
) -> Result<(), AnalysisError> {
    for finding in findings {
        if matches!(
            finding,
            Finding::HighestMode(HighestMode { limit: ModeLimit::BetweenSamples, .. })
        ) {
            *finding = fitted_step(estimate, dt)?;
        }
    }
    Ok(())
}

/// Returns the displacements of the last two samples.
fn last_two(p: &Prepared) -> Result<Option<Record>, AnalysisError> {
    let (x, len) = (&p.displacement, p.displacement.len());
    Ok(if len < 2 { None } else { Some(x.window(len - 2, 2)?) })
}

/// Returns the residual F − M ẍ − C ẋ − K x of the equation of motion.
fn equation_residual(
    p: &Prepared,
    estimate: &Estimate,
    noise_span: usize,
) -> Option<Result<Residual, AnalysisError>> {
    let a = p.acceleration.as_ref()?;
    let inertia = a.data() * estimate.mass().transpose();
    let samples = p.force.data()
        - &inertia
        - p.velocity.data() * estimate.damping().transpose()
        - p.displacement.data() * estimate.stiffness().transpose();
    let record = |data| Record::new(a.sampling(), data);
    let residual = || {
        let (samples, fitted) = (record(samples)?, record(inertia)?);
        let force = p.force.clone();
        Ok(Residual::Samples(SampleResidual { samples, fitted, force, noise_span }))
    };
    Some(residual())
}

/// Returns the name of the estimator that works from sample to sample.
fn estimator(discretisation: Discretisation) -> &'static str {
    match discretisation {
        Discretisation::Euler => "least squares from sample to sample, Euler's rule",
        Discretisation::ZeroOrderHold => {
            "least squares from sample to sample, force held between samples"
        }
        Discretisation::FirstOrderHold => {
            "least squares from sample to sample, force linear between samples"
        }
    }
}
