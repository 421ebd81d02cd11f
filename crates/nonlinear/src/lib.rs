//! Systems with nonlinear springs and dampers, from steady periods or any record.
//!
//! Nonlinear terms ([`Terms`](mechid_model::Terms)) are further regressors of the equation of
//! motion:
//!
//! ```text
//! M ẍ + C ẋ + K x + Σ θ f(q, q̇) = F
//! ```
//!
//! | To | Use |
//! |---|---|
//! | see whether the system is linear, and what kind of term it needs | [`distortion()`] |
//! | choose terms | [`select_terms`], from [`further_terms`] for those that a fit may lack |
//! | fit steady periods, fast and without start values | [`equation_error`] on [`SteadyExperiments`] |
//! | fit any record, without bias from noise on the response | [`output_error`], started from [`equation_error`] |
//! | fit a sweep, a random or a hammer record | [`output_error_of_open_records`], started from a linear fit |
//! | look at the restoring force, within the data and beyond | [`NonlinearEstimate::restoring_forces`], [`NonlinearEstimate::extrapolations`] |
//! | predict a response | [`predict()`], from the [`fitted_start`] |

mod channel_phase;
mod covariance;
mod distortion;
mod equation_error;
mod equations;
mod estimate;
mod experiments;
mod grid;
mod kinds;
mod limits;
mod output_error;
mod predict;
mod propagation;
mod restoring;
mod scatter;
mod selection;
mod shape;
mod simulate;
mod weighting;
mod whitening;

pub use channel_phase::ChannelPhase;
pub use distortion::{Distortion, Kind, Level, distortion};
pub use equation_error::{EquationErrorOptions, equation_error};
pub use estimate::{NamedParameter, NonlinearEstimate, StandardErrors};
pub use experiments::SteadyExperiments;
pub use kinds::further_terms;
pub use output_error::{
    FurtherFit, NonlinearFit, SteppedRecord, best_output_error, further_output_error, output_error,
    output_error_of_open_records,
};
pub use predict::{fitted_start, predict};
pub use restoring::{Extrapolation, REACH, RestoringForce};
pub use scatter::Misfit;
pub use selection::{Criterion, Selection, SelectionStep, least_certain, select_terms};
pub use shape::ShapeConstants;
pub use weighting::Weighting;
