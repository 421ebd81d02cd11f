//! Identification of the force on a known system from its measured response.
//!
//! | Function | Needs | Use it when |
//! |---|---|---|
//! | [`continuous`] | x, ẋ, ẍ of every degree of freedom | all three are measured or simulated |
//! | [`continuous_nonlinear`] | the same, of a system with nonlinear terms | the system is nonlinear |
//! | [`discretised`] | x, ẋ of every degree of freedom | no accelerations and little noise |
//! | [`frequency_domain`] | any channels, whole periods | the excited lines are known |
//! | [`regularised`] | any channels, a period or few samples | the lines are unknown |
//! | [`kalman`] | any channels, any length | the record is not a period |
//!
//! [`with_uncertain_system`] adds the uncertainty of an identified system to the standard error of
//! a force from any of these functions. The chapter on forces in the book explains the methods and
//! compares their errors.
//!
//! ```
//! use mechid_force::{Measurement, Noise, frequency_domain, relative_error};
//! use mechid_model::{ResponseQuantity, SecondOrderSystem};
//! use mechid_signal::{Record, Sampling, Spectrum};
//! use nalgebra::{Complex, DMatrix, dmatrix, dvector};
//!
//! // A rotor in two coupled directions; a force on the second one only, lines 1, 3 and 8.
//! let rotor = SecondOrderSystem::new(
//!     dmatrix![14.8, 0.0; 0.0, 14.8],
//!     dmatrix![20.0, 10.0; 10.0, 30.0],
//!     dmatrix![40.0, 50.0; -20.0, 60.0],
//! )?;
//! let (period, lines) = (Sampling::new(0.05, 256)?, [1, 3, 8]);
//! let (mut force, mut motion) = (DMatrix::zeros(129, 2), DMatrix::zeros(129, 2));
//! for n in lines {
//!     let omega = n as f64 * period.omega0();
//!     let stiffness = DMatrix::from_fn(2, 2, |i, j| Complex::new(
//!         rotor.stiffness()[(i, j)] - omega * omega * rotor.mass()[(i, j)],
//!         omega * rotor.damping()[(i, j)],
//!     ));
//!     let load = dvector![Complex::ZERO, Complex::new(100.0, 0.0)];
//!     force.set_row(n, &load.transpose());
//!     motion.set_row(n, &stiffness.lu().solve(&load).unwrap().transpose());
//! }
//! let force = Spectrum::from_lines(period, force)?.to_record()?;
//! let displacement = Spectrum::from_lines(period, motion)?.to_record()?;
//!
//! // Only the displacement of the first direction is measured: it determines the force.
//! let measured = Measurement::from_record(
//!     ResponseQuantity::Displacement,
//!     Record::from_channel(period, displacement.channel(0).to_vec())?,
//! );
//! let found = frequency_domain(&rotor, &measured, &[1], &lines, &Noise::Unknown)?;
//! assert!(relative_error(found.record(), &force)? < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod augmented;
mod band;
mod components;
mod continuous;
mod discretised;
mod error;
mod evidence;
mod force_information;
mod force_model;
mod frequency_domain;
mod identified;
mod intermittent;
mod kalman;
mod limits;
mod lines;
mod measurement;
mod measures;
mod motion_noise;
mod noise;
mod nonlinear;
mod open_operator;
mod period_operator;
mod posterior_points;
mod regularised;
mod rule;
mod smoother;
mod state_space;
mod transfer;
mod uncertainty;
mod unexplained;

pub use band::within_band;
pub use continuous::continuous;
pub use discretised::{discretised, discretised_by_taylor};
pub use error::ForceError;
pub use force_model::ForceModel;
pub use frequency_domain::frequency_domain;
pub use identified::IdentifiedForce;
pub use intermittent::starts_at_rest;
pub use kalman::{KalmanForce, Tuning, kalman};
pub use lines::inner_lines;
pub use measurement::{Channel, Measurement, Start};
pub use measures::{channel_errors, line_errors, relative_error, spectrum_ratio, spurious_ratio};
pub use motion_noise::{MotionNoise, continuous_with_noise, discretised_with_noise};
pub use noise::{MIN_OUTSIDE_LINES, Noise};
pub use nonlinear::{continuous_nonlinear, continuous_nonlinear_with_noise};
pub use open_operator::OPEN_UNKNOWNS;
pub use regularised::{ForceUnknowns, RegularisedForce, regularised};
pub use rule::{Filter, Rule};
pub use transfer::FrequencyResponse;
pub use uncertainty::{with_uncertain_nonlinear_system, with_uncertain_system};
pub use unexplained::Unexplained;
