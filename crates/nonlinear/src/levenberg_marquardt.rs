//! Nonlinear least squares: Gauss–Newton steps, damped where they do not descend.

use mechid_numerics::triangular::TriangularFactor;
use nalgebra::{DMatrix, DVector};

/// A sum of squares to be minimised over its parameters.
pub(super) trait SumOfSquares {
    /// Number of residuals.
    fn residuals(&self) -> usize;

    /// The residuals at `theta`; `false` where they do not exist.
    fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool;

    /// Their derivatives, residuals × parameters, where they were last evaluated.
    fn jacobian(&self, jacobian: &mut DMatrix<f64>);
}

/// End of a search.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub theta: DVector<f64>,
    pub steps: usize,
    pub converged: bool,
}

/// A step that promises less than this share of the cost ends the search: about
/// 10⁻⁶·√(residuals) standard errors.
const COST_TOLERANCE: f64 = 1e-12;
/// Step, as a fraction of the parameters, below which a search ends, too, for data without noise.
const STEP_TOLERANCE: f64 = 1e-12;
/// More steps than this mean that the start was not near a minimum.
const MAX_STEPS: usize = 60;
/// Damping beyond which no descent is to be had: rounding decides.
const MAX_DAMPING: f64 = 1e12;

/// The local minimum reached from `theta`.
///
/// Each linearisation is one QR decomposition of the column-scaled Jacobian; trying
/// another damping reuses it.
///
/// # Source
/// Nocedal & Wright, *Numerical Optimization*, section 10.3; scaling after Moré (1978).
pub(super) fn minimise(
    problem: &mut impl SumOfSquares,
    mut theta: DVector<f64>,
) -> Option<Minimum> {
    let (rows, columns) = (problem.residuals(), theta.len());
    let mut residual = DVector::zeros(rows);
    if !problem.residual(&theta, &mut residual) {
        return None;
    }
    let mut cost = residual.norm_squared();
    let mut trial_residual = residual.clone();
    let mut jacobian = DMatrix::zeros(rows, columns);
    let mut damping = 0.0;
    for steps in 0..MAX_STEPS {
        problem.jacobian(&mut jacobian);
        let (upper, scale) = triangle(&jacobian, &residual);
        let reachable = upper.view((0, columns), (columns, 1)).norm_squared();
        loop {
            let scaled_step = damped_step(&upper, columns, damping);
            let small = scaled_step.norm() <= STEP_TOLERANCE * scale.component_mul(&theta).norm();
            if small || reachable <= COST_TOLERANCE * cost {
                return Some(Minimum { theta, steps, converged: true });
            }
            let trial = &theta - scaled_step.component_div(&scale);
            let exists = problem.residual(&trial, &mut trial_residual);
            let trial_cost = trial_residual.norm_squared();
            if exists && trial_cost < cost {
                (theta, cost) = (trial, trial_cost);
                std::mem::swap(&mut residual, &mut trial_residual);
                damping = if damping < 1e-6 { 0.0 } else { damping / 10.0 };
                break;
            }
            damping = f64::max(10.0 * damping, 1e-4);
            if damping > MAX_DAMPING {
                // No descent in any direction: a minimum to within rounding.
                return Some(Minimum { theta, steps, converged: true });
            }
        }
    }
    Some(Minimum { theta, steps: MAX_STEPS, converged: false })
}

/// The triangle \[R q\] of \[J r\] with the columns of J scaled to unit length, and their lengths.
fn triangle(jacobian: &DMatrix<f64>, residual: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let columns = jacobian.ncols();
    let mut factor = TriangularFactor::new(columns + 1);
    let finite = factor.push(&[jacobian.as_view(), residual.as_view()]);
    // A point where the model overflows has no step: NaN says so to whoever solves for one.
    let mut upper = if finite { factor.r().clone() } else { factor.r().map(|_| f64::NAN) };
    let mut scale = DVector::from_element(columns, 1.0);
    for (length, mut column) in scale.iter_mut().zip(upper.column_iter_mut()) {
        // A rotation keeps lengths: those of R are those of J.
        if column.norm() > 0.0 {
            *length = column.norm();
            column /= *length;
        }
    }
    (upper, scale)
}

/// The minimiser y of ‖R y − q‖² + damping·‖y‖², with [R q] the upper triangle.
fn damped_step(upper: &DMatrix<f64>, columns: usize, damping: f64) -> DVector<f64> {
    let q = upper.view((0, columns), (columns, 1)).column(0).into_owned();
    let r = upper.view((0, 0), (columns, columns));
    let solution = r.solve_upper_triangular(&q).filter(|s| s.iter().all(|v| v.is_finite()));
    if let (true, Some(step)) = (damping == 0.0, solution) {
        return step;
    }
    let damping = damping.max(f64::EPSILON);
    let mut stacked = DMatrix::zeros(2 * columns, columns + 1);
    stacked.view_mut((0, 0), (columns, columns + 1)).copy_from(&upper.rows(0, columns));
    for j in 0..columns {
        stacked[(columns + j, j)] = damping.sqrt();
    }
    let reduced = stacked.qr().unpack_r();
    reduced
        .view((0, 0), (columns, columns))
        .solve_upper_triangular(&reduced.view((0, columns), (columns, 1)).column(0).into_owned())
        .expect("damping keeps the diagonal away from zero")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, 10(y − x²) and 1 − x.
    struct Valley {
        x: f64,
    }

    impl SumOfSquares for Valley {
        fn residuals(&self) -> usize {
            2
        }

        fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
            self.x = theta[0];
            residual[0] = 10.0 * (theta[1] - theta[0] * theta[0]);
            residual[1] = 1.0 - theta[0];
            true
        }

        fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
            jacobian.copy_from_slice(&[-20.0 * self.x, -1.0, 10.0, 0.0]);
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        let minimum = minimise(&mut Valley { x: 0.0 }, DVector::from_vec(vec![-1.2, 1.0])).unwrap();
        assert!(minimum.converged && minimum.steps < 40);
        assert!((minimum.theta - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-10);
    }
}
