//! Depth that the cases of a target reach. If the reader refuses every input, the target tests only
//! the reader.

use std::sync::atomic::{AtomicU64, Ordering};

/// Depth that a case reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// The reader refuses the input.
    Refused,
    /// The input is read, but lacks what the analysis needs.
    Read,
    /// The analysis begins, and ends with an error.
    Reached,
    /// The analysis ends with a result.
    Fitted,
}

/// Greatest depth that the running case has reached.
static CURRENT: AtomicU64 = AtomicU64::new(0);

/// Records the depth that the running case has reached.
pub fn reached(depth: Depth) {
    CURRENT.fetch_max(depth as u64, Ordering::Relaxed);
}

/// Returns the depth that the last case reached, and resets it for the next case.
pub(crate) fn taken() -> usize {
    CURRENT.swap(0, Ordering::Relaxed) as usize
}
