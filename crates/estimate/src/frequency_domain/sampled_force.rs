//! Forces that are held or linear between their samples.

use mechid_model::{Discretisation, ResponseQuantity, SecondOrderSystem, StateTransition};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector};

/// Sampled response of a system to a force that is held or linear between its samples.
struct SampledResponse<'a> {
    system: &'a SecondOrderSystem,
    step: StateTransition,
    inverse_mass: DMatrix<f64>,
    dt: f64,
    /// Number of degrees of freedom.
    dof: usize,
}

impl<'a> SampledResponse<'a> {
    fn new(system: &'a SecondOrderSystem, dt: f64, between: Discretisation) -> Option<Self> {
        let mut step =
            StateTransition::exact(system, dt, &StateTransition::force_input(system, dt)).ok()?;
        match between {
            Discretisation::Euler => return None,
            Discretisation::ZeroOrderHold => step.ramp.fill(0.0),
            Discretisation::FirstOrderHold => {}
        }
        let inverse_mass = system.mass().clone().lu().try_inverse()?;
        Some(Self { system, step, inverse_mass, dt, dof: system.dof() })
    }

    /// Returns the sampled response, in the given quantity, to a force (N) at ω (rad/s).
    fn at(
        &self,
        omega: f64,
        force: &DVector<Complex<f64>>,
        quantity: ResponseQuantity,
    ) -> Option<DVector<Complex<f64>>> {
        let turn = Complex::cis(omega * self.dt);
        let complex = |matrix: &DMatrix<f64>| matrix.map(|entry| Complex::new(entry, 0.0));
        let input = complex(&self.step.held) + complex(&self.step.ramp) * (turn - 1.0);
        let order = 2 * self.dof;
        let pencil =
            DMatrix::<Complex<f64>>::identity(order, order) * turn - complex(&self.step.state);
        let state = pencil.lu().solve(&(input * force))?;
        let displacement = state.rows(0, self.dof).into_owned();
        let velocity = state.rows(self.dof, self.dof) / Complex::from(self.dt);
        Some(match quantity {
            ResponseQuantity::Displacement => displacement,
            ResponseQuantity::Velocity => velocity,
            ResponseQuantity::Acceleration => {
                let by_damping = complex(self.system.damping()) * velocity;
                let by_stiffness = complex(self.system.stiffness()) * displacement;
                complex(&self.inverse_mass) * (force - by_damping - by_stiffness)
            }
        })
    }
}

/// Returns the data with an equivalent band-limited force (N). The force of the data is held or
/// linear between its samples, which are `dt` (s) apart; at the samples `system` responds to both
/// forces in the same way. `None` for Euler's rule, and if a response does not exist.
///
/// # Source
/// Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed. (1997), section 2.3 (sampling of a
/// continuous system).
pub fn equivalent_force(
    data: &FrequencyData,
    system: &SecondOrderSystem,
    dt: f64,
    between: Discretisation,
) -> Option<FrequencyData> {
    let sampled = SampledResponse::new(system, dt, between)?;
    let mut equivalent = data.force().clone();
    for (row, &omega) in data.omega().iter().enumerate() {
        let force = data.force().row(row).transpose();
        let response = sampled.at(omega, &force, data.measured())?;
        let displacement = response / data.measured().per_displacement(omega);
        let force = system.dynamic_stiffness(omega) * displacement;
        equivalent.row_mut(row).copy_from(&force.transpose());
    }
    let is_finite = equivalent.iter().all(|force| force.is_finite());
    is_finite.then(|| data.with_force(equivalent))
}
