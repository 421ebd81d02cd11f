//! Nonlinear least squares by Gauss–Newton steps. A step is corrected for the curvature of the
//! residuals, and damped if it does not reduce the sum of squares.
//!
//! A problem returns its sum of squares for given parameters, and a linearisation of its residuals
//! at these parameters in coordinates of its choice. There are two linearisations: [`GramMatrix`]
//! (normal equations, for many residuals and well-scaled coordinates) and [`Triangle`] (QR of the
//! Jacobian, for badly conditioned coordinates). [`minimise_residuals`] is for problems that
//! compute all residuals and their Jacobian at once.

mod gram_matrix;
mod residuals;
mod triangle;

use nalgebra::DVector;

use crate::limits::{
    COST_TOLERANCE, FIRST_DAMPING, LARGEST_CORRECTION, LARGEST_DAMPING, SMALLEST_DAMPING,
    STEP_TOLERANCE,
};
use crate::time_limit;
pub use gram_matrix::GramMatrix;
pub use residuals::{Residuals, minimise_residuals};
pub use triangle::{DampedTriangle, Triangle};

/// Residuals r linearised about some parameters: r + J v, with v the change of the parameters in
/// scaled coordinates.
///
/// In these coordinates the columns of J have unit length, so that damping has the same effect on
/// all coordinates.
pub trait Linearisation {
    /// Factor of the damped matrix JᵀJ + λI.
    type Factor;

    /// Returns the gradient Jᵀr.
    fn gradient(&self) -> &DVector<f64>;

    /// Returns the factor of JᵀJ + `damping`·I; `None` if this matrix is numerically singular.
    fn factor(&self, damping: f64) -> Option<Self::Factor>;

    /// Returns (JᵀJ + λI)⁻¹ `right`, with the factor of JᵀJ + λI.
    fn solve(&self, factor: &Self::Factor, right: &DVector<f64>) -> DVector<f64>;

    /// Returns the step (JᵀJ + λI)⁻¹ Jᵀr, with the factor of JᵀJ + λI.
    fn step(&self, factor: &Self::Factor) -> DVector<f64> {
        self.solve(factor, self.gradient())
    }

    /// Returns the sum of squares of r minus the sum of squares of r + J v.
    fn decrease(&self, v: &DVector<f64>) -> f64;

    /// Converts parameters to coordinates.
    fn coordinates(&self, parameters: &DVector<f64>) -> DVector<f64>;

    /// Converts coordinates to parameters.
    fn parameters(&self, coordinates: &DVector<f64>) -> DVector<f64>;
}

/// Sum of squares to be minimised over its parameters.
pub trait SumOfSquares {
    /// Linearisation of the residuals.
    type Linearisation: Linearisation;

    /// Returns the sum of squares at `parameters`; `None` if the residuals do not exist there. The
    /// parameters are a list in any units; the sum is in the square of the unit of the residuals.
    fn try_at(&mut self, parameters: &DVector<f64>) -> Option<f64>;

    /// Accepts the most recently tried parameters, to which linearisation and curvature then refer.
    fn accept(&mut self);

    /// Returns the linearisation at the accepted parameters; `None` if rounding or overflow
    /// prevents it.
    fn linearise(&mut self) -> Option<Self::Linearisation>;

    /// Returns Jᵀr″ where r″ is the second derivative of the residuals along `change`. `None` if r″
    /// is not known; steps are then not corrected. `change` is a change of the parameters: one
    /// entry for each parameter, in its unit.
    fn curvature(
        &self,
        _linearisation: &Self::Linearisation,
        _change: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        None
    }
}

/// Result of a search.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// Final parameters, a list, each in its unit.
    pub parameters: DVector<f64>,
    /// Final sum of squares, in the square of the unit of the residuals.
    pub cost: f64,
    /// Number of steps taken.
    pub steps: usize,
    /// `true` if a minimum was reached up to rounding; `false` if the number of steps was exhausted
    /// or the time limit was reached.
    pub converged: bool,
}

