//! Agreement of priors and data.

use std::fmt::{self, Formatter};

use super::digits::three_digits;
use super::finding::{Check, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Agreement of the prior of a parameter with the data.
///
/// The estimate is from the prior and the data together. If prior and data agree, estimate − mean
/// has the variance s² − v, with the variance s² of the prior and the variance v of the estimate.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PriorAgreement {
    /// Name of the parameter.
    pub parameter: String,
    /// Mean of the prior, in the unit of the parameter.
    pub mean: f64,
    /// Standard deviation of the prior, in the unit of the parameter.
    pub standard_deviation: f64,
    /// Estimate, in the unit of the parameter.
    pub estimate: f64,
    /// Probability of an estimate at least as far from the mean of the prior as this one, if prior
    /// and data agree.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for PriorAgreement {
    fn subject(&self) -> Subject {
        Subject::Prior
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let away = (self.estimate - self.mean).abs() / self.standard_deviation;
        write!(
            f,
            "{}: the distance of the estimate from the mean of its prior is {} standard deviations of the prior ({}): ",
            self.parameter,
            three_digits(away),
            self.p_value
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "prior and data agree",
            _ => "prior and data contradict each other: the prior, the data or the model is wrong",
        })
    }
}
