//! Figures and HTML pages of the results of an analysis; prints nothing and writes no file.

mod error;
pub mod figures;
pub mod page;
mod spectrum_csv;

pub use error::ReportError;
pub use figures::ToFigure;
pub use page::{PageSettings, page};
pub use spectrum_csv::spectrum_csv;
