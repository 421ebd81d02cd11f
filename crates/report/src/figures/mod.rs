//! Figures of the results of an analysis.

mod backbone;
mod bearing;
mod force;
mod frf;
pub mod modal;
mod motion;
pub mod receptance;
mod record;
mod sweep;
pub mod trace;

use mechid_analysis::bearing::BearingTable;
use mechid_analysis::{
    FrfTable, Identified, IdentifiedBearing, IdentifiedResponses, Inspected, Machine,
    Reconstructed, SweepSummary,
};
use mechid_estimate::frequency_domain::FrequencyData;
use mechid_model::SecondOrderSystem;
use mechid_plot::Figure;

use crate::ReportError;

/// A result that can be drawn.
pub trait ToFigure {
    /// Returns the usual figure of the result.
    ///
    /// # Errors
    /// [`ReportError::NoColumnToDraw`] or [`ReportError::NothingResonates`] if the result has nothing to draw,
    /// [`ReportError::Analysis`] if a curve cannot be computed.
    fn figure(&self) -> Result<Figure, ReportError>;
}

fn receptance_or_responses(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Figure, ReportError> {
    match receptance::receptance(title, data, system)? {
        Some(figure) => Ok(figure),
        None => receptance::responses(&format!("{title}; {}", receptance::WHY), data, system),
    }
}

impl ToFigure for Identified {
    /// Draws measured and identified receptance, or, where no line separates the forces, the amplitudes of
    /// the response, measured and predicted; for a fit in the time domain measured and predicted
    /// response of the first record.
    fn figure(&self) -> Result<Figure, ReportError> {
        let title = self.summary().title();
        match self.spectra() {
            Some(data) => receptance_or_responses(&title, data, &self.system()?),
            None => Ok(motion::motion(&title, &self.compared()?[0])),
        }
    }
}

impl ToFigure for IdentifiedResponses {
    /// Draws measured and identified receptance.
    fn figure(&self) -> Result<Figure, ReportError> {
        let title = self.summary().files.join(", ");
        receptance_or_responses(&title, self.data(), &self.system()?)
    }
}

impl ToFigure for IdentifiedBearing {
    /// Draws the dynamic stiffness, measured line by line and fitted.
    fn figure(&self) -> Result<Figure, ReportError> {
        Ok(bearing::dynamic_stiffness(self.summary()))
    }
}

impl ToFigure for BearingTable {
    /// Draws the coefficients over speed.
    fn figure(&self) -> Result<Figure, ReportError> {
        Ok(bearing::over_speed(self))
    }
}

impl ToFigure for FrfTable {
    /// Draws magnitude, phase and coherence.
    fn figure(&self) -> Result<Figure, ReportError> {
        Ok(frf::figure(self))
    }
}

impl ToFigure for Reconstructed {
    /// Draws each force over time with twice its standard error, and its spectrum.
    fn figure(&self) -> Result<Figure, ReportError> {
        Ok(force::figure(self))
    }
}

impl ToFigure for SweepSummary {
    /// Draws the error over the settings.
    fn figure(&self) -> Result<Figure, ReportError> {
        Ok(sweep::figure(self))
    }
}

impl ToFigure for Inspected {
    /// Draws columns over time beside their spectra.
    fn figure(&self) -> Result<Figure, ReportError> {
        record::figure(self)
    }
}

impl ToFigure for Machine {
    /// Draws the receptance around the natural frequencies; of a machine whose nonlinear terms were
    /// identified, to which no receptance belongs, the frequency of each mode over its amplitude.
    fn figure(&self) -> Result<Figure, ReportError> {
        let backbone = self.backbone()?;
        if !backbone.is_empty() {
            return Ok(backbone::figure(&self.name, &backbone));
        }
        let modes = self.modes()?;
        let resonances: Vec<modal::Resonance> = modes
            .iter()
            .map(|mode| (mode.natural_frequency_hz.value, mode.damping_ratio.value))
            .collect();
        modal::figure(&self.name, self.system(), &resonances)
    }
}
