//! Periodic steady state, computed directly, without a simulation of the transient.

use mechid_model::Response;
use mechid_numerics::krylov::gmres;
use mechid_signal::Sampling;

use crate::error::IntegrateError;
use crate::limits;
use crate::periodic::period_map::PeriodMap;
use crate::periodic::shooting::Shooting;
use crate::schemes::scheme::Scheme;
use crate::stepping::function_samples::FunctionSamples;
use crate::stepping::sampled_force::{ForceTable, SampledForce};
use crate::stepping::selected_dofs::SelectedDofs;
use crate::stepping::simulation::{Motion, Simulation};
use crate::stepping::transition::Transition;
use crate::system::System;

/// Finds the response that repeats with the force. The samples of the force are one period (samples
/// × n, in N).
///
/// Over one period the scheme is an affine map of its state, z_N = Φ z_0 + g. The periodic state
/// solves (I − Φ) z_0 = g; one pass from rest gives g, and a second pass gives the response. The
/// cost is about two passes, plus the powers of a matrix with two rows per degree of freedom (three
/// for Houbolt and Wilson θ). If the damping is very small, rounding leaves a difference between
/// z_0 and the state at the end of the second pass; the same factors then correct z_0, and the pass
/// is repeated.
///
/// For more than 300 degrees of freedom Φ is not formed: z_0 is found in the Krylov space of g, Φ
/// g, Φ² g … (GMRES), at one pass per vector. Few vectors suffice if most of the motion decays
/// within a period. If a thousand vectors do not suffice, the result is
/// [`IntegrateError::PeriodNotClosed`].
///
/// # Errors
/// The errors of [`integrate`](crate::integrate()); [`IntegrateError::LinearOnly`] if the system
/// has nonlinear forces; [`IntegrateError::NoPeriodicState`] if the free motion repeats too: a
/// rigid body, or an undamped mode of the discretised system exactly on a line;
/// [`IntegrateError::PeriodNotClosed`].
///
/// # Source
/// Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), on shooting for periodic solutions;
/// for a linear system its first step is exact.
pub fn integrate_periodic<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
) -> Result<Response, IntegrateError> {
    let table = ForceTable::periodic(scheme, system.dof(), force.into())?;
    let motion = Motion::zeros(table.sampling().len(), system.dof());
    periodic(scheme, system, table, motion)
}

/// Finds the response as [`integrate_periodic`] does, but for selected degrees of freedom: the
/// force has one column (N) for each degree of freedom in `dofs.forced`, the response one for each
/// in `dofs.observed`.
///
/// ```
/// use mechid_integrate::{Newmark, SelectedDofs, integrate_periodic_selected};
/// use mechid_model::{SparseSystem, band};
/// use mechid_signal::{Record, Sampling};
///
/// // A steady 1 N at the first of 500 masses between walls: the string of springs is straight.
/// let n = 500;
/// let (mass, damping) = (band(n, &[(0, 1.0)]), band(n, &[(0, 20.0)]));
/// let stiffness = band(n, &[(-1, -900.0), (0, 1900.0), (1, -900.0)]);
/// let chain = SparseSystem::new(mass, damping, stiffness)?;
/// let force = Record::from_channel(Sampling::new(0.02, 64)?, vec![1.0; 64])?;
/// let dofs = SelectedDofs { forced: &[0], observed: &[0, 1] };
/// let newmark = Newmark::AVERAGE_ACCELERATION;
/// let response = integrate_periodic_selected(&newmark, &chain, dofs, &force)?;
/// let [first, second] = [0, 1].map(|channel| response.displacement().channel(channel)[9]);
/// assert!((1900.0 * first - 900.0 * second - 1.0).abs() < 1e-11);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`integrate_periodic`]; [`IntegrateError::DofOutside`] and
/// [`IntegrateError::ForcedTwice`].
pub fn integrate_periodic_selected<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    dofs: SelectedDofs<'a>,
    force: impl Into<SampledForce<'a>>,
) -> Result<Response, IntegrateError> {
    dofs.check(system.dof())?;
    let table = ForceTable::periodic(scheme, dofs.forced.len(), force.into())?;
    let table = table.acting_on(dofs.forced, system.dof());
    let motion = Motion::observed(table.sampling().len(), system.dof(), dofs.observed);
    periodic(scheme, system, table, motion)
}

