//! Bounded Gauss–Newton search with damping (Levenberg–Marquardt).

use mechid_numerics::products::transposed_product;
use mechid_numerics::time_limit;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::limits::{SAME_MINIMUM, SHORT_STEP, STEPS};

/// A sum of squares with its derivative.
pub(super) trait LeastSquaresProblem {
    /// Residual at one set of parameters, and the data for its derivative.
    type Evaluation;

    /// Computes the residual; `None` if it does not exist.
    fn evaluate(&self, parameters: &[f64]) -> Option<Self::Evaluation>;

    /// Returns the residual of an evaluation.
    fn residual<'e>(&self, evaluation: &'e Self::Evaluation) -> &'e DVector<f64>;

    /// Returns the residual of an evaluation at `parameters` and its Jacobian; `None` if the
    /// Jacobian does not exist.
    fn linearised(&self, parameters: &[f64], evaluation: Self::Evaluation)
    -> Option<Linearisation>;
}

/// Residual and Jacobian at one set of parameters.
pub(super) struct Linearisation {
    pub(super) residual: DVector<f64>,
    /// Derivative of the residual, one column per parameter.
    pub(super) jacobian: DMatrix<f64>,
}

/// Bounds of the parameters; the bound of an unbounded parameter is infinite.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bounds {
    pub(super) min: Vec<f64>,
    pub(super) max: Vec<f64>,
}

impl Bounds {
    fn clamp(&self, parameters: &mut [f64]) {
        for (value, (min, max)) in parameters.iter_mut().zip(self.min.iter().zip(&self.max)) {
            *value = value.clamp(*min, *max);
        }
    }

    /// Returns whether a parameter is at a bound across which the sum of squares decreases.
    fn blocks(&self, at: usize, value: f64, gradient: f64) -> bool {
        let is_fixed = self.min[at] == self.max[at];
        let below = value <= self.min[at] && gradient > 0.0;
        is_fixed || below || (value >= self.max[at] && gradient < 0.0)
    }
}

/// Point at which a search ended.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub(super) parameters: Vec<f64>,
    pub(super) cost: f64,
    /// Number of entries of the residual.
    pub(super) numbers: usize,
    pub(super) steps: usize,
    pub(super) converged: bool,
    /// Flags of the parameters: `true` at a bound across which the sum of squares would decrease.
    pub(super) at_bound: Vec<bool>,
}

/// Maximum ratio of the length of the last step of a search to the length of the parameter vector;
/// a step up to this ratio ends the search. The other criterion is [`Effort::tolerance`]. Both
/// lengths are scaled by the columns of the Jacobian. For data without noise, this ratio ends the
/// search.
const STEP_TOLERANCE: f64 = 1e-12;
/// First nonzero damping λ of a Levenberg–Marquardt step, relative to the unit diagonal of the Gram
/// matrix.
const FIRST_DAMPING: f64 = 1e-8;
/// Minimum damping λ of a Levenberg–Marquardt step; a smaller λ is set to zero.
const LEAST_DAMPING: f64 = 1e-13;
/// Maximum damping λ of a Levenberg–Marquardt step; with a larger λ the step is so short that its
/// effect is only rounding.
const MAX_DAMPING: f64 = 1e12;
/// Maximum ratio of the length of the curvature correction to the length of the step that it
/// corrects; a larger correction is not used.
const MAX_CORRECTION: f64 = 0.75;
/// Fraction of a step over which the finite difference for the curvature is taken.
const CURVATURE_STEP: f64 = 0.1;

