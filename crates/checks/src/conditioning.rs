//! Conditioning of the regressors.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_signal::message;

use super::finding::{Check, Finding, Names};
use super::limits::CONDITION_NUMBER;
use super::{Subject, Verdict};

/// Condition number of the regressors.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Conditioning {
    /// Condition number of the regressors, with columns scaled to unit length.
    pub condition_number: f64,
    /// Number of combinations of regressors that do not vary.
    pub undetermined: usize,
}

/// Returns the conditioning of the regressors of an estimate.
pub(super) fn conditioning(estimate: &Estimate) -> Finding {
    let (condition_number, undetermined) = (estimate.condition(), estimate.undetermined().len());
    Finding::Conditioning(Conditioning { condition_number, undetermined })
}

impl Check for Conditioning {
    fn subject(&self) -> Subject {
        Subject::Conditioning
    }

    fn verdict(&self) -> Verdict {
        match self.undetermined {
            1.. => Verdict::Bad,
            0 if self.condition_number > CONDITION_NUMBER => Verdict::Doubtful,
            0 => Verdict::Good,
        }
    }

    fn value(&self) -> f64 {
        self.condition_number
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        if self.undetermined > 0 {
            let does = if self.undetermined == 1 { "does" } else { "do" };
            let combinations = message::count(self.undetermined, "combination");
            return write!(
                f,
                "{combinations} of displacements, velocities and forces {does} not vary in the data: some \
                 parameters stay undetermined; excite more lines, or give a known mass"
            );
        }
        match self.condition_number {
            short if short < 1e4 => write!(f, "condition number of the regressors {short:.1}")?,
            long => write!(f, "condition number of the regressors {long:.1e}")?,
        }
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            _ => ": in the worst combination of parameters, relative noise is amplified by up to this factor",
        })
    }
}
