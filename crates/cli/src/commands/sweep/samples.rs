//! Samples to identify from, simulated or measured, and the estimators.

use clap::ValueEnum;
use mechid::estimate::frequency_domain::{
    Lines, Motion, RepeatedPeriods, equation_error, output_error,
};
use mechid::estimate::time_domain::{Discretisation, Extent, TimeDomain, equation_of_motion};
use mechid::estimate::{Estimate, Unknowns};
use mechid::io::{Experiment, ResponseKind};
use mechid::model::Response;
use mechid::signal::{Record, Sampling};

use crate::commands::identify::excited::choose_lines;
use crate::commands::identify::measurement::Measurement;
use crate::error::CliError;

/// How a machine is found from a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Estimator {
    /// From sample to sample by Euler's rule, the dissertation's; biased in proportion to the step
    Euler,
    /// From sample to sample, the force held between them
    Held,
    /// From sample to sample, the force linear between them
    Linear,
    /// The equation of motion at the samples, with the acceleration
    EquationOfMotion,
    /// Least squares on the spectra of force and motion
    LeastSquares,
    /// Maximum likelihood on the spectra of force and motion
    MaximumLikelihood,
}

impl Estimator {
    /// The estimator in words.
    pub fn name(self) -> &'static str {
        match self {
            Estimator::Euler => "Euler's rule",
            Estimator::Held => "force held between samples",
            Estimator::Linear => "force linear between samples",
            Estimator::EquationOfMotion => "equation of motion at the samples",
            Estimator::LeastSquares => "least squares on the spectra",
            Estimator::MaximumLikelihood => "maximum likelihood on the spectra",
        }
    }
}

/// Forces and motions on one time axis.
#[derive(Debug)]
pub struct Samples {
    force: Record,
    motions: Vec<(Motion, Record)>,
    /// Samples in a period.
    period: usize,
    extent: Extent,
}

impl Samples {
    /// What an experiment as described would measure.
    pub fn simulated(experiment: &Experiment) -> Result<Self, CliError> {
        let simulation = mechid::simulate(experiment)?;
        let motion = &simulation.measured_response;
        Ok(Self {
            force: simulation.measured_force.clone(),
            motions: vec![
                (Motion::Displacement, motion.displacement().clone()),
                (Motion::Velocity, motion.velocity().clone()),
                (Motion::Acceleration, motion.acceleration().clone()),
            ],
            period: experiment.samples(),
            extent: match experiment.response {
                ResponseKind::Periodic => Extent::WholePeriod,
                ResponseKind::FromRest | ResponseKind::From(_) => Extent::Open,
            },
        })
    }

    /// The window of a record, taken as open from sample to sample.
    pub fn measured(measured: &Measurement) -> Self {
        let motions = measured.motions().into_iter();
        Self {
            force: measured.force.clone(),
            motions: motions.map(|(kind, record)| (kind, record.clone())).collect(),
            period: measured.period,
            extent: Extent::Open,
        }
    }

    /// Every `factor`-th sample, from the first on.
    ///
    /// # Errors
    /// [`CliError::DecimatedPeriod`] if a period is no whole number of them.
    pub fn decimated(&self, factor: usize) -> Result<Self, CliError> {
        if !self.period.is_multiple_of(factor) && self.period < self.force.len() {
            return Err(CliError::DecimatedPeriod { period: self.period, factor });
        }
        let thin = |record: &Record| {
            let len = record.len().div_ceil(factor);
            let sampling = Sampling::new(record.sampling().dt() * factor as f64, len)?;
            let data = record.data();
            let every = |k: usize, channel: usize| data[(k * factor, channel)];
            Record::new(sampling, nalgebra::DMatrix::from_fn(len, data.ncols(), every))
        };
        let motions = self.motions.iter().map(|(kind, record)| Ok((*kind, thin(record)?)));
        Ok(Self {
            force: thin(&self.force)?,
            motions: motions.collect::<Result<_, CliError>>()?,
            period: self.period.div_ceil(factor),
            extent: self.extent,
        })
    }

    /// The machine behind these samples.
    pub fn find(&self, estimator: Estimator, unknowns: &Unknowns) -> Result<Estimate, CliError> {
        let discretisation = match estimator {
            Estimator::Euler => Discretisation::Euler,
            Estimator::Held => Discretisation::ZeroOrderHold,
            Estimator::Linear => Discretisation::FirstOrderHold,
            Estimator::EquationOfMotion => {
                let [x, v, a] = [Motion::Displacement, Motion::Velocity, Motion::Acceleration]
                    .map(|kind| self.motion(kind));
                let response = Response::new(x?.clone(), v?.clone(), a?.clone())?;
                return Ok(equation_of_motion(&response, &self.force, unknowns)?);
            }
            Estimator::LeastSquares | Estimator::MaximumLikelihood => {
                let chosen = choose_lines(&self.force, self.period, None, None)?;
                let lines = Lines::new(self.force.sampling().with_len(self.period)?, chosen)?;
                let (kind, motion) = &self.motions[0];
                let data = RepeatedPeriods::new(&lines, &self.force, motion, *kind)?.mean()?;
                return Ok(match estimator {
                    Estimator::LeastSquares => equation_error(&data, unknowns)?,
                    _ => output_error(&data, unknowns)?.estimate,
                });
            }
        };
        let method = TimeDomain::new(discretisation, self.extent);
        let (x, v) = (self.motion(Motion::Displacement)?, self.motion(Motion::Velocity)?);
        Ok(method.fit(x, v, &self.force, unknowns)?.into_estimate())
    }

    fn motion(&self, wanted: Motion) -> Result<&Record, CliError> {
        let found = self.motions.iter().find(|(kind, _)| *kind == wanted);
        found.map(|(_, record)| record).ok_or(CliError::SweepMotion { wanted })
    }
}
