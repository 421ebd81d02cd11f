//! Estimators, and the sums that they accumulate chunk by chunk.

use mechid_estimate::frequency_domain::{equation_error, output_error};
use mechid_estimate::time_domain::Transitions;
use mechid_estimate::{EquationOfMotion, Estimate, Unknowns};
use mechid_model::{Discretisation, ResponseQuantity};
use mechid_spectra::{Lines, RepeatedPeriods};
use serde::{Deserialize, Serialize};

use super::samples::Samples;
use crate::AnalysisError;
use crate::identify::lines::{LineChoice, choose_lines};
use crate::measurement::{Block, CHUNK_SAMPLES, Hold};

/// Estimator of a sweep.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// Steps from sample to sample by Euler's rule; the bias is proportional to the step.
    Euler,
    /// Steps from sample to sample, with a force that is held between samples.
    Held,
    /// Steps from sample to sample, with a force that is linear between samples.
    #[default]
    Linear,
    /// The equation of motion at the samples, with the acceleration.
    EquationOfMotion,
    /// Least squares on the spectra of force and response.
    LeastSquares,
    /// Maximum likelihood on the spectra of force and response.
    MaximumLikelihood,
}

impl Estimator {
    /// Returns the name of the estimator.
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

    /// Returns whether the estimator needs whole periods.
    pub(crate) fn is_of_spectra(self) -> bool {
        matches!(self, Estimator::LeastSquares | Estimator::MaximumLikelihood)
    }

    /// Returns the part of a record to buffer.
    pub(crate) fn hold(self) -> Hold {
        if self.is_of_spectra() { Hold::Periods } else { Hold::Samples(0) }
    }

    /// Returns the number of samples to process at a time.
    pub(crate) fn chunk(self, period: usize) -> usize {
        if self.is_of_spectra() { period * (CHUNK_SAMPLES / period).max(1) } else { CHUNK_SAMPLES }
    }
}

/// Sums of an estimator over the processed samples.
#[derive(Debug)]
pub(crate) enum EstimatorSums {
    /// Sums over the steps from sample to sample, for the estimators in the time domain.
    Steps(Discretisation, Transitions),
    /// Sums over the samples, for the equation of motion.
    Instants(EquationOfMotion),
    /// Sums of the spectra of whole periods.
    Periods(Estimator, Box<RepeatedPeriods>),
}

impl EstimatorSums {
    /// Creates empty sums; `beginning` are the first samples, and the record has `periods` periods
    /// of `period` samples.
    pub(crate) fn new(
        estimator: Estimator,
        beginning: &Samples<'_>,
        period: usize,
        periods: usize,
    ) -> Result<Self, AnalysisError> {
        let (force, dof) = (&beginning.force, beginning.force.channels());
        let discretisation = match estimator {
            Estimator::Euler => Discretisation::Euler,
            Estimator::Held => Discretisation::ZeroOrderHold,
            Estimator::Linear => Discretisation::FirstOrderHold,
            Estimator::EquationOfMotion => return Ok(Self::Instants(EquationOfMotion::new(dof))),
            Estimator::LeastSquares | Estimator::MaximumLikelihood => {
                let chosen = choose_lines(force, period, &LineChoice::Driven)?;
                let lines = Lines::new(force.sampling().with_len(period)?, chosen)?;
                let (kind, _) = beginning.first_motion();
                let none = RepeatedPeriods::expecting(&lines, dof, kind, periods);
                return Ok(Self::Periods(estimator, Box::new(none)));
            }
        };
        Ok(Self::Steps(discretisation, Transitions::new(dof, force.sampling().dt())?))
    }

    /// Adds samples; if the estimator uses whole periods, the samples must be one or more complete
    /// periods.
    pub(crate) fn push(&mut self, samples: &Samples<'_>) -> Result<(), AnalysisError> {
        let force = &samples.force;
        match self {
            Self::Steps(_, rows) => {
                let x = samples.motion(ResponseQuantity::Displacement)?;
                let v = samples.motion(ResponseQuantity::Velocity)?;
                rows.push(x, v, force, samples.extent)?;
            }
            Self::Instants(rows) => {
                let response = samples.response()?;
                let [a, v, x] =
                    [response.acceleration(), response.velocity(), response.displacement()]
                        .map(|record| record.data().as_view());
                rows.push_rows(a, v, x, force.data().as_view())?;
            }
            Self::Periods(_, periods) => periods.push(force, samples.first_motion().1)?,
        }
        Ok(())
    }

    /// Returns the estimate from all samples.
    pub(crate) fn solve(&self, unknowns: &Unknowns) -> Result<Estimate, AnalysisError> {
        Ok(match self {
            Self::Steps(discretisation, rows) => {
                rows.fit(*discretisation, unknowns)?.into_estimate()
            }
            Self::Instants(rows) => rows.solve(unknowns)?,
            Self::Periods(Estimator::MaximumLikelihood, periods) => {
                output_error(&periods.mean()?, unknowns)?.estimate
            }
            Self::Periods(_, periods) => equation_error(&periods.mean()?, unknowns)?,
        })
    }
}

/// Every n-th sample of a record, accumulated chunk by chunk.
#[derive(Debug)]
pub struct Decimated {
    factor: usize,
    /// Number of samples before the next used sample.
    skip: usize,
    /// The last used sample, if it is fitted together with the next used sample.
    last: Option<Samples<'static>>,
    gathered: EstimatorSums,
}

impl Decimated {
    /// Creates an empty sum for a record whose buffered samples are `held`.
    ///
    /// # Errors
    /// [`AnalysisError::DecimatedPeriod`] if there are several periods and the length of a period
    /// is not a whole number of used samples, and the errors of choosing lines.
    pub fn new(
        estimator: Estimator,
        factor: usize,
        held: &Block,
        beginning: &Samples<'_>,
    ) -> Result<Self, AnalysisError> {
        let (period, periods) = (held.period, held.periods);
        if !period.is_multiple_of(factor) && periods > 1 {
            return Err(AnalysisError::DecimatedPeriod { period, factor });
        }
        let beginning = beginning.every(factor, 0)?;
        let gathered = EstimatorSums::new(estimator, &beginning, period.div_ceil(factor), periods)?;
        Ok(Self { factor, skip: 0, last: None, gathered })
    }

    /// Adds every n-th sample of the next chunk of the record.
    pub fn push(&mut self, chunk: &Samples<'_>) -> Result<(), AnalysisError> {
        let len = chunk.force.len();
        if self.skip >= len {
            self.skip -= len;
            return Ok(());
        }
        let mut taken = chunk.every(self.factor, self.skip)?;
        self.skip = self.skip + taken.force.len() * self.factor - len;
        if let Some(last) = &self.last {
            taken = last.followed_by(&taken)?;
        }
        self.gathered.push(&taken)?;
        if matches!(self.gathered, EstimatorSums::Steps(..)) {
            self.last = Some(taken.last()?);
        }
        Ok(())
    }

    /// Returns the estimate from the used samples.
    pub fn solve(&self, unknowns: &Unknowns) -> Result<Estimate, AnalysisError> {
        self.gathered.solve(unknowns)
    }
}
