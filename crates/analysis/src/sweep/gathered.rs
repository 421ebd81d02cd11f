//! The estimators, and what they gather from samples that come a chunk at a time.

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
    /// Steps from sample to sample by Euler's rule, the dissertation's; biased in proportion to the
    /// step.
    Euler,
    /// Steps from sample to sample, the force held between them.
    Held,
    /// Steps from sample to sample, the force linear between them.
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

    /// Returns whether it takes whole periods.
    pub(crate) fn is_of_spectra(self) -> bool {
        matches!(self, Estimator::LeastSquares | Estimator::MaximumLikelihood)
    }

    /// Returns how much of a record must be held.
    pub(crate) fn hold(self) -> Hold {
        if self.is_of_spectra() { Hold::Periods } else { Hold::Samples(0) }
    }

    /// Samples of a record to take at a time.
    pub(crate) fn chunk(self, period: usize) -> usize {
        if self.is_of_spectra() { period * (CHUNK_SAMPLES / period).max(1) } else { CHUNK_SAMPLES }
    }
}

/// Sums that an estimator needs of the samples it has seen.
#[derive(Debug)]
pub(crate) enum Gathered {
    /// Steps from sample to sample.
    Steps(Discretisation, Transitions),
    /// Samples of the equation of motion.
    Instants(EquationOfMotion),
    /// Spectra of whole periods.
    Periods(Estimator, Box<RepeatedPeriods>),
}

impl Gathered {
    /// Starts with no samples; they begin like these, and `period` of them are one of so many
    /// `periods`.
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

    /// Takes some samples: of whole periods one or more.
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

    /// The machine behind all of them.
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

/// Every n-th sample of a record, gathered as the record goes by.
#[derive(Debug)]
pub struct Decimated {
    factor: usize,
    /// Samples to come before the next one that is taken.
    skip: usize,
    /// The last sample taken, if the next one is fitted together with it.
    last: Option<Samples<'static>>,
    gathered: Gathered,
}

impl Decimated {
    /// Starts with no sample of a record of which this is held.
    ///
    /// # Errors
    /// [`AnalysisError::DecimatedPeriod`] if one of several periods is no whole number of the
    /// samples taken, and those of choosing lines.
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
        let gathered = Gathered::new(estimator, &beginning, period.div_ceil(factor), periods)?;
        Ok(Self { factor, skip: 0, last: None, gathered })
    }

    /// Takes its samples from the next chunk of the record.
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
        if matches!(self.gathered, Gathered::Steps(..)) {
            self.last = Some(taken.last()?);
        }
        Ok(())
    }

    /// The machine behind the samples taken.
    pub fn solve(&self, unknowns: &Unknowns) -> Result<Estimate, AnalysisError> {
        self.gathered.solve(unknowns)
    }
}
