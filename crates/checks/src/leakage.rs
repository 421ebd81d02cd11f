//! Resonances against the lines of the segments that were averaged.

use std::f64::consts::TAU;

use mechid_estimate::IdentifiedMode;
use mechid_spectra::frf::Frf;

use super::finding::Finding;
use super::thresholds::RESONANCE_LINES;

/// Checks that the narrowest resonance in the band of frequency responses, averaged over segments under a window, is
/// lines enough wide for what the window blunts to be told from it ([`Finding::Leakage`]); `settled` says whether
/// that came to an end in the fit. `None` where no window blunts, and without a mode that oscillates in the band.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 8.5 (half-power bandwidth and resolution bandwidth).
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
    let all = modes.iter().enumerate().filter(|(_, mode)| in_band(mode) && oscillates(mode));
    let narrowest = all.min_by(|(_, a), (_, b)| width(a).total_cmp(&width(b)));
    narrowest.map(|(at, mode)| {
        let lines = width(mode);
        let needed = samples * RESONANCE_LINES / lines.max(1e-6);
        Finding::Leakage {
            mode: at,
            frequency_hz: mode.natural_frequency_hz.value,
            lines,
            samples_needed: needed.max(samples).ceil() as usize,
            settled,
        }
    })
}
