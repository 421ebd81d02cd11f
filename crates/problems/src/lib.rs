//! Named systems with known answers, and exact responses: the reference solutions of the tests.
//!
//! The crate shares no code with an integrator or an estimator: the matrix exponential or the
//! receptance gives the response to a sampled force, see [`exact`].
//!
//! ```
//! use mechid_problems::{dissertation_sdof, exact_zoh_periodic};
//! use mechid_signal::{Record, Sampling};
//!
//! // A square wave, slow against the oscillator: it settles at F/k on every half.
//! let sampling = Sampling::new(0.01, 400)?;
//! let force = (0..400).map(|k| if k < 200 { 50.0 } else { -50.0 }).collect();
//! let force = Record::from_channel(sampling, force)?;
//! let response = exact_zoh_periodic(&dissertation_sdof().system(), &force)?;
//! assert!((response.displacement().channel(0)[199] - 50.0 / 5000.0).abs() < 1e-8);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
pub mod exact;
mod fault;
mod faulty_oscillator;
mod hammer_test;
pub mod machines;
mod named;
mod random;
mod random_test;
pub mod rig;
pub mod silverbox;
pub mod steady_lines;
mod transition;

pub use error::ProblemError;
pub use exact::{
    exact_foh, exact_foh_periodic, exact_harmonic, exact_harmonic_periodic, exact_zoh,
    exact_zoh_periodic,
};
pub use fault::Fault;
pub use faulty_oscillator::FaultyOscillator;
pub use hammer_test::{HammerRecord, HammerTest, MadeFault};
pub use named::{dissertation_bearing, dissertation_sdof, steffen_rade};
pub use random::random_stable;
pub use random_test::RandomTest;
