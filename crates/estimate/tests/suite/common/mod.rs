//! Closed-form steady states: the judges of the estimators.

pub mod documentation;
pub mod monte_carlo;

pub use mechid_problems::steady_lines::*;
