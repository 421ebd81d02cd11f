//! Displacement, velocity and acceleration at the same instants.

use mechid_signal::{Record, Sampling};

use crate::{ModelError, ResponseQuantity};

/// Response of a system: three records on one time axis, one channel per degree of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    displacement: Record,
    velocity: Record,
    acceleration: Record,
}

impl Response {
    /// Creates a response from its three records (m, m/s, m/s²), sampled at the same instants.
    ///
    /// # Errors
    /// [`ModelError::Channels`] or [`ModelError::Signal`] if the records differ in the number of
    /// channels or in the time axis.
    pub fn new(
        displacement: Record,
        velocity: Record,
        acceleration: Record,
    ) -> Result<Self, ModelError> {
        let expected = displacement.channels();
        for (quantity, record) in [("velocity", &velocity), ("acceleration", &acceleration)] {
            displacement.check_same_sampling(record)?;
            let got = record.channels();
            if got != expected {
                return Err(ModelError::Channels { quantity, got, expected });
            }
        }
        Ok(Self { displacement, velocity, acceleration })
    }

    /// Displacement x, in m: samples × degrees of freedom.
    pub fn displacement(&self) -> &Record {
        &self.displacement
    }

    /// Velocity ẋ, in m/s: samples × degrees of freedom.
    pub fn velocity(&self) -> &Record {
        &self.velocity
    }

    /// Acceleration ẍ, in m/s²: samples × degrees of freedom.
    pub fn acceleration(&self) -> &Record {
        &self.acceleration
    }

    /// Record of one quantity, in m, m/s or m/s²: samples × degrees of freedom.
    pub fn quantity(&self, which: ResponseQuantity) -> &Record {
        match which {
            ResponseQuantity::Displacement => &self.displacement,
            ResponseQuantity::Velocity => &self.velocity,
            ResponseQuantity::Acceleration => &self.acceleration,
        }
    }

    /// Returns the records of [`ResponseQuantity::ALL`], in m, m/s and m/s²: samples × degrees of
    /// freedom.
    pub fn into_records(self) -> [Record; 3] {
        [self.displacement, self.velocity, self.acceleration]
    }

    /// The common time axis.
    pub fn sampling(&self) -> Sampling {
        self.displacement.sampling()
    }

    /// Degrees of freedom.
    pub fn dof(&self) -> usize {
        self.displacement.channels()
    }
}
