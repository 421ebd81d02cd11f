//! Choice of the length of segments for a record of a random test.

use mechid_spectra::Lines;
use mechid_spectra::frf::FrfEstimator;

use super::peak::Peak;
use super::{Segmentation, average_of};
use crate::AnalysisError;
use crate::identify::left_out::LineRule;
use crate::measurement::Windowed;

/// Shortest segment, in samples.
const SHORTEST: usize = 64;

/// Minimum number of independent averages in excess of the number of forces.
const AVERAGES: f64 = 5.0;

/// Minimum number of lines within the half-power bandwidth of a resolved peak; the window alone
/// gives fewer.
const RESOLVED_LINES: usize = 3;

/// Minimum share of the maximum information: segments with slightly less information are shorter
/// and have more averages.
const ENOUGH: f64 = 0.9;

impl Segmentation {
    /// Returns these segments with the chosen length, and a remark about the choice; `None` if the
    /// length is given, or if no length gives enough averages.
    ///
    /// The length is the shortest power of two with enough averages that keeps 90 % of the
    /// information (coherence, averages and number of lines,
    /// [`Frf::information`](mechid_spectra::frf::Frf::information)). If segments of this length do
    /// not resolve the narrowest of the largest peaks with three lines, the next longer length that
    /// does is used, if there is one. The choice uses the samples in memory.
    ///
    /// # Errors
    /// As an average over segments.
    pub(crate) fn chosen(
        &self,
        recorded: &Windowed,
        rule: LineRule<'_>,
    ) -> Result<Option<(Self, String)>, AnalysisError> {
        let buffered = &recorded.held;
        if self.segment.is_some() {
            return Ok(None);
        }
        let mut tried: Vec<(usize, f64, bool)> = Vec::new();
        let mut len = SHORTEST;
        while 2 * len <= buffered.force.len() {
            let how = Self { segment: Some(len), ..self.clone() };
            let segments = how.segments(buffered.period)?;
            let lines = rule.lines(&buffered.force.window(0, len)?, len)?;
            let lines = Lines::new(buffered.force.sampling().with_len(len)?, lines)?;
            let average = average_of(recorded, &lines, segments, &buffered.driven)?;
            // Longer segments may separate two forces that this segment cannot separate.
            if let Ok(frf) = average.frf(FrfEstimator::H1) {
                if frf.averages() < AVERAGES + buffered.driven.len() as f64 {
                    break;
                }
                let peak = Peak::narrowest(&frf);
                let is_resolved = peak.is_none_or(|peak| peak.lines >= RESOLVED_LINES);
                tried.push((len, frf.information(), is_resolved));
            }
            len *= 2;
        }
        let most = tried.iter().map(|(_, information, _)| *information).fold(0.0, f64::max);
        let Some(enough) =
            tried.iter().position(|(_, information, _)| *information >= ENOUGH * most)
        else {
            return Ok(None);
        };
        let resolved = tried[enough..].iter().find(|(.., is_resolved)| *is_resolved);
        let (len, ..) = *resolved.unwrap_or(&tried[enough]);
        let why = if len > tried[enough].0 {
            "in which at least three lines lie within the half-power width of the narrowest peak"
        } else {
            "that give at least 90 % of the largest information (coherence, number of averages, number of lines)"
        };
        let remark = format!("segments of {len} samples were chosen: the shortest {why}");
        Ok(Some((Self { segment: Some(len), ..self.clone() }, remark)))
    }
}
