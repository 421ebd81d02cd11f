//! New fits of open records whose channels a check has changed.

use mechid_estimate::frequency_domain::ChangedRecords;
use mechid_signal::Extent;
use mechid_spectra::FrequencyData;

use super::limits::{LEAST_WIDTH_RATIO, LONGEST_STEP, PARABOLAS};
use super::spectral_residual::SpectralResidual;
use super::weighted_fit::after_spectral_fit;

/// Returns the residuals of a new maximum-likelihood fit to all changed records together. The fit
/// begins at the last estimate of `likelihood`; the estimated errors of the force pulses and the
/// estimated transients are subtracted from the records. `None` if the fit fails.
pub(super) fn residuals_of_fit(
    records: &[FrequencyData],
    likelihood: &ChangedRecords<'_>,
) -> Option<Vec<SpectralResidual>> {
    let fit = likelihood.fit(&joined(records)?).ok()?;
    let corrected = fit.without_pulse_errors(records).ok()?;
    let closed = fit.ends.as_ref()?.without_transients(&corrected).ok()?;
    Some(after_spectral_fit(&closed, &fit.estimate, Extent::Open).ok()?.records)
}

/// Returns the rows of all records; `None` without a record or for records of different kinds.
pub(super) fn joined(records: &[FrequencyData]) -> Option<FrequencyData> {
    let (first, following) = records.split_first()?;
    following.iter().try_fold(first.clone(), |joined, record| joined.and(record)).ok()
}

/// Returns the position of the minimum of a `cost` near `start`, and the cost there. The search
/// uses parabolas with a half width that decreases from the first of `widths` to the last. `None`
/// if a cost cannot be computed, or if `is_promising` returns false after a step. The arguments of
/// `is_promising` are the cost after the step and the decrease of the cost by this step, which is
/// `None` if the length of the step was limited.
pub(super) fn minimum_near(
    start: f64,
    widths: [f64; 2],
    mut cost: impl FnMut(f64) -> Option<f64>,
    is_promising: impl Fn(f64, Option<f64>) -> bool,
) -> Option<(f64, f64)> {
    let ([mut width, resolved], mut place) = (widths, start);
    let mut least = cost(place)?;
    for _ in 0..PARABOLAS {
        let [before, after] = [cost(place - width)?, cost(place + width)?];
        let (slope, curvature) = (after - before, after - 2.0 * least + before);
        // The step is limited if the three points do not enclose a minimum.
        let step = if curvature > 0.0 {
            (-0.5 * slope / curvature).clamp(-LONGEST_STEP, LONGEST_STEP)
        } else {
            -LONGEST_STEP * slope.signum()
        };
        place += step * width;
        let lower = cost(place)?;
        let decrease = (step.abs() < LONGEST_STEP).then_some(least - lower);
        least = lower;
        if !is_promising(least, decrease) {
            return None;
        }
        width *= f64::clamp(step.abs(), LEAST_WIDTH_RATIO, 1.0);
        if width < resolved {
            break;
        }
    }
    Some((place, least))
}
