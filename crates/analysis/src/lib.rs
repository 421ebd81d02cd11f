//! From a measured record to the machine behind it, or the force that drove it.
pub mod error;
mod extremes;
pub mod frf;
pub mod identify;
pub mod inspect;
mod levels;
pub mod machine;
pub mod measurement;
pub mod modal;
pub mod reconstruct;
pub mod review;
pub mod sweep;
pub mod text;

pub use error::AnalysisError;
pub use frf::{FrfSettings, FrfTable, Segmentation, frf};
pub use identify::{Identified, Identify, identify};
pub use inspect::{InspectSettings, Inspected, inspect};
pub use machine::Machine;
pub use measurement::{Channels, Detrend, Measurement, Reading, RecordPlan, Window};
pub use mechid_model::ResponseQuantity;
pub use modal::ModalSummary;
pub use reconstruct::{Reconstruct, Reconstructed, reconstruct};
pub use sweep::{SweepSettings, SweepSummary, sweep_experiment, sweep_record};
