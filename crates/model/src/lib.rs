//! Mechanical systems M ẍ + C ẋ + K x = F, linear or with nonlinear terms, and their closed forms.
//!
//! ```
//! use mechid_model::{JournalBearing, KyxSign, OilFilm};
//!
//! // A rigid shaft of 14.8 kg in an oil film. The film couples the two directions, and not
//! // symmetrically: whether the shaft whirls depends on the sign of Kyx.
//! let film = OilFilm {
//!     kxx: 40.0, kxy: 50.0, kyx: 20.0, kyy: 60.0,
//!     cxx: 20.0, cxy: 10.0, cyx: 10.0, cyy: 30.0,
//! };
//! let shaft = JournalBearing::new(14.8, film, KyxSign::Minus)?.system();
//!
//! let whirl = &shaft.modes()?[0];
//! assert!((whirl.damped_frequency() - 1.63331).abs() < 5e-6);
//! assert!((whirl.damping_ratio() - 0.0537).abs() < 5e-5);
//!
//! // Amplitude and phase of x (m) under 1 N in y, at the frequency of the whirl.
//! let x = shaft.receptance(whirl.damped_frequency())?[(0, 1)];
//! assert!(x.norm() > 5.0 * shaft.receptance(0.0)?[(0, 1)].norm());
//! # Ok::<(), mechid_model::ModelError>(())
//! ```
//!
//! | To get | Use |
//! |---|---|
//! | a system | [`SecondOrderSystem::new`], [`Sdof`], [`JournalBearing`] |
//! | a system of many degrees of freedom | [`SparseSystem`] |
//! | eigenvalues, damping ratios, mode shapes | [`SecondOrderSystem::modes`] |
//! | the free response that grows fastest | [`SecondOrderSystem::instability`] |
//! | dynamic stiffness | [`SecondOrderSystem::dynamic_stiffness`] |
//! | receptance | [`SecondOrderSystem::receptance`] |
//! | exact responses of one degree of freedom | [`Sdof`], such as [`Sdof::free_response`] |
//! | the exact step from one sample to the next | [`StateTransition`] |
//! | the name of a measured quantity | [`ResponseQuantity`] |
//! | the name of an identified entry | [`Parameter`] |
//! | the assumption on a force between samples | [`Discretisation`] |
//! | a system that was identified, with its covariance | [`UncertainSystem`] |
//! | springs and dampers that are not linear | [`NonlinearSystem`], [`Terms`] |
//! | frequency of free vibration as a function of its amplitude | [`UncertainNonlinearSystem::backbone`] |
//! | a time axis that suits the system | [`npi_sampling`] |

mod closed_form;
mod discretisation;
mod divided_exp;
pub mod elements;
mod error;
mod frequency_response;
mod initial_state;
mod journal_bearing;
mod limits;
mod modes;
mod nonlinear;
mod parameter;
mod response;
mod response_quantity;
mod sampled_force;
mod sampling_rule;
mod sdof;
mod second_order;
#[cfg(feature = "serde")]
mod serde_forms;
mod sparse_system;
mod state_transition;
mod steady_state;
mod uncertain_system;

pub use discretisation::Discretisation;
pub use error::ModelError;
pub use initial_state::InitialState;
pub use journal_bearing::{JournalBearing, KyxSign, OilFilm};
pub use mechid_numerics::{RealSchur, linear_algebra};
pub use modes::{EIGENVALUE_ROUNDING, Instability, Mode};
pub use nonlinear::{
    BackbonePoint, Constant, Coordinate, Friction, Law, NonlinearParameter, NonlinearSystem, Power,
    QuadraticDamping, SaturatingDamping, Term, Terms, UncertainNonlinearSystem,
};
pub use parameter::Parameter;
pub use response::Response;
pub use response_quantity::ResponseQuantity;
pub use sampling_rule::npi_sampling;
pub use sdof::Sdof;
pub use second_order::{Matrix, SecondOrderSystem};
pub use sparse_system::{SparseSystem, band, lumped, triplets};
pub use state_transition::StateTransition;
pub use steady_state::exact_periodic;
pub use uncertain_system::UncertainSystem;
