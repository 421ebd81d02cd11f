//! Figures and HTML pages of the results of an analysis; prints no text and writes no file.
//!
//! ```
//! use mechid_analysis::{Channels, Identify, Measurement, ResponseQuantity, identify};
//! use mechid_report::ToFigure as _;
//!
//! let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
//! let channels = Channels::new("force", ResponseQuantity::Displacement, "displacement");
//! let test = Measurement::open(rig, &channels)?.period(256)?;
//! let identified = identify(&[test], &Identify::default())?;
//! // Measured and identified receptance over frequency.
//! let svg = identified.figure()?.to_svg()?;
//! assert!(svg.starts_with("<svg") && svg.contains("Hz"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
// On docs.rs, which sets `docsrs`, badges show the features that an item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

mod error;
pub mod figures;
pub mod page;
mod spectrum_csv;

pub use error::ReportError;
pub use figures::modes::stabilisation;
pub use figures::shapes::ModeShapes;
pub use figures::{FigureStyle, FrequencyScale, MagnitudeScale, PhaseStyle, ToFigure};
#[cfg(feature = "parquet")]
pub use page::trends_page;
pub use page::{
    PageSettings, comparison_page, comparison_svg, elements_page, figure_page, modes_page, page,
};
pub use spectrum_csv::spectrum_csv;
