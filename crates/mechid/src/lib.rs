//! Identification of mechanical systems from measured forces and responses: the facade of the
//! workspace.
//!
//! ```
//! use mechid::{Channels, Displacement, Identify, MaximumLikelihood, Measurement, Reconstruct};
//!
//! let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
//! let channels = Channels::new("force", Displacement, "displacement");
//! let test = Measurement::open(rig, &channels)?.period(256)?;
//! let identified = mechid::identify(&[test.clone()], &Identify::spectra(MaximumLikelihood))?;
//! println!("{identified}");
//!
//! // The same machine under an unknown force.
//! let force = mechid::reconstruct(&test, &identified.machine()?, &Reconstruct::auto())?;
//! println!("{force}");
//! assert!(identified.summary().fit.unexplained_motion < Some(0.01));
//! # Ok::<(), mechid::analysis::AnalysisError>(())
//! ```
//!
//! The functions at the root analyse records; their settings are plain structs, and their results
//! implement `Display`. The other crates are available as modules:
//!
//! | Module | Contents |
//! |---|---|
//! | [`signal`] | time axes, records, spectra, multisines and other excitations |
//! | [`numerics`] | values with intervals, least squares, Gauss-Newton steps, decompositions |
//! | [`model`] | M, C, K; modes and receptance |
//! | [`bearing`] | journal bearings from their geometry: film force, coefficients, stability |
//! | [`integrate`] | the response by time-stepping schemes, linear and nonlinear |
//! | [`spectra`] | spectral lines of records, their noise, frequency responses |
//! | [`estimate`] | M, C, K from records, with their uncertainty |
//! | [`modal`] | modes of any set of sensors, free decays |
//! | [`nonlinear`] | nonlinear springs and dampers of a system |
//! | [`checks`] | checks of data and residuals, with verdicts and p-values |
//! | [`force`] | the unknown force from response and machine |
//! | [`io`] | records and descriptions of experiments in files |
//! | [`analysis`] | from a record to a machine, a force or a frequency response, with checks |
//! | [`excitation`] | multisines for a test with one or several inputs, and their quality |
//! | [`simulation`] | the record of a described experiment, and its summary |
//! | [`selected_modes`] | some of the modes of a large machine |
//! | [`stability`] | comparison of time-stepping schemes |
//! | `plot` | figures as SVG and PNG (feature `report`, on by default) |
//! | `report` | figures and HTML pages of results (the same feature) |
// docs.rs sets `docsrs`; its pages then show the feature that each item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod excitation;
pub mod selected_modes;
pub mod simulation;
pub mod stability;

/// Rust code of the README and of the book, compiled and run with the documentation tests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../../README.md")]
    mod readme {}
    #[doc = include_str!("../../../docs/book/src/theory/index.md")]
    mod machine {}
    #[doc = include_str!("../../../docs/book/src/theory/bearing.md")]
    mod bearing {}
    #[doc = include_str!("../../../docs/book/src/theory/signal.md")]
    mod signal {}
    #[doc = include_str!("../../../docs/book/src/theory/integrate.md")]
    mod integrate {}
    #[doc = include_str!("../../../docs/book/src/theory/estimate.md")]
    mod estimate {}
    #[doc = include_str!("../../../docs/book/src/theory/force.md")]
    mod force {}
    #[doc = include_str!("../../../docs/book/src/choose/nonlinear.md")]
    mod nonlinear {}
}

pub use mechid_analysis as analysis;
pub use mechid_analysis::identify::LineChoice;
pub use mechid_analysis::identify::Method::{self, Instrumental, LeastSquares, MaximumLikelihood};
pub use mechid_analysis::{
    BearingData, Channels, DecaySettings, Decayed, Detrend, ElementData, FrfSettings, Identified,
    IdentifiedBearing, IdentifiedElements, IdentifiedResponses, Identify, IdentifyBearing,
    IdentifyElements, IdentifyResponses, InspectSettings, Machine, Measurement, ModalSystem,
    ModeComparison, ModeSet, Modes, ModesSettings, Predict, Predicted, Reading, Reconstruct,
    Reconstructed, ResultRow, SavedAnalysis, Segmentation, Window, compare_modes, decay, frf,
    frf_of_records, identify, identify_bearing, identify_elements, identify_responses, inspect,
    modes, modes_of_responses, predict, predict_with_modes, reconstruct, reconstruct_with_modes,
};
pub use mechid_bearing as bearing;
pub use mechid_checks as checks;
pub use mechid_estimate as estimate;
pub use mechid_force as force;
pub use mechid_integrate as integrate;
pub use mechid_io as io;
pub use mechid_modal as modal;
pub use mechid_model as model;
pub use mechid_model::ResponseQuantity::{self, Acceleration, Displacement, Velocity};
pub use mechid_model::exact_periodic;
pub use mechid_nonlinear as nonlinear;
pub use mechid_numerics as numerics;
#[cfg(feature = "report")]
pub use mechid_plot as plot;
#[cfg(feature = "report")]
pub use mechid_report as report;
pub use mechid_signal as signal;
pub use mechid_spectra as spectra;

#[cfg(feature = "parquet")]
pub use simulation::{RunsSummary, simulate_runs};
pub use simulation::{
    SimulateError, SimulatedSystem, Simulation, SimulationSummary, respond, simulate, sweep,
};
#[cfg(feature = "report")]
pub use stability::stability_figure;
pub use stability::{NamedScheme, SchemeComparison, SteppedMachine, compare_schemes};
