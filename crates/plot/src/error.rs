//! Errors of figures.

use std::path::PathBuf;

/// Reason why a figure was not drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The figure has no panel.
    #[error("the figure \"{figure}\" has no panel")]
    NoPanels {
        /// Title of the figure.
        figure: String,
    },
    /// A panel has no curve.
    #[error("panel {panel} of the figure \"{figure}\" has no curve")]
    NoCurves {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
    },
    /// A curve has no point.
    #[error("the curve \"{curve}\" has no point")]
    EmptyCurve {
        /// Legend label of the curve.
        curve: String,
    },
    /// The numbers of abscissae and ordinates of a curve differ.
    #[error("the curve \"{curve}\" has {x_len} abscissae but {y_len} ordinates")]
    LengthMismatch {
        /// Legend label of the curve.
        curve: String,
        /// Number of abscissae.
        x_len: usize,
        /// Number of ordinates.
        y_len: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error(
        "the curve \"{curve}\" has the {coordinate} coordinate {value} at point {index}: leave such points out"
    )]
    NonFinite {
        /// Legend label of the curve.
        curve: String,
        /// Name of the coordinate: `x` or `y`.
        coordinate: char,
        /// Index of the point, from 0.
        index: usize,
        /// The value, in the unit of its axis.
        value: f64,
    },
    /// A logarithmic axis cannot show zero or a negative number.
    #[error(
        "the curve \"{curve}\" has the {coordinate} coordinate {value} at point {index}, which a logarithmic axis cannot show: leave such points out or choose a linear axis"
    )]
    NotPositive {
        /// Legend label of the curve.
        curve: String,
        /// Name of the coordinate: `x` or `y`.
        coordinate: char,
        /// Index of the point, from 0.
        index: usize,
        /// The value, in the unit of its axis.
        value: f64,
    },
    /// A reference line is at a value that its axis cannot show.
    #[error("the reference line \"{label}\" lies at {value}, which its axis cannot show")]
    Reference {
        /// Legend label of the line.
        label: String,
        /// The value, in the unit of its axis.
        value: f64,
    },
    /// The requested range of an axis is empty, not finite, or not positive on a logarithmic axis.
    #[error("the axis \"{axis}\" cannot run from {low} to {high}")]
    Range {
        /// Label of the axis.
        axis: String,
        /// Requested lower end, in the unit of the axis.
        low: f64,
        /// Requested upper end, in the unit of the axis.
        high: f64,
    },
    /// The figure is too small for its axes and legends, or its size is not finite.
    #[error(
        "{width} × {height} px is too small or not finite; the labels alone need {needed_width:.0} × {needed_height:.0} px: choose a larger size"
    )]
    Size {
        /// Width of the figure, px.
        width: f64,
        /// Height of the figure, px.
        height: f64,
        /// Minimum width, px.
        needed_width: f64,
        /// Minimum height, px.
        needed_height: f64,
    },
    /// The requested bitmap is empty or has more than 16,384 pixels per side.
    #[error(
        "a bitmap of {width} × {height} pixels is not possible: choose a scale that gives 1 to {limit} pixels per side"
    )]
    BitmapSize {
        /// Requested width, pixels.
        width: f64,
        /// Requested height, pixels.
        height: f64,
        /// Maximum number of pixels per side.
        limit: u32,
    },
    /// The renderer of bitmaps refused a drawing.
    #[error("the drawing cannot be turned into a bitmap: {reason}")]
    Raster {
        /// Message of the renderer.
        reason: String,
    },
    /// A file name does not end in `.svg` or `.png`.
    #[error("{}: the file name must end in .svg or .png", path.display())]
    Extension {
        /// The file name.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error("{} cannot be written: {source}", path.display())]
    Write {
        /// The file name.
        path: PathBuf,
        /// Reason given by the file system.
        source: std::io::Error,
    },
}
