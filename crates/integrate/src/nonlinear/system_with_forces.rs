//! Linear systems with nonlinear forces.

use std::sync::Arc;

use crate::error::IntegrateError;
use crate::nonlinear::force::NonlinearForce;
use crate::system::{Matrices, System};

/// A linear system with nonlinear forces: M ẍ + C ẋ + K x + Σ g(x, ẋ, t) = F.
///
/// Implicit schemes solve for the few degrees of freedom of these forces by Newton's method. All
/// other degrees of freedom remain linear, so that a step takes only a little more time than
/// without the forces. Stability is checked for the linear part only.
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
