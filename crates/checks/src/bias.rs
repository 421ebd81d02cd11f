//! Bias of an estimate by noise on the response.

use std::fmt::{self, Display, Formatter};

use mechid_model::Parameter;

use super::digits::six_digits;
use super::finding::{Check, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Difference between an estimate and another estimate that noise on the response does not bias.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Bias {
    /// Probability that noise alone gives a difference at least as large if neither estimate is
    /// biased.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Parameter with the largest change, in standard errors.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::as_text"))]
    pub parameter: Parameter,
    /// Value of the tested estimate, in the unit of the parameter.
    pub estimate: f64,
    /// Value from the estimator `reference` (unit of the parameter).
    pub unbiased: f64,
    /// Standard error of `estimate` (unit of the parameter).
    pub standard_error: f64,
    /// Estimator of `unbiased`.
    pub reference: Reference,
}

/// Estimator that noise on the response does not bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Reference {
    /// Instrumental variables, with the previous and the next sample as instruments.
    NeighbouringSamples,
    /// Maximum likelihood, one Gauss–Newton step from the estimate.
    MaximumLikelihood,
}

impl Check for Bias {
    fn subject(&self) -> Subject {
        Subject::Bias
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
        let Self { p_value, parameter, estimate, unbiased, standard_error, reference } = self;
        let [value, other] = [six_digits(*estimate), six_digits(*unbiased)];
        let errors = (unbiased - estimate).abs() / standard_error;
        if self.verdict() == Verdict::Good {
            write!(
                f,
                "the estimate agrees with {reference} ({p_value}): {parameter} is {value}, and \
                 {reference} gives {other}; they differ by {errors:.1} standard errors"
            )
        } else {
            write!(
                f,
                "noise on the response biases the estimate ({p_value}): {parameter} is {value}, but \
                 {reference} gives {other}, a difference of {errors:.1} standard errors; \
                 prefer maximum likelihood on whole periods"
            )
        }
    }
}

impl Display for Reference {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Reference::NeighbouringSamples => "instrumental variables (neighbouring samples)",
            Reference::MaximumLikelihood => "maximum likelihood (first step)",
        })
    }
}
