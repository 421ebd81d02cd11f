//! Fits of the spectral lines of whole periods.

use std::ops::Range;

use mechid_checks::{
    AfterSpectralFit, Finding, RowParts, SpectralResidual, Subject, Verdict, after_spectral_fit,
    before_spectral_fit, delay_of_lines, distortion_of_periods, fitted_band, steady_periods,
};
use mechid_estimate::frequency_domain::{
    PartsOfFit, SampledRows, Split, equation_error, instrumental_variables, output_error_pooling,
};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::SecondOrderSystem;
use mechid_numerics::time_limit;
use mechid_signal::{Extent, Record, Repetition, quantisation_step, repetition};
use mechid_spectra::{
    FrequencyData, Lines, NoiseModel, NoiseSpectrum, Pooling, RepeatedPeriods, SpectraError,
};

use super::CONSPICUOUS;
use super::compared::{Compared, rows_of};
use super::disagreement::Disagreement;
use super::fitted::{Fitted, Misfit, Residual, unexplained_motion};
use super::keywords::Domain;
use super::left_out::{LineRule, all_lines};
use super::open_records::{joined, remaining};
use super::options::PeriodEstimator;
use super::prediction::Prediction;
use super::quantity::other_quantity;
use super::remarks::{noise_remark, one_motion_of};
use crate::AnalysisError;
use crate::limits::CAUSE_OPERATIONS;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Maximum number of unknown parameters for which maximum likelihood is the default: 20 degrees of
/// freedom, which take seconds. With more, least squares is the default, and a record without
/// settings is not tried as an open record.
pub(super) const LIKELIHOOD_PARAMETERS: usize = 1200;

/// Maximum mean force-to-noise power ratio of a channel that counts as unexcited; noise alone gives
/// 1.
const IDLE: f64 = 2.0;

/// Maximum number of unknown parameters for a search for nonlinear terms; a fit with more
/// parameters omits this search.
const TERM_PARAMETERS: usize = 100;

/// Maximum unexplained part of the response that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// Largest excess of the residual power of least squares over that of maximum likelihood, per
/// parameter and in units of the noise power, at which least squares still counts as unbiased.
const EXCESS: f64 = 10.0;

/// Ratio of the residual of least squares to the residual of maximum likelihood. At or above it,
/// least squares counts as biased even if the residual of maximum likelihood is more than noise.
const BIASED_RATIO: f64 = 2.0;

/// Returns the pooling of the noise for an estimator.
fn pooling_of(estimator: Option<PeriodEstimator>) -> Pooling {
    match estimator {
        Some(PeriodEstimator::MaximumLikelihood(noise)) => noise,
        _ => Pooling::Automatic,
    }
}

/// The periods of a record, and the lines that were chosen from its force.
type Spectra = (RepeatedPeriods, Lines);

/// Fits the spectra of the windows of one or several records, each on the lines that `lines`
/// finds in a period of its force.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    lines: LineRule<'_>,
    estimator: Option<PeriodEstimator>,
) -> Result<Fitted, AnalysisError> {
    let noise = pooling_of(estimator);
    let mut spectra = read(records, lines, noise)?;
    let data = together(&spectra, &RepeatedPeriods::mean)?;
    let SpectralEstimate {
        estimator,
        estimate,
        mut misfit,
        noise: models,
        spectrum,
        noise_through,
        remark,
    } = estimated(&spectra, &data, unknowns, estimator)?;
    // An undetermined parameter ends the fit here, with an error that names the parameter.
    estimate.system()?;
    let RecordFindings { before, mut after, weighted, repeats } =
        RecordFindings::at(records, &spectra, unknowns, &estimate, noise, noise_through.as_ref())?;
    misfit = misfit.filter(|_| repeats);
    let AfterSpectralFit { records: residuals, bias } =
        after_spectral_fit(&weighted, &estimate, Extent::WholePeriod)?;
    let Compared { parts, omitted } = if residuals.iter().any(SpectralResidual::is_rounding) {
        Compared::default()
    } else {
        agreement(&spectra, &weighted, &estimate, spectrum.as_ref())?
    };
    let scattered = weighted.iter().all(|data| data.noise().is_some()).then(|| joined(&weighted));
    let is_left = exceeds_noise(&residuals);
    let quantity = quantity_of_periods(&data, &estimate, is_left)
        .filter(|quantity| explains_more(quantity, &mut after));
    let is_small = unknowns.free().len() <= TERM_PARAMETERS;
    let nonlinear = if is_left && is_small && quantity.is_none() {
        nonlinear_term(records, unknowns, lines)?
    } else {
        None
    };
    Ok(Fitted {
        equations: 2 * data.len(),
        scattered: scattered.transpose()?,
        before_all: before_spectral_fit(&data, unknowns)?,
        frequency: Some((spectra.swap_remove(0).1, data)),
        before,
        after,
        after_all: bias.into_iter().chain(quantity).chain(nonlinear).chain(parts).collect(),
        disagreement: Disagreement::new(omitted, None),
        residuals: Residual::from_lines(residuals),
        misfit,
        noise: models,
        remarks: one_motion_of(&records[0].held)
            .into_iter()
            .chain(remark)
            .chain(idle_forces(&records[0].held, &weighted))
            .collect(),
        ..Fitted::new(Domain::Frequency, estimator, Prediction::Steady, estimate)
    })
}

