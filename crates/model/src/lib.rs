//! Linear mechanical systems M ẍ + C ẋ + K x = F and what is known of them in closed form.
//!
//! ```
//! use mechid_model::SecondOrderSystem;
//! use nalgebra::dmatrix;
//!
//! // An oil film couples the two directions: C and K need not be symmetric.
//! let shaft = SecondOrderSystem::new(
//!     dmatrix![14.8, 0.0; 0.0, 14.8],
//!     dmatrix![20.0, 10.0; 10.0, 30.0],
//!     dmatrix![40.0, 50.0; -20.0, 60.0],
//! )?;
//! assert_eq!(shaft.dof(), 2);
//! # Ok::<(), mechid_model::ModelError>(())
//! ```

mod error;
mod frequency_response;
mod initial_state;
mod journal_bearing;
mod modes;
mod response;
mod sampling_rule;
mod sdof;
mod second_order;

pub use error::ModelError;
pub use initial_state::InitialState;
pub use journal_bearing::{JournalBearing, KyxSign, OilFilm};
pub use modes::Mode;
pub use response::Response;
pub use sampling_rule::npi_sampling;
pub use sdof::Sdof;
pub use second_order::{Matrix, SecondOrderSystem};
