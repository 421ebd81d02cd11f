//! Frequency responses without a phase.

use std::fmt::{self, Formatter};

use nalgebra::Complex;

use super::finding::{Check, Finding, Names};
use super::{Subject, Verdict};

/// Frequency response whose values are all real and positive: a magnitude without its phase.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ConstantPhase {
    /// Point of the response.
    pub response: String,
    /// Point of the force.
    pub reference: String,
    /// Number of frequencies.
    pub frequencies: usize,
}

/// Finds a frequency response, at several frequencies, whose values are all real and positive
/// ([`Finding::ConstantPhase`]): impossible for a damped system.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 2 (the phase of a receptance).
pub fn constant_phase(
    response: &str,
    reference: &str,
    values: impl Iterator<Item = Complex<f64>>,
) -> Option<Finding> {
    let mut frequencies = 0;
    for value in values {
        if value.im != 0.0 || value.re <= 0.0 {
            return None;
        }
        frequencies += 1;
    }
    let (response, reference) = (response.to_owned(), reference.to_owned());
    let finding = ConstantPhase { response, reference, frequencies };
    (frequencies > 1).then_some(Finding::ConstantPhase(finding))
}

impl Check for ConstantPhase {
    fn subject(&self) -> Subject {
        Subject::Range
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.frequencies as f64
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { response, reference, frequencies } = self;
        write!(
            f,
            "the response at {response} to {reference} is real and positive at all {frequencies} frequencies: \
             magnitudes without their phase. Export real and imaginary parts, or magnitude and phase"
        )
    }
}