/// Returns the finding that the responses are those of another quantity, if the estimate does not
/// explain them: a test of the residual warns (`warns`), or a conspicuous part of the response is
/// unexplained. `None` for a fit of many parameters, because the quantities would take too long.
fn quantity_of_periods(data: &FrequencyData, estimate: &Estimate, warns: bool) -> Option<Finding> {
    if estimate.unknowns().free().len() > TERM_PARAMETERS {
        return None;
    }
    let system = estimate.system().ok()?;
    let unexplained = unexplained_motion(data, &system).ok()?;
    if !warns && unexplained <= Some(CONSPICUOUS) {
        return None;
    }
    time_limit::apart(CAUSE_OPERATIONS, || other_quantity(data, data, estimate))
}

/// Returns whether less of the residual power remains with another quantity than with every delay
/// in `after`, and removes these delays if so: near a resonance, both may have a similar effect.
fn explains_more(quantity: &Finding, after: &mut [Vec<Finding>]) -> bool {
    let is_delay = |finding: &Finding| finding.subject() == Subject::Delay;
    let delays = after.iter().flatten().filter(|finding| is_delay(finding));
    let explains_more = delays.map(remaining).all(|delay| remaining(quantity) < delay);
    if explains_more {
        after.iter_mut().for_each(|findings| findings.retain(|finding| !is_delay(finding)));
    }
    explains_more
}

/// Returns whether a test of a residual warns.
fn exceeds_noise(residuals: &[SpectralResidual]) -> bool {
    let is_warning = |finding: &Finding| finding.verdict() > Verdict::Good;
    residuals.iter().any(|residual| residual.findings().iter().any(is_warning))
}

/// Findings on the periods of each record.
struct RecordFindings {
    before: Vec<Vec<Finding>>,
    after: Vec<Vec<Finding>>,
    /// Means of the periods, with their noise.
    weighted: Vec<FrequencyData>,
    /// `true` if all windows are periods.
    repeats: bool,
}

impl RecordFindings {
    fn at(
        records: &[Windowed],
        spectra: &[Spectra],
        unknowns: &Unknowns,
        estimate: &Estimate,
        noise: Pooling,
        noise_through: Option<&SecondOrderSystem>,
    ) -> Result<Self, AnalysisError> {
        let (before, after, weighted) = (Vec::new(), Vec::new(), Vec::new());
        let mut findings = Self { before, after, weighted, repeats: true };
        for (Windowed { held, .. }, (periods, lines)) in records.iter().zip(spectra) {
            let checks = steady_periods(&held.force, held.response().0, held.period)?;
            // Windows that are not periods differ by more than noise.
            let repeats = !checks.iter().any(no_period);
            let data = if repeats {
                with_noise(periods, noise, noise_through)?
            } else {
                periods.mean()?
            };
            findings.repeats &= repeats;
            findings.before.push(checks);
            let band = fitted_band(estimate, lines)?;
            let late = delay_of_lines(&data, lines.sampling().dt(), unknowns);
            findings.after.push(band.into_iter().chain(late).collect());
            findings.weighted.push(data);
        }
        Ok(findings)
    }
}

