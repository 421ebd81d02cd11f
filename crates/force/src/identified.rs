//! The force that was found.

use mechid_signal::{Record, Spectrum};

/// A reconstructed force: one channel per degree of freedom of the machine, in N.
///
/// Channels of degrees of freedom that the method was told are not forced are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedForce {
    record: Record,
    spectrum: Spectrum,
    standard_error: Option<Record>,
}

impl IdentifiedForce {
    /// A force whose uncertainty is not known.
    pub(crate) fn of(record: Record) -> Self {
        let spectrum = Spectrum::of(&record);
        Self { record, spectrum, standard_error: None }
    }

    /// The same force with its standard error, on the same time axis.
    pub(crate) fn with_standard_error(mut self, standard_error: Option<Record>) -> Self {
        self.standard_error = standard_error;
        self
    }

    /// F̂(t), in N: samples × degrees of freedom.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The lines of F̂, lines × degrees of freedom, in N; the record taken as one whole period.
    pub fn spectrum(&self) -> &Spectrum {
        &self.spectrum
    }

    /// One standard deviation of F̂(t), in N: samples × degrees of freedom; `None` where the
    /// method had no way to know it.
    pub fn standard_error(&self) -> Option<&Record> {
        self.standard_error.as_ref()
    }
}
