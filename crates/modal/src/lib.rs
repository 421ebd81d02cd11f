//! Modes of a structure from any set of sensors and any number of forces, with intervals.
//!
//! [`identify_modes`] takes spectral lines ([`mechid_spectra::LineData`]) of one record or of
//! several: open records with forces, hits with truncated decays, free decays without forces, or a
//! table of frequency responses (unit inputs, one record for each column). It fits the modal model
//! by maximum likelihood, without a window and without averages.
//!
//! | Equation | File |
//! |---|---|
//! | kernels of forces and transients, residual powers | `model.rs` |
//! | least squares of shapes and residual terms for all outputs | `projection.rs` |
//! | projected Jacobian and normal equations | `normal.rs` |
//! | damped steps of poles and participations | `search.rs` |
//! | first poles (subspace method, clusters over orders) | `initial_poles.rs` |
//! | first participations (free residues) | `residues.rs` |
//! | sensor noise and unmeasured forces | `noise.rs`, `unmeasured.rs` |
//! | covariance of poles, participations and shapes | `covariance.rs`, `scores.rs`, `mode_parameters.rs` |
//! | real shapes, reciprocity | `constraint.rs` |
//! | number of modes: candidates, likelihood, rules | `order.rs`, `rules.rs` |
//! | agreement of two parts of the data | `parts.rs` |
//! | frequency responses with their covariance | `modal_model.rs` |
//! | prediction of other records | `estimate.rs`, `synthesis.rs` |

pub mod ambient;
pub mod compare;
mod constraint;
mod covariance;
mod decomposition;
mod delays;
mod dense;
mod error;
mod estimate;
pub mod free_decay;
mod identify;
pub mod indicators;
mod initial_poles;
mod limits;
mod lines;
mod modal_model;
mod mode;
mod mode_parameters;
mod model;
mod noise;
mod normal;
mod order;
mod parts;
pub mod plscf;
mod projection;
mod residues;
mod results;
mod rules;
mod scatter;
mod scores;
mod search;
pub mod stabilisation;
mod synthesis;
mod unmeasured;

pub use mechid_numerics::Uncertain;

pub use constraint::{ConstraintTest, DrivingPoint, ModalConstraint};
pub use delays::OutputDelay;
pub use error::ModalError;
pub use estimate::ModalEstimate;
pub use identify::{ModalSettings, identify_modes, refit_modes};
pub use initial_poles::{initial_mode_count, stabilisation_of};
pub use modal_model::{ModalGroup, ModalModel, ModalTerm};
pub use mode::{DropReason, DroppedCandidate, IdentifiedMode};
pub use mode_parameters::MassNormalised;
pub use model::ResidualPowers;
pub use parts::PartsComparison;
