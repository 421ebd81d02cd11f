//! P-values, and the numbers of a test for correlation.

use std::fmt::{self, Display, Formatter};

use mechid_signal::correlation::Correlation;

use super::Verdict;
use super::limits::SIGNIFICANCE;

/// Probability that noise alone gives a statistic at least as large as the one found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PValue {
    /// Probability of this test alone (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "p_value"))]
    pub raw: f64,
    /// Adjusted for the number of tests made on the same fit; as `raw` before that (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "adjusted_p_value"))]
    pub adjusted: f64,
}

impl PValue {
    /// The p-value of a single test.
    pub fn of(raw: f64) -> Self {
        Self { raw, adjusted: raw }
    }

    /// Returns whether noise alone hardly gives such a statistic in any of the tests.
    pub fn is_significant(self) -> bool {
        self.adjusted < SIGNIFICANCE
    }

    /// Returns the verdict of a test that noise alone passes.
    pub(crate) fn verdict(self) -> Verdict {
        if self.is_significant() { Verdict::Doubtful } else { Verdict::Good }
    }
}

impl Display for PValue {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // A distribution function does not resolve the rest.
        match self.raw {
            p if p < 1e-15 => return f.write_str("p < 1e-15"),
            p if p < 1e-3 => write!(f, "p = {p:.1e}")?,
            p => write!(f, "p = {p:.3}")?,
        }
        match self.adjusted {
            p if p == self.raw => Ok(()),
            p if p < 1e-3 => write!(f, ", {p:.1e} adjusted"),
            p => write!(f, ", {p:.3} adjusted"),
        }
    }
}

/// Numbers of a test for correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CorrelationTest {
    /// Number of coefficients.
    pub coefficients: usize,
    /// Number of coefficients beyond the bound.
    pub outside: usize,
    /// Bound that 95 % of the coefficients of noise keep.
    pub bound: f64,
    /// Probability that noise alone is correlated as much.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Returns whether the residual is rounding, of which correlations mean nothing.
    pub rounding: bool,
}

impl CorrelationTest {
    /// Returns the numbers of a test; `rounding` where the residual is rounding.
    pub(super) fn new(correlation: &Correlation, rounding: bool) -> Self {
        Self {
            coefficients: correlation.coefficients.len(),
            outside: correlation.outside(),
            bound: correlation.bound,
            p_value: PValue::of(correlation.p_value),
            rounding,
        }
    }
}

impl CorrelationTest {
    /// Returns whether the residual is more than rounding, and correlated more than noise is.
    pub fn is_significant(&self) -> bool {
        !self.rounding && self.p_value.is_significant()
    }
}

impl Display for CorrelationTest {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { coefficients, outside, bound, p_value, rounding } = self;
        if *rounding {
            return f.write_str("rounding");
        }
        write!(
            f,
            "{outside} of {coefficients} correlations beyond the 95 % bound of {bound:.3} ({p_value})"
        )
    }
}
