//! Autocorrelation of a residual.

use std::fmt::{self, Formatter};

use super::finding::{Check, Names};
use super::p_value::{CorrelationTest, PValue};
use super::{Subject, Verdict};

/// Autocorrelation of a residual.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Whiteness {
    /// Tested residual.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub residual: Residual,
    /// Result of the test.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub test: CorrelationTest,
    /// Lags over which noise on the response correlates the residual, if the residual is
    /// uncorrelated beyond these lags.
    pub span: Option<NoiseSpan>,
}

/// Residual that is tested for whiteness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "residual_of", rename_all = "snake_case")
)]
pub enum Residual {
    /// Samples of a channel.
    Samples {
        /// Channel of the residual.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        residual: usize,
    },
    /// Lines of a spectrum, weighted by the noise.
    Lines {
        /// Channel of the residual.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        residual: usize,
    },
    /// Lines of a frequency response.
    FrequencyResponse {
        /// Degree of freedom of the response.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        response: usize,
        /// Degree of freedom of the force.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        force: usize,
        /// Smallest distance, in lines, at which the correlation between two lines is tested.
        distance: usize,
    },
}

/// Lags over which noise on the response correlates a residual.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NoiseSpan {
    /// Number of lags.
    pub lags: usize,
    /// Autocorrelation at lag 1 (pure number).
    pub first_coefficient: f64,
    /// Result of the test at lags longer than `lags`.
    pub beyond: CorrelationTest,
}

impl Check for Whiteness {
    fn subject(&self) -> Subject {
        Subject::Whiteness
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
        let Self { residual, test, span } = self;
        residual.sentence(names, f)?;
        if test.rounding {
            return write!(f, "{test}");
        }
        let significant = span.as_ref().filter(|_| test.is_significant());
        if let Some(NoiseSpan { lags, first_coefficient, beyond }) = significant {
            return write!(
                f,
                "correlated up to lag {lags} ({first_coefficient:.2} at lag 1), but not at longer lags ({beyond}): \
                 noise on the response has this effect. Least squares ignores this noise, so the parameters \
                 are biased by more than their standard errors"
            );
        }
        write!(f, "{test}; {}", residual.clause(test.is_significant()))
    }
}

impl Residual {
    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Residual::Samples { residual } => write!(f, "residual {}: ", residual + 1),
            Residual::Lines { residual } => write!(f, "lines of residual {}: ", residual + 1),
            Residual::FrequencyResponse { response, force, distance } => {
                let (response, force) = (response + 1, names.force(*force));
                write!(
                    f,
                    "residual of response {response} to {force}, on lines at least {distance} apart: "
                )
            }
        }
    }

    fn clause(&self, is_significant: bool) -> &'static str {
        match (self, is_significant) {
            (Residual::Samples { .. }, false) => "white",
            (Residual::Samples { .. }, true) => {
                "not white: coloured noise, or an incomplete model; do not rely on the intervals"
            }
            (Residual::Lines { .. } | Residual::FrequencyResponse { .. }, false) => {
                "uncorrelated from line to line"
            }
            (Residual::Lines { .. }, true) => {
                "correlated from line to line: a transient, leakage (for example from an unmeasured \
                 force), or an error of the model; use later periods"
            }
            (Residual::FrequencyResponse { .. }, true) => {
                "correlated from line to line: a missing mode, another error of the model, or segments too \
                 short for the damping"
            }
        }
    }
}
