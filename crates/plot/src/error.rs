//! What can be wrong with a figure.

use std::path::PathBuf;

/// Why a figure was not drawn.
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
    /// The coordinates of a curve differ in number.
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
        /// Which coordinate: `x` or `y`.
        coordinate: char,
        /// Index of the point, from 0.
        index: usize,
        /// The offending value, in the unit of its axis.
        value: f64,
    },
    /// A logarithmic axis cannot show zero or a negative number.
    #[error(
        "the curve \"{curve}\" has the {coordinate} coordinate {value} at point {index}, which a logarithmic axis cannot show"
    )]
    NotPositive {
        /// Legend label of the curve.
        curve: String,
        /// Which coordinate: `x` or `y`.
        coordinate: char,
        /// Index of the point, from 0.
        index: usize,
        /// The offending value, in the unit of its axis.
        value: f64,
    },
    /// A reference line lies at a value its axis cannot show.
    #[error("the reference line \"{label}\" lies at {value}, which its axis cannot show")]
    Reference {
        /// Legend label of the line.
        label: String,
        /// The offending value, in the unit of its axis.
        value: f64,
    },
    /// The range asked of an axis is empty, not finite, or not positive on a logarithmic axis.
    #[error("the axis \"{axis}\" cannot run from {low} to {high}")]
    Range {
        /// Label of the axis.
        axis: String,
        /// Lower end asked for, in the unit of the axis.
        low: f64,
        /// Upper end asked for, in the unit of the axis.
        high: f64,
    },
    /// The figure is too small for its axes and legends, or not of a finite size.
    #[error(
        "{width} × {height} px is no size to draw in; the labels alone need {needed_width:.0} × {needed_height:.0} px"
    )]
    Size {
        /// Width of the figure, px.
        width: f64,
        /// Height of the figure, px.
        height: f64,
        /// Least width, px.
        needed_width: f64,
        /// Least height, px.
        needed_height: f64,
    },
    /// The bitmap asked for is empty or larger than 16,384 pixels a side.
    #[error("a bitmap of {width} × {height} pixels cannot be made; from 1 to {limit} a side can")]
    BitmapSize {
        /// Width asked for, pixels.
        width: f64,
        /// Height asked for, pixels.
        height: f64,
        /// Largest number of pixels a side.
        limit: u32,
    },
    /// The rasteriser refused a drawing.
    #[error("the drawing cannot be turned into a bitmap: {reason}")]
    Raster {
        /// What the rasteriser says.
        reason: String,
    },
    /// A file name that ends neither in `.svg` nor in `.png`.
    #[error("{}: figures are saved as .svg or .png", path.display())]
    Extension {
        /// The file name.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error("{} cannot be written", path.display())]
    Write {
        /// The file name.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
}
