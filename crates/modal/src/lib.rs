//! Modes of a structure from any set of sensors and any number of forces.

mod covariance;
mod dense;
mod error;
mod estimate;
mod identify;
mod initial_poles;
mod limits;
mod lines;
mod mode;
mod model;
mod noise;
mod normal;
mod order;
mod projection;
mod residues;
mod results;
mod rules;
mod search;
mod synthesis;

pub use error::ModalError;
pub use estimate::ModalEstimate;
pub use identify::{ModalSettings, identify_modes};
pub use mode::{DropReason, DroppedCandidate, IdentifiedMode, Uncertain};
pub use model::ResidualPowers;
pub mod ambient;
pub mod compare;
mod decomposition;
pub mod indicators;
pub mod plscf;
pub mod stabilisation;
pub mod free_decay;
