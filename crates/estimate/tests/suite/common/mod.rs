//! Closed-form steady states: the references for the estimators.

pub mod documentation;
pub mod monte_carlo;

pub use mechid_problems::steady_lines::*;
