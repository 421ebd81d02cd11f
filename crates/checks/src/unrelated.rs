//! Responses that are unrelated to the force.

use std::fmt::{self, Formatter};

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::SIGNIFICANCE;
use super::{Subject, Verdict};

/// Response that does not follow the force: a fit explains no larger part of this response than of
/// noise.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Unrelated {
    /// Share of the power of the response that the fit explains.
    pub explained: f64,
    /// Upper bound of the probability that a fit explains at least as much of a response that is
    /// unrelated to the force.
    pub p_value: f64,
}

/// Finds a response that does not follow the force ([`Finding::Unrelated`]) from the residual of a
/// fit: `unexplained` is the ratio of the RMS values of the residual and of the fitted quantity.
/// The fit has `unknowns` parameters and `equations` real equations of one degree of freedom each.
/// `None` if the response follows the force.
///
/// The p-value is that of the F test of the regression, times the number of lines, because a fit
/// can place the resonance at any of them.
///
/// # Source
/// Draper & Smith, *Applied Regression Analysis*, 3rd ed. (1998), chapter 1; Bonferroni's bound.
pub fn unrelated_response(unexplained: f64, equations: usize, unknowns: usize) -> Option<Finding> {
    let freedom = equations.checked_sub(unknowns).filter(|spare| *spare > 0 && unknowns > 0)?;
    let (freedom, unknowns) = (freedom as f64, unknowns as f64);
    let residual_power = unexplained * unexplained;
    let explained = (1.0 - residual_power).max(0.0);
    if !residual_power.is_finite() || residual_power == 0.0 {
        return None;
    }
    let ratio = (explained / unknowns) / (residual_power / freedom);
    let lines = 0.5 * equations as f64;
    let tail = FisherSnedecor::new(unknowns, freedom).ok()?.sf(ratio);
    let p_value = (lines * tail).min(1.0);
    (p_value > SIGNIFICANCE).then_some(Finding::Unrelated(Unrelated { explained, p_value }))
}

impl Check for Unrelated {
    fn subject(&self) -> Subject {
        Subject::Misfit
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.explained
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the response does not follow the force: the fit explains {} % of the power of the response, \
             and would explain as much of pure noise; the parameters are meaningless. Check columns, cables and units",
            three_digits(100.0 * self.explained)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_named_and_a_weak_response_is_not() {
        // A fit of 3 parameters to 2000 equations of pure noise explains on average 0.15 % of it,
        // and about 1 % if the resonance is at the best of 1000 lines.
        assert!(unrelated_response(0.9985_f64.sqrt(), 2000, 3).is_some());
        assert!(unrelated_response(0.99_f64.sqrt(), 2000, 3).is_some());
        assert!(unrelated_response(1.2, 2000, 3).is_some());
        // Half of the power of the response is noise; the response still follows the force.
        assert_eq!(unrelated_response(0.5_f64.sqrt(), 2000, 3), None);
        assert_eq!(unrelated_response(0.97_f64.sqrt(), 2000, 3), None);
        // The test needs more equations than unknowns.
        assert_eq!(unrelated_response(0.5, 3, 3), None);
        assert_eq!(unrelated_response(f64::NAN, 100, 3), None);
    }
}
