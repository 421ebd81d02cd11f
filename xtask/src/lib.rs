//! Project tasks, as a library so that tests can run them too.

pub mod conformance;
pub mod cost;
pub mod drawing;
pub mod figures;
pub mod studies;
pub mod thesis;
