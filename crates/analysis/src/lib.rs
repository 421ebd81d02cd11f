//! Identification of a machine from its measured records, and reconstruction of the force on it.
//!
//! The numerical crates fit arrays; this crate answers the questions of a test engineer about a
//! record. It opens files of any format and length (or takes arrays), converts units, cuts windows,
//! chooses spectral lines and methods, checks the data before the fit and the residual after it,
//! and reports doubts about the result. It does not simulate, plot or print.
//!
//! ```
//! use mechid_analysis::{Channels, Identify, Machine, Measurement, Reconstruct, ResponseQuantity};
//! use mechid_analysis::{identify, identify::Method, reconstruct};
//!
//! let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
//! let channels = Channels::new("force", ResponseQuantity::Displacement, "displacement");
//! let test = Measurement::open(rig, &channels)?.period(256)?;
//! let identified = identify(&[test.clone()], &Identify::spectra(Method::MaximumLikelihood))?;
//! let mass = identified.estimate().parameter("m")?;
//! assert!((mass.value - 25.0).abs() < 3.0 * mass.standard_error);
//! println!("{identified}");
//!
//! // The force on the machine, from the response alone.
//! let force = reconstruct(&test, &identified.machine()?, &Reconstruct::auto())?;
//! assert!(force.force().standard_error().is_some());
//! # Ok::<(), mechid_analysis::AnalysisError>(())
//! ```
//!
//! | Question | Function | Settings | Result |
//! |---|---|---|---|
//! | What is in this record? | [`inspect()`] | [`InspectSettings`] | [`Inspected`] |
//! | What is the response per unit force? | [`frf()`] | [`FrfSettings`] | [`FrfTable`] |
//! | What machine is this? | [`identify()`] | [`Identify`] | [`Identified`] |
//! | What machine has these frequency responses? | [`identify_responses()`] | [`IdentifyResponses`] | [`IdentifiedResponses`] |
//! | What are the unknown parts of this machine? | [`identify_elements()`] | [`IdentifyElements`] | [`IdentifiedElements`] |
//! | Does it predict another record? | [`Identified::validate`] | [`Window`] | [`Validation`](identify::Validation) |
//! | What does it do under this force? | [`predict()`] | [`Predict`] | [`Predicted`] |
//! | What force drove it? | [`reconstruct()`] | [`Reconstruct`] | [`Reconstructed`] |
//! | What are the modes of this structure? | [`modes()`] | [`ModesSettings`] | [`Modes`] |
//! | What are the modes of these frequency responses? | [`modes_of_responses()`] | [`ModesSettings`] | [`Modes`] |
//! | Have the modes changed, or do they match a model? | [`compare_modes()`] | – | [`ModeComparison`] |
//! | How does the structure vibrate when left alone? | [`decay()`] | [`DecaySettings`] | [`Decayed`] |
//! | Which sampling step suits the estimator? | [`sweep_record()`], [`sweep_experiment()`] | [`SweepSettings`] | [`SweepSummary`] |
//! | What are the coefficients of this bearing? | [`identify_bearing()`] | [`IdentifyBearing`] | [`IdentifiedBearing`] |
//! | What are the machines behind these records? | [`SavedAnalysis::row`] | [`SavedAnalysis`] | [`ResultRow`] |
//! | How does the machine vibrate? | [`ModalSummary::from_machine`] | [`Machine`] | [`ModalSummary`] |
//!
//! Settings are plain structs with defaults, which `serde` saves and reads; every result contains
//! its settings and implements [`Display`](std::fmt::Display).
// docs.rs sets `docsrs`, which turns on the badges of features.
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod batch;
pub mod bearing;
pub mod decay;
pub mod elements;
mod error;
pub mod extremes;
#[cfg(feature = "parquet")]
pub mod fleet;
pub mod frf;
pub mod hits;
pub mod identify;
pub mod inspect;
pub mod limits;
mod machine;
pub mod measurement;
pub mod modal;
pub mod modes;
pub mod predict;
pub mod reconstruct;
pub mod review;
pub mod sweep;
pub mod text;
pub mod time_limit;
pub mod words;

pub use batch::{ResultRow, SavedAnalysis};
pub use bearing::{BearingData, IdentifiedBearing, IdentifyBearing, identify_bearing};
pub use decay::{DecaySettings, DecaySummary, Decayed, decay};
pub use elements::{ElementData, IdentifiedElements, IdentifyElements, identify_elements};
pub use error::AnalysisError;
pub use frf::{FrfSettings, FrfTable, Segmentation, frf, frf_of_records};
pub use identify::{
    Identified, IdentifiedResponses, Identify, IdentifyResponses, identify, identify_responses,
};
pub use inspect::{InspectSettings, Inspected, inspect};
pub use machine::{Machine, NonlinearPart};
pub use measurement::{Channels, Detrend, Measurement, Reading, RecordPlan, Window};
pub use mechid_model::ResponseQuantity;
pub use mechid_signal::HitRule;
pub use modal::ModalSummary;
pub use modes::{
    ModalSystem, ModeComparison, ModeSet, Modes, ModesSettings, compare_modes, modes,
    modes_of_responses, predict_with_modes,
};
pub use predict::{Predict, Predicted, predict};
pub use reconstruct::{Reconstruct, Reconstructed, reconstruct, reconstruct_with_modes};
pub use sweep::{SweepSettings, SweepSummary, sweep_experiment, sweep_record};
