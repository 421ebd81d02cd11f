//! Curvature of a response at the seam, where the last sample of a period meets the first.

use std::fmt::{self, Formatter};

use mechid_signal::Record;

use super::finding::{Check, Finding, Names};
use super::limits::{SEAM_BAD, SEAM_DOUBTFUL};
use super::{Subject, Verdict};

/// Curvature of the response from the last sample of a period to the first.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Seam {
    /// Ratio of the curvature at the seam to the RMS curvature inside the period; of several
    /// channels, the largest ratio (pure number).
    pub ratio: f64,
}

/// Checks whether a record of any response quantity is one whole period of a steady state: the
/// curvature across the seam, from the last sample to the first, relative to the RMS curvature
/// inside the record ([`Finding::Seam`]). In a whole period the seam is like any other sample.
///
/// # Source
/// Ours.
pub fn periodicity(response: &Record) -> Finding {
    periodicity_across(response, response)
}

/// Checks the seam as [`periodicity`] does, for a period too long for the memory. The RMS curvature
/// is computed from the `beginning` of the period; `end` has at least the last two samples of the
/// period (samples × channels, the same quantity and channels).
///
/// # Panics
/// If `end` has fewer channels.
///
/// # Source
/// Ours.
pub fn periodicity_across(beginning: &Record, end: &Record) -> Finding {
    let ratio = |channel: usize| {
        let (x, end) = (beginning.channel(channel), end.channel(channel));
        let [last_but_one, last] = [2, 1].map(|back| end[(2 * end.len() - back) % end.len()]);
        let curvature = |x: [f64; 3]| x[0] - 2.0 * x[1] + x[2];
        let inside: f64 = x.windows(3).map(|x| curvature([x[0], x[1], x[2]]).powi(2)).sum();
        let rms = (inside / x.len().saturating_sub(2).max(1) as f64).sqrt();
        let after = curvature([last, x[0], x[1 % x.len()]]);
        let seam = after.abs().max(curvature([last_but_one, last, x[0]]).abs());
        if seam == 0.0 { 0.0 } else { seam / rms }
    };
    Finding::Seam(Seam { ratio: (0..beginning.channels()).map(ratio).fold(0.0, f64::max) })
}

impl Check for Seam {
    fn subject(&self) -> Subject {
        Subject::Periodicity
    }

    fn verdict(&self) -> Verdict {
        Verdict::graded(self.ratio, SEAM_DOUBTFUL, SEAM_BAD)
    }

    fn value(&self) -> f64 {
        self.ratio
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "where the last sample of the response meets the first, the curvature is {:.1} times the RMS \
             curvature of the record: ",
            self.ratio
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "consistent with a whole period",
            Verdict::Doubtful => "probably not a steady state over one whole period",
            Verdict::Bad => "not a whole period; fit the window as an open record",
        })
    }
}
