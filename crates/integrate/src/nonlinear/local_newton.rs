//! The nonlinear equation of a step, reduced to the degrees of freedom of the nonlinear forces.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::error::IntegrateError;
use crate::limits;
use crate::nonlinear::force::{NonlinearForce, Tangents};

/// The nonlinear forces of a system at their p degrees of freedom.
#[derive(Debug, Clone)]
pub(crate) struct LocalForces {
    /// Degrees of freedom of all forces, counted from 0, in ascending order.
    dofs: Vec<usize>,
    forces: Vec<Member>,
}

#[derive(Debug, Clone)]
struct Member {
    force: Arc<dyn NonlinearForce>,
    /// For each degree of freedom of this force, the index among the degrees of freedom of all
    /// forces.
    at: Vec<usize>,
    x: Vec<f64>,
    v: Vec<f64>,
    g: Vec<f64>,
    moved: Vec<f64>,
    tangents: Tangents,
}

impl LocalForces {
    pub(crate) fn from_forces(forces: &[Arc<dyn NonlinearForce>]) -> Option<Self> {
        if forces.is_empty() {
            return None;
        }
        let mut dofs: Vec<usize> = forces.iter().flat_map(|f| f.dofs()).copied().collect();
        dofs.sort_unstable();
        dofs.dedup();
        let index = |dof: &usize| dofs.partition_point(|other| other < dof);
        let forces = forces
            .iter()
            .map(|force| {
                let p = force.dofs().len();
                let [x, v, g, moved] = [(); 4].map(|()| vec![0.0; p]);
                let zeros = || DMatrix::zeros(p, p);
                let tangents = Tangents { stiffness: zeros(), damping: zeros() };
                let at = force.dofs().iter().map(index).collect();
                Member { force: Arc::clone(force), at, x, v, g, moved, tangents }
            })
            .collect();
        Some(Self { dofs, forces })
    }

    pub(crate) fn dofs(&self) -> &[usize] {
        &self.dofs
    }

    /// Writes the sum of the forces into `g`.
    fn force(&mut self, time: f64, x: &[f64], v: &[f64], g: &mut [f64]) {
        g.fill(0.0);
        for member in &mut self.forces {
            member.gather(x, v);
            member.force.force(time, &member.x, &member.v, &mut member.g);
            member.at.iter().zip(&member.g).for_each(|(&at, force)| g[at] += force);
        }
    }

    /// Writes β̂ ∂g/∂x + γ̂ ∂g/∂ẋ, p×p.
    fn tangent(
        &mut self,
        time: f64,
        (x, beta_hat): (&[f64], f64),
        (v, gamma_hat): (&[f64], f64),
        sum: &mut DMatrix<f64>,
    ) {
        sum.fill(0.0);
        for member in &mut self.forces {
            member.gather(x, v);
            member.form_tangents(time);
            for (j, &column) in member.at.iter().enumerate() {
                for (i, &row) in member.at.iter().enumerate() {
                    sum[(row, column)] += beta_hat * member.tangents.stiffness[(i, j)]
                        + gamma_hat * member.tangents.damping[(i, j)];
                }
            }
        }
    }
}

impl Member {
    fn gather(&mut self, x: &[f64], v: &[f64]) {
        for (i, &at) in self.at.iter().enumerate() {
            self.x[i] = x[at];
            self.v[i] = v[at];
        }
    }

    fn form_tangents(&mut self, time: f64) {
        if self.force.tangents(time, &self.x, &self.v, &mut self.tangents) {
            return;
        }
        self.force.force(time, &self.x, &self.v, &mut self.g);
        for j in 0..self.at.len() {
            for of_velocity in [false, true] {
                let values = if of_velocity { &mut self.v } else { &mut self.x };
                let original = values[j];
                let largest = values.iter().fold(0.0, |most, v| f64::max(most, v.abs()));
                let step = limits::TANGENT_DIFFERENCE * if largest > 0.0 { largest } else { 1.0 };
                values[j] = original + step;
                // The difference quotient needs the step after rounding.
                let step = values[j] - original;
                self.force.force(time, &self.x, &self.v, &mut self.moved);
                let values = if of_velocity { &mut self.v } else { &mut self.x };
                values[j] = original;
                let tangent = if of_velocity {
                    &mut self.tangents.damping
                } else {
                    &mut self.tangents.stiffness
                };
                for (i, (moved, g)) in self.moved.iter().zip(&self.g).enumerate() {
                    tangent[(i, j)] = (moved - g) / step;
                }
            }
        }
    }
}

