//! Searches that a time limit has ended.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::{Subject, Verdict};

/// A search that the time limit has ended before it reached a minimum.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TimeLimit {
    /// The limit, in s.
    pub seconds: f64,
}

impl Check for TimeLimit {
    fn subject(&self) -> Subject {
        Subject::Search
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.seconds
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the time limit of {} s ended the work early: the numbers are the best so far, and \
             further steps may change them by more than their standard errors; intervals and checks \
             are not reliable (`time_limit`)",
            self.seconds
        )
    }
}
