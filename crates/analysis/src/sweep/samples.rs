//! Samples for an identification, simulated or measured.

use std::borrow::Cow;

use mechid_model::Response;
use mechid_model::ResponseQuantity;
use mechid_signal::Extent;
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use super::Simulated;
use crate::AnalysisError;
use crate::measurement::{Block, joined};

/// Forces and responses on one time axis.
#[derive(Debug)]
pub struct Samples<'a> {
    pub force: Cow<'a, Record>,
    motions: Vec<(ResponseQuantity, Cow<'a, Record>)>,
    pub extent: Extent,
}

impl<'a> Samples<'a> {
    /// Creates the samples of a simulated experiment.
    pub fn simulated(simulated: Simulated) -> Self {
        let Simulated { force, response, whole_periods } = simulated;
        let owned = |record: &Record| Cow::Owned(record.clone());
        Self {
            force: Cow::Owned(force),
            motions: vec![
                (ResponseQuantity::Displacement, owned(response.displacement())),
                (ResponseQuantity::Velocity, owned(response.velocity())),
                (ResponseQuantity::Acceleration, owned(response.acceleration())),
            ],
            extent: if whole_periods { Extent::WholePeriod } else { Extent::Open },
        }
    }

    /// Creates the samples of a record, treated as open.
    pub fn measured(measured: &'a Block) -> Self {
        let motions = measured.responses().into_iter();
        Self {
            force: Cow::Borrowed(&measured.force),
            motions: motions.map(|(kind, record)| (kind, Cow::Borrowed(record))).collect(),
            extent: Extent::Open,
        }
    }

    /// Returns every `factor`-th sample, beginning with sample `first`, counted from 0.
    pub fn every(&self, factor: usize, first: usize) -> Result<Samples<'static>, AnalysisError> {
        self.map(|record| {
            let len = (record.len() - first).div_ceil(factor);
            let sampling = Sampling::new(record.sampling().dt() * factor as f64, len)?;
            let data = record.data();
            let every = |k: usize, channel: usize| data[(first + k * factor, channel)];
            Ok(Record::new(sampling, DMatrix::from_fn(len, data.ncols(), every))?)
        })
    }

    /// Returns the last sample.
    pub fn last(&self) -> Result<Samples<'static>, AnalysisError> {
        self.map(|record| Ok(record.window(record.len() - 1, 1)?))
    }

    /// Returns these samples followed by samples of a later chunk.
    pub fn followed_by(&self, later: &Samples<'_>) -> Result<Samples<'static>, AnalysisError> {
        let join = |first, later| Ok::<_, AnalysisError>(Cow::Owned(joined(first, later)?));
        let pairs = self.motions.iter().zip(&later.motions);
        let motions = pairs.map(|((kind, first), (_, later))| Ok((*kind, join(first, later)?)));
        Ok(Samples {
            force: join(&self.force, &later.force)?,
            motions: motions.collect::<Result<_, AnalysisError>>()?,
            extent: self.extent,
        })
    }

    /// Returns one kind of response.
    ///
    /// # Errors
    /// [`AnalysisError::SweepMotion`] if it was not measured.
    pub fn motion(&self, wanted: ResponseQuantity) -> Result<&Record, AnalysisError> {
        let motion = self.motions.iter().find(|(kind, _)| *kind == wanted);
        motion.map(|(_, record)| record.as_ref()).ok_or(AnalysisError::SweepMotion { wanted })
    }

    /// Returns the first kind of response that exists.
    pub fn first_motion(&self) -> (ResponseQuantity, &Record) {
        (self.motions[0].0, &self.motions[0].1)
    }

    /// Returns displacement, velocity and acceleration.
    ///
    /// # Errors
    /// As [`Samples::motion`].
    pub fn response(&self) -> Result<Response, AnalysisError> {
        let [x, v, a] = [
            ResponseQuantity::Displacement,
            ResponseQuantity::Velocity,
            ResponseQuantity::Acceleration,
        ]
        .map(|kind| self.motion(kind));
        Ok(Response::new(x?.clone(), v?.clone(), a?.clone())?)
    }

    fn map(
        &self,
        of: impl Fn(&Record) -> Result<Record, AnalysisError>,
    ) -> Result<Samples<'static>, AnalysisError> {
        let motions =
            self.motions.iter().map(|(kind, record)| Ok((*kind, Cow::Owned(of(record)?))));
        Ok(Samples {
            force: Cow::Owned(of(&self.force)?),
            motions: motions.collect::<Result<_, AnalysisError>>()?,
            extent: self.extent,
        })
    }
}
