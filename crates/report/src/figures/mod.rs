//! Figures of the results of an analysis.

pub(crate) mod backbone;
mod bearing;
pub(crate) mod elements;
mod force;
mod frf;
pub mod modal;
pub mod modes;
mod motion;
pub mod receptance;
mod record;
pub mod restoring;
pub mod shapes;
mod style;
mod sweep;
pub mod trace;
#[cfg(feature = "parquet")]
pub mod trends;

use mechid_analysis::bearing::BearingTable;
#[cfg(feature = "parquet")]
use mechid_analysis::fleet::Trends;
use mechid_analysis::modes::SavedModes;
use mechid_analysis::{
    AnalysisError, Channels, Decayed, FrfTable, Identified, IdentifiedBearing, IdentifiedElements,
    IdentifiedResponses, Inspected, Machine, ModalSummary, Modes, Reconstructed, SweepSummary,
};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_plot::Figure;
use mechid_spectra::FrequencyData;
use serde::Serialize;

use self::receptance::Names;
pub use self::style::{FigureStyle, FrequencyScale, MagnitudeScale, PhaseStyle};
use crate::ReportError;
use crate::page::results::{self, result_page};
use crate::page::{PageSettings, elements_page, figure_page, modes_page};

/// A result that can be drawn.
pub trait ToFigure {
    /// Returns the usual figure of the result.
    ///
    /// # Errors
    /// [`ReportError::NoColumnToDraw`] or [`ReportError::NothingResonates`] if the result has no
    /// content for a figure, [`ReportError::Analysis`] if a curve cannot be computed.
    fn figure(&self) -> Result<Figure, ReportError> {
        self.styled_figure(FigureStyle::default())
    }

    /// Returns the usual figure of the result, with its frequency responses in the given style.
    ///
    /// # Errors
    /// As [`ToFigure::figure`].
    fn styled_figure(&self, style: FigureStyle) -> Result<Figure, ReportError>;

    /// Returns an HTML page of the figure with zoom and cursor; the page loads no other file. If
    /// there are several responses, it shows the figure of one response large, and those of all
    /// responses small.
    ///
    /// # Errors
    /// As [`ToFigure::figure`].
    fn styled_page(&self, style: FigureStyle) -> Result<String, ReportError> {
        self.page_with(style, &PageSettings::default())
    }

    /// Returns the page of [`ToFigure::styled_page`] with the heading and the details of the
    /// settings.
    ///
    /// # Errors
    /// As [`ToFigure::figure`].
    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        let figure = self.styled_figure(style)?;
        let title = settings.title.clone().unwrap_or_else(|| figure.name().to_owned());
        let settings = PageSettings { title: Some(title), ..settings.clone() };
        figure_page(vec![(String::new(), figure)], None, &settings)
    }
}

/// Returns the page of a result with modes: their table, figure, shapes and checks.
fn modes_of_result(
    summary: &impl Serialize,
    result: &impl ToFigure,
    style: FigureStyle,
    settings: &PageSettings,
) -> Result<String, ReportError> {
    let modes = SavedModes::from_result(summary)?;
    let shapes = shapes::ModeShapes::from_saved(&modes, settings.geometry.as_ref());
    let figure = match result.styled_figure(style) {
        Err(ReportError::NothingResonates { .. }) => None,
        figure => Some(figure?),
    };
    modes_page(&modes, figure, shapes.as_ref(), settings)
}

/// Returns measured and identified responses per unit force, a figure for each pair of response and
/// force; `None` for another kind of figure, or if the responses to the forces cannot be separated
/// at any line.
fn pairs(
    identified: &Identified,
    style: FigureStyle,
) -> Result<Option<Vec<(String, Figure)>>, ReportError> {
    let Some(data) = identified.drawn_spectra() else { return Ok(None) };
    if restoring::whole_periods(identified).is_some() {
        return Ok(None);
    }
    let channels = identified.names();
    let system = identified.estimate().system().map_err(AnalysisError::from)?;
    let names = Names {
        displacement: &|dof| motion_name(channels, data.measured(), dof, style.quantity),
        force: &|dof| channels.force_name(dof),
    };
    receptance::receptance_set(data, &system, names, style, identified.coherence()?.as_ref())
}

