//! Damped Newton steps on the p-norm of a multisine.

use nalgebra::{Cholesky, DVector};

use super::p_norm::{Derivatives, PNorm, norm};
use crate::limits;

/// Phases, with the norm and the derivatives of the norm at these phases.
pub(super) struct Point {
    pub(super) phases: Vec<f64>,
    signal: Vec<f64>,
    norm: f64,
}

impl Point {
    fn new(objective: &PNorm, phases: Vec<f64>, p: i32) -> Self {
        let signal = objective.signal(&phases);
        let norm = norm(&signal, p);
        Self { phases, signal, norm }
    }
}

/// Returns phases at which ‖x‖_p is smaller than at the given phases; `damping` is passed on from
/// one exponent p to the next.
pub(super) fn minimise(objective: &PNorm, phases: Vec<f64>, p: i32, damping: &mut f64) -> Vec<f64> {
    let mut point = Point::new(objective, phases, p);
    let mut small_gains = 0;
    for _ in 0..limits::CREST_STEPS {
        let Some(next) = step(objective, &point, p, damping) else {
            break;
        };
        let small = point.norm - next.norm < limits::CREST_GAIN * point.norm;
        small_gains = if small { small_gains + 1 } else { 0 };
        point = next;
        if small_gains == 2 {
            break;
        }
    }
    point.phases
}

/// Takes one step that lowers the norm, returns the new point, and updates `damping`; `None` at a
/// stationary point.
fn step(objective: &PNorm, from: &Point, p: i32, damping: &mut f64) -> Option<Point> {
    let derivatives = objective.derivatives(&from.phases, &from.signal, p);
    // A shift in time, common to all lines, does not change the norm, so the curvature in this
    // direction is zero. A multiple of the identity (Levenberg) damps this direction, too.
    let scale = derivatives.mean_curvature();
    let hessian = (from.phases.len() <= limits::DENSE_HESSIAN).then(|| derivatives.hessian());
    while *damping < limits::LARGEST_DAMPING {
        let added = *damping * scale;
        // The damping grows until the damped Hessian is positive definite and the norm decreases.
        let step = match &hessian {
            Some(hessian) => {
                let mut damped = hessian.clone();
                (0..damped.nrows()).for_each(|i| damped[(i, i)] += added);
                Cholesky::new(damped).map(|factor| factor.solve(&derivatives.gradient))
            }
            None => conjugate_gradients(&derivatives, added),
        };
        if let Some(step) = step {
            let phases = from.phases.iter().zip(&step).map(|(a, d)| a - d).collect();
            let next = Point::new(objective, phases, p);
            if next.norm < from.norm {
                *damping = (0.3 * *damping).max(1e-9);
                return Some(next);
            }
        }
        *damping *= 4.0;
    }
    *damping = limits::FIRST_DAMPING;
    None
}

/// Solves (H + added·I) d = g to a few per cent; `None` at negative curvature.
fn conjugate_gradients(derivatives: &Derivatives<'_>, added: f64) -> Option<DVector<f64>> {
    let g = &derivatives.gradient;
    let mut solution = DVector::zeros(g.len());
    let mut residual = g.clone();
    let mut direction = g.clone();
    let mut square = residual.norm_squared();
    let target = limits::CG_RESIDUAL.powi(2) * square;
    for _ in 0..limits::CG_STEPS.min(g.len()) {
        let mut applied = derivatives.apply(&direction);
        applied.axpy(added, &direction, 1.0);
        let curvature = direction.dot(&applied);
        if curvature <= 0.0 {
            return None;
        }
        let length = square / curvature;
        solution.axpy(length, &direction, 1.0);
        residual.axpy(-length, &applied, 1.0);
        let next = residual.norm_squared();
        if next <= target {
            break;
        }
        direction = &residual + direction * (next / square);
        square = next;
    }
    Some(solution)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::multisine::Multisine;
    use crate::phases::Phases;

    #[test]
    fn conjugate_gradients_solve_the_damped_system() {
        let m = Multisine::flat(1..=24, 1.0, Phases::Random { seed: 5 }).unwrap();
        let norm = PNorm::new(&m, 8);
        let derivatives = norm.derivatives(m.phases(), &norm.signal(m.phases()), 16);
        // With this damping the matrix is positive definite, so conjugate gradients converge to a
        // step.
        let added = 2.0 * derivatives.mean_curvature();
        let lower = derivatives.hessian();
        let full = DMatrix::from_fn(24, 24, |i, j| lower[(i.max(j), i.min(j))]);
        let step = conjugate_gradients(&derivatives, added).unwrap();
        let residual = full * &step + added * &step - &derivatives.gradient;
        assert!(residual.norm() <= 1.001 * limits::CG_RESIDUAL * derivatives.gradient.norm());
        // With negative damping, conjugate gradients must stop at a direction of negative
        // curvature.
        assert!(conjugate_gradients(&derivatives, -added).is_none());
    }
}
