//! Forces that are held or linear between their samples.

use mechid_model::{Discretisation, ResponseQuantity, SecondOrderSystem, StateTransition};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

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

    /// Returns the sampled responses, in the given quantity, to forces (N) at ω (rad/s). Each
    /// column of both is one case.
    fn at(
        &self,
        omega: f64,
        force: &DMatrix<Complex<f64>>,
        quantity: ResponseQuantity,
    ) -> Option<DMatrix<Complex<f64>>> {
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

/// Returns the data with an equivalent band-limited force (N), and with the variance of its noise.
/// The force of the data is held or linear between its samples, which are `dt` (s) apart; at the
/// samples `system` responds to both forces in the same way. `None` for Euler's rule, and if a
/// response does not exist.
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
    let (mut equivalent, mut variance) = (data.force().clone(), data.force_variance().clone());
    for (row, &omega) in data.omega().iter().enumerate() {
        let noisy: Vec<usize> =
            (0..data.dof()).filter(|dof| data.force_variance()[(row, *dof)] > 0.0).collect();
        let mut loads = DMatrix::zeros(data.dof(), 1 + noisy.len());
        loads.set_column(0, &data.force().row(row).transpose());
        for (column, &dof) in noisy.iter().enumerate() {
            loads[(dof, 1 + column)] = Complex::from(1.0);
        }
        let responses = sampled.at(omega, &loads, data.measured())?;
        let displacements = responses / data.measured().per_displacement(omega);
        let forces = system.dynamic_stiffness(omega) * displacements;
        equivalent.row_mut(row).tr_copy_from(&forces.column(0));
        for (column, &dof) in noisy.iter().enumerate() {
            variance[(row, dof)] *= forces[(dof, 1 + column)].norm_sqr();
        }
    }
    let is_finite = equivalent.iter().all(|force| force.is_finite());
    is_finite.then(|| data.with_noisy_force(equivalent, variance))
}
