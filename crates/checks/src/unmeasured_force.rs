//! Share of the response that a fit attributes to unmeasured forces.

use std::fmt::{self, Formatter};

use super::digits::three_digits;
use super::finding::{Check, Names};
use super::limits::UNMEASURED_FORCE;
use super::{Subject, Verdict};

/// Residual of a fit that is attributed to unmeasured forces.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct UnmeasuredForce {
    /// Share of the response (ratio of RMS values).
    pub fraction: f64,
}

impl Check for UnmeasuredForce {
    fn subject(&self) -> Subject {
        Subject::Misfit
    }

    fn verdict(&self) -> Verdict {
        if self.fraction >= UNMEASURED_FORCE { Verdict::Doubtful } else { Verdict::Good }
    }

    fn value(&self) -> f64 {
        self.fraction
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = three_digits(100.0 * self.fraction);
        write!(f, "{percent} % of the motion is attributed to unmeasured forces")?;
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            _ => {
                ": a missing degree of freedom has the same effect, and so has a nonlinearity if the force is random; \
                 repeat the test at another level of the force, or with a periodic force"
            }
        })
    }
}
