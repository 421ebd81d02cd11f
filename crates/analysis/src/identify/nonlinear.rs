//! Fits of whole periods with nonlinear terms in addition to M, C and K.

use mechid_checks::{Finding, NoiseSource, PValue, before_spectral_fit, steady_periods};
use mechid_estimate::Unknowns;
use mechid_model::{Term, Terms};
use mechid_nonlinear::{
    ChannelPhase, Criterion, EquationErrorOptions, Extrapolation, Level, NonlinearEstimate, REACH,
    Selection, ShapeConstants, StandardErrors, SteadyExperiments, SteppedRecord, Weighting,
    best_output_error, distortion, equation_error, least_certain, select_terms,
};
use mechid_signal::{Extent, Record};
use mechid_spectra::{FrequencyData, Lines};
use serde::Serialize;

use super::disagreement::Disagreement;
use super::fitted::{Fitted, Misfit, Residual, SampleResidual, WithTerms};
use super::further_terms::FurtherTerms;
use super::keywords::Domain;
use super::left_out::{LineRule, all_lines};
use super::lines::LineChoice;
use super::open_terms;
use super::options::{Nonlinear, TermEstimator, TermFit};
use super::prediction::Prediction;
use super::remarks::one_motion_of;
use super::rows::Uncertain;
use super::selection::SelectionSummary;
use super::spectra::periods;
use crate::AnalysisError;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Minimum number of records or windows for cross-validation of a candidate; each record or window
/// is excluded once.
const HELD_OUT_RECORDS: usize = 3;

/// Nonlinear terms of an identified system, which [`Machine::read`](crate::Machine::read) can read.
#[derive(Debug, Serialize)]
pub struct NonlinearSummary {
    /// Terms as they are written, with the estimated constants inside them.
    pub terms: Terms,
    /// Coefficients, one for each term, each in the unit that the law of the term requires.
    pub coefficients: Vec<f64>,
    /// Delay and phase of the channels; zero unless they were searched for.
    pub channels: ChannelPhase,
    /// Parameters that are not entries of M, C and K, with their uncertainty.
    pub parameters: Vec<TermRow>,
    /// Weighting of the lines that was used.
    pub weighting: Weighting,
    /// Number of blocks of time whose scatter gives the standard errors; `None` if the scatter of
    /// the periods gives them, or if the residual was assumed white.
    pub blocks: Option<usize>,
    /// Number of periods whose scatter gives the standard errors; `None` if the standard errors
    /// have another source.
    pub periods: Option<usize>,
    /// Evidence against a linear system in the first record, collected before the fit; `None` for
    /// open records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distortion: Option<DistortionRow>,
    /// Growth of each term beyond the amplitudes of the data; constant forces are omitted.
    pub extrapolation: Vec<ExtrapolationRow>,
    /// Selection of terms; `None` without candidates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub selection: Option<SelectionSummary>,
}

/// Restoring force of the equation of motion in which a term acts, at the largest amplitude of the
/// data and at 1.5 times this amplitude.
#[derive(Debug, Clone, Serialize)]
pub struct ExtrapolationRow {
    /// Name of the term.
    pub term: String,
    /// Exponent with which the force of the term grows from the largest amplitude of the data to
    /// 1.5 times this amplitude, a pure number; 3 for a cubic spring.
    pub order: f64,
    /// Ratio of the force of the term to the restoring force, at the largest amplitude of the data
    /// and at 1.5 times this amplitude.
    pub share: [f64; 2],
    /// Ratio of the standard error of the restoring force to the restoring force, at the largest
    /// amplitude of the data and at 1.5 times this amplitude.
    pub relative_error: [f64; 2],
    /// `true` if predictions beyond the data are unreliable.
    pub poor: bool,
}

impl ExtrapolationRow {
    fn new(found: Extrapolation) -> Self {
        let poor = found.is_poor();
        let Extrapolation { term, order, relative_error, share } = found;
        Self { term, order, share, relative_error, poor }
    }

    /// Returns the reason against extrapolation, in a sentence; `None` if there is none.
    pub(super) fn doubt(&self) -> Option<String> {
        let percent = |ratio: f64| format!("{} %", significant(100.0 * ratio, 2));
        let [near, far] = self.share.map(percent);
        let (term, order) = (&self.term, significant(self.order, 2));
        let error = percent(self.relative_error[1]);
        self.poor.then(|| {
            format!(
                "{term} extrapolates badly: its force grows with the power {order} of the motion. At the largest \
                 amplitude of the data this force is {near} of the restoring force. At {REACH} times this \
                 amplitude it is {far}, and the standard error of the restoring force is {error}. Do not predict \
                 beyond the measured amplitudes"
            )
        })
    }
}

