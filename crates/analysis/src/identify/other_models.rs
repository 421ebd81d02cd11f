//! Alternative models for tables of frequency responses: delay, structural damping, another
//! quantity, levels in dB.

use std::f64::consts::PI;

use mechid_checks::{
    Alternative, Cause, Finding, ModelledResponses, better_model, delay_of_responses,
};
use mechid_estimate::frequency_domain::{
    equation_error, output_error_of_table, output_error_pooling, structural_damping,
};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_io::FrequencyResponses;
use mechid_model::ResponseQuantity;
use mechid_numerics::time_limit;
use mechid_spectra::{FrequencyData, Pooling};
use nalgebra::{Complex, DMatrix};

use super::disagreement::outer_product_of_change;
use super::response_settings::IdentifyResponses;
use super::tabulated::{Tabulated, joined};
use super::thinned;
use crate::AnalysisError;
use crate::limits::CAUSE_OPERATIONS;

/// Number of rounds, each with an estimate of the delay and a fit with this delay.
const DELAY_ROUNDS: usize = 2;

/// Decibels per unit of the natural logarithm of a magnitude.
const DECIBELS: f64 = 20.0 / std::f64::consts::LN_10;

/// Largest level, in dB, that is converted to a magnitude; a larger number is not a level.
const MAX_LEVEL: f64 = 400.0;

/// Returns the model that explains the responses of tables far better than the `result` from their
/// `data`, if there is such a model: with a delay, with structural damping, for another measured
/// quantity, or for magnitudes given as levels.
///
/// If the tables have many lines, the models are fitted to fewer lines first. Most tables have no
/// better model, and a wrong model takes the longest to fit.
pub(super) fn better_model_of(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    data: &FrequencyData,
    result: &Estimate,
) -> Option<BetterModel> {
    if let Some(fewer) = thinned::for_models(tables, how, data, result.unknowns())
        && let Ok(data) = on_lines_of(&fewer, how)
    {
        better_model_on(&fewer, how, &data, result)?;
    }
    better_model_on(tables, how, data, result)
}

