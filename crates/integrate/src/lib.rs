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
//! // 10 kg on 5000 N/m with 180 N·s/m, driven on 31 lines up to 60 Hz, with each scheme.
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
//! `mechid-model` has the systems and `mechid-signal` the forces: a program that uses this crate
//! also depends on these two crates.
//!
//! A [`Scheme`] is a value: the parameters and conventions a user chooses. [`Scheme::prepare`] does
//! the work that depends on the system and the step once and returns a [`Stepper`], whose steps do
//! not allocate. A [`System`] is dense or sparse; a [`SystemWithForces`] also has nonlinear forces.
//! [`integrate()`] and [`integrate_periodic`] simulate a sampled force, [`integrate_function`] and
//! [`integrate_periodic_function`] a function of time, [`integrate_selected`] returns only some of
//! the degrees of freedom. [`spectral_radius`], [`critical_step`] and [`accuracy()`] give the
//! effect of the time step on the motion.

mod error;
mod limits;
mod modes;
mod nonlinear;
mod periodic;
mod schemes;
mod sparse;
mod stability;
mod stepping;
mod system;

pub use error::IntegrateError;
pub use modes::{ModeSearch, SparseMode, sparse_modes};
pub use nonlinear::force::{ForceFunction, NonlinearForce, Tangents};
pub use nonlinear::system_with_forces::SystemWithForces;
pub use nonlinear::term_forces::TermForces;
pub use periodic::linear::{
    integrate_periodic, integrate_periodic_function, integrate_periodic_selected,
};
pub use periodic::orbit::{PeriodicOrbit, periodic_orbit, periodic_orbit_selected};
pub use periodic::sparse_steady_state::sparse_steady_state;
pub use schemes::bathe::{Bathe, SubStepForce};
pub use schemes::central_difference::{CentralDifference, CentralDifferenceStart};
pub use schemes::generalised_alpha::{AlphaAcceleration, GeneralisedAlpha};
pub use schemes::houbolt::{Houbolt, HouboltStart};
pub use schemes::matrix_exponential::MatrixExponential;
pub use schemes::newmark::Newmark;
pub use schemes::runge_kutta::{MidStepForce, RungeKutta4};
pub use schemes::scheme::{AllowUnstable, Convention, Scheme};
pub use schemes::wilson_theta::{WilsonLoad, WilsonTheta};
pub use stability::accuracy::{Accuracy, accuracy};
pub use stability::free_growth::growth_per_period;
pub use stability::stable_steps::StableSteps;
pub use stability::{critical_step, critical_steps, spectral_radius};
pub use stepping::sampled_force::SampledForce;
pub use stepping::selected_dofs::SelectedDofs;
pub use stepping::stepper::{Instant, Loads, Stepper};
pub use stepping::time_loop::{
    integrate, integrate_displacement, integrate_function, integrate_selected,
};
pub use stepping::transition::Transition;
pub use system::{Matrices, System};
