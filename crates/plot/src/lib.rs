//! Drawings of records, spectra, frequency responses and sweeps, as SVG and PNG.
//!
//! A [`Figure`] is a description: panels, axes with units, curves, reference lines. Drawing it is a
//! pure function: the same description gives the same bytes on every machine, because widths come
//! from the metrics of an embedded font (Noto Sans, SIL Open Font License), and fonts of the system
//! are not used.
//!
//! ```
//! use mechid_plot::{Axis, Curve, Figure, Panel, Reference};
//!
//! // Receptance of 10 kg on 5,000 N/m and 180 N·s/m.
//! let omega: Vec<f64> = (1..=400).map(|k| 0.25 * f64::from(k)).collect();
//! let receptance: Vec<f64> =
//!     omega.iter().map(|w| 1.0 / (5000.0 - 10.0 * w * w).hypot(180.0 * w)).collect();
//!
//! let abscissa = Axis::log10("Angular frequency ω", "rad/s");
//! let figure = Figure::new("Mass on spring and damper").panel(
//!     Panel::new(abscissa, Axis::log10("Receptance |H|", "m/N"))
//!         .curve(Curve::line("exact", &omega, &receptance))
//!         .reference(Reference::vertical("natural frequency", 500f64.sqrt())),
//! );
//!
//! let svg = figure.to_svg()?;
//! assert!(svg.starts_with("<svg") && svg.contains("natural frequency"));
//! let png = figure.to_png(2.0)?;
//! assert_eq!(&png[1..4], b"PNG");
//! # Ok::<(), mechid_plot::PlotError>(())
//! ```
//!
//! [`charts`] has the most frequent figures; [`Canvas`] draws sketches other than plots.
//!
//! The crate `resvg` sets the text and makes the bitmaps. The axes are our own, because no plotting
//! crate aligns the frames of stacked panels, keeps legends off the curves and writes exponents.
//!
//! Every figure has a palette for colour-blind readers with a dash and a marker for each colour,
//! legends that hide no curve, the same style for the same method in every figure, ticks at round
//! numbers, and aligned axes of stacked panels.

mod axis;
mod bitmap;
mod canvas;
pub mod charts;
mod curve;
mod draw;
mod error;
mod figure;
mod interactive;
mod layout;
mod legend;
mod marks;
mod panel;
mod render;
mod save;
mod shapes;
mod style;
mod text;
mod ticks;
mod trace;

pub use axis::{Axis, NEPER, ROUNDING, Scale};
pub use bitmap::svg_to_png;
pub use canvas::{Anchor, Canvas, Point, Stroke, TextStyle};
pub use curve::{Curve, Reference};
pub use error::PlotError;
pub use figure::Figure;
pub use interactive::{
    DrawnSet, FigureSet, content_policy, figure_style, page_of, script, with_metadata,
};
pub use panel::{Legend, Panel, ResponsePart};
pub use save::save_svg;
pub use shapes::{DrawnMode, ShapeDrawing, matrix_of_squares};
pub use style::{Color, Dash, Marker};
pub use text::{Weight, text_width};