/// Equation a = a_linear − W g(x̂ + β̂ a, v̂ + γ̂ a, t) for the accelerations a; W has the columns
/// of M̂⁻¹ at the nonlinear forces g.
///
/// Only the p accelerations at these forces are unknown; all other accelerations follow from them.
#[derive(Debug)]
pub(crate) struct LocalNewton {
    forces: LocalForces,
    beta_hat: f64,
    gamma_hat: f64,
    /// W, n×p.
    influence: DMatrix<f64>,
    /// The rows of the influence matrix W at the degrees of freedom of the nonlinear forces, p×p.
    local: DMatrix<f64>,
    /// The last solution, which is the initial estimate of the next solution.
    a: DVector<f64>,
    linear: DVector<f64>,
    x_hat: DVector<f64>,
    v_hat: DVector<f64>,
    x: DVector<f64>,
    v: DVector<f64>,
    g: DVector<f64>,
    residual: DVector<f64>,
    step: DVector<f64>,
    tangent: DMatrix<f64>,
    jacobian: DMatrix<f64>,
}

impl LocalNewton {
    /// Creates the equation for a scheme with the given γ̂ and β̂; `influence` is M̂⁻¹ at the
    /// degrees of freedom of `forces`, n×p.
    pub(crate) fn new(
        forces: LocalForces,
        gamma_hat: f64,
        beta_hat: f64,
        influence: DMatrix<f64>,
    ) -> Self {
        let p = forces.dofs.len();
        let local = DMatrix::from_fn(p, p, |i, j| influence[(forces.dofs[i], j)]);
        let [a, linear, x_hat, v_hat, x, v, g, residual, step] =
            [(); 9].map(|()| DVector::zeros(p));
        let [tangent, jacobian] = [(); 2].map(|()| DMatrix::zeros(p, p));
        Self {
            forces,
            beta_hat,
            gamma_hat,
            influence,
            local,
            a,
            linear,
            x_hat,
            v_hat,
            x,
            v,
            g,
            residual,
            step,
            tangent,
            jacobian,
        }
    }

    /// Replaces the linear accelerations `a` (n entries) by the accelerations with nonlinear
    /// forces.
    pub(crate) fn correct(
        &mut self,
        time: f64,
        v_hat: &[f64],
        x_hat: &[f64],
        a: &mut [f64],
    ) -> Result<(), IntegrateError> {
        for (i, &at) in self.forces.dofs.iter().enumerate() {
            self.linear[i] = a[at];
            self.x_hat[i] = x_hat[at];
            self.v_hat[i] = v_hat[at];
        }
        self.solve(time)?;
        let n = a.len();
        nalgebra::DVectorViewMut::from_slice(a, n).gemv(-1.0, &self.influence, &self.g, 1.0);
        Ok(())
    }

    /// Solves for the accelerations a and the nonlinear forces g.
    fn solve(&mut self, time: f64) -> Result<(), IntegrateError> {
        let implicit = self.beta_hat != 0.0 || self.gamma_hat != 0.0;
        if !implicit {
            self.a.copy_from(&self.linear);
            self.evaluate(time);
            return Ok(());
        }
        if !self.a.iter().all(|a| a.is_finite()) {
            self.a.fill(0.0);
        }
        let mut missed = self.evaluate(time);
        for _ in 0..limits::STEP_NEWTON_STEPS {
            if missed <= limits::STEP_RESIDUAL * self.size() {
                return Ok(());
            }
            if !self.newton_step(time) {
                break;
            }
            let mut part = 1.0;
            self.a += &self.step;
            let mut now = self.evaluate(time);
            let is_worse = |now: f64| now.is_nan() || now > missed;
            while is_worse(now) && part > limits::STEP_NEWTON_FRACTION {
                part *= 0.5;
                self.a.axpy(-part, &self.step, 1.0);
                now = self.evaluate(time);
            }
            if is_worse(now) {
                self.a.axpy(-part, &self.step, 1.0);
                missed = self.evaluate(time);
                break;
            }
            missed = now;
        }
        if missed <= limits::STEP_RESIDUAL_ROUNDING * self.size() {
            return Ok(());
        }
        Err(IntegrateError::NotSolved { time, residual: missed })
    }