/// One parameter that is not an entry of M, C or K.
#[derive(Debug, Serialize)]
pub struct TermRow {
    /// Name of a term, of a constant inside a term (`c3.b` for the constant b of the term `c3`), or
    /// `delay`, `p3` or `p5`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Largest displacement (m) and velocity (m/s) of a term's coordinate in the data; `None` if
    /// the parameter is not the coefficient of a term.
    pub largest: Option<[f64; 2]>,
    /// Estimate with its uncertainty.
    #[serde(flatten)]
    pub estimate: Uncertain,
}

/// Levels of distortion, and the kind of term that explains most of the residual of a linear model.
#[derive(Debug, Serialize)]
pub struct DistortionRow {
    /// Level of the distortion on even lines; `None` if even lines are driven.
    pub even: Option<Level>,
    /// Level of the distortion on odd lines without excitation.
    pub odd: Option<Level>,
    /// Part of the force that a linear model does not explain, on the lines of the fit (pure
    /// number).
    pub linear_leaves: f64,
    /// The finding, in a sentence.
    pub text: String,
}

/// Fits records with nonlinear terms. For whole periods it uses least squares on the equation of
/// motion, optionally followed by output error. For open records it uses output error, started from
/// a linear fit. If neither extent nor period is given, records count as open unless a setting
/// needs periods.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &TermFit,
    period_given: bool,
) -> Result<Fitted, AnalysisError> {
    let Nonlinear { candidates, search, weighting, .. } = &how.terms;
    let is_weighted = *weighting != Weighting::default();
    let needs_periods = !candidates.is_empty() || search.delay || search.phase || is_weighted;
    match how.extent {
        Some(Extent::Open) => open_terms::fit(records, unknowns, how),
        None if !period_given && !needs_periods => open_terms::fit(records, unknowns, how),
        None if !period_given => match open_terms::no_period(records)? {
            Some(refusal) => Err(refusal),
            None => fitted(records, unknowns, how),
        },
        _ => fitted(records, unknowns, how),
    }
}

fn fitted(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &TermFit,
) -> Result<Fitted, AnalysisError> {
    let TermFit { terms: how, estimator, lines, .. } = how;
    let rule = lines.rule();
    let first = &records[0].held;
    let (kind, dofs) = (first.response().1, first.force.channels());
    let band = Lines::new(first.force.sampling().with_len(first.period)?, all_lines(first, rule)?)?;
    let mut data = SteadyExperiments::new(&band, dofs, kind);
    for Windowed { held, .. } in records {
        data.push(&held.force, held.response().0)?;
    }
    let mut selection = select(&data, unknowns, how)?;
    let (name, stepped) = stepped(records, *estimator)?;
    let (estimated, white) = estimated(&data, unknowns, how, &stepped, &mut selection)?;
    let experiments: Vec<[&Record; 2]> =
        records.iter().map(|r| [&r.held.force, r.held.response().0]).collect();
    let distortion_levels = distortion(&band, &experiments, kind, unknowns)?;
    let (before, spectra) = driven_spectra(records, &band, rule)?;
    let before_all = match &spectra {
        Some(data) => before_spectral_fit(data, unknowns)?,
        None => Vec::new(),
    };
    let misfit = estimated.misfit();
    let further = FurtherTerms::from_periods(&data, unknowns, how, &stepped, &estimated);
    let (omitted, squared_change) =
        further.map(|further| (further.finding, further.squared_change)).unzip();
    // With several periods, the misfit already compares the residual with the noise of the periods.
    let residuals = match misfit {
        Some(_) => Vec::new(),
        None => white_residuals(records, &white),
    };
    let restoring = estimated.restoring_forces(&data)?.swap_remove(0);
    let linear = estimated.linear().clone();
    Ok(Fitted {
        equations: estimated.equations() / dofs,
        frequency: spectra.map(|data| (band, data)),
        before_all,
        before,
        after: vec![Vec::new(); records.len()],
        after_all: misfit.map(finding).into_iter().chain(omitted).collect(),
        disagreement: Disagreement::new(squared_change, None),
        misfit: misfit
            .map(|misfit| Misfit { ratio: misfit.ratio, noise: "estimated from the periods" }),
        residuals,
        remarks: remarks(first, &estimated),
        nonlinear: Some(WithTerms {
            estimate: estimated,
            distortion: Some(distortion_levels),
            restoring: Some(restoring),
            selection: selection.map(|selection| SelectionSummary::new(selection, how)),
        }),
        ..Fitted::new(Domain::Frequency, name, Prediction::Steady, linear)
    })
}

