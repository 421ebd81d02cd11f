//! Refusal of fits in which the data determine no parameter.

use mechid_checks::{Finding, unrelated_response};
use mechid_estimate::{Estimate, IdentifiedMode};
use mechid_nonlinear::{NamedParameter, NonlinearEstimate};
use mechid_numerics::Uncertain;
use mechid_signal::message;

use super::checks::{CheckRow, When};
use super::rows::CONFIDENCE;
use crate::AnalysisError;
use crate::text::significant;

/// Maximum number of parameters and modes that a message lists.
const NAMED: usize = 6;

/// Refuses a fit of a linear system that is singular within rounding errors, that explains no more
/// of the response than chance does, or in which the interval of every parameter contains zero.
///
/// If a fault of the channels or another model explains the failure, only a singular fit is
/// refused. If all intervals contain zero, the modes of a system with several degrees of freedom
/// may still be determined: the fit is accepted if a natural frequency is determined. With one
/// degree of freedom, the fit is refused even then, because response and mode are indistinguishable
/// from noise. A biased estimate is accepted even if it explains no more than chance does: the
/// response may be mostly signal that the estimate does not explain because of its bias.
///
/// # Errors
/// [`AnalysisError::NothingDetermined`].
pub(super) fn check(
    estimate: &Estimate,
    modes: &[IdentifiedMode],
    checks: &[CheckRow],
    is_biased: bool,
) -> Result<(), AnalysisError> {
    let refused = |why: String| Err(AnalysisError::NothingDetermined { why });
    let is_unrelated = |check: &&CheckRow| matches!(check.finding, Finding::Unrelated(_));
    let condition = estimate.condition();
    if condition * f64::EPSILON >= 1.0 {
        let number = significant(condition, 2);
        let causes = checks.iter().filter(|check| explains_failure(check));
        let causes: String = causes.map(|check| format!(". {}", check.sentence())).collect();
        let singular = format!(
            "the condition number of the fit is {number}: the equations are singular within rounding errors"
        );
        return refused(singular + &causes);
    }
    if checks.iter().any(explains_failure) {
        return Ok(());
    }
    if let Some(check) = checks.iter().find(is_unrelated)
        && !is_biased
    {
        return refused(check.sentence());
    }
    let frequencies = determined(modes);
    if all_intervals_contain_zero(estimate) && (estimate.dof() == 1 || frequencies.is_empty()) {
        let modes = if frequencies.is_empty() {
            "and so do the intervals of all natural frequencies".to_owned()
        } else {
            format!("so that {} may be only a peak of the noise", frequencies.join(", "))
        };
        return refused(format!("{} contain zero, {modes}", intervals(estimate)));
    }
    Ok(())
}

/// Returns whether a check finds a fault of the channels, a delay or another model, which may
/// explain that a fit fails.
fn explains_failure(check: &CheckRow) -> bool {
    check.is_bad() && check.when == When::Before || check.is_explanation()
}

/// Refuses a fit with nonlinear terms if it explains no more of the force (with output error: of
/// the response) than chance does, or if the interval of every parameter contains zero.
///
/// # Errors
/// [`AnalysisError::NothingDetermined`].
pub(super) fn check_nonlinear(fit: &NonlinearEstimate) -> Result<(), AnalysisError> {
    let residual = fit.linear().residual_nrmse();
    let unexplained = (residual.iter().map(|e| e * e).sum::<f64>() / residual.len() as f64).sqrt();
    let dof = fit.linear().dof();
    let [equations, unknowns] = [fit.equations() / dof, fit.parameters().len().div_ceil(dof)];
    if let Some(Finding::Unrelated(unrelated)) =
        unrelated_response(unexplained, equations, unknowns)
    {
        let percent = significant(100.0 * unrelated.explained, 3);
        let why = format!(
            "the model explains {percent} % of the fitted data, and would explain as much of pure noise. Noise may \
             have biased least squares: use several periods or maximum likelihood (`method`)"
        );
        return Err(AnalysisError::NothingDetermined { why });
    }
    let contains_zero = |parameter: &NamedParameter| {
        let interval = parameter.estimate.interval(CONFIDENCE);
        interval.is_ok_and(|[low, high]| low <= 0.0 && high >= 0.0 && low < high)
    };
    if fit.parameters().is_empty() || !fit.parameters().iter().all(contains_zero) {
        return Ok(());
    }
    let named = |parameter: &NamedParameter| {
        let Uncertain { value, standard_error, .. } = parameter.estimate;
        let (value, error) = (significant(value, 3), significant(standard_error, 2));
        format!("{} = {value} ± {error} {}", parameter.name, parameter.unit)
    };
    let parameters: Vec<String> = fit.parameters().iter().map(named).collect();
    let parameters = message::list(&parameters, ", ", NAMED);
    let why = format!("the intervals of all parameters ({parameters}) contain zero");
    Err(AnalysisError::NothingDetermined { why })
}

/// Returns the remark on a fit that determines modes but no parameter.
pub(super) fn modes_alone(estimate: &Estimate, modes: &[IdentifiedMode]) -> Option<String> {
    let frequencies = determined(modes);
    (all_intervals_contain_zero(estimate) && !frequencies.is_empty()).then(|| {
        let [named, open] = [message::list(&frequencies, ", ", NAMED), intervals(estimate)];
        format!("the data determine modes ({named}), but no parameter: {open} contain zero")
    })
}

/// Returns whether the interval of every parameter contains zero; `false` if the fit has no
/// statistical degrees of freedom for an interval.
fn all_intervals_contain_zero(estimate: &Estimate) -> bool {
    estimate.parameters().len() > 0
        && estimate.parameters().all(|p| {
            let interval = p.interval(CONFIDENCE);
            interval.is_ok_and(|[low, high]| {
                low <= 0.0 && high >= 0.0 && low < high && (high - low).is_finite()
            })
        })
}

/// Returns the natural frequencies whose intervals do not contain zero.
fn determined(modes: &[IdentifiedMode]) -> Vec<String> {
    let is_determined = |mode: &&IdentifiedMode| {
        let interval = mode.natural_frequency_interval_hz(CONFIDENCE);
        interval.is_ok_and(|[low, high]| low > 0.0 && high.is_finite())
    };
    let named = |mode: &IdentifiedMode| {
        let frequency = &mode.natural_frequency_hz;
        let [value, error] = [frequency.value, frequency.standard_error];
        format!("{} ± {} Hz", significant(value, 6), significant(error, 2))
    };
    modes.iter().filter(is_determined).map(named).collect()
}

fn intervals(estimate: &Estimate) -> String {
    let of = |p: mechid_estimate::Estimated| {
        let (value, error) = (significant(p.value, 3), significant(p.standard_error, 2));
        format!("{} = {value} ± {error} {}", p.parameter, p.parameter.matrix().unit())
    };
    let intervals: Vec<String> = estimate.parameters().map(of).collect();
    format!("the intervals of all parameters ({})", message::list(&intervals, ", ", NAMED))
}