fn receptance_or_responses(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
    names: Names<'_>,
    style: FigureStyle,
) -> Result<Figure, ReportError> {
    match receptance::receptance(title, data, system, names, style)? {
        Some(figure) => Ok(figure),
        None => {
            let title = format!("{}: {title}", receptance::WHY);
            receptance::responses(&title, data, system, names, style)
        }
    }
}

/// Returns the name of a displacement, from the channel that measures it, such as `x at a1` for an
/// accelerometer.
pub(crate) fn displacement_name(channels: &Channels, kind: ResponseQuantity, dof: usize) -> String {
    let name = channels.response_name(kind, dof);
    match kind {
        ResponseQuantity::Displacement => name,
        _ => format!("x at {name}"),
    }
}

fn motion_letter(quantity: ResponseQuantity) -> &'static str {
    match quantity {
        ResponseQuantity::Displacement => "x",
        ResponseQuantity::Velocity => "v",
        ResponseQuantity::Acceleration => "a",
    }
}

/// Returns the name of a response in the figure: the name of its channel if the measured quantity
/// is drawn, otherwise the name of its point.
pub(crate) fn motion_name(
    channels: &Channels,
    measured: ResponseQuantity,
    dof: usize,
    drawn: Option<ResponseQuantity>,
) -> String {
    let name = channels.response_name(measured, dof);
    match drawn {
        Some(drawn) if drawn != measured => {
            format!("{} at {name}", motion_letter(drawn))
        }
        _ => name,
    }
}

impl ToFigure for Identified {
    /// Draws the measured and the identified receptance. If the responses to the forces cannot be
    /// separated at any line, draws the measured and the predicted amplitudes of the responses. For
    /// random and hammer tests, also draws the coherence. For a fit in the time domain, draws the
    /// measured and the predicted response of the first record. With nonlinear terms and whole
    /// periods, draws only the restoring force.
    fn styled_figure(&self, style: FigureStyle) -> Result<Figure, ReportError> {
        let title = self.summary().title();
        if let Some((fitted, points)) = restoring::whole_periods(self) {
            return restoring::figure(&title, fitted, points);
        }
        match self.drawn_spectra() {
            Some(data) => {
                let channels = self.names();
                let drawn = {
                    let system = self.estimate().system().map_err(AnalysisError::from)?;
                    let names = Names {
                        displacement: &|dof| {
                            motion_name(channels, data.measured(), dof, style.quantity)
                        },
                        force: &|dof| channels.force_name(dof),
                    };
                    receptance_or_responses(&title, data, &system, names, style)?
                };
                let name = |dof| channels.response_name(data.measured(), dof);
                Ok(match self.coherence()? {
                    Some(coherence) => drawn.panel(receptance::coherence(&coherence, &name, style)),
                    None => drawn,
                })
            }
            None => Ok(motion::motion(&title, &self.compared()?[0], "predicted")),
        }
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        let figures = match pairs(self, style)? {
            Some(pairs) => pairs,
            None => vec![(String::new(), self.styled_figure(style)?)],
        };
        result_page(&results::identified_words(self), figures, settings)
    }
}

impl ToFigure for IdentifiedResponses {
    /// Draws measured and identified receptance. If the table has an exponential window, both
    /// include the damping that this window adds.
    fn styled_figure(&self, style: FigureStyle) -> Result<Figure, ReportError> {
        let title = self.summary().files.join(", ");
        let system = self.fitted().system().map_err(AnalysisError::from)?;
        let point = |dof: usize| self.summary().points[dof].clone();
        let names = Names { displacement: &point, force: &point };
        receptance_or_responses(&title, self.data(), &system, names, style)
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        let system = self.fitted().system().map_err(AnalysisError::from)?;
        let point = |dof: usize| self.summary().points[dof].clone();
        let names = Names { displacement: &point, force: &point };
        let figures = match receptance::receptance_set(self.data(), &system, names, style, None)? {
            Some(pairs) => pairs,
            None => vec![(String::new(), self.styled_figure(style)?)],
        };
        result_page(&results::table_words(self), figures, settings)
    }
}

