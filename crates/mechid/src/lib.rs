//! Measure a force and a response, get the machine: the rooms of the workspace under one roof.
//!
//! ```
//! use mechid::estimate::Unknowns;
//! use mechid::estimate::frequency_domain::{FrequencyData, equation_error};
//! use mechid::model::{ResponseQuantity, Sdof};
//! use mechid::signal::{Multisine, Phases, Sampling, lines};
//!
//! // Excite: ten kilograms on a spring and a damper, driven on every line of a period.
//! let machine = Sdof::new(10.0, 180.0, 5000.0)?.system();
//! let sampling = Sampling::new(0.02, 256)?;
//! let excitation = Multisine::flat(lines::full(sampling), 50.0, Phases::SchroederBinary)?;
//! let force = excitation.sample(sampling)?;
//! let response = mechid::exact_periodic(&machine, &force)?;
//!
//! // Identify from force and displacement alone.
//! let lines = lines::full(sampling);
//! let data =
//!     FrequencyData::from_records(&force, response.displacement(), ResponseQuantity::Displacement, lines)?;
//! let found = equation_error(&data, &Unknowns::unknown_mass(1)?)?;
//! let stiffness = found.parameter("k")?;
//! assert!((stiffness.value / 5000.0 - 1.0).abs() < 1e-10);
//!
//! // Reconstruct the force that drove it.
//! let again = mechid::force::continuous(&found.system()?, &response)?;
//! assert!(mechid::force::relative_error(again.record(), &force)? < 1e-10);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | Module | What is in it |
//! |---|---|
//! | [`signal`] | time axes, records, spectra, multisines and other excitations |
//! | [`model`] | M, C, K; modes and receptance |
//! | [`integrate`] | the response by five time-stepping schemes |
//! | [`estimate`] | M, C, K from records, with their uncertainty |
//! | [`force`] | the unknown force from response and machine |
//! | [`io`] | records and descriptions of experiments in files |
//! | [`plot`] | figures as SVG and PNG |

mod simulation;

/// The Rust of the README and of the book, compiled and run with the documentation tests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../../README.md")]
    mod readme {}
    #[doc = include_str!("../../../docs/book/src/theory/index.md")]
    mod machine {}
    #[doc = include_str!("../../../docs/book/src/theory/signal.md")]
    mod signal {}
    #[doc = include_str!("../../../docs/book/src/theory/integrate.md")]
    mod integrate {}
    #[doc = include_str!("../../../docs/book/src/theory/estimate.md")]
    mod estimate {}
    #[doc = include_str!("../../../docs/book/src/theory/force.md")]
    mod force {}
}

pub use mechid_analysis as analysis;
pub use mechid_analysis::identify::LineChoice;
pub use mechid_analysis::identify::Method::{self, Instrumental, LeastSquares, MaximumLikelihood};
pub use mechid_analysis::{
    Channels, Detrend, FrfSettings, Identified, Identify, InspectSettings, Machine, Measurement,
    Reading, Reconstruct, Reconstructed, Segmentation, Window, frf, identify, inspect, reconstruct,
};
pub use mechid_estimate as estimate;
pub use mechid_force as force;
pub use mechid_integrate as integrate;
pub use mechid_io as io;
pub use mechid_model as model;
pub use mechid_model::ResponseQuantity::{self, Acceleration, Displacement, Velocity};
#[cfg(feature = "report")]
pub use mechid_plot as plot;
#[cfg(feature = "report")]
pub use mechid_report as report;
pub use mechid_signal as signal;
pub use simulation::{SimulateError, Simulation, exact_periodic, simulate, sweep};
