//! Direct time integration of M ẍ + C ẋ + K x = F, linear or with nonlinear forces: central
//! difference, Houbolt, Wilson θ, Newmark, generalised-α, Bathe, Runge–Kutta 4 and the matrix
//! exponential, with their conventions stated and their stability known.
//!
//! ```
//! use mechid_integrate::{
//!     CentralDifference, Houbolt, Newmark, RungeKutta4, Scheme, WilsonTheta, integrate_periodic,
//! };
//! use mechid_model::Sdof;
//! use mechid_signal::{Multisine, Phases, Sampling};
//!
//! // 10 kg on 5000 N/m with 180 N·s/m, driven on 31 lines up to 60 Hz: what does each scheme make of it?
//! let system = Sdof::new(10.0, 180.0, 5000.0)?.system();
//! let force = Multisine::flat(1..=31, 1.0, Phases::SchroederBinary)?
//!     .sample(Sampling::new(2e-3, 256)?)?;
//! let wilson = WilsonTheta::new(1.4)?;
//! let schemes: [&dyn Scheme; 5] = [
//!     &Newmark::AVERAGE_ACCELERATION,
//!     &CentralDifference::default(),
//!     &Houbolt::default(),
//!     &wilson,
//!     &RungeKutta4::LINEAR,
//! ];
//! for scheme in schemes {
//!     // The response that repeats, at once: no transient to wait for.
//!     let response = integrate_periodic(scheme, &system, &force)?;
//!     let largest = response.displacement().column(0).amax();
//!     assert!((largest / 0.6231e-3 - 1.0).abs() < 5e-3, "{}: {largest} m", scheme.name());
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `mechid-model` has the systems and `mechid-signal` the forces: a program that uses this crate depends
//! on them, too.
//!
//! A [`Scheme`] is a value: the parameters and conventions a user chooses. [`Scheme::prepare`]
//! does once what depends on the system and the step and gives a [`Stepper`], whose steps do
//! not allocate; a [`System`] is dense or sparse, and a [`SystemWithForces`] has forces besides. [`integrate()`] and [`integrate_periodic`] run
//! it over a sampled force, [`integrate_function`] and [`integrate_periodic_function`] over a function
//! of time, [`integrate_selected`] between some degrees of freedom of many. [`spectral_radius`],
//! [`critical_step`] and [`accuracy()`] tell what a step does to a motion.

mod accuracy;
mod arnoldi;
mod bathe;
mod central_difference;
mod collocations;
mod connection;
mod driver;
mod effective;
mod error;
mod fixed_size;
mod force;
mod free_growth;
mod generalised_alpha;
mod houbolt;
mod matrix_exponential;
mod modes;
mod newmark;
mod newton;
mod nonlinear;
mod orbit;
mod period;
mod periodic;
mod run;
mod runge_kutta;
mod scheme;
mod shooting;
mod sparse;
mod stability;
mod steady_state;
mod system;
mod term;
mod transition;
mod wilson_theta;

pub use accuracy::{Accuracy, accuracy};
pub use bathe::{Bathe, SubStepForce};
pub use central_difference::{CentralDifference, CentralDifferenceStart};
pub use connection::{Connection, NonlinearElement};
pub use driver::{
    SelectedDofs, integrate, integrate_displacement, integrate_function, integrate_selected,
};
pub use error::IntegrateError;
pub use force::SampledForce;
pub use free_growth::growth_per_period;
pub use generalised_alpha::{AlphaAcceleration, GeneralisedAlpha};
pub use houbolt::{Houbolt, HouboltStart};
pub use matrix_exponential::MatrixExponential;
pub use modes::{ModeSearch, SparseMode, sparse_modes};
pub use newmark::Newmark;
pub use nonlinear::{ForceFunction, NonlinearForce, SystemWithForces, Tangents};
pub use orbit::{PeriodicOrbit, periodic_orbit, periodic_orbit_selected};
pub use periodic::{integrate_periodic, integrate_periodic_function, integrate_periodic_selected};
pub use runge_kutta::{MidStepForce, RungeKutta4};
pub use scheme::{AllowUnstable, Convention, Instant, Loads, Scheme, StableSteps, Stepper};
pub use stability::{critical_step, critical_steps, spectral_radius};
pub use steady_state::sparse_steady_state;
pub use system::{Matrices, System};
pub use term::TermForces;
pub use transition::Transition;
pub use wilson_theta::{WilsonLoad, WilsonTheta};
