//! Fits of whole periods with nonlinear terms beside M, C and K.

use mechid_checks::{Finding, Verdict, before_spectral_fit, steady_periods};
use mechid_estimate::Unknowns;
use mechid_model::Terms;
use mechid_nonlinear::{
    ChannelPhase, Criterion, EquationErrorOptions, Extrapolation, Level, REACH, Selection,
    StandardErrors, SteadyExperiments, SteppedRecord, Weighting, distortion, equation_error,
    output_error, select_terms,
};
use mechid_signal::{Extent, Record};
use mechid_spectra::{FrequencyData, Lines};
use serde::Serialize;

use super::fitted::{Fitted, Residual, SampleResidual, WithTerms};
use super::keywords::Domain;
use super::left_out::{LineRule, all_lines};
use super::lines::LineChoice;
use super::options::{Nonlinear, TermEstimator, TermFit};
use super::prediction::{Model, Prediction};
use super::remarks::one_motion_of;
use super::rows::Uncertain;
use super::selection::SelectionSummary;
use super::spectra::periods;
use crate::AnalysisError;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Records or windows, at least, of which each is left out once to judge a candidate.
const HELD_OUT_RECORDS: usize = 3;

/// Nonlinear terms of an identified system, which [`Machine::read`](crate::Machine::read) reads back.
#[derive(Debug, Serialize)]
pub struct NonlinearSummary {
    /// Terms as they are written, with the constants found inside them.
    pub terms: Terms,
    /// Coefficients, one for each term, in its unit.
    pub coefficients: Vec<f64>,
    /// Delay and phase of the channels; zero unless they were searched for.
    pub channels: ChannelPhase,
    /// Parameters beside those of M, C and K, with their uncertainty.
    pub parameters: Vec<TermRow>,
    /// Weighting of the lines that was used.
    pub weighting: Weighting,
    /// Number of blocks of time whose scatter gives the standard errors; `None` if the residual was
    /// taken as white.
    pub blocks: Option<usize>,
    /// Evidence against a linear system in the first record, before any model.
    pub distortion: DistortionRow,
    /// Growth of each term, constant forces apart, beyond the data.
    pub extrapolation: Vec<ExtrapolationRow>,
    /// Selection of terms; `None` where there were no candidates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub selection: Option<SelectionSummary>,
}

/// Restoring force in the equation of motion of a term, at the edge of the data and 1.5 times as far.
#[derive(Debug, Clone, Serialize)]
pub struct ExtrapolationRow {
    /// Name of the term.
    pub term: String,
    /// Power with which its force grows there, a pure number.
    pub order: f64,
    /// Part of the restoring force that the term makes, at the two places; ratios.
    pub share: [f64; 2],
    /// Standard error of the restoring force over the restoring force, at the two places; ratios.
    pub relative_error: [f64; 2],
    /// `true` if predictions beyond the data are not to be relied on.
    pub poor: bool,
}

impl ExtrapolationRow {
    fn of(found: Extrapolation) -> Self {
        let poor = found.is_poor();
        let Extrapolation { term, order, relative_error, share } = found;
        Self { term, order, share, relative_error, poor }
    }

    /// Returns what speaks against extrapolation, in a sentence; `None` if nothing does.
    pub(super) fn doubt(&self) -> Option<String> {
        let percent = |ratio: f64| format!("{} %", significant(100.0 * ratio, 2));
        let [near, far] = self.share.map(percent);
        let (term, order) = (&self.term, significant(self.order, 2));
        let error = percent(self.relative_error[1]);
        self.poor.then(|| {
            format!(
                "{term} extrapolates badly: its force grows with the power {order}, from {near} of the \
                 restoring force at the edge of the data to {far} at {REACH} times as far, where the \
                 standard error of that force is {error}. Do not predict beyond the amplitudes measured"
            )
        })
    }
}

/// One parameter beside those of M, C and K.
#[derive(Debug, Serialize)]
pub struct TermRow {
    /// Name of a term, `c3.b` for the constant b inside a term, `delay`, `p3` or `p5`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Largest displacement (m) and velocity (m/s) of a term's coordinate in the data; `None` for
    /// what is no coefficient of a term.
    pub largest: Option<[f64; 2]>,
    /// Estimate with its uncertainty.
    #[serde(flatten)]
    pub estimate: Uncertain,
}