/// Normal equations for the parameters that no bound blocks, with columns of unit length.
struct Local<'a> {
    linearisation: &'a Linearisation,
    free: Vec<usize>,
    /// Lengths of the Jacobian columns of the free parameters.
    scale: DVector<f64>,
    gram: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl<'a> Local<'a> {
    fn new(linearisation: &'a Linearisation, parameters: &[f64], bounds: &Bounds) -> Self {
        let Linearisation { residual, jacobian } = linearisation;
        let half_gradient = jacobian.tr_mul(residual);
        let free = |at: &usize| !bounds.blocks(*at, parameters[*at], half_gradient[*at]);
        let free: Vec<usize> = (0..parameters.len()).filter(free).collect();
        let length = |at: &usize| match jacobian.column(*at).norm() {
            length if length > 0.0 => length,
            _ => 1.0,
        };
        let scale = DVector::from_iterator(free.len(), free.iter().map(length));
        let mut columns = jacobian.select_columns(&free);
        for (mut column, scale) in columns.column_iter_mut().zip(scale.iter()) {
            column.unscale_mut(*scale);
        }
        let gram = transposed_product(columns.as_view(), columns.as_view());
        let gradient = columns.tr_mul(residual);
        Self { linearisation, free, scale, gram, gradient }
    }

    fn factor(&self, damping: f64) -> Option<Cholesky<f64, Dyn>> {
        let mut damped = self.gram.clone();
        for at in 0..self.free.len() {
            damped[(at, at)] += damping;
        }
        damped.cholesky()
    }

    /// Returns the change of all parameters from the change of the scaled free parameters.
    fn change(&self, scaled: &DVector<f64>, count: usize) -> DVector<f64> {
        let mut change = DVector::zeros(count);
        for (at, parameter) in self.free.iter().enumerate() {
            change[*parameter] = scaled[at] / self.scale[at];
        }
        change
    }

    /// Returns the decrease of the sum of squares that the linearisation predicts for a change of
    /// the parameters.
    fn predicted_decrease(&self, change: &DVector<f64>) -> f64 {
        let moved = &self.linearisation.jacobian * change;
        -(2.0 * self.linearisation.residual.dot(&moved) + moved.norm_squared())
    }
}

/// Effort of a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Maximum number of steps.
    pub(super) steps: usize,
    /// Predicted decrease of the sum of squares, relative to this sum, below which the search ends.
    pub(super) tolerance: f64,
}

impl Effort {
    /// Effort for the final estimate: the search ends within about 10⁻⁶·√(number of residuals)
    /// standard errors of the minimum.
    pub(super) const FINAL: Self = Self { steps: STEPS, tolerance: 1e-12 };
    /// Effort to distinguish minima. The sums of squares of different minima differ by more than
    /// [`SAME_MINIMUM`]. The smaller tolerance of the final estimate would cost many steps near a
    /// wrong minimum, where the residual is large and the steps converge only linearly.
    pub(super) const ROUGH: Self = Self { steps: STEPS, tolerance: 1e-2 * SAME_MINIMUM };
}

