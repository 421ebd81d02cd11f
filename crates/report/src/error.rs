//! Errors of figures and pages.

/// Error in drawing or describing a result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A record has no columns of numbers except the time.
    #[error("{file}: nothing to plot: no column other than time holds numbers")]
    NoColumnToDraw {
        /// The record.
        file: String,
    },
    /// A system has mass but no stiffness, and therefore no resonance.
    #[error("{file}: nothing to plot: the machine has no natural frequency other than zero")]
    NothingResonates {
        /// File of the system.
        file: String,
    },
    /// An analysis for a figure or a page fails.
    #[error(transparent)]
    Analysis(#[from] mechid_analysis::AnalysisError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Plot(#[from] mechid_plot::PlotError),
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
    /// Spectral lines cannot be used.
    #[error(transparent)]
    Spectra(#[from] mechid_spectra::SpectraError),
    /// A numerical method fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
    /// An estimate cannot be evaluated.
    #[error(transparent)]
    Estimate(#[from] mechid_estimate::EstimateError),
    /// A model cannot be used.
    #[error(transparent)]
    Model(#[from] mechid_model::ModelError),
}