/// Searches for the local minimum from `parameters` in at most `max_steps` steps; afterwards
/// `problem` holds the accepted parameters. A [time limit](crate::time_limit) ends the search at
/// the lowest sum of squares so far.
///
/// A step v and its correction a for the curvature of the residuals solve
///
/// ```text
/// (JᵀJ + λI) v = −Jᵀr,      (JᵀJ + λI) a = −½ Jᵀr″(v)
/// ```
///
/// and the step v + a is tried if a is small relative to v. Here r are the residuals, J is their
/// Jacobian, r″(v) is their second derivative along v, and λ is the damping. The correction makes a
/// step follow curved valleys, which arise when the data determine a combination of parameters
/// badly; without the correction the steps would be tiny. Parameters are a list in any units.
///
/// # Source
/// Nocedal & Wright, *Numerical Optimization*, section 10.3; Nielsen (1999), IMM-REP-1999-05, for
/// the damping; Transtrum & Sethna (2012), arXiv:1201.5885, for the correction.
///
/// ```
/// use mechid_numerics::gauss_newton::{SumOfSquares, Triangle, minimise};
/// use nalgebra::{DVector, dmatrix, dvector};
///
/// /// Circle about the origin whose radius fits the points (1, 0), (0, 2) and (−3, 0) best.
/// struct Circle(f64, f64);
///
/// impl SumOfSquares for Circle {
///     type Linearisation = Triangle;
///
///     fn try_at(&mut self, at: &DVector<f64>) -> Option<f64> {
///         self.1 = at[0];
///         Some([1.0, 2.0, 3.0].iter().map(|r| (at[0] - r) * (at[0] - r)).sum())
///     }
///
///     fn accept(&mut self) {
///         self.0 = self.1;
///     }
///
///     fn linearise(&mut self) -> Option<Triangle> {
///         let residual = dvector![self.0 - 1.0, self.0 - 2.0, self.0 - 3.0];
///         Some(Triangle::new(&dmatrix![1.0; 1.0; 1.0], &residual))
///     }
/// }
///
/// let minimum = minimise(&mut Circle(0.0, 0.0), dvector![10.0], 20).unwrap();
/// assert!(minimum.converged && (minimum.parameters[0] - 2.0).abs() < 1e-12);
/// ```
pub fn minimise<P: SumOfSquares>(
    problem: &mut P,
    mut parameters: DVector<f64>,
    max_steps: usize,
) -> Option<Minimum> {
    let mut cost = problem.try_at(&parameters)?;
    problem.accept();
    let mut damping = 0.0;
    for steps in 0..max_steps {
        if time_limit::is_over() {
            return Some(Minimum { parameters, cost, steps, converged: false });
        }
        log::trace!("step {}, sum of squares {cost:.4e}", steps + 1);
        let linearisation = problem.linearise()?;
        let undamped = linearisation.factor(0.0);
        // Only the undamped step shows whether this is a minimum; it does not exist if JᵀJ is
        // numerically singular.
        if let Some(factor) = &undamped {
            if is_minimum(&linearisation, factor, &parameters, cost) {
                return Some(Minimum { parameters, cost, steps, converged: true });
            }
        } else {
            damping = f64::max(damping, FIRST_DAMPING);
        }
        let mut growth = 2.0;
        loop {
            let damped = (damping > 0.0).then(|| linearisation.factor(damping));
            let factor = damped.as_ref().map_or(undamped.as_ref(), Option::as_ref);
            let step = factor.and_then(|factor| Step::new(problem, &linearisation, factor));
            let lower = step.and_then(|step| {
                let trial = &parameters + &step.change;
                let lower = problem.try_at(&trial).filter(|lower| *lower < cost)?;
                Some((trial, lower, (cost - lower) / step.promise))
            });
            if let Some((trial, lower, gain)) = lower {
                problem.accept();
                (parameters, cost) = (trial, lower);
                damping *= f64::max(0.1, 1.0 - (2.0 * gain - 1.0).powi(3));
                damping = if damping < SMALLEST_DAMPING { 0.0 } else { damping };
                break;
            }
            if time_limit::is_over() {
                return Some(Minimum { parameters, cost, steps, converged: false });
            }
            damping = f64::max(growth * damping, FIRST_DAMPING);
            growth *= 2.0;
            if damping > LARGEST_DAMPING {
                // No direction reduces the cost: this is a minimum up to rounding, or the data
                // determine no minimum.
                return Some(Minimum { parameters, cost, steps, converged: undamped.is_some() });
            }
        }
    }
    Some(Minimum { parameters, cost, steps: max_steps, converged: false })
}