/// Returns the name of an estimator and the records that it simulates.
fn stepped(
    records: &[Windowed],
    estimator: TermEstimator,
) -> Result<(&'static str, Vec<SteppedRecord>), AnalysisError> {
    Ok(match estimator {
        TermEstimator::EquationError => {
            ("least squares on the equation of motion, in the frequency domain", Vec::new())
        }
        TermEstimator::OutputError => (
            "output error on the mean periods, started from least squares",
            records.iter().map(|record| whole_periods(&record.held)).collect::<Result<_, _>>()?,
        ),
    })
}

fn remarks(first: &Block, estimated: &NonlinearEstimate) -> Vec<String> {
    let mut remarks = one_motion_of(first);
    if estimated.standard_errors() == StandardErrors::White {
        remarks.push(
            "the record is too short to estimate standard errors from the scatter of blocks of time: the \
             standard errors assume a white residual"
                .into(),
        );
    }
    remarks
}

/// Returns the findings on the periods of each record, and the mean spectra of all records on the
/// lines that the force drives.
fn driven_spectra(
    records: &[Windowed],
    band: &Lines,
    rule: LineRule<'_>,
) -> Result<(Vec<Vec<Finding>>, Option<FrequencyData>), AnalysisError> {
    let (mut findings, mut spectra) = (Vec::new(), None::<FrequencyData>);
    for recorded in records {
        let buffered = &recorded.held;
        let chosen = LineRule { choice: &LineChoice::Driven, ..rule }
            .lines(&buffered.force, buffered.period)?;
        let driven = Lines::new(band.sampling(), chosen)?;
        findings.push(steady_periods(&buffered.force, buffered.response().0, buffered.period)?);
        let spectrum = periods(recorded, &driven)?.mean()?;
        spectra = Some(match spectra {
            None => spectrum,
            Some(all) => all.and(&spectrum)?,
        });
    }
    Ok((findings, spectra))
}

/// Selects terms from the candidates; `None` without candidates.
fn select(
    data: &SteadyExperiments,
    unknowns: &Unknowns,
    how: &Nonlinear,
) -> Result<Option<Selection>, AnalysisError> {
    if how.candidates.is_empty() {
        return Ok(None);
    }
    if how.criterion == Criterion::HeldOut && data.count() < HELD_OUT_RECORDS {
        let got = data.count();
        let why = format!(
            "held-out leaves out one record or window at a time, and needs at least {HELD_OUT_RECORDS} records or \
             windows, got {got}"
        );
        return Err(AnalysisError::Setting { setting: "criterion", why });
    }
    let Nonlinear { terms, candidates, criterion, weighting, .. } = how;
    Ok(Some(select_terms(data, unknowns, terms, candidates, *criterion, *weighting)?))
}

/// Returns the residuals of an output-error fit, whitened for the most likely noise, each with the
/// response and the force of its record.
pub(super) fn white_residuals(records: &[Windowed], residuals: &[Record]) -> Vec<Residual> {
    let residual = |(Windowed { held, .. }, samples): (&Windowed, &Record)| {
        Residual::Samples(SampleResidual {
            samples: samples.clone(),
            fitted: held.response().0.clone(),
            force: held.force.clone(),
            noise_span: 0,
        })
    };
    records.iter().zip(residuals).map(residual).collect()
}

fn whole_periods(held: &Block) -> Result<SteppedRecord, AnalysisError> {
    let periods = held.force.len() / held.period;
    let whole = |record: &Record| record.window(0, periods * held.period);
    let (force, response) = (whole(&held.force)?, whole(held.response().0)?);
    Ok(SteppedRecord { force, response, extent: Extent::WholePeriod, periods })
}

