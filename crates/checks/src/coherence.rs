//! Coherence of force and response.

use std::fmt::{self, Formatter};

use mechid_spectra::frf::Frf;

use super::finding::{Check, Finding, Names};
use super::limits::{INCOHERENCE_BAD, INCOHERENCE_DOUBTFUL};
use super::{Subject, Verdict};

/// Multiple coherence of the responses over the lines.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Coherence {
    /// Median over lines and responses (pure number).
    pub median: f64,
    /// Minimum (pure number).
    pub minimum: f64,
    /// Number of independent averages (pure number).
    pub averages: f64,
}

/// Checks the median coherence of frequency responses; `None` if there is no frequency response.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 6; the limits are ours.
pub fn coherence(frf: &Frf) -> Option<Finding> {
    let mut coherence: Vec<f64> = frf.coherence().iter().copied().collect();
    coherence.sort_by(f64::total_cmp);
    let (minimum, median) = (*coherence.first()?, coherence[coherence.len() / 2]);
    Some(Finding::Coherence(Coherence { median, minimum, averages: frf.averages() }))
}

impl Check for Coherence {
    fn subject(&self) -> Subject {
        Subject::Coherence
    }

    fn verdict(&self) -> Verdict {
        Verdict::graded(1.0 - self.median, INCOHERENCE_DOUBTFUL, INCOHERENCE_BAD)
    }

    fn value(&self) -> f64 {
        self.median
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { median, minimum, averages } = self;
        write!(
            f,
            "median coherence {median:.4}, minimum {minimum:.4}, from {averages:.1} independent averages"
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            _ => ". Possible causes: noise, leakage, other forces. Use longer segments, or more segments",
        })
    }
}
