//! How far the cases of a target come: a target that every input leaves at the door tests the door alone.

use std::sync::atomic::{AtomicU64, Ordering};

/// Depth that a case reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// The reader refuses the input.
    Refused,
    /// The input is read, and what is asked for does not exist in it.
    Read,
    /// The work begins, and ends in an error.
    Reached,
    /// The work ends with a result.
    Fitted,
}

/// Deepest depth of the case that is running.
static CURRENT: AtomicU64 = AtomicU64::new(0);

/// Says how far a case has come.
pub fn reached(depth: Depth) {
    CURRENT.fetch_max(depth as u64, Ordering::Relaxed);
}

/// Returns how far the last case came, and begins another one.
pub(crate) fn taken() -> usize {
    CURRENT.swap(0, Ordering::Relaxed) as usize
}
