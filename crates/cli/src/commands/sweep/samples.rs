//! Samples to identify from, simulated or measured.

use std::borrow::Cow;

use mechid::io::{Experiment, ResponseKind};
use mechid::model::{Response, ResponseQuantity};
use mechid::signal::{Extent, Record, Sampling};
use nalgebra::DMatrix;

use crate::commands::identify::measurement::{Measurement, joined};
use crate::error::CliError;

/// Forces and motions on one time axis.
#[derive(Debug)]
pub struct Samples<'a> {
    pub force: Cow<'a, Record>,
    motions: Vec<(ResponseQuantity, Cow<'a, Record>)>,
    pub extent: Extent,
}

impl<'a> Samples<'a> {
    /// What an experiment as described would measure.
    pub fn simulated(experiment: &Experiment) -> Result<Self, CliError> {
        let simulation = mechid::simulate(experiment)?;
        let motion = &simulation.measured_response;
        let own = |record: &Record| Cow::Owned(record.clone());
        Ok(Self {
            force: own(&simulation.measured_force),
            motions: vec![
                (ResponseQuantity::Displacement, own(motion.displacement())),
                (ResponseQuantity::Velocity, own(motion.velocity())),
                (ResponseQuantity::Acceleration, own(motion.acceleration())),
            ],
            extent: match experiment.response {
                ResponseKind::Periodic => Extent::WholePeriod,
                ResponseKind::FromRest | ResponseKind::From(_) => Extent::Open,
            },
        })
    }

    /// Those of a record, taken as open from sample to sample.
    pub fn measured(measured: &'a Measurement) -> Self {
        let motions = measured.motions().into_iter();
        Self {
            force: Cow::Borrowed(&measured.force),
            motions: motions.map(|(kind, record)| (kind, Cow::Borrowed(record))).collect(),
            extent: Extent::Open,
        }
    }

    /// Every `factor`-th sample, from the `first` on, counted from 0.
    pub fn every(&self, factor: usize, first: usize) -> Result<Samples<'static>, CliError> {
        self.map(|record| {
            let len = (record.len() - first).div_ceil(factor);
            let sampling = Sampling::new(record.sampling().dt() * factor as f64, len)?;
            let data = record.data();
            let every = |k: usize, channel: usize| data[(first + k * factor, channel)];
            Ok(Record::new(sampling, DMatrix::from_fn(len, data.ncols(), every))?)
        })
    }

    /// The last of them.
    pub fn last(&self) -> Result<Samples<'static>, CliError> {
        self.map(|record| Ok(record.window(record.len() - 1, 1)?))
    }

    /// These and then those of a later stretch.
    pub fn followed_by(&self, later: &Samples<'_>) -> Result<Samples<'static>, CliError> {
        let join = |own, later| Ok::<_, CliError>(Cow::Owned(joined(own, later)?));
        let pairs = self.motions.iter().zip(&later.motions);
        let motions = pairs.map(|((kind, own), (_, later))| Ok((*kind, join(own, later)?)));
        Ok(Samples {
            force: join(&self.force, &later.force)?,
            motions: motions.collect::<Result<_, CliError>>()?,
            extent: self.extent,
        })
    }

    /// One kind of motion.
    ///
    /// # Errors
    /// [`CliError::SweepMotion`] if it was not measured.
    pub fn motion(&self, wanted: ResponseQuantity) -> Result<&Record, CliError> {
        let found = self.motions.iter().find(|(kind, _)| *kind == wanted);
        found.map(|(_, record)| record.as_ref()).ok_or(CliError::SweepMotion { wanted })
    }

    /// The first kind of motion there is.
    pub fn first_motion(&self) -> (ResponseQuantity, &Record) {
        (self.motions[0].0, &self.motions[0].1)
    }

    /// All three motions.
    ///
    /// # Errors
    /// As [`Samples::motion`].
    pub fn response(&self) -> Result<Response, CliError> {
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
        of: impl Fn(&Record) -> Result<Record, CliError>,
    ) -> Result<Samples<'static>, CliError> {
        let motions =
            self.motions.iter().map(|(kind, record)| Ok((*kind, Cow::Owned(of(record)?))));
        Ok(Samples {
            force: Cow::Owned(of(&self.force)?),
            motions: motions.collect::<Result<_, CliError>>()?,
            extent: self.extent,
        })
    }
}
