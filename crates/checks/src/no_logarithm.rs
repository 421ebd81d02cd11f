//! Transition matrix, from one sample to the next, that has no real logarithm.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::{Subject, Verdict};

/// Transition matrix, from one sample to the next, that has no real logarithm: the sampling
/// interval is too long for a mode.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NoLogarithm {
    /// Eigenvalue of the transition matrix, zero or negative (pure number).
    pub eigenvalue: f64,
}

impl Check for NoLogarithm {
    fn subject(&self) -> Subject {
        Subject::Step
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.eigenvalue
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the transition from sample to sample has the eigenvalue {:.3e}, which should be positive: the \
             sampling interval is too long for a mode, or the data contain mostly noise; sample faster",
            self.eigenvalue
        )
    }
}