/// Compares the records, the halves of their periods and the bands of lines, and compares the fit
/// with larger models. If the noise of a record is not known, the halves are not compared, and the
/// noise is assumed to have the form of `spectrum`.
fn agreement(
    spectra: &[Spectra],
    weighted: &[FrequencyData],
    estimate: &Estimate,
    spectrum: Option<&NoiseSpectrum>,
) -> Result<Compared, AnalysisError> {
    let mut records = Vec::new();
    let mut sampled = Vec::new();
    let mut halves: Vec<Vec<Range<usize>>> = vec![Vec::new(); 2];
    let is_stated = weighted.iter().all(|data| data.noise().is_some());
    let mut row = 0;
    for ((periods, lines), data) in spectra.iter().zip(weighted) {
        let sampling = lines.sampling();
        let Some(noise) = data.noise().filter(|_| is_stated) else {
            sampled.push(SampledRows { rows: row..row + data.len(), sampling });
            row += data.len();
            records.push(data.clone());
            continue;
        };
        let (first, second) = periods.halves()?;
        let count = periods.count();
        let noise = noise.clone().scaled(count as f64 / (count / 2) as f64);
        let record = first.with_noise(noise.clone())?.and(&second.with_noise(noise)?)?;
        for half in &mut halves {
            half.push(row..row + data.len());
            sampled.push(SampledRows { rows: row..row + data.len(), sampling });
            row += data.len();
        }
        records.push(record);
    }
    let joint = joined(&records)?;
    let mut splits = vec![(Split::Bands, RowParts::Records)];
    if records.len() > 1 {
        splits.push((Split::Rows(rows_of(&records)), RowParts::Records));
    }
    if is_stated {
        splits.push((Split::Rows(halves), RowParts::Halves));
    }
    let parts = PartsOfFit::new(&joint, estimate, None, spectrum);
    // Least squares of several periods ignores their noise, so its estimate does not maximise the
    // likelihood. The score test assumes such a maximum.
    let is_one = spectra.iter().all(|(periods, _)| periods.count() == 1);
    let sampled = (spectrum.is_some() || is_one).then_some(&sampled[..]);
    Ok(parts.map_or_else(Compared::default, |fit| Compared::new(&fit, &splits, sampled, estimate)))
}

/// Returns the periods of each record, on the lines found in its force.
fn read(
    records: &[Windowed],
    lines: LineRule<'_>,
    noise: Pooling,
) -> Result<Vec<Spectra>, AnalysisError> {
    let mut spectra = Vec::new();
    for recorded in records {
        let block = &recorded.held;
        let chosen = lines.lines(&block.force, block.period)?;
        let lines = Lines::new(block.force.sampling().with_len(block.period)?, chosen)?;
        spectra.push((periods(recorded, &lines)?, lines));
    }
    if noise == Pooling::PerLine && spectra.iter().any(|(periods, _)| periods.count() < 2) {
        let why = "per-line takes the noise of each line from the scatter of two or more periods, but there is \
                   only one period: give `period`, or choose another `noise`";
        return Err(AnalysisError::Setting { setting: "noise", why: why.into() });
    }
    Ok(spectra)
}

/// Returns the remark on unexcited forces: those with only noise in every record.
fn idle_forces(held: &Block, records: &[FrequencyData]) -> Option<String> {
    let over_noise = |channel: usize, data: &FrequencyData| {
        let (noise, index) = (data.noise()?, data.dof() + channel);
        let of_noise = (0..data.len()).map(|row| noise.covariance(row)[(index, index)].re);
        Some(data.force().column(channel).norm_squared() / of_noise.sum::<f64>())
    };
    let is_idle = |channel: &usize| {
        records.iter().all(|data| over_noise(*channel, data).is_some_and(|ratio| ratio < IDLE))
    };
    let idle = (0..held.force.channels()).filter(is_idle);
    let names: Vec<String> = idle.map(|channel| held.names.force_name(channel)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}: only noise; if no force acts there, give 0 instead (`force`); otherwise the noise is treated as excitation",
            names.join(", ")
        )
    })
}

