//! The length of the segments that a record of a random test is cut into, where none is given.

use mechid_spectra::Lines;
use mechid_spectra::frf::FrfEstimator;

use super::peak::Peak;
use super::{Segmentation, average_of};
use crate::AnalysisError;
use crate::identify::left_out::LineRule;
use crate::measurement::Windowed;

/// Shortest segment, in samples.
const SHORTEST: usize = 64;

/// Independent averages beyond the number of forces at least.
const AVERAGES: f64 = 5.0;

/// Number of lines within half the power of a peak from which it is more than the window makes of
/// any.
const TOLD: usize = 3;

/// Part of the most information that is enough: of segments that say nearly as much the shorter
/// ones have more averages.
const ENOUGH: f64 = 0.9;

impl Segmentation {
    /// Returns these segments with a length, and a remark on how it was chosen; `None` where it is
    /// given, and where no segments would have averages enough.
    ///
    /// The length is the shortest of the powers of two, as far as they leave averages enough, whose
    /// responses say at least nine tenths of what the best say, by their coherence, averages and
    /// number of lines ([`Frf::information`](mechid_spectra::frf::Frf::information)); or a longer
    /// one in which the narrowest of the largest peaks is three lines wide, if there is one. The
    /// samples held in memory are looked at.
    ///
    /// # Errors
    /// The errors of an average over segments.
    pub(crate) fn chosen(
        &self,
        recorded: &Windowed,
        rule: LineRule<'_>,
    ) -> Result<Option<(Self, String)>, AnalysisError> {
        let held = &recorded.held;
        if self.segment.is_some() {
            return Ok(None);
        }
        let mut tried: Vec<(usize, f64, bool)> = Vec::new();
        let mut len = SHORTEST;
        while 2 * len <= held.force.len() {
            let how = Self { segment: Some(len), ..self.clone() };
            let segments = how.segments(held.period)?;
            let lines = rule.lines(&held.force.window(0, len)?, len)?;
            let lines = Lines::new(held.force.sampling().with_len(len)?, lines)?;
            let average = average_of(recorded, &lines, segments, &held.driven)?;
            // Two forces that one segment cannot tell apart may be told by longer ones.
            if let Ok(frf) = average.frf(FrfEstimator::H1) {
                if frf.averages() < AVERAGES + held.driven.len() as f64 {
                    break;
                }
                let is_told = Peak::narrowest(&frf).is_none_or(|peak| peak.lines >= TOLD);
                tried.push((len, frf.information(), is_told));
            }
            len *= 2;
        }
        let most = tried.iter().map(|(_, information, _)| *information).fold(0.0, f64::max);
        let Some(enough) =
            tried.iter().position(|(_, information, _)| *information >= ENOUGH * most)
        else {
            return Ok(None);
        };
        let told = tried[enough..].iter().find(|(.., is_told)| *is_told);
        let (len, ..) = *told.unwrap_or(&tried[enough]);
        let why = match len > tried[enough].0 {
            false => {
                "whose coherence, averages and lines say nine tenths of what those of any length say"
            }
            true => "in which the narrowest peak is wider than the window makes any",
        };
        let remark = format!("segments of {len} samples were chosen: the shortest {why}");
        Ok(Some((Self { segment: Some(len), ..self.clone() }, remark)))
    }
}
