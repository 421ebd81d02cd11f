//! Responses that are those of another quantity than stated.

use std::slice::from_ref;

use mechid_checks::limits::DELAY_REMAINING;
use mechid_checks::{Alternative, Cause, Finding, better_model};
use mechid_estimate::frequency_domain::{equation_error, output_error_pooling, thin_step};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_spectra::{FrequencyData, Pooling};

use super::other_models::modelled;

/// Returns the finding that another quantity explains the responses of open records far better than
/// the stated one: at most a quarter of the residual power remains, and this residual is
/// uncorrelated from line to line. `data` are the records without errors of pulses; `closed` are
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
    let others = ResponseQuantity::ALL.into_iter().filter(|quantity| *quantity != stated);
    let fits = others.filter_map(|quantity| Some((quantity, fitted_as(quantity)?)));
    let (quantities, models): (Vec<_>, Vec<_>) = fits.unzip();
    let best = better_model(data.omega(), None, &fitted, &models);
    let is_right = |(best, remaining): &(usize, f64)| {
        *remaining <= DELAY_REMAINING && models[*best].is_white(data.omega(), None)
    };
    let (best, remaining) = best.filter(is_right)?;
    let cause = Cause::RecordedQuantity { quantity: quantities[best], stated };
    Some(Finding::Alternative(Alternative { cause, remaining }))
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
