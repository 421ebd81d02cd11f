//! Nonlinear forces g of displacement, velocity and time: M ẍ + C ẋ + K x + g(x, ẋ, t) = F.

use std::fmt;

use nalgebra::DMatrix;

/// A force g(x, ẋ, t) between p degrees of freedom, on the left side of the equation of motion: the
/// g of a spring grows with x.
pub trait NonlinearForce: fmt::Debug + Send + Sync {
    /// The p degrees of freedom, counted from 0, none twice.
    fn dofs(&self) -> &[usize];

    /// Writes g (N, p entries) at `time` (s) for the displacements `x` (m, p entries) and
    /// velocities `v` (m/s, p entries) of these degrees of freedom.
    fn force(&self, time: f64, x: &[f64], v: &[f64], g: &mut [f64]);

    /// Writes the tangents ∂g/∂x (N/m, p×p) and ∂g/∂ẋ (N·s/m, p×p) and returns true. The default
    /// returns false: the tangents are then formed by differences of the force.
    fn tangents(&self, time: f64, x: &[f64], v: &[f64], tangents: &mut Tangents) -> bool {
        let _ = (time, x, v, tangents);
        false
    }
}

/// Derivatives of a nonlinear force with respect to displacement and velocity.
#[derive(Debug, Clone, PartialEq)]
pub struct Tangents {
    /// ∂g/∂x, p × p, in N/m.
    pub stiffness: DMatrix<f64>,
    /// ∂g/∂ẋ, p × p, in N·s/m.
    pub damping: DMatrix<f64>,
}

/// A nonlinear force given as a function.
///
/// ```
/// use mechid_integrate::{NonlinearForce, ForceFunction};
///
/// // A pendulum of 1 kg on 1 m: m g sin x, in place of the spring.
/// let gravity = ForceFunction::new(vec![0], |_time, x, _v, g| g[0] = 9.81 * x[0].sin());
/// let mut g = [0.0];
/// gravity.force(0.0, &[0.1], &[0.0], &mut g);
/// assert!((g[0] - 0.9794).abs() < 1e-4);
/// ```
pub struct ForceFunction<F> {
    dofs: Vec<usize>,
    function: F,
}

impl<F: Fn(f64, &[f64], &[f64], &mut [f64]) + Send + Sync> ForceFunction<F> {
    /// `function(t, x, v, g)` writes the forces (N) on the p degrees of freedom `dofs`, counted
    /// from 0, into `g`, for their displacements `x` (m) and velocities `v` (m/s) at t (s), p
    /// entries each.
    pub fn new(dofs: Vec<usize>, function: F) -> Self {
        Self { dofs, function }
    }
}

impl<F> fmt::Debug for ForceFunction<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ForceFunction").field("dofs", &self.dofs).finish_non_exhaustive()
    }
}

impl<F: Fn(f64, &[f64], &[f64], &mut [f64]) + Send + Sync> NonlinearForce for ForceFunction<F> {
    fn dofs(&self) -> &[usize] {
        &self.dofs
    }

    fn force(&self, time: f64, x: &[f64], v: &[f64], g: &mut [f64]) {
        (self.function)(time, x, v, g);
    }
}
