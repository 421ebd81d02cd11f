//! The analysis as a Rust program uses it. The references are closed forms and seeded experiments.
//!
//! All modules are one test program, because each separate test program would have to be linked
//! with all crates.

mod acquisition;
mod bearing;
mod bearing_checks;
mod crosstalk;
mod decay;
mod decay_nonlinear;
mod doors;
mod error_rate;
mod faults;
#[cfg(feature = "parquet")]
mod fleet;
mod force_spectrum;
mod hammer;
mod headlines;
mod modal;
mod modes;
mod modes_applied;
mod nonlinear;
mod other_models;
mod parts;
mod random;
mod reading;
mod rig;
mod tables;
mod time_limit;
mod unscaled;
