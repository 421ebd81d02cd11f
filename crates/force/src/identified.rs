//! The force that was found.

use std::sync::OnceLock;

use mechid_signal::{Record, Spectrum};

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
}

impl PartialEq for IdentifiedForce {
    fn eq(&self, other: &Self) -> bool {
        self.record == other.record && self.standard_error == other.standard_error
    }
}

impl IdentifiedForce {
    /// A force whose uncertainty is not known.
    pub(crate) fn of(record: Record) -> Self {
        Self { record, spectrum: OnceLock::new(), standard_error: None, rest: None }
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

    /// Part of each measured channel that the force leaves unexplained.
    ///
    /// `None` where every channel is needed for a force of its own, and by
    /// [`continuous`](crate::continuous()) and [`discretised`](crate::discretised()), which compare
    /// nothing.
    pub fn unexplained(&self) -> Option<&[Unexplained]> {
        self.rest.as_ref().map(Rest::channels)
    }
}
