//! Width of the peaks of frequency responses.

use mechid_spectra::frf::Frf;

/// Part of a peak at which its width is taken: half its power.
const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The largest peak of a frequency response.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub(super) motion: usize,
    pub(super) input: usize,
    /// Place of its line, counted from 0.
    pub(super) at: usize,
    /// Number of lines within half its power: under Hann's window a single line has one or two.
    pub(super) lines: usize,
}

impl Peak {
    /// The narrowest of the largest peaks of all responses; `None` if all of them are at an end of
    /// the band.
    pub(super) fn narrowest(frf: &Frf) -> Option<Self> {
        let (motions, inputs) = frf.omega().first().map_or((0, 0), |_| frf.response(0).shape());
        let pairs = (0..motions).flat_map(|motion| (0..inputs).map(move |input| (motion, input)));
        let peaks = pairs.filter_map(|(motion, input)| Self::of(frf, motion, input));
        peaks.min_by_key(|peak| peak.lines)
    }

    fn of(frf: &Frf, motion: usize, input: usize) -> Option<Self> {
        let count = frf.omega().len();
        let magnitude = |at: usize| frf.response(at)[(motion, input)].norm();
        let at = (0..count).max_by(|a, b| magnitude(*a).total_cmp(&magnitude(*b)))?;
        let is_high = |place: &usize| magnitude(*place) > HALF_POWER * magnitude(at);
        let lines =
            (0..at).rev().take_while(is_high).count() + (at..count).take_while(is_high).count();
        (at > 0 && at + 1 < count).then_some(Self { motion, input, at, lines })
    }
}
