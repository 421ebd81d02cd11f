//! Modes of a structure from any set of sensors and any number of forces.

pub mod ambient;
pub mod compare;
mod covariance;
mod decomposition;
mod dense;
mod error;
mod estimate;
pub mod free_decay;
mod identify;
pub mod indicators;
mod initial_poles;
mod limits;
mod lines;
mod mode;
mod model;
mod noise;
mod normal;
mod order;
pub mod plscf;
mod projection;
mod residues;
mod results;
mod rules;
mod scores;
mod search;
pub mod stabilisation;
mod synthesis;
mod unmeasured;

pub use mechid_numerics::Uncertain;

pub use error::ModalError;
pub use estimate::ModalEstimate;
pub use identify::{ModalSettings, identify_modes};
pub use mode::{DropReason, DroppedCandidate, IdentifiedMode};
pub use model::ResidualPowers;