fn periodic(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: ForceTable<'_>,
    motion: Motion<'_>,
) -> Result<Response, IntegrateError> {
    if !system.nonlinear_forces().is_empty() {
        return Err(IntegrateError::LinearOnly { what: "the periodic steady state" });
    }
    if system.dof() <= limits::PERIOD_MAP_DOF {
        by_whole_map(scheme, system, &table, motion)
    } else {
        by_products(scheme, system, table, motion)
    }
}

fn by_whole_map(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: &ForceTable<'_>,
    mut motion: Motion<'_>,
) -> Result<Response, IntegrateError> {
    let (samples, dof) = (table.sampling().len(), system.dof());
    let mut simulation = Simulation::new(scheme, system, table.sampling().dt())?;
    let period =
        PeriodMap::new(&Transition::from_stepper(simulation.stepper()), dof, table.sampling())?;
    simulation.step(table, samples - 1)?;
    simulation.restart(&period.at_rest(&simulation.state));
    simulation.advance(table, 0, samples, &mut motion)?;
    let mut start = period.repeat(&simulation.state);
    let mut missed_before = f64::INFINITY;
    // The first pass gives the response; further passes correct rounding over the period.
    for _ in 0..limits::PERIODIC_PASSES {
        simulation.restart(&start);
        motion.set(0, &start);
        simulation.advance(table, 0, samples, &mut motion)?;
        let gap: Vec<f64> =
            simulation.state.iter().zip(&start).map(|(end, begin)| end - begin).collect();
        let correction = period.repeat(&gap);
        let missed = period.norm(&correction) / period.norm(&start);
        if missed <= limits::PERIODIC_GAP
            || missed > limits::PERIODIC_PROGRESS * missed_before
            || !missed.is_finite()
        {
            break;
        }
        missed_before = missed;
        start.iter_mut().zip(correction).for_each(|(z, dz)| *z += dz);
    }
    motion.into_response(table)
}

/// Finds the periodic response in a Krylov space, without forming the matrix Φ.
fn by_products(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: ForceTable<'_>,
    motion: Motion<'_>,
) -> Result<Response, IntegrateError> {
    let rounding = f64::EPSILON * table.sampling().len() as f64;
    let mut shooting = Shooting::new(scheme, system, table)?;
    let mut start = shooting.state_after_last_step_from_rest()?;
    shooting.measure(&start)?;
    let most = shooting.most_vectors();
    let (mut missed_before, mut products) = (f64::INFINITY, 0);
    for _ in 0..limits::PERIODIC_SEARCHES {
        let gap = shooting.gap(&start)?;
        if !Shooting::largest_modulus(&gap).is_finite() {
            // `response` returns the error that names the sample at which the motion overflows.
            return shooting.response(&start, motion);
        }
        let solution = gmres::solve(&gap, limits::PERIODIC_GMRES_RESIDUAL, most, |state, end| {
            shooting.free(state, end)
        })?;
        products += solution.products;
        log::debug!(
            "after {} passes over the period, the relative residual of the periodic state is {:.1e}",
            solution.products,
            solution.residual
        );
        if solution.reciprocal_condition <= rounding {
            return Err(IntegrateError::NoPeriodicState {
                period: shooting.period(),
                reciprocal_condition: solution.reciprocal_condition,
                rounding,
            });
        }
        start += solution.vector.component_mul(&shooting.scales);
        let size = Shooting::largest_modulus(&start.component_div(&shooting.scales));
        let missed = Shooting::largest_modulus(&solution.vector) / size;
        // If a correction is more than a tenth of the previous correction, only rounding remains,
        // and the search ends.
        let solved = solution.residual <= limits::PERIODIC_GMRES_RESIDUAL;
        if solved
            && (missed <= limits::PERIODIC_GAP
                || missed > limits::PERIODIC_PROGRESS * missed_before)
            || size == 0.0
        {
            return shooting.response(&start, motion);
        }
        missed_before = missed;
    }
    let missed = Shooting::largest_modulus(&shooting.gap(&start)?);
    Err(IntegrateError::PeriodNotClosed { period: shooting.period(), missed, products })
}

/// Finds the response as [`integrate_periodic`] does, for a force given as a function of time with
/// the period of `sampling`; `force(t, f)` writes the n components at t (s) into `f` (N).
///
/// # Errors
/// The errors of [`integrate_periodic`]; [`IntegrateError::NotFinite`] if the function yields a NaN
/// or infinity.
pub fn integrate_periodic_function(
    scheme: &dyn Scheme,
    system: &dyn System,
    sampling: Sampling,
    mut force: impl FnMut(f64, &mut [f64]),
) -> Result<Response, IntegrateError> {
    let sampled = FunctionSamples::from_function(scheme, system.dof(), sampling, &mut force)?;
    integrate_periodic(scheme, system, sampled.force())
}

