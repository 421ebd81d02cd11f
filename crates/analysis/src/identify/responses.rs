//! Fits frequency responses.

use mechid_checks::{
    Finding, RowParts, Subject, after_response_fit, before_spectral_fit, claimed_period, coherence,
    delay_of_lines, leakage, linearity,
};
use mechid_estimate::frequency_domain::{PartsOfFit, Split, equation_error};
use mechid_estimate::{
    Estimate, EstimateError, ResponseEstimate, Unknowns, output_error_of_responses,
};
use mechid_model::Discretisation;
use mechid_signal::Extent;
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, Lines};

use super::coherence::ResponseCoherence;
use super::compared::Compared;
use super::fitted::{Fitted, Misfit};
use super::keywords::Domain;
use super::open_records::rows_of;
use super::options::{Method, SegmentFit};
use super::prediction::Prediction;
use super::remarks::one_motion_of;
use super::rows::LinesUsed;
use super::spectra::no_period;
use crate::AnalysisError;
use crate::frf::Responses;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Standard errors by which the window of segments moves a parameter before the result says so.
const BLUNTED: f64 = 0.5;

/// Fits the frequency responses of one or several records, weighted by their coherence unless least
/// squares is asked for. The length of segments that is not given, nor a period, is chosen for the first record.
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
    // Says what the data leave open, before anything is made of it.
    estimate.system()?;
    let periodic = segments.are_periods();
    let coherent = responses.first().map(|r| ResponseCoherence::new(&r.frf, r.averages()));
    let modes = estimate.modes()?;
    let (mut before, mut after, mut misfit) = (Vec::new(), Vec::new(), misfit);
    for (Windowed { held, .. }, r) in records.iter().zip(&responses) {
        let mut checks = Vec::from_iter(coherence(&r.frf));
        if periodic {
            checks.extend(claimed_period(&held.force, held.period));
        }
        let mut looked = looked_at(held, r, unknowns, &estimate, data.len(), periodic)?;
        looked.extend(leakage(&r.frf, &modes, settled));
        // What differs between windows that are no periods is no noise.
        if checks.iter().any(no_period) {
            looked.retain(|finding| finding.subject() != Subject::Misfit);
            misfit = None;
        }
        before.push(checks);
        after.push(looked);
    }
    let Compared { parts, omitted } = match *method {
        Some(Method::LeastSquares) => Compared::default(),
        _ => agreement(&responses, &data, &estimate)?,
    };
    let of_motion = one_motion_of(&records[0].held).into_iter();
    let remarks = of_motion.chain(of_averages(records, &responses)).chain(remark);
    let remarks = remarks.chain(chosen.map(|(_, remark)| remark)).collect();
    let prediction = match periodic {
        true => Prediction::Steady,
        false => Prediction::Sampled {
            discretisation: Discretisation::FirstOrderHold,
            extent: Extent::Open,
        },
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
        omitted,
        misfit,
        drawn: Some(measured),
        remarks,
        ..Fitted::new(Domain::Frequency, name, prediction, estimate)
    })
}

/// Compares the bands of lines and, of several, the records. Looks for terms that the model leaves out.
fn agreement(
    responses: &[Responses],
    data: &FrequencyData,
    estimate: &Estimate,
) -> Result<Compared, AnalysisError> {
    let records: Vec<(Frf, Vec<usize>)> =
        responses.iter().map(|r| (r.frf.clone(), r.driven.clone())).collect();
    let mut splits = vec![(Split::Bands, RowParts::Records)];
    if records.len() > 1 {
        let each = records.iter().map(|(frf, driven)| frf.data(driven));
        let each: Vec<FrequencyData> = each.collect::<Result<_, _>>()?;
        splits.push((Split::Rows(rows_of(&each)), RowParts::Records));
    }
    let parts = PartsOfFit::from_responses(data, &records, estimate);
    Ok(parts
        .map_or_else(Compared::default, |fit| Compared::new(&fit, &splits, Some(&[]), estimate)))
}

