//! Fits frequency responses.

use mechid_checks::{
    Finding, Subject, Verdict, after_response_fit, before_spectral_fit, claimed_period, coherence,
    delay_of_lines, leakage, linearity, steady_periods,
};
use mechid_estimate::frequency_domain::equation_error;
use mechid_estimate::{
    Estimate, EstimateError, ResponseEstimate, Unknowns, output_error_of_responses,
};
use mechid_model::Discretisation;
use mechid_signal::Extent;
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, Lines};

use super::coherence::ResponseCoherence;
use super::compared::Compared;
use super::disagreement::Disagreement;
use super::fitted::{Fitted, Misfit};
use super::keywords::Domain;
use super::lines::LineChoice;
use super::options::{Method, SegmentFit, SpectralLines};
use super::prediction::Prediction;
use super::remarks::one_motion_of;
use super::rows::LinesUsed;
use super::spectra::no_period;
use crate::AnalysisError;
use crate::frf::Responses;
use crate::hits;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Change of a parameter by the correction of the window bias, in standard errors, above which a
/// remark reports this change.
const NOTED_WINDOW_CORRECTION: f64 = 0.5;

/// Remark on records that are not whole periods, and that are too long to be fitted as open records
/// by default.
pub(super) const UNTRIED: &str = "the windows are not whole periods, and have too many lines and unknowns to estimate \
                                  the transients by default: frequency responses were averaged over segments. \
                                  `extent` open estimates the transients";

