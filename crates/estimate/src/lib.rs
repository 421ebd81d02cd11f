//! Mass, damping and stiffness from measured forces and motions, with confidence intervals.
//!
//! ```
//! use mechid_estimate::{EquationOfMotion, Unknowns};
//! use nalgebra::{DMatrix, dmatrix};
//!
//! // 2 ẍ + 0.3 ẋ + 8 x = F at five instants; the force is rounded to a tenth of a newton.
//! let a = dmatrix![1.0; 0.0; 2.0; -1.0; 3.0];
//! let v = dmatrix![0.0; 1.0; 1.0; -2.0; 1.0];
//! let x = dmatrix![1.0; -1.0; 0.5; 1.5; 2.0];
//! let force: DMatrix<f64> = 2.0 * &a + 0.3 * &v + 8.0 * &x;
//! let read = force.map(|f| (10.0 * f).round() / 10.0);
//!
//! let mut rows = EquationOfMotion::new(1);
//! rows.push_rows(a.as_view(), v.as_view(), x.as_view(), read.as_view())?;
//! let estimate = rows.solve(&Unknowns::unknown_mass(1)?)?;
//!
//! let stiffness = estimate.parameter("k")?;
//! let [low, high] = stiffness.interval(0.95)?;
//! assert!(low < 8.0 && 8.0 < high && high - low < 1.0);
//! # Ok::<(), mechid_estimate::EstimateError>(())
//! ```
//!
//! The types of matrices come from `nalgebra`; a program that uses this crate needs `nalgebra` as a
//! dependency, too. The types of spectra and records come from `mechid-signal`.

mod covariance;
pub mod derivatives;
mod elimination;
mod equation_of_motion;
mod error;
mod estimate;
pub mod frequency_domain;
mod frequency_responses;
pub mod likelihood;
mod limits;
mod modal;
mod prediction;
mod pulse_covariance;
mod related_equations;
mod relations;
mod sweep;
pub mod time_domain;
mod unknowns;

pub use covariance::{Covariance, Product};
pub use equation_of_motion::EquationOfMotion;
pub use error::{EstimateError, NAMED_DIRECTIONS, NAMED_PARAMETERS};
pub use estimate::{Estimate, EstimateParts, Estimated, Undetermined};
pub use frequency_responses::{ResponseEstimate, output_error_of_responses};
pub use modal::{IdentifiedMode, identified_modes};
pub use prediction::{
    StartFit, fit_percent, fitted_start, missing_force, predict, predict_periodic,
};
pub use relations::Relations;
pub use sweep::{Sweep, SweepPoint, sweep};
pub use unknowns::{Unknowns, only_ratios};