/// Returns remarks on the averages of several records, and on their channels.
fn of_averages(records: &[Windowed], responses: &[Responses]) -> Vec<String> {
    let of_channels = records.iter().zip(responses).flat_map(|(recorded, r)| {
        let file = (records.len() > 1).then_some(recorded.held.file.as_str());
        r.of_channels(file)
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

/// The responses of all records, one after the other.
fn joined(responses: &[Responses]) -> Result<FrequencyData, AnalysisError> {
    let mut all: Vec<FrequencyData> =
        responses.iter().map(|r| r.frf.data(&r.driven)).collect::<Result<_, _>>()?;
    let first = all.remove(0);
    Ok(all.iter().try_fold(first, |data, next| data.and(next))?)
}

/// An estimate from frequency responses.
struct Outcome {
    /// The estimator in words.
    name: &'static str,
    estimate: Estimate,
    /// Residual against the coherence.
    misfit: Option<Misfit>,
    remark: Option<String>,
    /// Whether what the window blunts was told from the machine.
    settled: bool,
}

/// Returns the estimate; of maximum likelihood the `responses` become those that it fitted, less what their window
/// blunts.
fn estimated(
    responses: &mut [Responses],
    unknowns: &Unknowns,
    method: Option<Method>,
) -> Result<Outcome, AnalysisError> {
    match method {
        Some(Method::Instrumental) => Err(AnalysisError::InstrumentalResponses),
        Some(Method::LeastSquares) => {
            let name = "least squares on frequency responses, all lines alike";
            let estimate = equation_error(&joined(responses)?, unknowns)?;
            Ok(Outcome { name, estimate, misfit: None, remark: None, settled: true })
        }
        Some(Method::MaximumLikelihood) | None => {
            let name = "maximum likelihood on frequency responses, weighted by their coherence";
            let records: Vec<_> =
                responses.iter().map(|r| (r.frf.clone(), r.driven.clone())).collect();
            let found = output_error_of_responses(&records, unknowns)?;
            let remark = blunted(&found);
            let ResponseEstimate { fit, responses: fitted, settled, .. } = found;
            for (response, frf) in responses.iter_mut().zip(fitted) {
                response.frf = frf;
            }
            let misfit =
                Misfit { ratio: fit.misfit_ratio, noise: "that follows from the coherence" };
            Ok(Outcome { name, estimate: fit.estimate, misfit: Some(misfit), remark, settled })
        }
    }
}

/// Returns a remark on what a window of segments does to the parameters, where it does.
pub(super) fn blunted(found: &ResponseEstimate) -> Option<String> {
    (found.blunted > BLUNTED).then(|| {
        format!(
            "the window of the segments blunts the responses: that was taken off them, by which a parameter moves \
             by {} standard errors",
            significant(found.blunted, 2)
        )
    })
}

/// Returns the findings after the fit of one record; `rows` are those of all records together.
fn looked_at(
    held: &Block,
    r: &Responses,
    unknowns: &Unknowns,
    estimate: &Estimate,
    rows: usize,
    periodic: bool,
) -> Result<Vec<Finding>, AnalysisError> {
    let late = delay_of_lines(&r.frf.data(&r.driven)?, held.force.sampling().dt(), unknowns);
    let share = (r.driven.len() * r.lines.as_slice().len()) as f64 / rows as f64;
    let fitted = share * estimate.parameters().len() as f64;
    let mut checks = Vec::from_iter(late);
    checks.extend(after_response_fit(&r.frf, &r.driven, estimate, fitted)?);
    if !periodic {
        checks.extend(of_linearity(held, &r.lines, estimate)?);
    }
    Ok(checks)
}

/// Judges the lines between the first and the last one fitted; `None` for a free machine, which has no
/// displacement to take powers of.
fn of_linearity(
    measured: &Block,
    lines: &Lines,
    estimate: &Estimate,
) -> Result<Option<Finding>, AnalysisError> {
    let (motion, kind) = measured.response();
    let used = LinesUsed::of(lines);
    match linearity(estimate, &measured.force, motion, kind, [used.first_hz, used.last_hz]) {
        Err(EstimateError::Model(_)) => Ok(None),
        looked => Ok(Some(looked?)),
    }
}
