//! Estimators in the frequency domain.

mod data;
mod equation_error;
mod instrumental;
mod levenberg_marquardt;
mod lines;
mod misfit;
mod motion;
mod output_error;
mod periods;

pub use data::FrequencyData;
pub use equation_error::{equation_error, equation_rows};
pub use instrumental::instrumental_variables;
pub use lines::Lines;
pub use motion::Motion;
pub use output_error::{OutputErrorFit, output_error};
pub use periods::RepeatedPeriods;

pub use crate::noise_spectrum::{NoiseSpectrum, Pooling};
