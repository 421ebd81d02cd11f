//! Searches for the highest likelihood.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::{Subject, Verdict};

/// Number of searches from different initial values that ended at the highest likelihood.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SearchAgreement {
    /// Number of searches.
    pub searches: usize,
    /// Number of searches that ended at the highest likelihood.
    pub agreeing: usize,
}

impl Check for SearchAgreement {
    fn subject(&self) -> Subject {
        Subject::Search
    }

    fn verdict(&self) -> Verdict {
        if self.searches > 1 && self.agreeing < 2 { Verdict::Doubtful } else { Verdict::Good }
    }

    fn value(&self) -> f64 {
        self.agreeing as f64
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} searches ended at the highest likelihood",
            self.agreeing, self.searches
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            _ => {
                ": other searches may reach a still higher likelihood; give better initial values or bounds, or \
                 more searches (`starts`)"
            }
        })
    }
}