/// Returns whether the undamped step, or the decrease of the cost that it predicts, is negligible.
fn is_minimum<L: Linearisation>(
    linearisation: &L,
    factor: &L::Factor,
    parameters: &DVector<f64>,
    cost: f64,
) -> bool {
    let newton = linearisation.step(factor);
    newton.norm() <= STEP_TOLERANCE * linearisation.coordinates(parameters).norm()
        || linearisation.gradient().dot(&newton) <= COST_TOLERANCE * cost
}

/// Change of the parameters, and the predicted decrease of the sum of squares.
struct Step {
    change: DVector<f64>,
    promise: f64,
}

impl Step {
    /// Returns the step with its correction; `None` if the correction is too large or the step does
    /// not descend.
    fn new<P: SumOfSquares>(
        problem: &P,
        linearisation: &P::Linearisation,
        factor: &<P::Linearisation as Linearisation>::Factor,
    ) -> Option<Self> {
        let step = -linearisation.step(factor);
        let change = linearisation.parameters(&step);
        let promise = linearisation.decrease(&step);
        if promise.is_nan() || promise <= 0.0 {
            return None;
        }
        let Some(curvature) = problem.curvature(linearisation, &change) else {
            return Some(Self { change, promise });
        };
        let correction = linearisation.solve(factor, &curvature) * -0.5;
        let follows = correction.norm() <= LARGEST_CORRECTION * step.norm();
        let change = change + linearisation.parameters(&correction);
        follows.then_some(Self { change, promise })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{dmatrix, dvector};

    use super::*;
    use crate::time_limit::{TimeLimit, within};

    /// Rosenbrock's valley, 10(y − x²) and 1 − x, linearised by `L`.
    struct Valley<L> {
        at: [f64; 2],
        tried: [f64; 2],
        is_curved: bool,
        linearise: fn([f64; 2]) -> L,
    }

    impl<L: Linearisation> SumOfSquares for Valley<L> {
        type Linearisation = L;

        fn try_at(&mut self, parameters: &DVector<f64>) -> Option<f64> {
            let [x, y] = [parameters[0], parameters[1]];
            self.tried = [x, y];
            Some((10.0 * (y - x * x)).powi(2) + (1.0 - x).powi(2))
        }

        fn accept(&mut self) {
            self.at = self.tried;
        }

        fn linearise(&mut self) -> Option<L> {
            Some((self.linearise)(self.at))
        }

        fn curvature(&self, linearisation: &L, change: &DVector<f64>) -> Option<DVector<f64>> {
            let second = -20.0 * change[0] * change[0];
            let in_parameters = dvector![-20.0 * self.at[0] * second, 10.0 * second];
            // Coordinates are multiples of the parameters, so Jᵀ in coordinates is Jᵀ divided by
            // the same factors.
            let scale = linearisation.coordinates(&dvector![1.0, 1.0]);
            self.is_curved.then(|| in_parameters.component_div(&scale))
        }
    }

    #[test]
    fn a_time_limit_ends_at_the_best_parameters_so_far() {
        let linearise = |at| {
            let (jacobian, residual) = linearised(at);
            Triangle::new(&jacobian, &residual)
        };
        let search = |polls| {
            let mut valley = Valley { at: [0.0; 2], tried: [0.0; 2], is_curved: false, linearise };
            let limit = Some(TimeLimit::from_polls(polls));
            let from = dvector![-1.2, 1.0];
            let minimum = within(limit, || minimise(&mut valley, from, 40)).unwrap();
            // The problem holds the returned parameters, not those of a later trial.
            assert_eq!(valley.at.as_slice(), minimum.parameters.as_slice());
            let cost = valley.try_at(&minimum.parameters);
            assert_eq!(cost, Some(minimum.cost));
            minimum
        };
        let whole = search(u64::MAX);
        assert!(whole.converged);
        let costs: Vec<f64> = (0..100).map(|polls| search(polls).cost).collect();
        assert!((costs[0] - 24.2).abs() < 1e-12, "{}", costs[0]);
        assert!(costs.windows(2).all(|pair| pair[1] <= pair[0]), "{costs:?}");
        let converged = (0..100).filter(|polls| search(*polls).converged).count();
        assert!((1..100).contains(&converged), "{converged}");
    }

    fn linearised([x, y]: [f64; 2]) -> (nalgebra::DMatrix<f64>, DVector<f64>) {
        (dmatrix![-20.0 * x, 10.0; -1.0, 0.0], dvector![10.0 * (y - x * x), 1.0 - x])
    }

    fn follow<L: Linearisation>(linearise: fn([f64; 2]) -> L) {
        for is_curved in [false, true] {
            let mut valley = Valley { at: [0.0; 2], tried: [0.0; 2], is_curved, linearise };
            let minimum = minimise(&mut valley, dvector![-1.2, 1.0], 40).unwrap();
            assert!(minimum.converged, "{minimum:?}");
            assert!((minimum.parameters - dvector![1.0, 1.0]).norm() < 1e-10);
            assert_eq!(valley.at, valley.tried);
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        follow(|at| {
            let (jacobian, residual) = linearised(at);
            Triangle::new(&jacobian, &residual)
        });
        follow(|at| {
            let (jacobian, residual) = linearised(at);
            GramMatrix::new(&jacobian.tr_mul(&jacobian), &jacobian.tr_mul(&residual))
        });
    }

    /// A fit of exp(−θ t) to exact data: the search ends at the true θ from any start.
    #[test]
    fn steps_that_are_too_long_are_damped() {
        struct Decay(f64, f64);
        impl Decay {
            fn residual(rate: f64, t: f64) -> f64 {
                (-rate * t).exp() - (-2.0 * t).exp()
            }
        }
        impl SumOfSquares for Decay {
            type Linearisation = Triangle;
            fn try_at(&mut self, at: &DVector<f64>) -> Option<f64> {
                self.1 = at[0];
                let cost = (1..9).map(|t| Self::residual(at[0], 0.2 * f64::from(t)).powi(2)).sum();
                Some(cost).filter(|cost: &f64| cost.is_finite())
            }
            fn accept(&mut self) {
                self.0 = self.1;
            }
            fn linearise(&mut self) -> Option<Triangle> {
                let time = |row: usize| 0.2 * (row + 1) as f64;
                let jacobian = nalgebra::DMatrix::from_fn(8, 1, |row, _| {
                    -time(row) * (-self.0 * time(row)).exp()
                });
                let residual = DVector::from_fn(8, |row, _| Self::residual(self.0, time(row)));
                Some(Triangle::new(&jacobian, &residual))
            }
        }
        for start in [0.0, 5.0, 12.0] {
            let minimum = minimise(&mut Decay(start, start), dvector![start], 60).unwrap();
            assert!(minimum.converged && (minimum.parameters[0] - 2.0).abs() < 1e-9, "{minimum:?}");
        }
    }
}
