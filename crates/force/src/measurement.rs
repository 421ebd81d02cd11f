//! Measured responses and their degrees of freedom.

use mechid_model::{Response, ResponseQuantity};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use crate::band::check_band;
use crate::error::ForceError;

/// One measured channel: a quantity at a degree of freedom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub struct Channel {
    /// Degree of freedom, counted from 0.
    pub dof: usize,
    /// Response quantity that the channel measures.
    pub quantity: ResponseQuantity,
}

/// State of the system at the first sample of an open record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Start {
    /// Start at rest: no displacement, no velocity.
    FromRest,
    /// Unknown: displacement and velocity are estimated with the force.
    InMotion,
}

/// A measured record and the quantity of each of its channels.
///
/// Any mixture is possible, for example the displacement of one degree of freedom, the
/// accelerations of all degrees of freedom, or both.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    record: Record,
    channels: Vec<Channel>,
    /// Band of the force to identify; `None`: all frequencies.
    band_hz: Option<[f64; 2]>,
}

impl Measurement {
    /// Creates a measurement from its record and the description of each channel.
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
        Ok(Self { record, channels, band_hz: None })
    }

    /// Creates a measurement of the same quantity on every channel, channel c at degree of freedom
    /// c.
    pub fn from_record(quantity: ResponseQuantity, record: Record) -> Self {
        let channels = (0..record.channels()).map(|dof| Channel { dof, quantity }).collect();
        Self { record, channels, band_hz: None }
    }

    /// Creates a measurement of displacement, velocity and acceleration of every degree of freedom.
    pub fn from_response(response: &Response) -> Self {
        let dof = response.dof();
        let parts = ResponseQuantity::ALL.map(|which| (which, response.quantity(which)));
        let data = DMatrix::from_fn(response.sampling().len(), 3 * dof, |k, c| {
            parts[c / dof].1.data()[(k, c % dof)]
        });
        let record =
            Record::new(response.sampling(), data).expect("records of a response are finite");
        let channels =
            (0..3 * dof).map(|c| Channel { dof: c % dof, quantity: parts[c / dof].0 }).collect();
        Self { record, channels, band_hz: None }
    }

    /// Measured record, samples × channels; each channel is in the unit of its quantity: m, m/s or
    /// m/s².
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Degree of freedom and response quantity of each channel.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Restricts the force to the band between two frequencies in Hz, including the ends.
    ///
    /// Force and standard error then belong to this band ([`within_band`](crate::within_band) of
    /// the force). The response outside the band is used to estimate the noise and the spectrum of
    /// the force, but the force outside the band is not returned.
    ///
    /// # Errors
    /// [`ForceError::NoBand`] if the lower end is not below the upper end, or an end is not finite.
    pub fn in_band(self, band_hz: [f64; 2]) -> Result<Self, ForceError> {
        check_band(band_hz)?;
        Ok(Self { band_hz: Some(band_hz), ..self })
    }

    /// Returns the measurement of some consecutive samples.
    pub(crate) fn part(&self, samples: std::ops::Range<usize>) -> Result<Self, ForceError> {
        let record = self.record.window(samples.start, samples.len())?;
        Ok(Self { record, ..self.clone() })
    }

    /// Lowest and highest frequency of the force to identify, in Hz; `None`: all frequencies.
    pub fn band_hz(&self) -> Option<[f64; 2]> {
        self.band_hz
    }

    /// Returns the band in which a measurement without displacements shows a force; `None` if the
    /// force needs no restriction to a band.
    pub(crate) fn shown(&self, lowest_hz: Option<f64>) -> Option<[f64; 2]> {
        let displaced = self.channels.iter().any(|c| c.quantity == ResponseQuantity::Displacement);
        let nyquist = 0.5 * self.sampling().rate_hz();
        let low_hz = lowest_hz.filter(|low| !displaced && (0.0..nyquist).contains(low))?;
        (low_hz > 0.0).then_some([low_hz, nyquist])
    }

    /// The time axis.
    pub fn sampling(&self) -> Sampling {
        self.record.sampling()
    }

    /// Returns whether there are more channels than forces, so that the channels have a residual.
    pub(crate) fn exceeds(&self, forced: &[usize]) -> bool {
        self.channels.len() > forced.len()
    }

    /// Returns an error unless these channels can identify the forces at `forced`.
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

/// Returns the first index that occurs twice.
pub(crate) fn first_repeated(indices: &[usize]) -> Option<usize> {
    let mut earlier = std::collections::HashSet::new();
    indices.iter().copied().find(|index| !earlier.insert(*index))
}
