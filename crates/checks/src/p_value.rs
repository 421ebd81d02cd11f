//! P-values, and results of tests for correlation.

use std::fmt::{self, Display, Formatter};

use mechid_signal::correlation::Correlation;

use super::Verdict;
use super::limits::SIGNIFICANCE;

/// Probability that noise alone gives a statistic at least as large as the observed one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PValue {
    /// Probability of this test alone (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "p_value"))]
    pub raw: f64,
    /// Probability adjusted for the number of tests made on the same fit; equal to `raw` before the
    /// adjustment (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "adjusted_p_value"))]
    pub adjusted: f64,
}

impl PValue {
    /// Creates the p-value of a single test.
    pub fn new(raw: f64) -> Self {
        Self { raw, adjusted: raw }
    }

    /// Returns whether the adjusted p-value is below the significance level.
    pub fn is_significant(self) -> bool {
        self.adjusted < SIGNIFICANCE
    }

    /// Returns the verdict of a test: doubtful if it is significant.
    pub(crate) fn verdict(self) -> Verdict {
        if self.is_significant() { Verdict::Doubtful } else { Verdict::Good }
    }
}

impl Display for PValue {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // Distribution functions are not accurate below 1e-15.
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

/// Result of a test for correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CorrelationTest {
    /// Number of coefficients.
    pub coefficients: usize,
    /// Number of coefficients beyond the bound.
    pub outside: usize,
    /// Bound that contains 95 % of the coefficients of noise.
    pub bound: f64,
    /// Probability that noise alone gives a correlation at least as strong.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// `true` if the residual is only rounding, whose correlations have no meaning.
    pub rounding: bool,
}

impl CorrelationTest {
    /// Creates the result of a test; `rounding` states whether the residual is only rounding.
    pub(super) fn new(correlation: &Correlation, rounding: bool) -> Self {
        Self {
            coefficients: correlation.coefficients.len(),
            outside: correlation.outside(),
            bound: correlation.bound,
            p_value: PValue::new(correlation.p_value),
            rounding,
        }
    }
}

impl CorrelationTest {
    /// Returns whether the residual is more than rounding and significantly correlated.
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
