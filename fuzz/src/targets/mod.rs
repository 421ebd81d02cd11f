//! What is tried.

mod readers;

use crate::Target;

/// All targets.
pub fn all() -> Vec<Target> {
    readers::TARGETS.to_vec()
}