#[cfg(test)]
mod tests {
    use mechid_model::{SparseSystem, band};
    use mechid_signal::{Multisine, Phases, Record};
    use nalgebra_sparse::SparseEntryMut;

    use super::*;
    use crate::*;

    /// Returns a chain of masses of 1 kg between walls. Each mass also has a spring and a damper to
    /// ground, and C is not symmetric.
    fn chain(dof: usize, damping: f64) -> SparseSystem {
        let stiffness = band(dof, &[(-1, -900.0), (0, 1900.0), (1, -900.0)]);
        let mass = band(dof, &[(0, 1.0)]);
        SparseSystem::new(mass, band(dof, &[(-1, -0.2), (0, damping), (1, -0.3)]), stiffness)
            .unwrap()
    }

    fn schemes() -> Vec<Box<dyn Scheme>> {
        vec![
            Box::new(CentralDifference::default()),
            Box::new(Houbolt::default()),
            Box::new(WilsonTheta::new(1.4).unwrap()),
            Box::new(Newmark::AVERAGE_ACCELERATION),
            Box::new(GeneralisedAlpha::new(0.7).unwrap()),
            Box::new(Bathe::HALVES),
            Box::new(RungeKutta4::LINEAR),
        ]
    }

    fn record(samples: usize) -> Record {
        let sampling = Sampling::new(0.01, samples).unwrap();
        Multisine::flat(1..=9, 1.0, Phases::SchroederBinary).unwrap().sample(sampling).unwrap()
    }

    /// The response found in a Krylov space is compared with the response from the map formed as a
    /// matrix, for every scheme. With the weaker damping, nearly half of the 140 modes still have a
    /// tenth of their motion after a period, so that (I − Φ)⁻¹ amplifies rounding errors.
    #[test]
    fn a_search_finds_what_the_whole_map_gives() {
        let force = record(160);
        for (damping, tolerance) in [(8.0, 1e-12), (2.0, 1e-12)] {
            let system = chain(70, damping);
            for scheme in schemes() {
                let response = |whole: bool| {
                    let dofs = SelectedDofs { forced: &[3], observed: &[0, 3, 69] };
                    let table = ForceTable::periodic(&*scheme, 1, (&force).into()).unwrap();
                    let table = table.acting_on(dofs.forced, 70);
                    let motion = Motion::observed(160, 70, dofs.observed);
                    if whole {
                        by_whole_map(&*scheme, &system, &table, motion).unwrap()
                    } else {
                        by_products(&*scheme, &system, table, motion).unwrap()
                    }
                };
                let (found, judge) = (response(false), response(true));
                let pairs = [
                    (found.displacement(), judge.displacement()),
                    (found.velocity(), judge.velocity()),
                    (found.acceleration(), judge.acceleration()),
                ];
                for (found, judge) in pairs {
                    let missed = (found.data() - judge.data()).amax() / judge.data().amax();
                    assert!(missed < tolerance, "{} {damping}: {missed:e}", scheme.name());
                }
            }
        }
    }

    /// The periodic response of a free chain is refused: a constant displacement repeats in every
    /// period, so that the response is not unique.
    #[test]
    fn what_does_not_repeat_is_refused_at_any_size() {
        let mut stiffness = band(400, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
        for end in [0, 399] {
            if let Some(SparseEntryMut::NonZero(entry)) = stiffness.get_entry_mut(end, end) {
                *entry = 900.0;
            }
        }
        let damping = &stiffness * 0.02;
        let free = SparseSystem::new(band(400, &[(0, 1.0)]), damping, stiffness).unwrap();
        let dofs = SelectedDofs { forced: &[0], observed: &[0] };
        let force = Multisine::flat(1..=9, 1.0, Phases::SchroederBinary).unwrap();
        let force = force.sample(Sampling::new(0.1, 400).unwrap()).unwrap();
        let scheme = Newmark::AVERAGE_ACCELERATION;
        let refused = integrate_periodic_selected(&scheme, &free, dofs, &force);
        let none = matches!(
            refused,
            Err(IntegrateError::NoPeriodicState { .. } | IntegrateError::PeriodNotClosed { .. })
        );
        assert!(none, "{refused:?}");
    }
}