/// Levels of distortion, and the kind of term that a linear model lacks most.
#[derive(Debug, Serialize)]
pub struct DistortionRow {
    /// Level on even lines, where odd ones alone are driven.
    pub even: Option<Level>,
    /// Level on odd lines that are not driven.
    pub odd: Option<Level>,
    /// Part of the force that a linear model leaves on the lines (pure number).
    pub linear_leaves: f64,
    /// The finding, in a sentence.
    pub text: String,
}

/// Fits whole periods of one or several records of the same period with nonlinear terms: by least
/// squares on the equation of motion, or from there by output error.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &TermFit,
) -> Result<Fitted, AnalysisError> {
    fitted(records, unknowns, how).map_err(|error| match error {
        AnalysisError::Setting { .. } => error,
        other => no_period(records).unwrap_or(other),
    })
}

fn fitted(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &TermFit,
) -> Result<Fitted, AnalysisError> {
    let TermFit { terms: how, estimator, lines } = how;
    let rule = lines.rule();
    let first = &records[0].held;
    let (kind, dofs) = (first.response().1, first.force.channels());
    let band = Lines::new(first.force.sampling().with_len(first.period)?, all_lines(first, rule)?)?;
    let mut data = SteadyExperiments::new(&band, dofs, kind);
    for Windowed { held, .. } in records {
        data.push(&held.force, held.response().0)?;
    }
    let options = EquationErrorOptions { weighting: how.weighting, shape: how.search };
    let selection = select(&data, unknowns, how)?;
    let terms = selection.as_ref().map_or(&how.terms, |selection| &selection.terms);
    let start = equation_error(&data, unknowns, terms, &options)?;
    let (estimator, estimated) = match estimator {
        TermEstimator::EquationError => {
            ("least squares on the equation of motion, in the frequency domain", start)
        }
        TermEstimator::OutputError => {
            let stepped: Vec<SteppedRecord> =
                records.iter().map(|r| mean_period(&r.held)).collect::<Result<_, _>>()?;
            let estimate = output_error(&stepped, kind, &start)?.estimate;
            ("output error on the mean periods, started from least squares", estimate)
        }
    };
    let experiments: Vec<[&Record; 2]> =
        records.iter().map(|r| [&r.held.force, r.held.response().0]).collect();
    let seen = distortion(&band, &experiments, kind, unknowns)?;
    let model = Model::Nonlinear { system: estimated.system()?, channels: estimated.channels() };
    let (before, spectra) = driven_spectra(records, &band, rule)?;
    let before_all = match &spectra {
        Some(data) => before_spectral_fit(data, unknowns)?,
        None => Vec::new(),
    };
    let mut remarks = one_motion_of(first);
    if estimated.standard_errors() == StandardErrors::White {
        remarks.push(
            "the record is too short for standard errors from the scatter of blocks of time: they \
             take the residual as white"
                .into(),
        );
    }
    let restoring = estimated.restoring_forces(&data)?.swap_remove(0);
    let linear = estimated.linear().clone();
    Ok(Fitted {
        equations: estimated.equations() / dofs,
        frequency: spectra.map(|data| (band, data)),
        before_all,
        before,
        after: vec![Vec::new(); records.len()],
        residuals: steady_residuals(records, &model)?,
        remarks,
        nonlinear: Some(WithTerms {
            estimate: estimated,
            distortion: seen,
            restoring,
            selection: selection.map(|selection| SelectionSummary::of(selection, how)),
        }),
        ..Fitted::new(Domain::Frequency, estimator, Prediction::Steady, linear)
    })
}

