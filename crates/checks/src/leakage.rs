//! Width of resonances compared with the line spacing of averaged segments.

use std::f64::consts::TAU;
use std::fmt::{self, Formatter};

use mechid_estimate::IdentifiedMode;
use mechid_spectra::frf::Frf;

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::RESONANCE_LINES;
use super::{Subject, Verdict};

/// Checks that the narrowest resonance in the band of frequency responses, averaged over windowed
/// segments, has enough lines to separate its damping from the smoothing by the window
/// ([`Finding::Leakage`]); `settled` states whether the correction of the window converged in the
/// fit. `None` without a window, or without an oscillating mode in the band.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 8.5 (half-power bandwidth and
/// resolution bandwidth).
pub fn leakage(frf: &Frf, modes: &[IdentifiedMode], settled: bool) -> Option<Finding> {
    let [spacing, samples] = frf.resolution()?;
    let spacing_hz = spacing / TAU;
    let [low, high] = [frf.omega().first(), frf.omega().last()].map(|omega| omega.copied());
    let in_band = |mode: &IdentifiedMode| {
        let omega = TAU * mode.natural_frequency_hz.value;
        low.is_some_and(|low| omega >= low) && high.is_some_and(|high| omega <= high)
    };
    let oscillates = |mode: &IdentifiedMode| mode.damped_frequency_hz.value > 0.0;
    let width = |mode: &IdentifiedMode| {
        2.0 * mode.damping_ratio.value.abs() * mode.natural_frequency_hz.value / spacing_hz
    };
    let candidates = modes.iter().enumerate().filter(|(_, mode)| in_band(mode) && oscillates(mode));
    let narrowest = candidates.min_by(|(_, a), (_, b)| width(a).total_cmp(&width(b)));
    narrowest.map(|(at, mode)| {
        let lines = width(mode);
        let needed = samples * RESONANCE_LINES / lines.max(1e-6);
        Finding::Leakage(Leakage {
            mode: at,
            frequency_hz: mode.natural_frequency_hz.value,
            lines,
            samples_needed: needed.max(samples).ceil() as usize,
            settled,
        })
    })
}

/// Width of the narrowest resonance, in lines of the segments that were averaged.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Leakage {
    /// Index of the mode, by rising natural frequency.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub mode: usize,
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Half-power bandwidth 2ζf divided by the line spacing (pure number).
    pub lines: f64,
    /// Minimum number of samples of a segment for a sufficient number of lines in the half-power
    /// bandwidth.
    pub samples_needed: usize,
    /// True if the smoothing by the window could be separated from the resonance.
    pub settled: bool,
}

impl Check for Leakage {
    fn subject(&self) -> Subject {
        Subject::Leakage
    }

    fn verdict(&self) -> Verdict {
        if self.settled && self.lines >= RESONANCE_LINES {
            Verdict::Good
        } else {
            Verdict::Doubtful
        }
    }

    fn value(&self) -> f64 {
        self.lines
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { mode, frequency_hz, lines, samples_needed, settled } = self;
        write!(
            f,
            "the half-power width of the resonance of mode {} ({frequency_hz:.4} Hz) is {} line spacings of a segment",
            mode + 1,
            three_digits(*lines)
        )?;
        match (self.verdict(), settled) {
            (Verdict::Good, _) => Ok(()),
            (_, true) => write!(
                f,
                ". This is too narrow to separate the damping of this mode from leakage, and the intervals are not \
                 reliable: use segments of {samples_needed} samples or more, or fit the record as an open one \
                 (without `from_frf`)"
            ),
            (_, false) => write!(
                f,
                ". The bias of the window could not be separated from the damping of this mode, and the intervals \
                 are not reliable: use segments of {samples_needed} samples or more, or fit the record as an open \
                 one (without `from_frf`)"
            ),
        }
    }
}
