//! Intervals from the profile likelihood.

use super::fit::Fit;
use super::limits::STEPS;
use super::response_model::ResponseModel;
use super::search::{Bounds, minimise};

/// Maximum number of steps away from the estimate until the sum of squares has risen enough.
const OUTWARD_STEPS: usize = 24;
/// Smallest and largest factor from one distance to the next on the way out.
const OUTWARD: [f64; 2] = [1.5, 8.0];
/// Maximum number of steps between two sides of the limit.
const INWARD_STEPS: usize = 20;
/// Relative deviation from the required rise of the sum of squares that ends the search.
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
    // The square root of the rise is about linear in the distance from the estimate. It is infinite
    // where the response does not exist, because the likelihood is zero there.
    let needed = rise.sqrt();
    let mut root_of_rise = |value: f64| -> f64 {
        let mut fixed: Bounds = bounds.clone();
        (fixed.min[parameter], fixed.max[parameter]) = (value, value);
        from[parameter] = value;
        let Some(minimum) = minimise(&fit.residual(), &fixed, &from, STEPS) else {
            return f64::INFINITY;
        };
        from = minimum.parameters;
        (minimum.cost - fit.minimum.cost).max(0.0).sqrt()
    };
    let is_limit = |root: f64| (root * root - rise).abs() <= TOLERANCE * rise;
    let (mut inside, mut outside) = ((estimate, 0.0), None);
    let mut step = first.abs().max(f64::MIN_POSITIVE);
    for _ in 0..OUTWARD_STEPS {
        let value = estimate + direction * step;
        let beyond = if direction < 0.0 { value <= limit } else { value >= limit };
        let value = if beyond { limit } else { value };
        let root = root_of_rise(value);
        if is_limit(root) {
            return value;
        }
        if root >= needed {
            outside = Some((value, root));
            break;
        }
        if beyond {
            return limit;
        }
        inside = (value, root);
        step *= (1.1 * needed / root).clamp(OUTWARD[0], OUTWARD[1]);
    }
    let Some(mut outside) = outside else { return direction * f64::INFINITY };
    for at in 0..INWARD_STEPS {
        let ((low, low_root), (high, high_root)) = (inside, outside);
        let share = (needed - low_root) / (high_root - low_root);
        // Every other step halves the bracket, in case that the secant hardly shortens it.
        let share = if at % 2 == 0 && share > 0.0 { share } else { 0.5 };
        let value = low + share * (high - low);
        let root = root_of_rise(value);
        if is_limit(root) {
            return value;
        }
        if root < needed {
            inside = (value, root);
        } else {
            outside = (value, root);
        }
    }
    0.5 * (inside.0 + outside.0)
}