/// Returns the findings on the periods of each record, and their mean spectra on the lines that the force drives, of all
/// records together.
fn driven_spectra(
    records: &[Windowed],
    band: &Lines,
    rule: LineRule<'_>,
) -> Result<(Vec<Vec<Finding>>, Option<FrequencyData>), AnalysisError> {
    let (mut findings, mut spectra) = (Vec::new(), None::<FrequencyData>);
    for recorded in records {
        let held = &recorded.held;
        let chosen =
            LineRule { choice: &LineChoice::Driven, ..rule }.lines(&held.force, held.period)?;
        let driven = Lines::new(band.sampling(), chosen)?;
        findings.push(steady_periods(&held.force, held.response().0, held.period)?);
        let spectrum = periods(recorded, &driven)?.mean()?;
        spectra = Some(match spectra {
            None => spectrum,
            Some(all) => all.and(&spectrum)?,
        });
    }
    Ok((findings, spectra))
}

/// Returns the reason why a fit fails whose window is taken for one period and does not look like one.
fn no_period(records: &[Windowed]) -> Option<AnalysisError> {
    records.iter().find_map(|Windowed { held, .. }| {
        let looked = steady_periods(&held.force, held.response().0, held.period).ok()?;
        let is_none = held.period == held.force.len()
            && looked.iter().any(|finding| finding.verdict() > Verdict::Good);
        is_none.then(|| AnalysisError::Setting {
            setting: "nonlinear",
            why: format!(
                "nonlinear terms are fitted to whole periods, and {} is none: its end does not meet its beginning",
                held.file
            ),
        })
    })
}

/// Chooses among the candidates; `None` where there are none.
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
            "held-out needs {HELD_OUT_RECORDS} records or windows or more, each left out once, got {got}"
        );
        return Err(AnalysisError::Setting { setting: "criterion", why });
    }
    let Nonlinear { terms, candidates, criterion, weighting, .. } = how;
    Ok(Some(select_terms(data, unknowns, terms, candidates, *criterion, *weighting)?))
}

/// Returns, record by record, the part of the response that the steady state under the measured force
/// leaves, means apart.
fn steady_residuals(records: &[Windowed], model: &Model) -> Result<Vec<Residual>, AnalysisError> {
    let mut residuals = Vec::new();
    for Windowed { held, .. } in records {
        let fitted = held.response().0.without_mean();
        let predicted = Prediction::Steady.predict(model, held)?.swap_remove(0).predicted;
        residuals.push(Residual::Samples(SampleResidual {
            samples: Record::new(fitted.sampling(), fitted.data() - predicted.data())?,
            fitted,
            force: held.force.clone(),
            noise_span: 0,
        }));
    }
    Ok(residuals)
}

fn mean_period(held: &Block) -> Result<SteppedRecord, AnalysisError> {
    Ok(SteppedRecord {
        force: held.force.period_mean(held.period)?,
        response: held.response().0.period_mean(held.period)?,
        extent: Extent::WholePeriod,
    })
}

impl NonlinearSummary {
    pub(super) fn of(fitted: &WithTerms) -> Result<Self, AnalysisError> {
        let WithTerms { estimate: fit, distortion, selection, .. } = fitted;
        let linear = fit.linear().parameters().len();
        let ranges = fit.ranges().iter().map(|range| Some(*range));
        let rows = fit.parameters()[linear..].iter().zip(ranges.chain(std::iter::repeat(None)));
        let row = |(parameter, largest): (&mechid_nonlinear::NamedParameter, _)| {
            let estimate = Uncertain::of(&parameter.estimate)?;
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
                StandardErrors::White => None,
            },
            distortion: DistortionRow {
                even: distortion.even,
                odd: distortion.odd,
                linear_leaves: distortion.linear_leaves,
                text: distortion.to_string(),
            },
            extrapolation: fit.extrapolations()?.into_iter().map(ExtrapolationRow::of).collect(),
            selection: selection.clone(),
        })
    }

    /// Returns the findings before the fit and the amplitudes that hold the terms, a sentence each.
    pub(super) fn text(&self) -> String {
        let mut text = format!("before the fit: {}\n", self.distortion.text);
        text += &self.selection.as_ref().map(SelectionSummary::text).unwrap_or_default();
        for row in &self.parameters {
            if let Some([x, v]) = row.largest {
                let (x, v) = (significant(x, 3), significant(v, 3));
                text += &format!("{}: data up to {x} m, {v} m/s; beyond extrapolated\n", row.name);
            }
        }
        text
    }
}
