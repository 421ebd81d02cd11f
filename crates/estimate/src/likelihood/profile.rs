//! Intervals from the profile likelihood.

use super::fit::Fit;
use super::limits::{
    PROFILE_FACTORS, PROFILE_MARGIN, PROFILE_SECANTS, PROFILE_STEPS, PROFILE_TOLERANCE,
};
use super::response_model::ResponseModel;
use super::search::{Bounds, Effort, minimise};

/// Returns the limit of an interval of a parameter below (`direction` −1) or above (+1) its
/// estimate. At this limit the sum of squares, minimised over all other parameters, is larger than
/// at the estimate by `rise`. If the bound is nearer, the limit is the bound; if the sum never
/// rises by `rise`, the limit is infinite. The search begins at the distance `first` from the
/// estimate.
///
/// # Source
/// Venzon & Moolgavkar (1988), Applied Statistics 37, 87–94; Raue et al. (2009), Bioinformatics 25,
/// 1923–1929.
pub(super) fn limit<M: ResponseModel>(
    fit: &Fit<'_, M>,
    parameter: usize,
    direction: f64,
    first: f64,
    rise: f64,
) -> f64 {
    let estimate = fit.minimum.parameters[parameter];
    let bounds = &fit.space.bounds;
    let bound = if direction < 0.0 { bounds.min[parameter] } else { bounds.max[parameter] };
    let mut profile = Profile { fit, parameter, from: fit.minimum.parameters.clone(), rise };
    let mut inside = Point { value: estimate, root: 0.0 };
    let mut distance = first.abs().max(f64::MIN_POSITIVE);
    for _ in 0..PROFILE_STEPS {
        let value = estimate + direction * distance;
        let beyond = if direction < 0.0 { value <= bound } else { value >= bound };
        let point = profile.at(if beyond { bound } else { value });
        if profile.is_limit(point) {
            return point.value;
        }
        if point.root >= rise.sqrt() {
            return profile.between(inside, point);
        }
        if beyond {
            return bound;
        }
        inside = point;
        let [least, most] = PROFILE_FACTORS;
        distance *= (PROFILE_MARGIN * rise.sqrt() / point.root).clamp(least, most);
    }
    direction * f64::INFINITY
}

/// Profile likelihood of one parameter.
struct Profile<'a, 'b, M: ResponseModel> {
    fit: &'a Fit<'b, M>,
    parameter: usize,
    /// All parameters of the last point of the profile; they are the initial estimates for the next
    /// point.
    from: Vec<f64>,
    /// Rise of the sum of squares at the limit of the interval.
    rise: f64,
}

/// Value of a parameter, and the square root of the rise of the sum of squares at this value. The
/// root is approximately proportional to the distance from the estimate. The root is infinite where
/// the response does not exist, because the likelihood is zero there.
#[derive(Clone, Copy)]
struct Point {
    value: f64,
    root: f64,
}

impl<M: ResponseModel> Profile<'_, '_, M> {
    /// Fits all other parameters while this parameter has the given value.
    fn at(&mut self, value: f64) -> Point {
        let mut fixed: Bounds = self.fit.space.bounds.clone();
        (fixed.min[self.parameter], fixed.max[self.parameter]) = (value, value);
        self.from[self.parameter] = value;
        let Some(minimum) = minimise(&self.fit.residual(), &fixed, &self.from, Effort::FINAL)
        else {
            return Point { value, root: f64::INFINITY };
        };
        self.from = minimum.parameters;
        let rise = minimum.cost - self.fit.minimum.cost;
        Point { value, root: rise.max(0.0).sqrt() }
    }

    fn is_limit(&self, point: Point) -> bool {
        (point.root.powi(2) - self.rise).abs() <= PROFILE_TOLERANCE * self.rise
    }

    /// Returns the limit of the interval, from a value inside the interval and a value outside it.
    fn between(&mut self, mut inside: Point, mut outside: Point) -> f64 {
        let needed = self.rise.sqrt();
        for step in 0..PROFILE_SECANTS {
            let share = (needed - inside.root) / (outside.root - inside.root);
            // Every other step halves the interval, because a secant step may hardly shorten it.
            let share = if step % 2 == 0 && share > 0.0 { share } else { 0.5 };
            let point = self.at(inside.value + share * (outside.value - inside.value));
            if self.is_limit(point) {
                return point.value;
            }
            if point.root < needed {
                inside = point;
            } else {
                outside = point;
            }
        }
        0.5 * (inside.value + outside.value)
    }
}
