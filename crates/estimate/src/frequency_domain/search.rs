//! Nonlinear least squares: Gauss–Newton steps along the curve of the residuals, damped where they
//! do not descend.

use mechid_numerics::cholesky::Cholesky;
use nalgebra::DVector;

use super::normal_equations::{Coordinates, NormalEquations};

/// A sum of squares to be minimised over its parameters.
pub(super) trait SumOfSquares {
    /// The sum at `theta`, `None` where it does not exist.
    fn try_at(&mut self, theta: &DVector<f64>) -> Option<f64>;

    /// Makes the parameters last tried those that everything else refers to.
    fn accept(&mut self);

    /// The normal equations, `None` where rounding or overflow leave none.
    fn normal_equations(&mut self) -> Option<NormalEquations>;

    /// The step to the least-squares solution of the equation of motion with the weights that belong
    /// to the parameters last accepted.
    fn linear_step(&mut self) -> Option<DVector<f64>>;

    /// Lets every spectral line count by a share drawn at random, of mean 1 and standard deviation √5,
    /// or all of them alike. What was accepted before has to be tried again.
    fn resample(&mut self, seed: Option<u64>);

    /// Jᵀr″, in the same coordinates as the normal equations, with r″ the second derivative of the
    /// residuals along `step`, a change of the parameters.
    fn curvature(&self, coordinates: &Coordinates, step: &DVector<f64>) -> DVector<f64>;
}

/// End of a search.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub theta: DVector<f64>,
    pub cost: f64,
    pub steps: usize,
    pub converged: bool,
}

/// A step that promises less than this share of the cost ends the search: about
/// 10⁻⁶·√(residuals) standard errors.
const COST_TOLERANCE: f64 = 1e-12;
/// Step, as a fraction of the parameters, below which a search ends, too, for data without noise.
const STEP_TOLERANCE: f64 = 1e-12;
/// First damping, against a Gram matrix of unit diagonal.
const FIRST_DAMPING: f64 = 1e-8;
/// Damping below which there is none.
const LEAST_DAMPING: f64 = 1e-13;
/// Damping beyond which no descent is to be had: rounding decides.
const MAX_DAMPING: f64 = 1e12;
/// The correction for curvature may be this part of a step.
const MAX_CORRECTION: f64 = 0.75;

/// The local minimum reached from `theta` in at most `max_steps`; `problem` is left there.
///
/// A step v and its correction a for the curvature of the residuals solve
///
/// ```text
/// (JᵀJ + λI) v = −Jᵀr,      (JᵀJ + λI) a = −½ Jᵀr″(v)
/// ```
///
/// and the step v + a is tried if a is small against v. The correction follows the curved valleys
/// of parameters that the data determine badly, where straight steps have to be tiny.
///
/// # Source
/// Nocedal & Wright, *Numerical Optimization*, section 10.3; Nielsen (1999), IMM-REP-1999-05, for
/// the damping; Transtrum & Sethna (2012), arXiv:1201.5885, for the correction.
pub(super) fn minimise(
    problem: &mut impl SumOfSquares,
    mut theta: DVector<f64>,
    max_steps: usize,
) -> Option<Minimum> {
    let mut cost = problem.try_at(&theta)?;
    problem.accept();
    let mut damping = 0.0;
    for steps in 0..max_steps {
        log::trace!("step {}, sum of squares {cost:.4e}", steps + 1);
        let equations = problem.normal_equations()?;
        let NormalEquations { gram, gradient, coordinates } = &equations;
        let undamped = Cholesky::new(gram, 0.0);
        let size = coordinates.of(&theta).norm();
        // Where the Gram matrix is singular to rounding only damped steps can tell.
        if let Some(factor) = &undamped {
            let newton = factor.solve(gradient);
            let small = newton.norm() <= STEP_TOLERANCE * size;
            if small || gradient.dot(&newton) <= COST_TOLERANCE * cost {
                return Some(Minimum { theta, cost, steps, converged: true });
            }
        } else {
            damping = f64::max(damping, FIRST_DAMPING);
        }
        let mut growth = 2.0;
        loop {
            let curvature = |v: &_| problem.curvature(coordinates, v);
            let step = match &undamped {
                Some(factor) if damping == 0.0 => Step::new(&equations, factor, curvature),
                _ => {
                    Cholesky::new(gram, damping).and_then(|f| Step::new(&equations, &f, curvature))
                }
            };
            let tried = step.and_then(|step| {
                let trial = &theta + &step.change;
                let lower = problem.try_at(&trial).filter(|lower| *lower < cost)?;
                Some((trial, lower, (cost - lower) / step.promise))
            });
            if let Some((trial, lower, gain)) = tried {
                problem.accept();
                (theta, cost) = (trial, lower);
                damping *= f64::max(0.1, 1.0 - (2.0 * gain - 1.0).powi(3));
                damping = if damping < LEAST_DAMPING { 0.0 } else { damping };
                break;
            }
            damping = f64::max(growth * damping, FIRST_DAMPING);
            growth *= 2.0;
            if damping > MAX_DAMPING {
                // No descent in any direction: a minimum to within rounding, if the data determine one.
                return Some(Minimum { theta, cost, steps, converged: undamped.is_some() });
            }
        }
    }
    Some(Minimum { theta, cost, steps: max_steps, converged: false })
}

