//! Transition of the state from one sample to the next.

use nalgebra::DMatrix;

use crate::{ModelError, SecondOrderSystem};
use mechid_numerics::linear_algebra::exponential;

/// Transition of the state z over one step Δt: z(k+1) = Φ z(k) + Γ₀ u(k) + Γ₁ (u(k+1) − u(k)). The
/// last term applies only to an input u that is linear between samples.
///
/// In step units the state is z = \[x; Δt ẋ\] and time is τ = t/Δt, so that no entry is large
/// unless the step is long for the system:
///
/// ```text
/// d ┌  x   ┐   ┌      0           I     ┐ ┌  x   ┐   ┌ 0 ┐
/// ──│      │ = │                        │ │      │ + │   │ u
/// dτ└ Δt ẋ ┘   └ −Δt² M⁻¹K   −Δt M⁻¹C   ┘ └ Δt ẋ ┘   └ B ┘
/// ```
///
/// With B = Δt² M⁻¹ the input u is the force F, with B = I it is Δt² M⁻¹ F.
///
/// ```
/// use mechid_model::{SecondOrderSystem, StateTransition};
/// use nalgebra::{DVector, dmatrix, dvector};
///
/// // A free mass of 2 kg under 6 N, from rest for half a second: x = ½·3·0.25 m, ẋ = 1.5 m/s.
/// let zero = dmatrix![0.0];
/// let mass = SecondOrderSystem::new(dmatrix![2.0], zero.clone(), zero)?;
/// let dt = 0.5;
/// let step = StateTransition::exact(&mass, dt, &StateTransition::force_input(&mass, dt))?;
/// let z: DVector<f64> = &step.held * dvector![6.0];
/// assert!((z[0] - 0.375).abs() < 1e-15 && (z[1] / dt - 1.5).abs() < 1e-15);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct StateTransition {
    /// Φ, 2n × 2n, dimensionless.
    pub state: DMatrix<f64>,
    /// Γ₀, 2n × inputs, in m per unit of the input: effect of an input that keeps its initial value
    /// over the step.
    pub held: DMatrix<f64>,
    /// Γ₁, 2n × inputs, in the unit of Γ₀: effect of an input that rises from 0 to 1 over the step.
    pub ramp: DMatrix<f64>,
}

impl StateTransition {
    /// Computes the exact transition for any step, for the input matrix B (n × inputs, in m per
    /// unit of the input): one matrix exponential of order 2(n + inputs).
    ///
    /// # Errors
    /// [`ModelError::ForceChannels`] if B does not have one row per degree of freedom;
    /// [`ModelError::Numerics`] if the step is so long that Φ overflows.
    ///
    /// # Source
    /// Van Loan (1978), IEEE Trans. Automatic Control 23(3), 395–404.
    pub fn exact(
        system: &SecondOrderSystem,
        dt: f64,
        input: &DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        let (n, inputs) = (system.dof(), input.ncols());
        if input.nrows() != n {
            return Err(ModelError::ForceChannels { got: input.nrows(), dof: n });
        }
        let (states, order) = (2 * n, 2 * (n + inputs));
        let mut generator = DMatrix::zeros(order, order);
        generator.view_mut((0, 0), (states, states)).copy_from(&Self::rate(system, dt));
        generator.view_mut((n, states), (n, inputs)).copy_from(input);
        generator.view_mut((states, states + inputs), (inputs, inputs)).fill_with_identity();
        let exponential = exponential(&generator)?;
        let block = |at, width| exponential.view((0, at), (states, width)).into_owned();
        Ok(Self {
            state: block(0, states),
            held: block(states, inputs),
            ramp: block(states + inputs, inputs),
        })
    }

    /// Computes the transition for a constant input. The exponential series ends with the term of
    /// power p = `order`; order 1 is Euler's rule. The input matrix is B = I (n inputs, in m).
    ///
    /// ```text
    /// Φ = Σ_{j=0}^{p} Aʲ/j!      Γ₀ = Σ_{j=0}^{p−1} Aʲ B/(j+1)!
    /// ```
    ///
    /// # Source
    /// Dissertation eqs. (4.5.9)–(4.5.12) for order 1.
    pub fn taylor(system: &SecondOrderSystem, dt: f64, order: usize) -> Self {
        let n = system.dof();
        let rate = Self::rate(system, dt);
        let mut term = DMatrix::identity(2 * n, 2 * n);
        let (mut state, mut held) = (term.clone(), DMatrix::zeros(2 * n, n));
        for j in 1..=order {
            term /= j as f64;
            held += term.columns(n, n);
            term = &term * &rate;
            state += &term;
        }
        Self { state, held, ramp: DMatrix::zeros(2 * n, n) }
    }

