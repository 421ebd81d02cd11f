//! Velocity and acceleration by differentiation or integration if only one of displacement and
//! acceleration was measured.

use std::ops::Range;

use mechid_estimate::derivatives::{spectral_from_acceleration, spectral_from_displacement};
use mechid_model::Response;
use mechid_signal::Record;

use super::options::Derivatives;
use crate::AnalysisError;
use crate::measurement::{Block, joined};

/// Samples of a fit in the time domain, in which responses that were not measured are derived from
/// the measured responses.
#[derive(Debug)]
pub struct Prepared {
    pub displacement: Record,
    pub velocity: Record,
    pub acceleration: Option<Record>,
    pub force: Record,
    /// `true` if all samples, including those of the force, are second derivatives of the
    /// quantities that the fields name.
    pub twice_differentiated: bool,
}

impl Prepared {
    fn new(response: Response, force: Record) -> Self {
        Self {
            displacement: response.displacement().clone(),
            velocity: response.velocity().clone(),
            acceleration: Some(response.acceleration().clone()),
            force,
            twice_differentiated: false,
        }
    }

    /// Returns the measured samples; with `derivatives`, the missing responses are derived.
    ///
    /// # Errors
    /// [`AnalysisError::TimeDomainMotions`] if a kind of response is missing,
    /// [`AnalysisError::NothingToDerive`] if none is missing.
    pub fn from_block(
        measured: &Block,
        derivatives: Option<Derivatives>,
    ) -> Result<Self, AnalysisError> {
        let force = &measured.force;
        let filter = derivatives.map(Derivatives::filter).transpose()?.flatten();
        let responses = (&measured.displacement, &measured.velocity, &measured.acceleration);
        match (responses, derivatives, filter) {
            ((Some(x), Some(v), a), None, _) => Ok(Self {
                displacement: x.clone(),
                velocity: v.clone(),
                acceleration: a.clone(),
                force: force.clone(),
                twice_differentiated: false,
            }),
            (_, None, _) => Err(AnalysisError::TimeDomainMotions),
            ((Some(x), None, None), Some(Derivatives::Spectral), _) => {
                Ok(Self::new(spectral_from_displacement(x)?, force.clone()))
            }
            ((None, None, Some(a)), Some(Derivatives::Spectral), _) => {
                Ok(Self::new(spectral_from_acceleration(a)?, force.without_mean()))
            }
            ((Some(x), None, None), _, Some(filter)) => {
                Ok(Self::new(filter.motion(x)?, force.clone()))
            }
            ((None, None, Some(a)), _, Some(filter)) => {
                let (response, force) = filter.twice_differentiated(a, force)?;
                Ok(Self { twice_differentiated: true, ..Self::new(response, force) })
            }
            _ => Err(AnalysisError::NothingToDerive),
        }
    }

    /// Returns the samples of a range, counted from 0.
    pub fn window(self, samples: Range<usize>) -> Result<Self, AnalysisError> {
        if samples == (0..self.force.len()) {
            return Ok(self);
        }
        let cut = |record: &Record| record.window(samples.start, samples.len());
        Ok(Self {
            displacement: cut(&self.displacement)?,
            velocity: cut(&self.velocity)?,
            acceleration: self.acceleration.as_ref().map(cut).transpose()?,
            force: cut(&self.force)?,
            ..self
        })
    }

    /// Returns these samples, extended by one sample: the first sample of `others`.
    pub fn followed_by(&self, others: &Self) -> Result<Self, AnalysisError> {
        let join = |own: &Record, other: &Record| joined(own, &other.window(0, 1)?);
        let pair = self.acceleration.as_ref().zip(others.acceleration.as_ref());
        Ok(Self {
            displacement: join(&self.displacement, &others.displacement)?,
            velocity: join(&self.velocity, &others.velocity)?,
            acceleration: pair.map(|(own, other)| join(own, other)).transpose()?,
            force: join(&self.force, &others.force)?,
            ..*self
        })
    }

    /// Returns displacement, velocity and acceleration together; `None` without an acceleration.
    pub fn response(&self) -> Result<Option<Response>, AnalysisError> {
        let Some(a) = &self.acceleration else { return Ok(None) };
        Ok(Some(Response::new(self.displacement.clone(), self.velocity.clone(), a.clone())?))
    }

    /// Returns displacement, velocity and force.
    pub fn states(&self) -> [&Record; 3] {
        [&self.displacement, &self.velocity, &self.force]
    }
}