    /// Returns the largest modulus of an acceleration; the limits of the residual are relative to
    /// it.
    fn size(&self) -> f64 {
        self.linear.amax().max(self.a.amax())
    }

    /// Writes g and the residual a − a_linear + W g at the present accelerations and returns its
    /// largest entry.
    fn evaluate(&mut self, time: f64) -> f64 {
        for i in 0..self.a.len() {
            self.x[i] = self.x_hat[i] + self.beta_hat * self.a[i];
            self.v[i] = self.v_hat[i] + self.gamma_hat * self.a[i];
        }
        let (x, v) = (self.x.as_slice(), self.v.as_slice());
        self.forces.force(time, x, v, self.g.as_mut_slice());
        self.residual.copy_from(&self.a);
        self.residual -= &self.linear;
        self.residual.gemv(1.0, &self.local, &self.g, 1.0);
        // `amax` would ignore NaN.
        self.residual.iter().fold(0.0, |most, r| if r.abs() <= most { most } else { r.abs() })
    }

    /// Writes the Newton step of a; returns false if it does not exist.
    fn newton_step(&mut self, time: f64) -> bool {
        let (x, v) = (self.x.as_slice(), self.v.as_slice());
        let tangent = &mut self.tangent;
        self.forces.tangent(time, (x, self.beta_hat), (v, self.gamma_hat), tangent);
        self.jacobian.fill_with_identity();
        for (mut column, tangent) in self.jacobian.column_iter_mut().zip(self.tangent.column_iter())
        {
            // Most entries of the tangent are zero, because each force acts between few degrees of
            // freedom.
            for (of_one, slope) in self.local.column_iter().zip(tangent.iter()) {
                if *slope != 0.0 {
                    column.axpy(*slope, &of_one, 1.0);
                }
            }
        }
        self.step.copy_from(&self.residual);
        self.step.neg_mut();
        solve_in_place(&mut self.jacobian, &mut self.step)
    }
}

/// Solves A x = b for a small A by elimination with exchanges of rows, writing x over `b` and the
/// factors over `a`; false if A is singular or not finite.
fn solve_in_place(a: &mut DMatrix<f64>, b: &mut DVector<f64>) -> bool {
    let p = b.len();
    for j in 0..p {
        let pivot = (j..p).max_by(|i, k| a[(*i, j)].abs().total_cmp(&a[(*k, j)].abs()));
        let pivot = pivot.unwrap_or(j);
        if !(a[(pivot, j)].abs() > 0.0 && a[(pivot, j)].is_finite()) {
            return false;
        }
        a.swap_rows(j, pivot);
        b.swap_rows(j, pivot);
        // Columns are contiguous in memory.
        let (before, after) = a.as_mut_slice().split_at_mut((j + 1) * p);
        let column = &mut before[j * p..];
        let pivot = column[j];
        let factors = &mut column[j + 1..];
        factors.iter_mut().for_each(|factor| *factor /= pivot);
        let columns = after.chunks_exact_mut(p).chain(std::iter::once(b.as_mut_slice()));
        for column in columns {
            let top = column[j];
            column[j + 1..].iter_mut().zip(&*factors).for_each(|(value, f)| *value -= f * top);
        }
    }
    for j in (0..p).rev() {
        b[j] /= a[(j, j)];
        for i in 0..j {
            b[i] -= a[(i, j)] * b[j];
        }
    }
    true
}
