//! Fits sample by sample.

use clap::{Args, ValueEnum};
use mechid::estimate::checks::{
    Finding, Subject, before_equation_of_motion, before_fit, delay_at_samples,
    delay_between_samples, noise_on_response, periodicity_across,
};
use mechid::estimate::time_domain::{TimeDomain, Transitions};
use mechid::estimate::{EquationOfMotion, Estimate, Unknowns, missing_force};
use mechid::model::Discretisation;
use mechid::signal::{Extent, Interpolation, Record, counted};

use super::CONSPICUOUS;
use super::course::Course;
use super::derivatives::{Derivatives, Prepared};
use super::fit::{BetweenSamples, Fitted, Residual};
use super::measurement::{Hold, Measurement, Recorded, STRETCH};
use crate::error::CliError;
use crate::options::at_least_one;

/// What a fit sample by sample makes of the record.
#[derive(Debug, Args)]
#[command(next_help_heading = "Time domain")]
pub struct TimeArgs {
    /// What the window is [default: open, or period with spectral derivatives]
    #[arg(long, value_name = "EXTENT", value_enum)]
    extent: Option<WindowExtent>,
    /// How to find the velocity and the acceleration where only the displacement was measured, or
    /// only the acceleration: by the spectrum of whole periods, or by a polynomial of an ORDER
    /// through a sliding WINDOW of samples (odd)
    #[arg(long, value_name = "spectral|savitzky-golay:WINDOW:ORDER")]
    derivatives: Option<Derivatives>,
    /// Put this many steps into every interval, which makes the error of --between-samples smaller
    #[arg(long, value_name = "FACTOR", value_parser = at_least_one,
          requires_all = ["interpolation", "between_samples"])]
    refine: Option<usize>,
    /// How to find the values between the samples
    #[arg(long, value_name = "WAY", value_enum, requires = "refine")]
    interpolation: Option<Between>,
}

/// What a window is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum WindowExtent {
    /// Any stretch of motion
    Open,
    /// Whole periods: the first sample follows the last again
    Period,
}

/// A way to find values between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Between {
    /// Straight lines
    Linear,
    /// A cubic spline
    Spline,
    /// The Fourier series of the window, which must hold whole periods
    BandLimited,
}

