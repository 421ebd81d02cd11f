//! The targets.

mod analysis;
mod calls;
mod draw;
mod estimate;
mod fits;
mod force;
mod integrate;
mod model;
mod readers;
mod signal;

use crate::Target;

/// Returns all targets.
pub fn all() -> Vec<Target> {
    [&readers::TARGETS[..], &fits::TARGETS, &calls::TARGETS].concat()
}
