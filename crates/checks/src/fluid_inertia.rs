//! Inertia of the fluid in a bearing whose reported coefficients are stiffness and damping only.

use std::fmt::{self, Formatter};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Inertia of the fluid, which eight coefficients of a bearing do not describe.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FluidInertia {
    /// Twice the logarithm of the likelihood ratio of the model with twelve coefficients to the
    /// model with eight (pure number).
    pub statistic: f64,
    /// Probability of a statistic at least as large for a fluid without inertia.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

/// Reports a test of twelve coefficients of a bearing against eight ([`Finding::FluidInertia`]);
/// `p_value` is the probability that noise alone gives a `statistic` at least as large.
///
/// # Source
/// Wilks (1938), Annals of Mathematical Statistics 9, 60–62.
pub fn fluid_inertia(statistic: f64, p_value: f64) -> Finding {
    Finding::FluidInertia(FluidInertia { statistic, p_value: PValue::new(p_value) })
}

impl Check for FluidInertia {
    fn subject(&self) -> Subject {
        Subject::Mass
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
        let statistic = three_digits(self.statistic);
        let p_value = self.p_value;
        if self.verdict() == Verdict::Good {
            return write!(
                f,
                "no inertia of the fluid was found: the likelihood-ratio \
                 statistic is {statistic} ({p_value})"
            );
        }
        write!(
            f,
            "the fluid has inertia (likelihood-ratio statistic {statistic}, {p_value}). Eight coefficients \
             ignore this inertia and are biased: identify twelve (`coefficients`)"
        )
    }
}
