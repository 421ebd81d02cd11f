//! The force that was found.

use std::sync::OnceLock;

use mechid_signal::{Extent, Record, Spectrum};

use crate::ForceError;
use crate::band::{is_within, within_band};
use crate::lines::noise_weight;
use crate::unexplained::{Rest, Unexplained};

/// A reconstructed force: one channel per degree of freedom of the machine, in N.
///
/// Channels of degrees of freedom that the method was told are not forced are zero.
#[derive(Debug, Clone)]
pub struct IdentifiedForce {
    record: Record,
    /// Found when it is asked for: of the many forces behind a standard error nobody asks.
    spectrum: OnceLock<Spectrum>,
    standard_error: Option<Record>,
    /// Remainder of the measured channels; `None` where there are no more of them than forces.
    rest: Option<Rest>,
    /// Band of record and standard error; `None`: all frequencies.
    band_hz: Option<[f64; 2]>,
}

impl PartialEq for IdentifiedForce {
    fn eq(&self, other: &Self) -> bool {
        self.record == other.record && self.standard_error == other.standard_error
    }
}

impl IdentifiedForce {
    /// A force whose uncertainty is not known.
    pub(crate) fn of(record: Record) -> Self {
        Self { record, spectrum: OnceLock::new(), standard_error: None, rest: None, band_hz: None }
    }

    /// The same force with its standard error, on the same time axis.
    pub(crate) fn with_standard_error(mut self, standard_error: Option<Record>) -> Self {
        self.standard_error = standard_error;
        self
    }

    /// The same force with what it leaves of the measured channels.
    pub(crate) fn with_rest(mut self, rest: Option<Rest>) -> Self {
        self.rest = rest;
        self
    }

    /// The same with another record.
    pub(crate) fn replaced(self, record: Record) -> Self {
        Self { record, spectrum: OnceLock::new(), ..self }
    }

    /// The same, said to be the force of this band only.
    pub(crate) fn with_band(mut self, band_hz: [f64; 2]) -> Self {
        self.band_hz = Some(band_hz);
        self
    }

    /// The part of the force between two frequencies in Hz, ends included, its error taken as white.
    ///
    /// The standard error, in N, is then that of as many lines as lie in the band. It is for the
    /// equation of motion ([`continuous`](crate::continuous()) and its like), which makes white noise
    /// of white noise; the other methods take the band of their measurement
    /// ([`Measurement::in_band`](crate::Measurement::in_band)).
    ///
    /// # Errors
    /// [`ForceError::NoBand`] if the lower end is not below the upper one or one is not finite.
    ///
    /// # Source
    /// Brillinger, *Time Series: Data Analysis and Theory* (1981), chapter 4 (white noise on lines).
    pub fn white_in_band(self, band_hz: [f64; 2], extent: Extent) -> Result<Self, ForceError> {
        let record = within_band(&self.record, band_hz, extent)?;
        let sampling = record.sampling();
        let nyquist = 0.5 * sampling.rate_hz();
        let share = match extent {
            Extent::Open => (band_hz[1].min(nyquist) - band_hz[0]).max(0.0) / nyquist,
            Extent::WholePeriod => {
                let spacing = sampling.line_spacing_hz();
                let weight = |n: usize| noise_weight(record.len(), n);
                let inside = |n: &usize| is_within(band_hz, *n as f64 * spacing, spacing);
                (0..sampling.lines()).filter(inside).map(weight).sum()
            }
        };
        let error = self
            .standard_error
            .as_ref()
            .map(|error| Record::new(sampling, error.data() * share.sqrt()));
        let error = error.transpose()?;
        Ok(self.replaced(record).with_standard_error(error).with_band(band_hz))
    }

    pub(crate) fn rest(&self) -> Option<&Rest> {
        self.rest.as_ref()
    }

    /// F̂(t), in N: samples × degrees of freedom.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The lines of F̂, lines × degrees of freedom, in N; the record taken as one whole period.
    pub fn spectrum(&self) -> &Spectrum {
        self.spectrum.get_or_init(|| Spectrum::of(&self.record))
    }

    /// One standard deviation of F̂(t), in N: samples × degrees of freedom; `None` where the
    /// method had no way to know it.
    pub fn standard_error(&self) -> Option<&Record> {
        self.standard_error.as_ref()
    }

    /// Lowest and highest frequency, in Hz, between which force and standard error hold; `None`: at
    /// all frequencies.
    ///
    /// It is the band asked for ([`Measurement::in_band`](crate::Measurement::in_band)) or, where
    /// no displacement was measured, the one in which the channels show more of a force than noise.
    pub fn band_hz(&self) -> Option<[f64; 2]> {
        self.band_hz
    }

    /// Part of each measured channel that the force leaves unexplained.
    ///
    /// `None` where every channel is needed for a force of its own, and by
    /// [`continuous`](crate::continuous()) and [`discretised`](crate::discretised()), which compare
    /// nothing.
    pub fn unexplained(&self) -> Option<&[Unexplained]> {
        self.rest.as_ref().map(Rest::channels)
    }
}
