//! Intervals from the profile likelihood.

use super::fit::Fit;
use super::limits::STEPS;
use super::response_model::ResponseModel;
use super::search::{Bounds, minimise};

/// Maximum number of doublings of the distance in the search for the limit of an interval.
const DOUBLINGS: usize = 24;
/// Maximum number of bisections for the limit of an interval.
const HALVINGS: usize = 20;
/// Relative deviation from the required rise of the sum of squares that ends the bisection.
const TOLERANCE: f64 = 1e-3;

/// Returns the limit of an interval of a parameter below (`direction` −1) or above (+1) its
/// estimate: the value with a sum of squares, minimised over all other parameters, that is larger
/// by `rise`. It is the bound if the bound is nearer, and infinite if the sum never rises by
/// `rise`.
///
/// # Source
/// Venzon & Moolgavkar (1988), Applied Statistics 37, 87–94; Raue et al. (2009), Bioinformatics 25,
/// 1923–1929.
pub(super) fn end<M: ResponseModel>(
    fit: &Fit<'_, M>,
    parameter: usize,
    direction: f64,
    first: f64,
    rise: f64,
) -> f64 {
    let estimate = fit.minimum.parameters[parameter];
    let bounds = &fit.space.bounds;
    let limit = if direction < 0.0 { bounds.min[parameter] } else { bounds.max[parameter] };
    let mut from = fit.minimum.parameters.clone();
    let mut excess = |value: f64| -> Option<f64> {
        let mut fixed: Bounds = bounds.clone();
        (fixed.min[parameter], fixed.max[parameter]) = (value, value);
        from[parameter] = value;
        let minimum = minimise(&fit.residual(), &fixed, &from, STEPS)?;
        let excess = minimum.cost - fit.minimum.cost - rise;
        from = minimum.parameters;
        Some(excess)
    };
    let (mut inside, mut step) = (estimate, first.abs().max(f64::MIN_POSITIVE));
    let mut outside = None;
    for _ in 0..DOUBLINGS {
        let value = estimate + direction * step;
        let beyond = if direction < 0.0 { value <= limit } else { value >= limit };
        let value = if beyond { limit } else { value };
        match excess(value) {
            Some(excess) if excess < 0.0 && beyond => return limit,
            Some(excess) if excess < 0.0 => inside = value,
            // The likelihood is zero if the response does not exist.
            _ => {
                outside = Some(value);
                break;
            }
        }
        step *= 2.0;
    }
    let Some(mut outside) = outside else { return direction * f64::INFINITY };
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        match excess(middle) {
            Some(excess) if excess.abs() <= TOLERANCE * rise => return middle,
            Some(excess) if excess < 0.0 => inside = middle,
            _ => outside = middle,
        }
    }
    0.5 * (inside + outside)
}
