//! Correlation of a residual with a force.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::p_value::{CorrelationTest, PValue};
use super::{Subject, Verdict};

/// Correlation of a residual with a force.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CrossCorrelation {
    /// Channel of the residual.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub residual: usize,
    /// Channel of the force.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub force: usize,
    /// Result of the test.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub test: CorrelationTest,
}

impl Check for CrossCorrelation {
    fn subject(&self) -> Subject {
        Subject::CrossCorrelation
    }

    fn verdict(&self) -> Verdict {
        if self.test.is_significant() { Verdict::Doubtful } else { Verdict::Good }
    }

    fn value(&self) -> f64 {
        self.test.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        (!self.test.rounding).then_some(&mut self.test.p_value)
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { residual, force, test } = self;
        write!(f, "residual {} with {}: {test}", residual + 1, names.force(*force))?;
        f.write_str(match (test.rounding, test.is_significant()) {
            (true, _) => "",
            (_, false) => "; uncorrelated",
            (_, true) => {
                "; the residual is correlated with the force: the model misses part of the \
                 response; add a degree of freedom, or repeat the test at another force level"
            }
        })
    }
}
