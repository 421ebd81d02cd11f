//! The likelihood of line data, the same for all kinds of records and models.
//!
//! [`LineData`](mechid_spectra::LineData) has the inputs, the outputs and the covariance of their
//! noise, line by line. A [`ResponseModel`] is the model. All data and models share one residual
//! with one derivative, one bounded search, and one covariance.

mod covariance;
mod delay_score;
pub mod entries;
mod error;
mod estimate;
mod fit;
mod limits;
pub mod machine;
mod multi_start;
mod profile;
mod residual;
mod response_model;
mod search;
mod settings;
mod thinned;
mod transient;
mod unknown_noise;
mod weight_uncertainty;
mod weights;

pub use delay_score::DelayScore;
pub use error::LikelihoodError;
pub use estimate::{
    Combination, FoundMinimum, IntervalKind, LikelihoodEstimate, ParameterEstimate, PriorReport,
};
pub use response_model::{Dimensions, LineResponse, ResponseModel};
pub use settings::{NoiseSource, Settings};