/// Returns the failure of a search. Adds a reason if the values of the tables seem to be responses
/// of another quantity, or levels in dB: a fit to these responses must explain them far better than
/// least squares explains the responses as stated. If the tables have many lines, only some of the
/// lines are fitted.
pub(super) fn with_better_model(
    failure: AnalysisError,
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> AnalysisError {
    let is_ended = time_limit::ended().is_some();
    let error = match failure {
        AnalysisError::Estimate(error @ EstimateError::NotConverged { .. }) => error,
        AnalysisError::Estimate(error) if is_ended => error,
        failure => return failure,
    };
    let better = time_limit::apart(CAUSE_OPERATIONS, || {
        let fewer = thinned::for_models(tables, how, data, unknowns)
            .and_then(|fewer| Some((on_lines_of(&fewer, how).ok()?, fewer)));
        let (data, tables) = match &fewer {
            Some((data, fewer)) => (data, &fewer[..]),
            None => (data, tables),
        };
        other_model(tables, how, data, &equation_error(data, unknowns).ok()?)
    });
    match better {
        Some(Other {
            cause: cause @ (Cause::Quantity { .. } | Cause::Decibels),
            remaining,
            ..
        }) => {
            let finding = Finding::Alternative(Alternative { cause, remaining });
            AnalysisError::Unfit { error, reasons: finding.to_string() }
        }
        _ => error.into(),
    }
}

/// Returns the responses of tables as data for a fit.
fn on_lines_of(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<FrequencyData, AnalysisError> {
    let measured = tables.iter().map(|table| Tabulated::new(table, how));
    joined(&measured.collect::<Result<Vec<_>, _>>()?)
}

/// Returns the model that explains the `data` far better than the `result`.
fn better_model_on(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    data: &FrequencyData,
    result: &Estimate,
) -> Option<BetterModel> {
    let likely = output_error_pooling(data, result.unknowns(), Pooling::AllLines).ok();
    let estimate = likely.as_ref().map_or(result, |likely| &likely.estimate);
    let Other { cause, remaining, mut estimate } = other_model(tables, how, data, estimate)?;
    if let Cause::Delay { seconds } = cause {
        // The fit keeps the weights of the result, so that only the delay changes the parameters.
        let late = data.with_later_force(seconds);
        estimate = output_error_of_table(&late, result.unknowns()).ok().map(|fit| fit.estimate);
    }
    let change = estimate.map(|estimate| outer_product_of_change(result, &estimate));
    let finding = Finding::Alternative(Alternative { cause, remaining });
    Some(BetterModel { finding, remaining, change })
}

/// A model that explains the responses far better than an estimate.
struct Other {
    cause: Cause,
    /// Fraction of the residual power that remains with this model.
    remaining: f64,
    /// Estimate with this model. `None` for structural damping, whose parameters have another
    /// meaning, and for a delay, which `better_model_on` fits again.
    estimate: Option<Estimate>,
}

/// Returns the model that explains the `data` far better than an `estimate` from them.
fn other_model(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    data: &FrequencyData,
    estimate: &Estimate,
) -> Option<Other> {
    let fitted = modelled(data, data, estimate)?;
    let (mut others, mut models) = (Vec::new(), Vec::new());
    let mut add = |cause, model, estimate: Option<Estimate>| {
        others.push((cause, estimate));
        models.push(model);
    };
    if let Some((seconds, fit)) = delayed(data, estimate)
        && let Some(model) = modelled(data, &data.with_later_force(seconds), &fit)
    {
        add(Cause::Delay { seconds }, model, None);
    }
    if let Some(fit) = structural_damping(data, estimate.unknowns()) {
        let model = in_measured_quantity(data, &fit.displacement);
        let model = ModelledResponses { modelled: model, ..fitted.clone() };
        add(Cause::StructuralDamping { loss_factor: fit.loss_factor }, model, None);
    }
    if tables.iter().all(|table| table.added_decay.is_none()) {
        let stated = data.measured();
        for quantity in ResponseQuantity::ALL.into_iter().filter(|other| *other != stated) {
            if let Some((fit, model)) = refitted(tables, how, quantity, estimate) {
                add(Cause::Quantity { quantity, stated }, model, Some(fit));
            }
        }
        for sign in [1.0, -1.0] {
            if let Some((fit, model)) = level_responses(tables, how, stated, estimate, sign) {
                add(Cause::Decibels, model, Some(fit));
            }
        }
    }
    let deviation = deviation(data);
    let (best, remaining) = better_model(data.omega(), deviation.as_ref(), &fitted, &models)?;
    let (cause, estimate) = others.swap_remove(best);
    Some(Other { cause, remaining, estimate })
}

/// A model that explains the responses far better.
pub(super) struct BetterModel {
    pub(super) finding: Finding,
    /// Fraction of the residual power that remains with this model.
    pub(super) remaining: f64,
    /// Outer product Δ Δᵀ of the vector Δ of the parameter changes that this model causes
    /// (parameters × parameters), in the product of the units of two parameters. `None` if the
    /// parameters of this model have another meaning.
    pub(super) change: Option<DMatrix<f64>>,
}

/// Converts displacements to the measured quantity.
fn in_measured_quantity(
    data: &FrequencyData,
    displacement: &DMatrix<Complex<f64>>,
) -> DMatrix<Complex<f64>> {
    let unit = |row: usize| data.measured().per_displacement(data.omega()[row]);
    DMatrix::from_fn(data.len(), data.dof(), |row, channel| {
        displacement[(row, channel)] * unit(row)
    })
}

/// Returns the measured responses of `data`, and the responses of `estimate` to the forces of
/// `forces`.
pub(super) fn modelled(
    data: &FrequencyData,
    forces: &FrequencyData,
    estimate: &Estimate,
) -> Option<ModelledResponses> {
    let system = estimate.system().ok()?;
    let mut displacement = DMatrix::zeros(data.len(), data.dof());
    for (row, omega) in data.omega().iter().enumerate() {
        let force = forces.force().row(row).transpose();
        let response = system.receptance(*omega).ok()? * force;
        displacement.row_mut(row).copy_from(&response.transpose());
    }
    Some(ModelledResponses {
        measured: in_measured_quantity(data, data.displacement()),
        modelled: in_measured_quantity(data, &displacement),
        log_area: 0.0,
    })
}

/// Returns the standard deviation of the noise of each response in the measured quantity; `None` if
/// it is unknown or zero.
fn deviation(data: &FrequencyData) -> Option<DMatrix<f64>> {
    let noise = data.noise()?;
    let deviation = DMatrix::from_fn(data.len(), data.dof(), |row, channel| {
        let unit = data.measured().per_displacement(data.omega()[row]).norm();
        noise.covariance(row)[(channel, channel)].re.sqrt() * unit
    });
    deviation.iter().all(|deviation| *deviation > 0.0).then_some(deviation)
}

/// Returns the delay of the best fit, in s, and this fit.
fn delayed(data: &FrequencyData, estimate: &Estimate) -> Option<(f64, Estimate)> {
    let (mut fit, mut seconds) = (estimate.clone(), 0.0);
    for _ in 0..DELAY_ROUNDS {
        seconds = delay_of_responses(data, estimate.unknowns(), &fit)?;
        let late = data.with_later_force(seconds);
        fit = output_error_pooling(&late, estimate.unknowns(), Pooling::AllLines).ok()?.estimate;
    }
    Some((seconds, fit))
}

/// Returns a fit to the tables in which every value counts as a response of `quantity`. Also
/// returns the measured and the fitted responses.
fn refitted(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    quantity: ResponseQuantity,
    estimate: &Estimate,
) -> Option<(Estimate, ModelledResponses)> {
    let how = IdentifyResponses { quantity: Some(quantity), ..how.clone() };
    let one = |table: &FrequencyResponses| {
        let mut modified = table.clone();
        modified.functions.iter_mut().for_each(|function| function.quantity = Some(quantity));
        Tabulated::new(&modified, &how).ok()
    };
    let measured = tables.iter().map(one).collect::<Option<Vec<_>>>()?;
    let data = joined(&measured).ok()?;
    let fit = output_error_pooling(&data, estimate.unknowns(), Pooling::AllLines).ok()?;
    let model = modelled(&data, &data, &fit.estimate)?;
    Some((fit.estimate, model))
}

/// Returns a fit to the tables in which every magnitude counts as a level in dB. Also returns the
/// measured and the fitted responses. The mean level of the first function has the given `sign`.
fn level_responses(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
    quantity: ResponseQuantity,
    estimate: &Estimate,
    sign: f64,
) -> Option<(Estimate, ModelledResponses)> {
    let values = || tables.iter().flat_map(|table| &table.functions).flat_map(|f| &f.values);
    if values().any(|z| z.norm() > MAX_LEVEL) {
        return None;
    }
    let mut first = None;
    let mut converted = |table: &FrequencyResponses| {
        let mut table = FrequencyResponses { coherence: Vec::new(), ..table.clone() };
        for function in &mut table.functions {
            function.standard_error = None;
            let levels = levels(&function.values);
            let mean = levels.iter().sum::<f64>() / levels.len() as f64;
            // The functions of one machine have similar levels, so the mean level of each function
            // gets the sign that brings it nearer to the mean level of the first function.
            let first = *first.get_or_insert(sign * mean);
            let sign = if (mean - first).abs() <= (mean + first).abs() { 1.0 } else { -1.0 };
            let pairs = function.values.iter_mut().zip(levels);
            pairs.for_each(|(z, level)| *z = magnitude(*z, sign * level));
        }
        table
    };
    let tables: Vec<FrequencyResponses> = tables.iter().map(&mut converted).collect();
    let (fit, model) = refitted(&tables, how, quantity, estimate)?;
    let log_area = |z: &Complex<f64>| {
        let level = (DECIBELS * z.norm().ln()).abs();
        if level > 0.0 { (z.norm_sqr() / (DECIBELS * level)).ln() } else { 0.0 }
    };
    let log_area = model.measured.iter().map(log_area).sum();
    Some((fit, ModelledResponses { log_area, ..model }))
}

/// Converts a value `z`, whose magnitude is the absolute value of `level` (dB), to a response. If
/// the level is negative, the phase of `z` contains a shift of π, and this shift is removed.
fn magnitude(z: Complex<f64>, level: f64) -> Complex<f64> {
    let turn = if level < 0.0 { PI } else { 0.0 };
    Complex::from_polar((level / DECIBELS).exp(), z.arg() + turn)
}

/// Returns levels in dB, with their signs. The magnitudes of `values` are the absolute values of
/// these levels; a negative level appears as a phase shift of π. The sign of the first level is
/// unknown and taken as positive. Each further level gets the sign with which the logarithm of the
/// response changes less from the previous line.
fn levels(values: &[Complex<f64>]) -> Vec<f64> {
    let mut sign = 1.0;
    let mut levels: Vec<f64> = values.iter().map(|z| z.norm()).collect();
    for (at, pair) in values.windows(2).enumerate() {
        let [before, after] = [pair[0].norm() / DECIBELS, pair[1].norm() / DECIBELS];
        let turned = |z: Complex<f64>| (z * pair[0].conj()).arg();
        let same = (after - before).hypot(turned(pair[1]));
        let opposite = (after + before).hypot(turned(-pair[1]));
        if opposite < same {
            sign = -sign;
        }
        levels[at + 1] *= sign;
    }
    levels
}