/// A change of the parameters and what it promises to take off the cost.
struct Step {
    change: DVector<f64>,
    promise: f64,
}

impl Step {
    fn new(
        equations: &NormalEquations,
        factor: &Cholesky,
        curvature: impl Fn(&DVector<f64>) -> DVector<f64>,
    ) -> Option<Self> {
        let NormalEquations { gram, gradient, coordinates } = equations;
        let step = -factor.solve(gradient);
        let change = coordinates.unknowns(&step);
        let correction = factor.solve(&curvature(&change)) * -0.5;
        let promise = -(2.0 * gradient.dot(&step) + step.dot(&(gram * &step)));
        let follows = correction.norm() <= MAX_CORRECTION * step.norm();
        let change = change + coordinates.unknowns(&correction);
        (follows && promise > 0.0).then_some(Self { change, promise })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, 10(y − x²) and 1 − x.
    struct Valley {
        at: [f64; 2],
        tried: [f64; 2],
    }

    impl SumOfSquares for Valley {
        fn try_at(&mut self, theta: &DVector<f64>) -> Option<f64> {
            let [x, y] = [theta[0], theta[1]];
            self.tried = [x, y];
            Some((10.0 * (y - x * x)).powi(2) + (1.0 - x).powi(2))
        }

        fn accept(&mut self) {
            self.at = self.tried;
        }

        fn normal_equations(&mut self) -> Option<NormalEquations> {
            let [x, y] = self.at;
            let jacobian = nalgebra::dmatrix![-20.0 * x, 10.0; -1.0, 0.0];
            let residual = nalgebra::dvector![10.0 * (y - x * x), 1.0 - x];
            Some(NormalEquations {
                gram: jacobian.tr_mul(&jacobian),
                gradient: jacobian.tr_mul(&residual),
                coordinates: Coordinates::plain(2),
            })
        }

        fn linear_step(&mut self) -> Option<DVector<f64>> {
            None
        }

        fn resample(&mut self, _: Option<u64>) {}

        fn curvature(&self, _: &Coordinates, step: &DVector<f64>) -> DVector<f64> {
            let second = -20.0 * step[0] * step[0];
            nalgebra::dvector![-20.0 * self.at[0] * second, 10.0 * second]
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        let start = nalgebra::dvector![-1.2, 1.0];
        let mut valley = Valley { at: [0.0; 2], tried: [0.0; 2] };
        let minimum = minimise(&mut valley, start, 40).unwrap();
        assert!(minimum.converged, "{minimum:?}");
        assert!((minimum.theta - nalgebra::dvector![1.0, 1.0]).norm() < 1e-10);
        assert_eq!(valley.at, valley.tried);
    }
}
