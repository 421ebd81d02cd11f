//! Rows of data that belong to one open record.

use std::ops::Range;

use mechid_signal::Sampling;

/// Open record among the rows of data.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenRecord {
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Rows of its lines.
    pub rows: Range<usize>,
}