/// Returns the nonlinear term that explains most of the residual of the linear model in all
/// records; `None` if the records differ in sampling rate or in the number of samples of a period.
fn nonlinear_term(
    records: &[Windowed],
    unknowns: &Unknowns,
    rule: LineRule<'_>,
) -> Result<Option<Finding>, AnalysisError> {
    let first = &records[0].held;
    let period = first.force.sampling().with_len(first.period)?;
    let (mut band, mut experiments) = (Vec::new(), Vec::new());
    for Windowed { held, .. } in records {
        if held.force.sampling().with_len(held.period)? != period {
            return Ok(None);
        }
        band.extend(all_lines(held, rule)?);
        experiments.push([&held.force, held.response().0]);
    }
    let band = Lines::new(period, band)?;
    // An error is ignored here, because the fit reports it if the data cannot be fitted.
    Ok(distortion_of_periods(&band, &experiments, first.response().1, unknowns).unwrap_or(None))
}

/// Returns a remark on a window that was used as one period although it contains several. The
/// scatter of these periods shows the noise, but was not used.
pub(super) fn unstated_period(record: &Windowed) -> Option<String> {
    let (held, len) = (&record.held, record.held.force.len());
    let force = held.force.channel(*held.driven.first()?);
    let Repetition { period, mismatch } = repetition(force).filter(|_| held.period == len)?;
    (len >= 2 * period && len % period == 0).then(|| {
        format!(
            "the force of {} repeats every {period} samples, within {} % of its RMS: with `period` {period} the {} \
             periods are averaged, and their scatter shows the noise",
            held.file,
            significant(100.0 * mismatch, 2),
            len / period
        )
    })
}

/// Returns whether a finding says that the windows are not periods of the record.
pub(super) fn no_period(finding: &Finding) -> bool {
    finding.subject() == Subject::Periodicity && finding.verdict() == Verdict::Bad
}

/// An estimate from spectra.
struct SpectralEstimate {
    estimator: &'static str,
    estimate: Estimate,
    misfit: Option<Misfit>,
    noise: Vec<NoiseModel>,
    /// Noise spectrum that weighted the fit; `None` without weights.
    spectrum: Option<NoiseSpectrum>,
    /// System whose response to unmeasured forces gives the form of the noise spectrum; `None` if
    /// no such form was used.
    noise_through: Option<SecondOrderSystem>,
    remark: Option<String>,
}

/// Returns the estimate of a method from the `spectra` of the periods and from their means, `data`.
/// Without a method, it uses maximum likelihood if the periods show the noise and the search
/// converges, otherwise least squares.
fn estimated(
    spectra: &[Spectra],
    data: &FrequencyData,
    unknowns: &Unknowns,
    estimator: Option<PeriodEstimator>,
) -> Result<SpectralEstimate, AnalysisError> {
    let noise = pooling_of(estimator);
    match estimator {
        Some(PeriodEstimator::LeastSquares) => least_squares(data, unknowns, None),
        Some(PeriodEstimator::Instrumental) => {
            let first = together(spectra, &|periods| Ok(periods.halves()?.0))?;
            let second = together(spectra, &|periods| Ok(periods.halves()?.1))?;
            Ok(SpectralEstimate {
                estimator: "instrumental variables: each half of the periods is the instrument of the other half",
                estimate: instrumental_variables(&first, &second, unknowns)?,
                misfit: None,
                noise: Vec::new(),
                spectrum: None,
                noise_through: None,
                remark: None,
            })
        }
        Some(PeriodEstimator::MaximumLikelihood(_)) => {
            let noisy = together(spectra, &|periods| with_noise(periods, noise, None))?;
            Ok(likelihood(spectra, &noisy, unknowns, noise)?)
        }
        None => suitable(spectra, data, unknowns),
    }
}

