//! The identified force.

use std::sync::OnceLock;

use mechid_signal::{Extent, Record, Spectrum};

use crate::band::{is_within, within_band};
use crate::error::ForceError;
use crate::lines::noise_weight;
use crate::unexplained::{Residual, Unexplained};

/// An identified force: one channel per degree of freedom of the system, in N.
///
/// Channels of degrees of freedom without a force are zero.
#[derive(Debug, Clone)]
pub struct IdentifiedForce {
    record: Record,
    /// Spectrum of the force. It is computed on demand, because a search over many forces does not
    /// need it.
    spectrum: OnceLock<Spectrum>,
    standard_error: Option<Record>,
    /// Residual of the measured channels; `None` if there are not more channels than forces.
    residual: Option<Residual>,
    /// Band of record and standard error; `None`: all frequencies.
    band_hz: Option<[f64; 2]>,
}

impl PartialEq for IdentifiedForce {
    fn eq(&self, other: &Self) -> bool {
        self.record == other.record && self.standard_error == other.standard_error
    }
}

impl IdentifiedForce {
    /// Creates a force of unknown uncertainty.
    pub(crate) fn from_record(record: Record) -> Self {
        Self {
            record,
            spectrum: OnceLock::new(),
            standard_error: None,
            residual: None,
            band_hz: None,
        }
    }

    /// Returns the same force with its standard error, on the same time axis.
    pub(crate) fn with_standard_error(mut self, standard_error: Option<Record>) -> Self {
        self.standard_error = standard_error;
        self
    }

    /// Returns the same force with the residual of the measured channels.
    pub(crate) fn with_residual(mut self, residual: Option<Residual>) -> Self {
        self.residual = residual;
        self
    }

    /// Returns the same force with another record.
    pub(crate) fn replaced(self, record: Record) -> Self {
        Self { record, spectrum: OnceLock::new(), ..self }
    }

    /// Returns the same force with the statement that its record and its standard error cover only
    /// this band.
    pub(crate) fn with_band(mut self, band_hz: [f64; 2]) -> Self {
        self.band_hz = Some(band_hz);
        self
    }

    /// Returns the part of the force between two frequencies in Hz, including the ends, for a force
    /// with a white error.
    ///
    /// The standard error, in N, then covers the lines in the band. Use this function for the
    /// equation of motion ([`continuous`](crate::continuous()) and its variants), which turns white
    /// noise into white noise; the other methods use the band of their measurement
    /// ([`Measurement::in_band`](crate::Measurement::in_band)).
    ///
    /// # Errors
    /// [`ForceError::NoBand`] if the lower end is not below the upper end, or an end is not finite.
    ///
    /// # Source
    /// Brillinger, *Time Series: Data Analysis and Theory* (1981), chapter 4 (white noise on
    /// lines).
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

    pub(crate) fn residual(&self) -> Option<&Residual> {
        self.residual.as_ref()
    }

    /// Force F̂(t), in N: samples × degrees of freedom.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Lines of the force, lines × degrees of freedom, in N; the record must be one whole period.
    pub fn spectrum(&self) -> &Spectrum {
        self.spectrum.get_or_init(|| Spectrum::from_record(&self.record))
    }

    /// Standard deviation of F̂(t), in N: samples × degrees of freedom; `None` if the method cannot
    /// estimate it.
    pub fn standard_error(&self) -> Option<&Record> {
        self.standard_error.as_ref()
    }

    /// Lowest and highest frequency, in Hz, of force and standard error; `None`: all frequencies.
    ///
    /// It is the requested band ([`Measurement::in_band`](crate::Measurement::in_band)) or, without
    /// a measured displacement, the band in which the force exceeds the noise of the channels.
    pub fn band_hz(&self) -> Option<[f64; 2]> {
        self.band_hz
    }

    /// Part of each measured channel that the force does not explain.
    ///
    /// `None` if there are as many forces as channels, and for [`continuous`](crate::continuous())
    /// and [`discretised`](crate::discretised()), which have no residual.
    pub fn unexplained(&self) -> Option<&[Unexplained]> {
        self.residual.as_ref().map(Residual::channels)
    }
}
