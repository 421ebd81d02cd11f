//! Records that may be averaged whole, without a window.

use super::of_hits::{PARTS, over_largest};
use crate::measurement::Windowed;

/// RMS of the last part of a record over that of its largest part, noise included, up to which it
/// ends at rest.
const AT_REST: f64 = 0.05;

/// RMS difference of two forces over their RMS, noise included, up to which they are one.
const ALIKE: f64 = 0.1;

/// Returns whether several records close on themselves, so that no sample needs the ones before it:
/// bursts, at whose end force and response are at rest, or one period after another of the same
/// force.
///
/// One record is cut into segments whatever it is, for it gives no average as a whole.
pub(super) fn close(records: &[Windowed]) -> bool {
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
        force.shape() == first.shape() && (force - first).norm() <= ALIKE * first.norm()
    })
}
