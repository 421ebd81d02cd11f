//! Records that can be averaged as a whole, without a window.

use super::of_hits::{PARTS, over_largest};
use crate::measurement::Windowed;

/// Maximum RMS in the last part of a record that ends at rest, including noise, relative to the
/// largest RMS in any part of the record.
const AT_REST: f64 = 0.05;

/// Maximum RMS difference, including noise, of two forces that count as equal, relative to the RMS
/// of the first.
const SAME_FORCE: f64 = 0.1;

/// Returns whether several records have no transients: bursts with force and response at rest at
/// the end, or successive periods of the same force.
///
/// A single record is always cut into segments, because an average needs several.
pub(super) fn have_no_transients(records: &[Windowed]) -> bool {
    records.len() > 1 && (records.iter().all(ends_at_rest) || repeat(records))
}

fn ends_at_rest(recorded: &Windowed) -> bool {
    let (force, response) = (&recorded.held.force, recorded.held.response().0);
    [force, response].into_iter().all(|record| {
        let last = record.len() - record.len().div_ceil(PARTS)..record.len();
        over_largest(record, last) <= AT_REST
    })
}

fn repeat(records: &[Windowed]) -> bool {
    let first = records[0].held.force.data();
    records[1..].iter().all(|recorded| {
        let force = recorded.held.force.data();
        force.shape() == first.shape() && (force - first).norm() <= SAME_FORCE * first.norm()
    })
}