    /// Returns the rate matrix A in step units, 2n×2n, dimensionless.
    ///
    /// # Source
    /// Dissertation eqs. (4.5.8) and (4.5.26), there in s⁻¹ and s⁻².
    pub fn rate(system: &SecondOrderSystem, dt: f64) -> DMatrix<f64> {
        let n = system.dof();
        let mass = system.mass().clone().lu();
        let mut rate = DMatrix::zeros(2 * n, 2 * n);
        rate.view_mut((0, n), (n, n)).fill_with_identity();
        for (column, matrix, unit) in [(0, system.stiffness(), dt * dt), (n, system.damping(), dt)]
        {
            let solved = mass.solve(matrix).expect("a system's mass matrix is invertible");
            rate.view_mut((n, column), (n, n)).copy_from(&(solved * -unit));
        }
        rate
    }

    /// Returns the input matrix B = Δt² M⁻¹, n × n, in m/N: the input is the force.
    ///
    /// # Source
    /// The state z = [x; Δt ẋ] of M ẍ + C ẋ + K x = F.
    pub fn force_input(system: &SecondOrderSystem, dt: f64) -> DMatrix<f64> {
        let unit = DMatrix::identity(system.dof(), system.dof());
        let solved = system.mass().clone().lu().solve(&unit);
        solved.expect("a system's mass matrix is invertible") * (dt * dt)
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Record, Sampling};
    use nalgebra::{DVector, dmatrix, dvector};

    use super::*;
    use crate::Sdof;

    /// A step gives the response of the closed form of one degree of freedom, for a held and for a
    /// linear force.
    #[test]
    fn a_step_is_the_closed_form() {
        let (sdof, dt, force) = (Sdof::new(3.0, 0.8, 50.0).unwrap(), 0.13, [4.0, -7.0]);
        let (system, start) = (sdof.system(), dvector![0.02, dt * -0.3]);
        let step = StateTransition::exact(&system, dt, &StateTransition::force_input(&system, dt))
            .unwrap();
        let record = Record::from_channel(Sampling::new(dt, 2).unwrap(), force.to_vec()).unwrap();
        let held = sdof.held_force_response(&record, 0.02, -0.3).unwrap();
        let linear = sdof.linear_force_response(&record, 0.02, -0.3).unwrap();
        let rise = force[1] - force[0];
        let stepped = &step.state * start + &step.held * dvector![force[0]];
        for (response, z) in
            [(held, stepped.clone()), (linear, stepped + &step.ramp * dvector![rise])]
        {
            let end = [response.displacement().channel(0)[1], response.velocity().channel(0)[1]];
            assert!((z[0] - end[0]).abs() < 1e-15 && (z[1] / dt - end[1]).abs() < 1e-14);
        }
    }

    #[test]
    fn forces_on_some_degrees_of_freedom_are_columns_of_all() {
        let system = SecondOrderSystem::new(
            dmatrix![2.0, 0.3; 0.1, 4.0],
            dmatrix![1.0, 2.0; 3.0, 4.0],
            dmatrix![8.0, -2.0; 6.0, 12.0],
        )
        .unwrap();
        let all = StateTransition::force_input(&system, 0.2);
        let one = StateTransition::exact(&system, 0.2, &all.columns(1, 1).into_owned()).unwrap();
        let all = StateTransition::exact(&system, 0.2, &all).unwrap();
        assert!((one.held - all.held.columns(1, 1)).norm() < 1e-16);
        assert!((one.ramp - all.ramp.columns(1, 1)).norm() < 1e-16);
        assert!((one.state - all.state).norm() < 1e-15);
    }

    #[test]
    fn the_series_ends_at_the_exponential_and_begins_with_eulers_rule() {
        let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![1.0], dmatrix![8.0]).unwrap();
        let exact = StateTransition::exact(&system, 0.1, &dmatrix![1.0]).unwrap();
        let long = StateTransition::taylor(&system, 0.1, 12);
        assert!((long.state - exact.state).norm() < 1e-15);
        assert!((long.held - exact.held).norm() < 1e-15);
        let euler = StateTransition::taylor(&system, 0.1, 1);
        let identity: DMatrix<f64> = DMatrix::identity(2, 2);
        assert_eq!(euler.state, identity + StateTransition::rate(&system, 0.1));
        let unit: DVector<f64> = dvector![0.0, 1.0];
        assert_eq!(euler.held.column(0), unit);
    }
}