/// Returns the estimate by maximum likelihood if the periods show the noise and the search
/// converges, otherwise by least squares.
fn suitable(
    spectra: &[Spectra],
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<SpectralEstimate, AnalysisError> {
    let noise = Pooling::Automatic;
    let noisy = together(spectra, &|periods| with_noise(periods, noise, None))?;
    let parameters = unknowns.independent();
    if noisy.noise().is_none() {
        let plain = least_squares(data, unknowns, None)?;
        if parameters > LIKELIHOOD_PARAMETERS {
            return Ok(plain);
        }
        return Ok(match likelihood(spectra, &noisy, unknowns, noise) {
            Ok(likely) => preferred(data, plain, likely)?,
            Err(_) => plain,
        });
    }
    if parameters > LIKELIHOOD_PARAMETERS {
        let remark = format!(
            "least squares was used, because maximum likelihood would take minutes for {parameters} \
             parameters: noise on the response biases the estimate; `method` maximum-likelihood avoids \
             this bias"
        );
        return least_squares(data, unknowns, Some(remark));
    }
    match likelihood(spectra, &noisy, unknowns, noise) {
        Err(error @ EstimateError::NotConverged { .. }) => {
            let remark = format!(
                "least squares was used, because maximum likelihood failed: {error}. Noise on the response biases least squares"
            );
            least_squares(data, unknowns, Some(remark))
        }
        other => Ok(other?),
    }
}

fn least_squares(
    data: &FrequencyData,
    unknowns: &Unknowns,
    remark: Option<String>,
) -> Result<SpectralEstimate, AnalysisError> {
    let estimator = "least squares on the equation of motion, in the frequency domain";
    let estimate = equation_error(data, unknowns)?;
    Ok(SpectralEstimate {
        estimator,
        estimate,
        misfit: None,
        noise: Vec::new(),
        spectrum: None,
        noise_through: None,
        remark,
    })
}

/// Returns the estimate by maximum likelihood from data with noise. If the noise may be the
/// response to unmeasured forces, the system of the first search gives the shape of the noise
/// spectrum, and a second search uses this shape.
fn likelihood(
    spectra: &[Spectra],
    noisy: &FrequencyData,
    unknowns: &Unknowns,
    noise: Pooling,
) -> Result<SpectralEstimate, EstimateError> {
    let mut fit = output_error_pooling(noisy, unknowns, noise)?;
    let mut noise_through = None;
    if noisy.noise().is_some() && fit.noise.iter().any(|model| *model != NoiseModel::White) {
        let machine = fit.estimate.system()?;
        let of_forces = |periods: &RepeatedPeriods| with_noise(periods, noise, Some(&machine));
        let beside = together(spectra, &of_forces).ok();
        let is_of_forces = |model: &NoiseModel| matches!(model, NoiseModel::UnmeasuredForce { .. });
        let beside = beside.filter(|data| {
            data.noise().is_some_and(|noise| noise.models().iter().any(is_of_forces))
        });
        // The result of the first search remains if the second one fails.
        let again = beside.and_then(|data| output_error_pooling(&data, unknowns, noise).ok());
        if let Some(again) = again {
            (fit, noise_through) = (again, Some(machine));
        }
    }
    let source = "estimated from the periods";
    let fewest = spectra.iter().map(|(periods, _)| periods.count()).min().unwrap_or(1);
    Ok(SpectralEstimate {
        estimator: "maximum likelihood, in the frequency domain",
        estimate: fit.estimate,
        misfit: noisy.noise().map(|_| Misfit { ratio: fit.misfit_ratio, noise: source }),
        remark: Some(noise_remark(fewest, noisy.noise().is_some(), &fit.noise)),
        noise: fit.noise,
        spectrum: Some(fit.spectrum),
        noise_through,
    })
}

/// Returns least squares if it explains the response as well as maximum likelihood. Also returns
/// least squares if the residual of maximum likelihood is more than noise, and the residual of
/// least squares is less than [`BIASED_RATIO`] times the residual of maximum likelihood. Otherwise
/// noise has biased least squares: returns maximum likelihood with this reason.
fn preferred(
    data: &FrequencyData,
    plain: SpectralEstimate,
    likely: SpectralEstimate,
) -> Result<SpectralEstimate, AnalysisError> {
    let unexplained = |found: &SpectralEstimate| match found.estimate.system() {
        Ok(system) => unexplained_motion(data, &system),
        Err(_) => Ok(None),
    };
    let (Some(of_plain), Some(of_likely)) = (unexplained(&plain)?, unexplained(&likely)?) else {
        return Ok(plain);
    };
    let unknown = likely.estimate.unknowns().independent() as f64;
    let equations = 2.0 * (data.dof() * data.len()) as f64;
    // The excess of the residual of least squares over that of maximum likelihood is computed
    // twice: with equal weights, and with the weights of maximum likelihood.
    let unweighted = ((of_plain / of_likely).powi(2) - 1.0) * equations;
    let weighted = likely.estimate.squared_distance(&plain.estimate).unwrap_or(0.0);
    let excess = unweighted.max(weighted) / unknown;
    if of_plain <= ROUNDING || excess.is_nan() || excess <= EXCESS {
        return Ok(plain);
    }
    // If the residual of maximum likelihood is more than noise, the model is wrong, and so are the
    // estimates of both methods. Least squares is then kept unless its residual is much larger.
    let fit_findings =
        after_spectral_fit(std::slice::from_ref(data), &likely.estimate, Extent::WholePeriod)?;
    let is_noise = |finding: &Finding| finding.verdict() == Verdict::Good;
    if of_plain < BIASED_RATIO * of_likely
        && !fit_findings.records.iter().flat_map(SpectralResidual::findings).all(|f| is_noise(&f))
    {
        return Ok(plain);
    }
    let reason = format!(
        "maximum likelihood was used: least squares is biased by noise and leaves {} % of the motion unexplained; \
         maximum likelihood leaves {} %",
        significant(100.0 * of_plain, 3),
        significant(100.0 * of_likely, 3)
    );
    let remark = likely.remark.map(|remark| format!("{reason}; {remark}"));
    Ok(SpectralEstimate { remark, ..likely })
}

/// Returns the rows of all records, concatenated.
fn together(
    spectra: &[Spectra],
    of: &dyn Fn(&RepeatedPeriods) -> Result<FrequencyData, SpectraError>,
) -> Result<FrequencyData, AnalysisError> {
    let mut data = of(&spectra[0].0)?;
    for (periods, _) in &spectra[1..] {
        data = data.and(&of(periods)?)?;
    }
    Ok(data)
}

/// Returns all periods of a record, read chunk by chunk.
pub fn periods(recorded: &Windowed, lines: &Lines) -> Result<RepeatedPeriods, AnalysisError> {
    let Block { force, period, periods, .. } = &recorded.held;
    let kind = recorded.held.response().1;
    let mut repeated = RepeatedPeriods::expecting(lines, force.channels(), kind, *periods);
    let samples = period * recorded.at_once().div_ceil(*period);
    recorded.chunks(samples, samples, &mut |chunk| {
        Ok(repeated.push(&chunk.force, chunk.response().0)?)
    })?;
    Ok(repeated.with_quantisation(steps(&recorded.held))?)
}

/// Maximum ratio of a quantisation step to the RMS of its channel for which the step is ignored;
/// such a fine step changes no parameter.
const FINE: f64 = 3e-5;

/// Returns the quantisation steps of responses and forces, in their units; 0 for a channel without
/// steps or with fine steps.
fn steps(held: &Block) -> Vec<f64> {
    let of = |record: &Record| -> Vec<f64> {
        let channels = (0..record.channels()).map(|channel| {
            let rms = record.column(channel).variance().sqrt();
            quantisation_step(record.channel(channel)).filter(|step| *step > FINE * rms)
        });
        channels.map(|step| step.unwrap_or(0.0)).collect()
    };
    [of(held.response().0), of(&held.force)].concat()
}

/// Returns the mean of the periods, with its noise if this noise exceeds rounding. If a `machine`
/// is given, the noise may be the response of the machine to unmeasured forces.
fn with_noise(
    periods: &RepeatedPeriods,
    noise: Pooling,
    machine: Option<&SecondOrderSystem>,
) -> Result<FrequencyData, SpectraError> {
    if periods.count() < 2 {
        return periods.mean();
    }
    // If the periods differ by rounding only, their noise spectrum cannot be estimated.
    match periods.mean_with_noise(Pooling::AllLines)?.noise_above_rounding() {
        Some(_) => match machine {
            Some(machine) => periods.mean()?.with_noise(periods.noise_with_system(noise, machine)?),
            None => periods.mean_with_noise(noise),
        },
        None => periods.mean(),
    }
}
