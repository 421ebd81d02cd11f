//! Exact response over one time step.

use mechid_model::{ModelError, SecondOrderSystem};
use mechid_numerics::linear_algebra::exponential;
use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::error::ProblemError;

/// Assumption on the force between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Between {
    /// The force is constant, with the value of the earlier sample.
    Held,
    /// The force is linear from one sample to the next.
    Linear,
}

/// Transition z(t+Δt) = Φ z(t) + Γ0 F(t) + Γ1 F(t+Δt) with z = [x; Δt ẋ], without discretisation
/// error.
///
/// Time is counted in steps, which keeps the exponential well scaled. One matrix exponential gives
/// Φ, Γ0 and Γ1, from the state matrix A and the input matrix B:
///
/// ```text
///     ┌ A  B  0 ┐   ┌ Φ  P1  P2 ┐
/// exp │ 0  0  I │ = │ 0  I   I  │      Γ0 = P1, Γ1 = 0          held
///     └ 0  0  0 ┘   └ 0  0   I  ┘      Γ0 = P1 − P2, Γ1 = P2    linear
/// ```
///
/// # Source
/// Van Loan (1978), IEEE Trans. Automatic Control 23(3), 395–404.
pub(crate) struct Transition {
    pub(crate) phi: DMatrix<f64>,
    from_left: DMatrix<f64>,
    from_right: DMatrix<f64>,
    mass: LU<f64, Dyn, Dyn>,
    system: SecondOrderSystem,
    dt: f64,
}

impl Transition {
    pub(crate) fn new(
        system: &SecondOrderSystem,
        dt: f64,
        between: Between,
    ) -> Result<Self, ProblemError> {
        let n = system.dof();
        let a = in_steps(system, dt);
        let scale = a.iter().map(|v| v.abs()).fold(0.0, f64::max);
        if scale > 1e12 || a.iter().any(|v| v.is_nan()) {
            return Err(ProblemError::StepTooLong { dt, scale });
        }
        let mut generator = DMatrix::zeros(4 * n, 4 * n);
        generator.view_mut((0, 0), (2 * n, 2 * n)).copy_from(&a);
        generator.view_mut((n, 2 * n), (n, n)).fill_with_identity();
        generator.view_mut((2 * n, 3 * n), (n, n)).fill_with_identity();
        let exponential = exponential(&generator)?;
        let block = |column, width| exponential.view((0, column), (2 * n, width)).into_owned();

        let mass = system.mass().clone().lu();
        let unit_forces = DMatrix::identity(n, n) * (dt * dt);
        let input = mass.solve(&unit_forces).expect("the constructor checked M");
        let (p1, p2) = (block(2 * n, n) * &input, block(3 * n, n) * &input);
        let (from_left, from_right) = match between {
            Between::Held => (p1, DMatrix::zeros(2 * n, n)),
            Between::Linear => (p1 - &p2, p2),
        };
        Ok(Self { phi: block(0, 2 * n), from_left, from_right, mass, system: system.clone(), dt })
    }

    /// Returns the state after one step from `state` under the forces at the two ends of the step.
    pub(crate) fn step(
        &self,
        state: &DVector<f64>,
        left: &DVector<f64>,
        right: &DVector<f64>,
    ) -> DVector<f64> {
        &self.phi * state + &self.from_left * left + &self.from_right * right
    }

    /// Returns the state z = [x; Δt ẋ].
    pub(crate) fn state(&self, x: &DVector<f64>, v: &DVector<f64>) -> DVector<f64> {
        let n = self.system.dof();
        DVector::from_fn(2 * n, |i, _| if i < n { x[i] } else { self.dt * v[i - n] })
    }

    /// Returns x, ẋ and ẍ = M⁻¹(F − C ẋ − K x) of a state under a force.
    pub(crate) fn motion(&self, state: &DVector<f64>, force: &DVector<f64>) -> [DVector<f64>; 3] {
        let n = self.system.dof();
        let x = state.rows(0, n).into_owned();
        let v = state.rows(n, n) / self.dt;
        let unbalanced = force - self.system.damping() * &v - self.system.stiffness() * &x;
        let a = self.mass.solve(&unbalanced).expect("the constructor checked M");
        [x, v, a]
    }

    pub(crate) fn check(&self, channels: usize) -> Result<(), ModelError> {
        let dof = self.system.dof();
        if channels == dof { Ok(()) } else { Err(ModelError::ForceChannels { got: channels, dof }) }
    }
}

/// Returns the state matrix for z = [x; Δt ẋ] and time counted in steps.
fn in_steps(system: &SecondOrderSystem, dt: f64) -> DMatrix<f64> {
    let n = system.dof();
    let mut a = system.state_matrix();
    a.view_mut((n, 0), (n, n)).scale_mut(dt * dt);
    a.view_mut((n, n), (n, n)).scale_mut(dt);
    a
}
