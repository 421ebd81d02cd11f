//! Width of the peaks of frequency responses.

use mechid_spectra::frf::Frf;

/// Ratio of the magnitudes at the half-power points and at the peak.
const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The largest peak of a frequency response.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub(super) motion: usize,
    pub(super) input: usize,
    /// Index of the line of the peak, counted from 0.
    pub(super) at: usize,
    /// Number of lines within the half-power bandwidth: a sinusoid under a Hann window has one or
    /// two.
    pub(super) lines: usize,
}

impl Peak {
    /// Returns the narrowest of the largest peaks of all responses; `None` if all are at an edge of
    /// the band.
    pub(super) fn narrowest(frf: &Frf) -> Option<Self> {
        let (motions, inputs) = frf.omega().first().map_or((0, 0), |_| frf.response(0).shape());
        let pairs = (0..motions).flat_map(|motion| (0..inputs).map(move |input| (motion, input)));
        let peaks = pairs.filter_map(|(motion, input)| Self::new(frf, motion, input));
        peaks.min_by_key(|peak| peak.lines)
    }

    fn new(frf: &Frf, motion: usize, input: usize) -> Option<Self> {
        let count = frf.omega().len();
        let magnitude = |at: usize| frf.response(at)[(motion, input)].norm();
        let at = (0..count).max_by(|a, b| magnitude(*a).total_cmp(&magnitude(*b)))?;
        let is_high = |line: &usize| magnitude(*line) > HALF_POWER * magnitude(at);
        let lines =
            (0..at).rev().take_while(is_high).count() + (at..count).take_while(is_high).count();
        (at > 0 && at + 1 < count).then_some(Self { motion, input, at, lines })
    }
}
