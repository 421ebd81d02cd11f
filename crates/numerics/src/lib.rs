//! Numerical methods that several crates share; nothing here knows of machines or records.

mod error;
mod uncertain;

pub use error::NumericsError;
pub use uncertain::{Uncertain, student_interval};
