//! The analysis as a caller in Rust meets it, judged by closed forms and seeded experiments.
//!
//! One program of many modules: each test program of its own would compile and link all crates below anew.

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
mod unscaled;