/// Estimates the terms, by output error if `stepped` has records. Removes uncertain candidates,
/// because noise on the response biases the least squares that selected them. Also returns the
/// residuals of output error; this list is empty for least squares, because its residual is a force
/// and not a response.
pub(super) fn estimated(
    data: &SteadyExperiments,
    unknowns: &Unknowns,
    how: &Nonlinear,
    stepped: &[SteppedRecord],
    selection: &mut Option<Selection>,
) -> Result<(NonlinearEstimate, Vec<Record>), AnalysisError> {
    let options = EquationErrorOptions { weighting: how.weighting, shape: how.search };
    loop {
        let terms = selection.as_ref().map_or(&how.terms, |selection| &selection.terms);
        let start = equation_error(data, unknowns, terms, &options)?;
        let (estimate, residuals) = match stepped {
            [] => (start, Vec::new()),
            _ => {
                // The constants inside the laws may differ much from their given values. A second
                // start therefore uses estimates of these constants.
                let shape = ShapeConstants { laws: true, ..how.search };
                let has_constants = |term: &Term| !term.law().constants().is_empty();
                let is_open = !how.search.laws && terms.iter().any(has_constants);
                let options = EquationErrorOptions { shape, ..options };
                let from_equation_error =
                    is_open.then(|| equation_error(data, unknowns, terms, &options).ok());
                let starts: Vec<_> =
                    [start].into_iter().chain(from_equation_error.flatten()).collect();
                let fit = best_output_error(stepped, data.measured(), &starts)?;
                (fit.estimate, fit.residuals)
            }
        };
        let uncertain = match how.criterion {
            Criterion::Information => least_certain(&estimate, &how.candidates)?,
            Criterion::HeldOut => None,
        };
        match (selection.as_mut(), uncertain) {
            (Some(selection), Some(name)) => selection.remove(name)?,
            _ => return Ok((estimate, residuals)),
        }
    }
}

/// Returns the check of the residual against the noise of the periods.
fn finding(misfit: mechid_nonlinear::Misfit) -> Finding {
    Finding::Misfit(mechid_checks::Misfit {
        ratio: misfit.ratio,
        p_value: PValue::new(misfit.p_value),
        source: NoiseSource::Periods,
        concentration: None,
    })
}

impl NonlinearSummary {
    pub(super) fn from_fit(fitted: &WithTerms) -> Result<Self, AnalysisError> {
        let WithTerms { estimate: fit, distortion, selection, .. } = fitted;
        let linear = fit.linear().parameters().len();
        let ranges = fit.ranges().iter().map(|range| Some(*range));
        let rows = fit.parameters()[linear..].iter().zip(ranges.chain(std::iter::repeat(None)));
        let row = |(parameter, largest): (&mechid_nonlinear::NamedParameter, _)| {
            let estimate = Uncertain::from_estimate(&parameter.estimate)?;
            let (name, unit) = (parameter.name.clone(), parameter.unit.clone());
            Ok(TermRow { name, unit, largest, estimate })
        };
        Ok(Self {
            terms: fit.terms().clone(),
            coefficients: fit.system()?.coefficients().to_vec(),
            channels: fit.channels(),
            parameters: rows.map(row).collect::<Result<_, AnalysisError>>()?,
            weighting: fit.weighting(),
            blocks: match fit.standard_errors() {
                StandardErrors::Blocks(count) => Some(count),
                _ => None,
            },
            periods: match fit.standard_errors() {
                StandardErrors::Periods(count) => Some(count),
                _ => None,
            },
            distortion: distortion.as_ref().map(|distortion| DistortionRow {
                even: distortion.even,
                odd: distortion.odd,
                linear_leaves: distortion.linear_unexplained,
                text: distortion.to_string(),
            }),
            extrapolation: fit.extrapolations()?.into_iter().map(ExtrapolationRow::new).collect(),
            selection: selection.clone(),
        })
    }

    /// Returns the finding before the fit, the selection of terms and, for each term, the largest
    /// amplitudes in the data; a prediction for larger amplitudes extrapolates the term.
    pub fn text(&self) -> String {
        let before = self.distortion.as_ref();
        let mut text =
            before.map(|row| format!("before the fit: {}\n", row.text)).unwrap_or_default();
        text += &self.selection.as_ref().map(SelectionSummary::text).unwrap_or_default();
        for row in &self.parameters {
            if let Some([x, v]) = row.largest {
                let (x, v) = (significant(x, 3), significant(v, 3));
                text += &format!(
                    "{}: data up to {x} m, {v} m/s; beyond this range, extrapolated\n",
                    row.name
                );
            }
        }
        text
    }
}