/// Searches for a local minimum within `bounds` from `start`; `None` if the residual does not
/// exist. A time limit ends the search at the lowest sum of squares so far.
///
/// A step v and its correction a for the curvature r″ of the residual along v solve (JᵀJ + λI) v =
/// −Jᵀr and (JᵀJ + λI) a = −½ Jᵀr″(v) for the parameters that no bound blocks; the step is
/// projected onto the bounds.
///
/// # Source
/// Nocedal & Wright, *Numerical Optimization*, 2nd ed. (2006), sections 10.3 and 16.7 (projected
/// steps); Nielsen (1999), IMM-REP-1999-05 (damping); Transtrum & Sethna (2012), arXiv:1201.5885
/// (correction).
pub(super) fn minimise(
    problem: &impl LeastSquaresProblem,
    bounds: &Bounds,
    start: &[f64],
    effort: Effort,
) -> Option<Minimum> {
    let mut parameters = start.to_vec();
    bounds.clamp(&mut parameters);
    let mut damping = 0.0_f64;
    let mut at = problem.linearised(&parameters, problem.evaluate(&parameters)?)?;
    let mut cost = at.residual.norm_squared();
    let mut steps = 0;
    while steps < effort.steps && !time_limit::is_over() {
        let local = Local::new(&at, &parameters, bounds);
        let newton = local.factor(damping.max(LEAST_DAMPING)).map(|f| f.solve(&-&local.gradient));
        if let Some(newton) = &newton {
            let size = local.free.iter().zip(local.scale.iter());
            let size =
                size.map(|(at, scale)| (parameters[*at] * scale).powi(2)).sum::<f64>().sqrt();
            let small = newton.norm() <= STEP_TOLERANCE * size;
            let full = -local.gradient.dot(newton) <= effort.tolerance * cost;
            if local.free.is_empty() || ((small || full) && damping <= FIRST_DAMPING) {
                let end = Minimum { steps, converged: true, ..ended(&local, &parameters, cost) };
                return Some(polished(problem, bounds, &local, newton, end));
            }
        }
        let next = descend(problem, bounds, &local, &parameters, cost, &mut damping);
        let Some((next, evaluation)) = next else {
            // No damped step reduces the cost: this is a minimum up to rounding, unless the time
            // limit ended the damped steps.
            let converged = !time_limit::is_over();
            return Some(Minimum { steps, converged, ..ended(&local, &parameters, cost) });
        };
        parameters = next;
        at = problem.linearised(&parameters, evaluation)?;
        cost = at.residual.norm_squared();
        steps += 1;
    }
    let local = Local::new(&at, &parameters, bounds);
    Some(Minimum { steps, ..ended(&local, &parameters, cost) })
}

fn ended(local: &Local<'_>, parameters: &[f64], cost: f64) -> Minimum {
    let at_bound = (0..parameters.len()).map(|at| !local.free.contains(&at)).collect();
    let numbers = local.linearisation.residual.len();
    Minimum { parameters: parameters.to_vec(), cost, numbers, steps: 0, converged: false, at_bound }
}

/// Returns the minimum after the last Gauss–Newton step; if this step increases the sum of squares,
/// returns `end` without the step. The effect of the step on the sum is negligible.
fn polished(
    problem: &impl LeastSquaresProblem,
    bounds: &Bounds,
    local: &Local<'_>,
    newton: &DVector<f64>,
    end: Minimum,
) -> Minimum {
    let change = local.change(newton, end.parameters.len());
    let mut next: Vec<f64> =
        end.parameters.iter().zip(change.iter()).map(|(value, by)| value + by).collect();
    bounds.clamp(&mut next);
    match cost_at(problem, &next) {
        Some(cost) if cost <= end.cost => Minimum { parameters: next, cost, ..end },
        _ => end,
    }
}

/// Returns the sum of squares at `parameters`, `None` if the residual does not exist.
fn cost_at(problem: &impl LeastSquaresProblem, parameters: &[f64]) -> Option<f64> {
    problem.evaluate(parameters).map(|evaluation| problem.residual(&evaluation).norm_squared())
}

/// Returns the next parameters, which have a lower sum of squares, and their residual; `None` if no
/// damping λ up to [`MAX_DAMPING`] gives a lower sum, or if the time limit is over.
fn descend<P: LeastSquaresProblem>(
    problem: &P,
    bounds: &Bounds,
    local: &Local<'_>,
    parameters: &[f64],
    cost: f64,
    damping: &mut f64,
) -> Option<(Vec<f64>, P::Evaluation)> {
    let mut growth = 2.0;
    loop {
        if let Some(step) = step(problem, local, parameters, *damping) {
            let mut next: Vec<f64> =
                parameters.iter().zip(step.iter()).map(|(value, by)| value + by).collect();
            bounds.clamp(&mut next);
            let change = DVector::from_fn(next.len(), |at, _| next[at] - parameters[at]);
            let predicted_decrease = local.predicted_decrease(&change);
            let lower = problem
                .evaluate(&next)
                .map(|evaluation| (problem.residual(&evaluation).norm_squared(), evaluation));
            if let Some((lower, evaluation)) = lower.filter(|(lower, _)| *lower < cost) {
                let gain = if predicted_decrease > 0.0 {
                    (cost - lower) / predicted_decrease
                } else {
                    0.0
                };
                *damping *= f64::max(0.1, 1.0 - (2.0 * gain - 1.0).powi(3));
                *damping = if *damping < LEAST_DAMPING { 0.0 } else { *damping };
                return Some((next, evaluation));
            }
        }
        *damping = f64::max(growth * *damping, FIRST_DAMPING);
        growth *= 2.0;
        if *damping > MAX_DAMPING || time_limit::is_over() {
            return None;
        }
    }
}