impl ToFigure for IdentifiedBearing {
    /// Draws the dynamic stiffness, measured line by line and fitted.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(bearing::dynamic_stiffness(self.summary()))
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        let figures = vec![(String::new(), self.styled_figure(style)?)];
        result_page(&results::bearing_words(self.summary()), figures, settings)
    }
}

impl ToFigure for BearingTable {
    /// Draws the coefficients over speed.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(bearing::over_speed(self))
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        let figures = vec![(String::new(), self.styled_figure(style)?)];
        result_page(&results::campaign_words(self), figures, settings)
    }
}

impl ToFigure for FrfTable {
    /// Draws magnitude, phase and coherence.
    fn styled_figure(&self, style: FigureStyle) -> Result<Figure, ReportError> {
        Ok(frf::figure(self, style))
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        result_page(&results::response_words(self), frf::figures(self, style), settings)
    }
}

impl ToFigure for Decayed {
    /// Draws the response from the beginning of the decay, measured and fitted, and the residual.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        let title = format!("{}: free decay", self.summary().file);
        Ok(motion::motion(&title, self.compared(), "fitted"))
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        modes_of_result(self.summary(), self, style, settings)
    }
}

impl ToFigure for Modes {
    /// Draws the responses of the first record over frequency, measured and explained by the modes,
    /// with the stabilisation diagram and the mode indicator.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        modes::figure(self)
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        modes_of_result(self.summary(), self, style, settings)
    }
}

impl ToFigure for IdentifiedElements {
    /// Draws the responses of the first sensors over frequency, measured and computed with the
    /// identified system.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(elements::figure(self))
    }

    fn page_with(&self, _: FigureStyle, settings: &PageSettings) -> Result<String, ReportError> {
        elements_page(self, settings)
    }
}

impl ToFigure for Reconstructed {
    /// Draws each force over time with twice its standard error, and its spectrum.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(force::figure(self))
    }

    fn page_with(&self, _: FigureStyle, settings: &PageSettings) -> Result<String, ReportError> {
        result_page(&results::force_words(self.summary()), force::figures(self), settings)
    }
}

impl ToFigure for SweepSummary {
    /// Draws the error of a sweep as a function of the settings.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(sweep::figure(self))
    }
}

impl ToFigure for Inspected {
    /// Draws columns over time, with their spectra.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        record::figure(self)
    }

    fn page_with(&self, _: FigureStyle, settings: &PageSettings) -> Result<String, ReportError> {
        result_page(&results::record_words(self), record::figures(self)?, settings)
    }
}

#[cfg(feature = "parquet")]
impl ToFigure for Trends {
    /// Draws every parameter, natural frequency and damping ratio over the records, with 95 %
    /// intervals.
    fn styled_figure(&self, _: FigureStyle) -> Result<Figure, ReportError> {
        Ok(trends::figure(self))
    }
}

impl ToFigure for Machine {
    /// Draws the receptance around the natural frequencies; for a system with identified nonlinear
    /// terms, which has no receptance, the frequency of each mode over its amplitude.
    fn styled_figure(&self, style: FigureStyle) -> Result<Figure, ReportError> {
        let backbone = self.backbone()?;
        if !backbone.is_empty() {
            let title = format!("Backbone: {}", self.name);
            return Ok(backbone::of_machine(&title, &backbone));
        }
        let modes = self.modes()?;
        let resonances: Vec<modal::Resonance> = modes
            .iter()
            .map(|mode| (mode.natural_frequency_hz.value, mode.damping_ratio.value))
            .collect();
        let drawn = style.quantity.unwrap_or(ResponseQuantity::Displacement);
        let displacement = |dof: usize| match self.names.first_response() {
            Some(kind) => motion_name(&self.names, kind, dof, Some(drawn)),
            None => format!("{}{}", motion_letter(drawn), dof + 1),
        };
        let force = |dof: usize| {
            if self.names.force.is_empty() {
                format!("F{}", dof + 1)
            } else {
                self.names.force_name(dof)
            }
        };
        let names = Names { displacement: &displacement, force: &force };
        modal::figure(&self.name, self.system(), names, &resonances, style)
    }

    fn page_with(
        &self,
        style: FigureStyle,
        settings: &PageSettings,
    ) -> Result<String, ReportError> {
        modes_of_result(&ModalSummary::from_machine(self)?, self, style, settings)
    }
}
