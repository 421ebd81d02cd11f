//! Measured responses and their degrees of freedom.

use mechid_model::{Response, ResponseQuantity};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use crate::ForceError;

/// One measured channel: a quantity at a degree of freedom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub struct Channel {
    /// Degree of freedom, counted from 0.
    pub dof: usize,
    /// Response quantity measured there.
    pub quantity: ResponseQuantity,
}

/// State of the machine at the first sample of an open record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Start {
    /// Start at rest: neither displaced nor moving.
    FromRest,
    /// Unknown: displacement and velocity are estimated with the force.
    InMotion,
}

/// A measured record and what each of its channels is.
///
/// Any mixture will do: displacement of one degree of freedom only, accelerations of all, both.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    record: Record,
    channels: Vec<Channel>,
}

impl Measurement {
    /// A measurement from its record and the description of each channel.
    ///
    /// # Errors
    /// [`ForceError::ChannelCount`] if the numbers of channels differ.
    pub fn new(record: Record, channels: Vec<Channel>) -> Result<Self, ForceError> {
        if record.channels() != channels.len() {
            return Err(ForceError::ChannelCount {
                record: record.channels(),
                described: channels.len(),
            });
        }
        Ok(Self { record, channels })
    }

    /// The same quantity on every channel, channel c at degree of freedom c.
    pub fn of_all(quantity: ResponseQuantity, record: Record) -> Self {
        let channels = (0..record.channels()).map(|dof| Channel { dof, quantity }).collect();
        Self { record, channels }
    }

    /// Displacement, velocity and acceleration of every degree of freedom.
    pub fn of_response(response: &Response) -> Self {
        let dof = response.dof();
        let parts = ResponseQuantity::ALL.map(|which| (which, response.quantity(which)));
        let data = DMatrix::from_fn(response.sampling().len(), 3 * dof, |k, c| {
            parts[c / dof].1.data()[(k, c % dof)]
        });
        let record =
            Record::new(response.sampling(), data).expect("records of a response are finite");
        let channels =
            (0..3 * dof).map(|c| Channel { dof: c % dof, quantity: parts[c / dof].0 }).collect();
        Self { record, channels }
    }

    /// The measured samples × channels, in m, m/s or m/s² as each channel's quantity says.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Degree of freedom and response quantity of each channel.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The time axis.
    pub fn sampling(&self) -> Sampling {
        self.record.sampling()
    }

    /// Returns whether there are more channels than so many forces need: they can contradict one another.
    pub(crate) fn exceeds(&self, forced: &[usize]) -> bool {
        self.channels.len() > forced.len()
    }

    /// An error unless the forces at `forced` can be sought from these channels.
    pub(crate) fn check(&self, dofs: usize, forced: &[usize]) -> Result<(), ForceError> {
        let named = self.channels.iter().map(|c| c.dof).chain(forced.iter().copied());
        if let Some(dof) = named.into_iter().find(|dof| *dof >= dofs) {
            return Err(ForceError::NoSuchDof { dof, dofs });
        }
        if forced.is_empty() {
            return Err(ForceError::NoForcedDof);
        }
        if let Some(dof) = first_repeated(forced) {
            return Err(ForceError::RepeatedDof { dof });
        }
        if forced.len() > self.channels.len() {
            return Err(ForceError::MoreForcesThanMeasurements {
                forces: forced.len(),
                measurements: self.channels.len(),
            });
        }
        Ok(())
    }
}

/// The first index that was already there.
pub(crate) fn first_repeated(indices: &[usize]) -> Option<usize> {
    let mut seen = std::collections::HashSet::new();
    indices.iter().copied().find(|index| !seen.insert(*index))
}
