//! Searches that the limit of the work has ended.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::{Subject, Verdict};

/// A search that the limit of the work has ended before it reached a minimum.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct WorkLimit {
    /// The limit, a number of operations (pure number).
    pub operations: f64,
}

impl Check for WorkLimit {
    fn subject(&self) -> Subject {
        Subject::Search
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.operations
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the searches reached the limit of the work for a file of this size ({:.1e} operations) \
             and ended early: the numbers are the best so far, and further steps may change them by \
             more than their standard errors; intervals and checks are not reliable. Such a long \
             search often means a wrong model or a wrong quantity; a time (`time_limit`) replaces \
             this limit",
            self.operations
        )
    }
}
