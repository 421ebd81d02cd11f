//! Spectral lines of measured inputs and outputs: what every estimator in the frequency domain takes.

mod error;
pub mod line_data;

pub use error::SpectraError;
pub use line_data::{LineData, Transient};
