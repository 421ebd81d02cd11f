//! Rows of data from one open record.

use std::ops::Range;

use mechid_signal::Sampling;

/// Open record and the rows of its lines in the data.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenRecord {
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Rows of the lines of the record.
    pub rows: Range<usize>,
}