/// Returns whether averages over segments suit the records better than whole windows: true if a
/// window does not consist of whole periods, the force is not a series of hits, and no lines are
/// chosen by number (line numbers refer to whole windows).
///
/// # Errors
/// [`AnalysisError::Estimate`] if a window cannot be checked.
pub(super) fn suit(records: &[Windowed], lines: &SpectralLines) -> Result<bool, AnalysisError> {
    let by_number = matches!(lines.choice, LineChoice::Lines(_)) || lines.without.lines.is_some();
    if by_number || hits::uncut(records).is_some() {
        return Ok(false);
    }
    for Windowed { held, .. } in records {
        let checks = steady_periods(&held.force, held.response().0, held.period)?;
        let is_other = |finding: &Finding| finding.verdict() > Verdict::Good;
        if checks.iter().any(|f| f.subject() == Subject::Periodicity && is_other(f)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Fits the frequency responses of one or several records, weighted by their coherence unless least
/// squares is requested. If neither a period nor the length of the segments is given, a length is
/// chosen from the first record.
///
/// # Errors
/// [`AnalysisError::InstrumentalResponses`] for instrumental variables.
pub fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &SegmentFit,
    period_given: bool,
) -> Result<Fitted, AnalysisError> {
    let SegmentFit { estimator, segments, method, lines } = how;
    let lines = lines.rule();
    let chosen = if period_given { None } else { segments.chosen(&records[0], lines)? };
    let segments = chosen.as_ref().map_or(segments, |(segments, _)| segments);
    let estimate =
        |recorded| Responses::new(std::slice::from_ref(recorded), segments, *estimator, lines);
    let mut responses: Vec<Responses> = records.iter().map(estimate).collect::<Result<_, _>>()?;
    let measured = joined(&responses)?;
    let Outcome { name, estimate, misfit, remark, settled } =
        estimated(&mut responses, unknowns, *method)?;
    let data = joined(&responses)?;
    // An undetermined parameter ends the fit here with an error that names it. Without this check,
    // a later step would fail with a less useful error.
    estimate.system()?;
    let periodic = segments.are_periods();
    let coherent = responses.first().map(|r| ResponseCoherence::new(&r.frf, r.averages()));
    let scope = Scope { unknowns, estimate: &estimate, rows: data.len(), periodic, settled };
    let Findings { before, after, repeats } = findings(records, &responses, &scope)?;
    let Compared { parts, omitted } = match *method {
        Some(Method::LeastSquares) => Compared::default(),
        _ => {
            let records: Vec<(Frf, Vec<usize>)> =
                responses.iter().map(|r| (r.frf.clone(), r.driven.clone())).collect();
            Compared::from_averages(&data, &records, &estimate)?
        }
    };
    let of_motion = one_motion_of(&records[0].held).into_iter();
    let remarks = of_motion.chain(average_remarks(records, &responses)).chain(remark);
    let remarks = remarks.chain(chosen.map(|(_, remark)| remark)).collect();
    let prediction = if periodic {
        Prediction::Steady
    } else {
        Prediction::Sampled { discretisation: Discretisation::FirstOrderHold, extent: Extent::Open }
    };
    Ok(Fitted {
        least_squares: *method == Some(Method::LeastSquares),
        equations: 2 * data.len(),
        coherence: coherent,
        before_all: before_spectral_fit(&data, unknowns)?,
        frequency: responses.into_iter().next().map(|r| (r.lines, data)),
        before,
        after,
        after_all: parts,
        disagreement: Disagreement::new(omitted, None),
        misfit: misfit.filter(|_| repeats),
        drawn: Some(measured),
        remarks,
        ..Fitted::new(Domain::Frequency, name, prediction, estimate)
    })
}

/// Returns remarks on the averages of several records, and on their channels.
fn average_remarks(records: &[Windowed], responses: &[Responses]) -> Vec<String> {
    let of_channels = records.iter().zip(responses).flat_map(|(recorded, r)| {
        let file = (records.len() > 1).then_some(recorded.held.file.as_str());
        r.channel_remarks(file)
    });
    let segments_of: Vec<String> = responses.iter().map(|r| r.counts[0].to_string()).collect();
    let of_segments = format!(
        "the frequency responses of {} records, fitted together, are averages of {} segments",
        records.len(),
        segments_of.join(", ")
    );
    let of_segments = (records.len() > 1).then_some(of_segments);
    of_segments.into_iter().chain(of_channels).collect()
}

/// Returns the responses of all records, concatenated.
fn joined(responses: &[Responses]) -> Result<FrequencyData, AnalysisError> {
    let mut remaining: Vec<FrequencyData> =
        responses.iter().map(|r| r.frf.data(&r.driven)).collect::<Result<_, _>>()?;
    let first = remaining.remove(0);
    Ok(remaining.iter().try_fold(first, |data, next| data.and(next))?)
}

/// An estimate from frequency responses.
struct Outcome {
    /// The estimator in words.
    name: &'static str,
    estimate: Estimate,
    /// Ratio of the residual power to the noise power that follows from the coherence.
    misfit: Option<Misfit>,
    remark: Option<String>,
    /// `true` if the bias of the window was separated from the system.
    settled: bool,
}

/// Returns the estimate. Maximum likelihood replaces the `responses` by the fitted responses, which
/// are corrected for the bias of the window.
fn estimated(
    responses: &mut [Responses],
    unknowns: &Unknowns,
    method: Option<Method>,
) -> Result<Outcome, AnalysisError> {
    match method {
        Some(Method::Instrumental) => Err(AnalysisError::InstrumentalResponses),
        Some(Method::LeastSquares) => {
            let name = "least squares on frequency responses, all lines with equal weights";
            let estimate = equation_error(&joined(responses)?, unknowns)?;
            Ok(Outcome { name, estimate, misfit: None, remark: None, settled: true })
        }
        Some(Method::MaximumLikelihood) | None => {
            let name = "maximum likelihood on frequency responses, weighted by their coherence";
            let records: Vec<_> =
                responses.iter().map(|r| (r.frf.clone(), r.driven.clone())).collect();
            let outcome = output_error_of_responses(&records, unknowns)?;
            let remark = blunted(&outcome);
            let ResponseEstimate { fit, responses: fitted, settled, .. } = outcome;
            for (response, frf) in responses.iter_mut().zip(fitted) {
                response.frf = frf;
            }
            let misfit =
                Misfit { ratio: fit.misfit_ratio, noise: "that follows from the coherence" };
            Ok(Outcome { name, estimate: fit.estimate, misfit: Some(misfit), remark, settled })
        }
    }
}

/// Returns a remark if the correction of the window bias changes a parameter.
pub(super) fn blunted(found: &ResponseEstimate) -> Option<String> {
    (found.blunted > NOTED_WINDOW_CORRECTION).then(|| {
        format!(
            "the bias of the window of the segments was subtracted from the responses; \
             this changes a parameter by up to {} standard errors",
            significant(found.blunted, 2)
        )
    })
}

/// Fit to which findings refer.
struct Scope<'a> {
    unknowns: &'a Unknowns,
    estimate: &'a Estimate,
    /// Number of rows of all records.
    rows: usize,
    /// `true` if the segments are periods.
    periodic: bool,
    /// `true` if the bias of the window was separated from the system.
    settled: bool,
}

/// Findings before and after the fit, record by record.
struct Findings {
    before: Vec<Vec<Finding>>,
    after: Vec<Vec<Finding>>,
    /// `false` if the windows of a record are not periods.
    repeats: bool,
}

fn findings(
    records: &[Windowed],
    responses: &[Responses],
    scope: &Scope<'_>,
) -> Result<Findings, AnalysisError> {
    let modes = scope.estimate.modes()?;
    let mut findings = Findings { before: Vec::new(), after: Vec::new(), repeats: true };
    for (Windowed { held, .. }, r) in records.iter().zip(responses) {
        let mut before = Vec::from_iter(coherence(&r.frf));
        if scope.periodic {
            before.extend(claimed_period(&held.force, held.period));
        }
        let mut after = after_fit(held, r, scope)?;
        after.extend(leakage(&r.frf, &modes, scope.settled));
        // Windows that are not periods differ by more than noise.
        if before.iter().any(no_period) {
            after.retain(|finding| finding.subject() != Subject::Misfit);
            findings.repeats = false;
        }
        findings.before.push(before);
        findings.after.push(after);
    }
    Ok(findings)
}

/// Returns the findings after the fit of one record.
fn after_fit(
    held: &Block,
    r: &Responses,
    scope: &Scope<'_>,
) -> Result<Vec<Finding>, AnalysisError> {
    let Scope { unknowns, estimate, rows, periodic, .. } = *scope;
    let late = delay_of_lines(&r.frf.data(&r.driven)?, held.force.sampling().dt(), unknowns);
    let share = (r.driven.len() * r.lines.as_slice().len()) as f64 / rows as f64;
    let fitted = share * estimate.parameters().len() as f64;
    let mut checks = Vec::from_iter(late);
    checks.extend(after_response_fit(&r.frf, &r.driven, estimate, fitted)?);
    if !periodic {
        checks.extend(linearity_finding(held, &r.lines, estimate)?);
    }
    Ok(checks)
}

/// Tests the linearity on all lines from the first to the last fitted line. Returns `None` for a
/// free system, because the test needs powers of the displacement, which cannot be computed for
/// such a system.
fn linearity_finding(
    measured: &Block,
    lines: &Lines,
    estimate: &Estimate,
) -> Result<Option<Finding>, AnalysisError> {
    let (motion, kind) = measured.response();
    let used = LinesUsed::from_lines(lines);
    match linearity(estimate, &measured.force, motion, kind, [used.first_hz, used.last_hz]) {
        Err(EstimateError::Model(_)) => Ok(None),
        looked => Ok(Some(looked?)),
    }
}
