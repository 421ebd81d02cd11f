//! Responses that are those of another quantity than stated.

use std::slice::from_ref;

use mechid_checks::limits::DELAY_REMAINING;
use mechid_checks::{Alternative, Cause, Finding, ModelledResponses, better_model};
use mechid_estimate::frequency_domain::{equation_error, output_error_pooling, thin_step};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_spectra::{FrequencyData, Pooling};
use nalgebra::{Complex, DMatrix, DVectorView};

use super::other_models::modelled;

/// Returns the finding that another quantity explains the responses of open records far better than
/// the stated one: at most a quarter of the residual power remains, and this residual is
/// noise. `data` are the records without errors of pulses; `closed` are
/// the same lines without their transients, and `estimate` is the estimate from them.
///
/// Every quantity, the stated one included, is fitted to the same lines by maximum likelihood with
/// white noise; long records are fitted on a part of their lines. If the search for the stated
/// quantity fails, the given estimate replaces its result.
///
/// # Source
/// That of [`better_model`].
pub(super) fn other_quantity(
    data: &FrequencyData,
    closed: &FrequencyData,
    estimate: &Estimate,
) -> Option<Finding> {
    let unknowns = estimate.unknowns();
    let step = thin_step(data, unknowns).max(1);
    let (data, closed) = (data.thinned(step)?, closed.thinned(step)?);
    let stated = data.measured();
    let fitted_as = |quantity: ResponseQuantity| {
        let taken = data.taken_as(quantity);
        let fit = output_error_pooling(&taken, unknowns, Pooling::AllLines).ok()?;
        let closed = match &fit.ends {
            Some(ends) => ends.without_transients(from_ref(&taken)).ok()?.remove(0),
            None => taken,
        };
        modelled(&closed, &closed, &fit.estimate)
    };
    let fitted = fitted_as(stated).or_else(|| modelled(&closed, &closed, estimate))?;
    let not_stated = ResponseQuantity::ALL.into_iter().filter(|quantity| *quantity != stated);
    let fits = not_stated.filter_map(|quantity| Some((quantity, fitted_as(quantity)?)));
    let (quantities, models): (Vec<_>, Vec<_>) = fits.unzip();
    let best = better_model(data.omega(), None, &fitted, &models);
    let is_right = |(best, remaining): &(usize, f64)| {
        *remaining <= DELAY_REMAINING && leaves_noise(&models[*best], &data)
    };
    let (best, remaining) = best.filter(is_right)?;
    let cause = Cause::RecordedQuantity { quantity: quantities[best], stated };
    Some(Finding::Alternative(Alternative { cause, remaining }))
}

/// Returns whether the residual of a model is uncorrelated from line to line, also relative to the
/// phase of each force: the phases of a random force make the error of a wrong model, which is
/// smooth relative to the force, look uncorrelated.
fn leaves_noise(model: &ModelledResponses, data: &FrequencyData) -> bool {
    let in_phase_with = |force: DVectorView<'_, Complex<f64>>| {
        let turned = |responses: &DMatrix<Complex<f64>>| {
            let mut turned = responses.clone();
            for (mut row, force) in turned.row_iter_mut().zip(&force) {
                row *= force.conj() / force.norm();
            }
            turned
        };
        ModelledResponses {
            measured: turned(&model.measured),
            modelled: turned(&model.modelled),
            log_area: model.log_area,
        }
    };
    let acts = |force: &DVectorView<'_, Complex<f64>>| force.iter().all(|z| z.norm() > 0.0);
    let forces = data.force().column_iter().filter(acts);
    model.is_white(data.omega(), None)
        && forces.map(in_phase_with).all(|turned| turned.is_white(data.omega(), None))
}

/// Returns the finding of [`other_quantity`] if there is no estimate, because the search has
/// failed: the other quantities are compared with least squares on the equation of motion.
pub(super) fn quantity_of_failed_search(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Option<Finding> {
    let estimate = equation_error(data, unknowns).ok()?;
    other_quantity(data, data, &estimate)
}