/// Returns a damped step with its correction for curvature.
fn step(
    problem: &impl LeastSquaresProblem,
    local: &Local<'_>,
    parameters: &[f64],
    damping: f64,
) -> Option<DVector<f64>> {
    let factor = local.factor(damping)?;
    let scaled = factor.solve(&-&local.gradient);
    if scaled.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let change = local.change(&scaled, parameters.len());
    if damping > SHORT_STEP {
        return Some(change);
    }
    let ahead: Vec<f64> =
        parameters.iter().zip(change.iter()).map(|(v, by)| v + CURVATURE_STEP * by).collect();
    let Some(ahead) = problem.evaluate(&ahead) else { return Some(change) };
    let Linearisation { residual, jacobian } = local.linearisation;
    let slope = (problem.residual(&ahead) - residual) / CURVATURE_STEP;
    let curvature = (slope - jacobian * &change) * (2.0 / CURVATURE_STEP);
    let mut projected = jacobian.select_columns(&local.free).tr_mul(&curvature);
    projected.component_div_assign(&local.scale);
    let correction = factor.solve(&projected) * -0.5;
    let bounded = correction.norm() <= MAX_CORRECTION * scaled.norm();
    Some(if bounded { local.change(&(scaled + correction), parameters.len()) } else { change })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, with the residuals 10(y − x²) and 1 − x.
    struct Valley;

    impl LeastSquaresProblem for Valley {
        type Evaluation = DVector<f64>;

        fn evaluate(&self, p: &[f64]) -> Option<DVector<f64>> {
            Some(nalgebra::dvector![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]])
        }

        fn residual<'e>(&self, evaluation: &'e DVector<f64>) -> &'e DVector<f64> {
            evaluation
        }

        fn linearised(&self, p: &[f64], residual: DVector<f64>) -> Option<Linearisation> {
            let jacobian = nalgebra::dmatrix![-20.0 * p[0], 10.0; -1.0, 0.0];
            Some(Linearisation { residual, jacobian })
        }
    }

    fn bounds(min: [f64; 2], max: [f64; 2]) -> Bounds {
        Bounds { min: min.to_vec(), max: max.to_vec() }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        let free = bounds([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        let minimum = minimise(&Valley, &free, &[-1.2, 1.0], Effort::FINAL).unwrap();
        assert!(minimum.converged, "{minimum:?}");
        assert!(minimum.parameters.iter().all(|value| (value - 1.0).abs() < 1e-10));
        assert_eq!(minimum.at_bound, [false, false]);
    }

    /// With the bound x ≤ ½, the search ends at x = ½ and y = ¼, and reports that x is at its
    /// bound.
    #[test]
    fn a_bound_holds_and_is_reported() {
        let half = bounds([f64::NEG_INFINITY; 2], [0.5, f64::INFINITY]);
        let minimum = minimise(&Valley, &half, &[-1.2, 1.0], Effort::FINAL).unwrap();
        assert!(minimum.converged, "{minimum:?}");
        assert_eq!(minimum.parameters[0], 0.5);
        assert!((minimum.parameters[1] - 0.25).abs() < 1e-9);
        assert_eq!(minimum.at_bound, [true, false]);
    }
}
