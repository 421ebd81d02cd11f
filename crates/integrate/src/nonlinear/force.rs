//! Nonlinear forces g of displacement, velocity and time: M ẍ + C ẋ + K x + g(x, ẋ, t) = F.

use std::fmt;
use std::sync::Arc;

use nalgebra::DMatrix;

use crate::error::IntegrateError;
use crate::system::{Matrices, System};

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

/// Derivatives of a nonlinear force by displacement and velocity.
#[derive(Debug, Clone, PartialEq)]
pub struct Tangents {
    /// ∂g/∂x, p × p, in N/m.
    pub stiffness: DMatrix<f64>,
    /// ∂g/∂ẋ, p × p, in N·s/m.
    pub damping: DMatrix<f64>,
}

/// A linear system with nonlinear forces: M ẍ + C ẋ + K x + Σ g(x, ẋ, t) = F.
///
/// Implicit schemes solve for the few degrees of freedom of these forces by Newton's method; the
/// others remain linear, so that a step costs little more. Stability is checked for the linear part
/// only.
///
/// ```
/// use mechid_integrate::{Newmark, SystemWithForces, TermForces, integrate};
/// use mechid_model::{InitialState, Sdof};
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dvector;
///
/// // Duffing's oscillator, ẍ + x + x³ = 0, let go at 1 m: its period is 4.7680 s, not 2π s.
/// let linear = Sdof::new(1.0, 0.0, 1.0)?.system();
/// let hardening = TermForces::new(&"k3: x1^3".parse()?, &[1.0])?;
/// let duffing = SystemWithForces::new(&linear).with(hardening)?;
/// let none = Record::from_channel(Sampling::new(4.768 / 400.0, 401)?, vec![0.0; 401])?;
/// let start = InitialState::new(dvector![1.0], dvector![0.0])?;
/// let response = integrate(&Newmark::AVERAGE_ACCELERATION, &duffing, &none, &start)?;
/// assert!((response.displacement().channel(0)[400] - 1.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct SystemWithForces<'a> {
    linear: Matrices<'a>,
    forces: Vec<Arc<dyn NonlinearForce>>,
}

impl<'a> SystemWithForces<'a> {
    /// Creates the system of the linear part, without nonlinear forces.
    pub fn new(linear: &'a dyn System) -> Self {
        Self { linear: linear.matrices(), forces: linear.nonlinear_forces().to_vec() }
    }

    /// Returns the system with one more force.
    ///
    /// # Errors
    /// [`IntegrateError::DofOutside`] and [`IntegrateError::ForcedTwice`] if the force acts on
    /// degrees of freedom outside the system, or twice on the same one.
    pub fn with(mut self, force: impl NonlinearForce + 'static) -> Result<Self, IntegrateError> {
        let dof = self.dof();
        for (k, &index) in force.dofs().iter().enumerate() {
            if index >= dof {
                return Err(IntegrateError::DofOutside { index, dof });
            }
            if force.dofs()[..k].contains(&index) {
                return Err(IntegrateError::ForcedTwice { index });
            }
        }
        self.forces.push(Arc::new(force));
        Ok(self)
    }
}

impl System for SystemWithForces<'_> {
    fn matrices(&self) -> Matrices<'_> {
        self.linear
    }

    fn nonlinear_forces(&self) -> &[Arc<dyn NonlinearForce>] {
        &self.forces
    }
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