impl TimeArgs {
    /// The first of these options that was given, for a message.
    pub fn given(&self) -> Option<&'static str> {
        [
            (self.extent.is_some(), "--extent"),
            (self.derivatives.is_some(), "--derivatives"),
            (self.refine.is_some(), "--refine"),
        ]
        .into_iter()
        .find_map(|(given, name)| given.then_some(name))
    }

    fn extent(&self) -> Extent {
        match (self.extent, &self.derivatives) {
            (Some(WindowExtent::Period), _) | (None, Some(Derivatives::Spectral)) => {
                Extent::WholePeriod
            }
            _ => Extent::Open,
        }
    }

    fn refinement(&self) -> Option<(usize, Interpolation)> {
        let way = match self.interpolation? {
            Between::Linear => Interpolation::Linear,
            Between::Spline => Interpolation::NotAKnotSpline,
            Between::BandLimited => Interpolation::BandLimited,
        };
        Some((self.refine?, way))
    }

    /// How much of a record must be held: all of it where every sample needs all others.
    pub fn hold(&self) -> Hold {
        match (&self.derivatives, self.interpolation) {
            (Some(Derivatives::Spectral), _) => Hold::Whole,
            (_, Some(Between::Spline | Between::BandLimited)) => Hold::Whole,
            (Some(Derivatives::SavitzkyGolay(filter)), _) => Hold::Samples(filter.window()),
            (None, _) => Hold::Samples(0),
        }
    }

    /// Fits the samples of one or several windows: the equation of motion itself where there is an
    /// acceleration and nothing else is asked for, otherwise what leads from one sample to the next.
    pub fn fit(
        &self,
        records: &[Recorded],
        unknowns: &Unknowns,
        between: Option<BetweenSamples>,
    ) -> Result<Fitted, CliError> {
        let prepare = |r: &Recorded| Prepared::of(&r.held, self.derivatives.as_ref());
        let prepared: Vec<Prepared> = records.iter().map(prepare).collect::<Result<_, _>>()?;
        if between.is_some() && prepared.iter().any(|p| p.twice_differentiated) {
            return Err(CliError::TwiceDifferentiated);
        }
        match between {
            None if prepared[0].acceleration.is_some() => {
                self.at_samples(records, &prepared, unknowns)
            }
            _ => self.step_by_step(records, &prepared, unknowns, between),
        }
    }

    /// Goes through a record in stretches of which each but the first begins with the last sample of
    /// the one before, and says which is the last; in one, where every sample needs all others.
    fn stretches(
        &self,
        recorded: &Recorded,
        take: &mut dyn FnMut(Prepared, bool) -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        let held = &recorded.held;
        let advance = match self.hold() {
            Hold::Whole => held.force.len(),
            _ => (STRETCH / self.refine.unwrap_or(1)).max(1),
        };
        // A sliding polynomial has no middle at the first and last samples it sees.
        let margin = self.noise_span() / 2;
        recorded.stretches(advance + 1 + 2 * margin, advance, &mut |stretch| {
            let len = stretch.force.len();
            let first = stretch.first_sample == held.first_sample;
            let last = stretch.first_sample + len - 1 == held.last_sample();
            let inside = if first { 0 } else { margin }..if last { len } else { len - margin };
            take(Prepared::of(stretch, self.derivatives.as_ref())?.window(inside)?, last)
        })
    }

    /// What a window is as far as it is held.
    fn extent_of(&self, held: &Measurement) -> Extent {
        if held.held_to().is_some() { Extent::Open } else { self.extent() }
    }

    /// With what was seen before the fit, whether a period that is not held whole is one, by its last
    /// samples.
    fn with_seam(
        &self,
        mut seen: Vec<Finding>,
        recorded: &Recorded,
        p: &Prepared,
        end: Option<Record>,
    ) -> Vec<Finding> {
        let long = self.extent() == Extent::WholePeriod && recorded.held.held_to().is_some();
        if let Some(end) = end.filter(|_| long) {
            let step = seen.iter().position(|finding| finding.subject() == Subject::Step);
            seen.insert(step.unwrap_or(seen.len()), periodicity_across(&p.displacement, &end));
        }
        seen
    }

    /// Gathers the samples of a record; the displacements of its last two.
    fn push_instants(
        &self,
        recorded: &Recorded,
        rows: &mut EquationOfMotion,
    ) -> Result<Option<Record>, CliError> {
        let mut end = None;
        self.stretches(recorded, &mut |p, last| {
            let Some(response) = p.response()? else { return Err(CliError::TimeDomainMotions) };
            // The next stretch begins with the last sample of this one.
            let own = if last { p.force.len() } else { p.force.len() - 1 };
            let [a, v, x] = [response.acceleration(), response.velocity(), response.displacement()]
                .map(|r| r.data().rows(0, own));
            rows.push_rows(a, v, x, p.force.data().rows(0, own))?;
            end = last_two(&p)?;
            Ok(())
        })?;
        Ok(end)
    }

    /// Gathers what leads from sample to sample of a record that begins as `held`; the displacements
    /// of its last two.
    fn push_steps(
        &self,
        recorded: &Recorded,
        held: &Prepared,
        rows: &mut Transitions,
    ) -> Result<Option<Record>, CliError> {
        let (extent, mut end) = (self.extent(), None);
        self.stretches(recorded, &mut |p, last| {
            end = last_two(&p)?;
            if let Some((factor, interpolation)) = self.refinement() {
                return Ok(rows.push_refined(p.states(), extent, factor, interpolation)?);
            }
            // After the last sample of a period comes its first.
            let closes = last && extent == Extent::WholePeriod;
            let p = if closes { p.followed_by(held)? } else { p };
            let [x, v, force] = p.states();
            Ok(rows.push(x, v, force, Extent::Open)?)
        })?;
        Ok(end)
    }

    fn at_samples(
        &self,
        records: &[Recorded],
        prepared: &[Prepared],
        unknowns: &Unknowns,
    ) -> Result<Fitted, CliError> {
        let mut rows = EquationOfMotion::new(unknowns.dof());
        let mut before = Vec::new();
        for (recorded, p) in records.iter().zip(prepared) {
            let end = self.push_instants(recorded, &mut rows)?;
            let Some(response) = p.response()? else { return Err(CliError::TimeDomainMotions) };
            let extent = self.extent_of(&recorded.held);
            let seen = before_equation_of_motion(&response, &p.force, unknowns, extent)?;
            before.push(self.with_seam(seen, recorded, p, end));
        }
        let estimate = rows.solve(unknowns)?;
        // Says what the data leave open, before anything is made of it.
        estimate.system()?;
        let span = self.noise_span();
        let residuals = prepared.iter().filter_map(|p| left_of_equation(p, &estimate, span));
        let look = |p: &Prepared| self.at_samples_after(p, &estimate);
        let after = prepared.iter().map(look).collect::<Result<_, _>>()?;
        Ok(Fitted {
            domain: "time",
            estimator: "least squares on the equation of motion, sample by sample",
            least_squares: false,
            equations: rows.rows(),
            frequency: None,
            before,
            after,
            residuals: residuals.collect::<Result<_, _>>()?,
            course: self.course(Discretisation::FirstOrderHold),
            misfit: None,
            remarks: self.remarks(prepared, &estimate),
            estimate,
        })
    }

    /// What is looked at beside the residual.
    fn at_samples_after(
        &self,
        p: &Prepared,
        estimate: &Estimate,
    ) -> Result<Vec<Finding>, CliError> {
        let Some(response) = p.response()? else { return Ok(Vec::new()) };
        let mut checks = Vec::from_iter(delay_at_samples(&response, &p.force, estimate.unknowns()));
        // What was differentiated has noise in common from sample to sample.
        if self.derivatives.is_none() {
            checks.extend(noise_on_response(&response, &p.force, estimate)?);
        }
        Ok(checks)
    }

    fn step_by_step(
        &self,
        records: &[Recorded],
        prepared: &[Prepared],
        unknowns: &Unknowns,
        between: Option<BetweenSamples>,
    ) -> Result<Fitted, CliError> {
        let between = between.unwrap_or(BetweenSamples::Linear);
        let discretisation = between.discretisation();
        let dt = prepared[0].force.sampling().dt();
        let steps = self.refine.unwrap_or(1) as f64;
        let mut rows = Transitions::new(unknowns.dof(), dt / steps)?;
        let mut before = Vec::new();
        for (recorded, p) in records.iter().zip(prepared) {
            let end = self.push_steps(recorded, p, &mut rows)?;
            let [x, v, force] = p.states();
            let method = TimeDomain::new(discretisation, self.extent_of(&recorded.held));
            before.push(self.with_seam(before_fit(method, x, v, force)?, recorded, p, end));
        }
        let fit = rows.fit(discretisation, unknowns)?;
        let estimate = fit.into_estimate();
        let left = |(recorded, p): (&Recorded, &Prepared)| -> Result<Residual, CliError> {
            let extent = self.extent_of(&recorded.held);
            let [left, fitted] =
                missing_force(&estimate, p.states(), discretisation, extent, self.refinement())?;
            let force = p.force.window(0, left.len())?;
            // An error of a measured state is in the interval before it and in the one after.
            let noise_span = self.noise_span() + 1;
            Ok(Residual { left, fitted, force, noise_span })
        };
        let residuals = records.iter().zip(prepared).map(left).collect::<Result<_, _>>()?;
        let method = TimeDomain::new(discretisation, Extent::Open);
        let late = |p: &Prepared| {
            let [x, v, force] = p.states();
            Vec::from_iter(delay_between_samples(method, x, v, force, unknowns))
        };
        Ok(Fitted {
            domain: "time",
            estimator: between.estimator(),
            least_squares: false,
            equations: rows.rows(),
            frequency: None,
            before,
            after: prepared.iter().map(late).collect(),
            residuals,
            course: self.course(discretisation),
            misfit: None,
            remarks: self.remarks(prepared, &estimate),
            estimate,
        })
    }

    fn course(&self, discretisation: Discretisation) -> Course {
        match &self.derivatives {
            // What was differentiated by its spectrum is predicted by it.
            Some(Derivatives::Spectral) => Course::Steady,
            _ => Course::Sampled { discretisation, extent: self.extent() },
        }
    }

    /// Samples apart that the noise of one sample still reaches.
    fn noise_span(&self) -> usize {
        match &self.derivatives {
            Some(Derivatives::SavitzkyGolay(filter)) => filter.window() - 1,
            _ => 0,
        }
    }

    fn remarks(&self, prepared: &[Prepared], estimate: &Estimate) -> Vec<String> {
        let mut remarks = Vec::new();
        if let Some((factor, way)) = self.refinement() {
            let open = way != Interpolation::BandLimited && self.extent() == Extent::WholePeriod;
            remarks.push(format!(
                "{} in every interval; the standard errors count measured samples only{}",
                counted(factor, "step"),
                if open { ", and the interpolation takes the window as open" } else { "" }
            ));
        }
        if prepared.iter().any(|p| p.twice_differentiated) {
            remarks.push(
                "the equation of motion was fitted to second derivatives of force and acceleration"
                    .into(),
            );
        } else if self.derivatives.is_some() {
            remarks.push("two of the three motions are derivatives, not measured".into());
        }
        let left = estimate.residual_nrmse().iter().copied().fold(0.0, f64::max);
        if self.derivatives == Some(Derivatives::Spectral) && left > CONSPICUOUS {
            remarks.push(
                "spectral derivatives hold the noise of every line, driven or not, and of low ones \
                 most where the acceleration was measured: without --domain time and --derivatives \
                 the same whole periods are fitted on the lines of the force alone"
                    .into(),
            );
        }
        remarks
    }
}

/// The displacements of the last two samples.
fn last_two(p: &Prepared) -> Result<Option<Record>, CliError> {
    let (x, len) = (&p.displacement, p.displacement.len());
    Ok(if len < 2 { None } else { Some(x.window(len - 2, 2)?) })
}

/// F − M ẍ − C ẋ − K x, left of the inertia.
fn left_of_equation(
    p: &Prepared,
    estimate: &Estimate,
    noise_span: usize,
) -> Option<Result<Residual, CliError>> {
    let a = p.acceleration.as_ref()?;
    let inertia = a.data() * estimate.mass().transpose();
    let left = p.force.data()
        - &inertia
        - p.velocity.data() * estimate.damping().transpose()
        - p.displacement.data() * estimate.stiffness().transpose();
    let record = |data| Record::new(a.sampling(), data);
    let residual = || {
        let (left, fitted) = (record(left)?, record(inertia)?);
        Ok(Residual { left, fitted, force: p.force.clone(), noise_span })
    };
    Some(residual())
}
