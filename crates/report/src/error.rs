//! Errors between a result and its figure or page.

/// A failure to draw or to describe a result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A record without numbers but those of time.
    #[error("{file}: nothing to plot: no column other than time holds numbers")]
    NoColumnToDraw {
        /// The record.
        file: String,
    },
    /// A mass without a spring.
    #[error("{file}: nothing to plot: the machine has no natural frequency other than zero")]
    NothingResonates {
        /// The machine.
        file: String,
    },
    /// The analysis cannot compute what is shown.
    #[error(transparent)]
    Analysis(#[from] mechid_analysis::AnalysisError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Plot(#[from] mechid_plot::PlotError),
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
    /// Spectral lines are unusable.
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
