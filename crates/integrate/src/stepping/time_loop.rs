//! Simulation from given initial values.

use mechid_model::{InitialState, Response};
use mechid_signal::{Record, Sampling};

use crate::error::IntegrateError;
use crate::schemes::scheme::Scheme;
use crate::stepping::function_samples::FunctionSamples;
use crate::stepping::sampled_force::{ForceTable, SampledForce};
use crate::stepping::selected_dofs::SelectedDofs;
use crate::stepping::simulation::{Motion, Simulation};
use crate::stepping::stepper::check_finite;
use crate::system::System;

/// Computes the motion of `system` from `initial` under a sampled force (samples × n, in N).
///
/// Displacement, velocity and acceleration belong to the instants of the samples of the force; the
/// first is t = 0.
///
/// # Errors
/// The errors of [`Scheme::prepare`]; [`IntegrateError::Components`] if force or initial values do
/// not fit the system; [`IntegrateError::MidStepMissing`]; [`IntegrateError::NotAtRest`];
/// [`IntegrateError::Overflow`].
pub fn integrate<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Response, IntegrateError> {
    let table = ForceTable::ending(scheme, system.dof(), force.into())?;
    let motion = Motion::zeros(table.sampling().len(), system.dof());
    simulate(scheme, system, &table, initial, motion)?.into_response(&table)
}

/// Simulates as [`integrate`] does and returns only the displacement, samples × n in m. It needs a
/// third of the memory of [`integrate`]. For few degrees of freedom it also takes less time,
/// because most of the time is used to write to memory.
///
/// ```
/// use mechid_integrate::{Newmark, integrate, integrate_displacement};
/// use mechid_model::{InitialState, Sdof};
/// use mechid_signal::{Record, Sampling};
///
/// let system = Sdof::new(1.0, 0.2, 40.0)?.system();
/// let force = Record::from_channel(Sampling::new(0.01, 500)?, vec![1.0; 500])?;
/// let (scheme, rest) = (Newmark::AVERAGE_ACCELERATION, InitialState::rest(1));
/// let displacement = integrate_displacement(&scheme, &system, &force, &rest)?;
/// assert_eq!(&displacement, integrate(&scheme, &system, &force, &rest)?.displacement());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`integrate`].
pub fn integrate_displacement<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Record, IntegrateError> {
    let table = ForceTable::ending(scheme, system.dof(), force.into())?;
    let motion = Motion::displacement(table.sampling().len(), system.dof());
    simulate(scheme, system, &table, initial, motion)?.into_displacement(&table)
}

/// Computes the motion of some degrees of freedom of `system` from `initial` under a sampled force
/// (in N) that acts on some degrees of freedom: the force has samples × `dofs.forced`, the response
/// samples × `dofs.observed`.
///
/// ```
/// use mechid_integrate::{Newmark, SelectedDofs, integrate_selected};
/// use mechid_model::{InitialState, SparseSystem, band};
/// use mechid_signal::{Record, Sampling};
///
/// // A step of 1 N at one end of a chain of 1000; the wave has not reached the middle after 2 s.
/// let n = 1000;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// let chain = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[(0, 0.1)]), stiffness)?;
/// let force = Record::from_channel(Sampling::new(1e-2, 200)?, vec![1.0; 200])?;
/// let dofs = SelectedDofs { forced: &[0], observed: &[0, 500] };
/// let rest = InitialState::rest(n);
/// let response = integrate_selected(&Newmark::AVERAGE_ACCELERATION, &chain, dofs, &force, &rest)?;
/// let [near, far] = [0, 1].map(|channel| response.displacement().channel(channel)[199]);
/// assert!(near > 1e-4 && far.abs() < 1e-20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`integrate`]; [`IntegrateError::DofOutside`] and [`IntegrateError::ForcedTwice`].
pub fn integrate_selected<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    dofs: SelectedDofs<'a>,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Response, IntegrateError> {
    dofs.check(system.dof())?;
    let table = ForceTable::ending(scheme, dofs.forced.len(), force.into())?;
    let table = table.acting_on(dofs.forced, system.dof());
    let motion = Motion::observed(table.sampling().len(), system.dof(), dofs.observed);
    simulate(scheme, system, &table, initial, motion)?.into_response(&table)
}

/// Computes the motion of `system` from `initial` under a force given as a function of time:
/// `force(t, f)` writes the n components at t (s) into `f` (N).
///
/// Every scheme uses the values of the function at the instants at which it needs the force.
///
/// # Errors
/// The errors of [`integrate`]; [`IntegrateError::NotFinite`] if the function yields a NaN or
/// infinity.
pub fn integrate_function(
    scheme: &dyn Scheme,
    system: &dyn System,
    sampling: Sampling,
    initial: &InitialState,
    mut force: impl FnMut(f64, &mut [f64]),
) -> Result<Response, IntegrateError> {
    let sampled = FunctionSamples::from_function(scheme, system.dof(), sampling, &mut force)?;
    let mut next = vec![0.0; system.dof()];
    let end = sampling.duration();
    force(end, &mut next);
    check_finite("the force", &next, end)?;
    let table = ForceTable::ending(scheme, system.dof(), sampled.force())?.continued(next);
    let motion = Motion::zeros(sampling.len(), system.dof());
    simulate(scheme, system, &table, initial, motion)?.into_response(&table)
}

fn simulate<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: &ForceTable<'_>,
    initial: &InitialState,
    mut motion: Motion<'a>,
) -> Result<Motion<'a>, IntegrateError> {
    let dof = system.dof();
    initial.check_dof(dof)?;
    let sampling = table.sampling();
    let mut simulation = Simulation::new(scheme, system, sampling.dt())?;
    let first = simulation.stepper().first();
    let mut motions = vec![vec![0.0; 3 * dof]; first + 1];
    simulation.start(initial, &table.early(first), &mut motions)?;
    for (k, values) in motions.iter().enumerate().take(sampling.len()) {
        motion.set(k, values);
    }
    simulation.advance(table, first, (sampling.len() - 1).max(first), &mut motion)?;
    Ok(motion)
}
