//! Periodic responses of nonlinear systems, and their stability.

use mechid_model::{InitialState, Response};
use mechid_numerics::RealSchur;
use mechid_numerics::krylov::arnoldi::{Arnoldi, Dominant};
use mechid_numerics::krylov::gmres;
use mechid_numerics::krylov::start_vector::numbered_start_vector;
use nalgebra::{Complex, DMatrix, DVector};

use crate::error::IntegrateError;
use crate::limits;
use crate::periodic::shooting::Shooting;
use crate::schemes::scheme::Scheme;
use crate::stepping::sampled_force::{ForceTable, SampledForce};
use crate::stepping::selected_dofs::SelectedDofs;
use crate::stepping::simulation::Motion;
use crate::system::System;

/// A periodic response and the stability of small disturbances of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicOrbit {
    response: Response,
    multipliers: Vec<Complex<f64>>,
    multiplier_error: f64,
    scheme_error: Option<f64>,
}

impl PeriodicOrbit {
    /// One period of the response.
    pub fn response(&self) -> &Response {
        &self.response
    }

    /// Returns the 2n Floquet multipliers, largest first: the pure numbers that multiply
    /// disturbances of the orbit in each period, with an error of about 1e-9 of the largest. A
    /// scheme with a memory has further multipliers; only the 2n largest are returned. For more
    /// than 64 degrees of freedom the list contains only the largest multiplier, by Arnoldi's
    /// iteration; it is empty if numbers overflow.
    pub fn multipliers(&self) -> &[Complex<f64>] {
        &self.multipliers
    }

    /// Returns the numerical error of the largest multiplier (pure number). The error due to the
    /// time step is not included; [`scheme_error`](Self::scheme_error) returns that error. For more
    /// than 64 degrees of freedom, the numerical error is the norm of the residual of this
    /// multiplier; it is large if many multipliers have about the same modulus.
    pub fn multiplier_error(&self) -> f64 {
        self.multiplier_error
    }

    /// Returns an estimate of the error of the largest multiplier due to the time step of the
    /// scheme (pure number): the change of the multiplier with twice the step. For a scheme of
    /// order p, this change is about 2ᵖ − 1 times the error. `None` if the number of samples is
    /// odd, or if there is no orbit with twice the step.
    ///
    /// # Source
    /// Richardson (1911), Philosophical Transactions of the Royal Society A 210, 307–357.
    pub fn scheme_error(&self) -> Option<f64> {
        self.scheme_error
    }

    /// Returns whether small disturbances decay: all multipliers are inside the unit circle, and
    /// none overflows.
    pub fn is_stable(&self) -> bool {
        let largest = self.multipliers.first();
        largest.is_some_and(|multiplier| multiplier.norm() < 1.0)
    }
}

/// Finds a response of `system`, which may have nonlinear forces, that repeats with the force. The
/// samples of the force are one period (samples × n, in N). The method is shooting.
///
/// From `guess` the system first moves freely for `settling` periods, which leads to a stable orbit
/// nearby; Newton's method on the state at the first sample then closes the orbit, stable or not. A
/// nonlinear system may have several orbits. Some may repeat only after two or more periods of the
/// force; to find these, give a force record of that number of periods. Nonlinear forces that
/// depend on time must repeat with the force.
///
/// If the number of samples is even, the orbit is found again with twice the step. The difference
/// shows the error of the multipliers due to the time step; the second search increases the
/// computing time by half.
///
/// Up to 64 degrees of freedom a Newton step costs two passes over the period for each entry of the
/// state. For more degrees of freedom, the derivative of the state over a period is not formed. The
/// step is then found in the Krylov space of products with this derivative (GMRES), at two passes
/// for each product. Few products suffice if most of the motion decays within a period, but many
/// lightly damped modes need many products. For linear systems
/// [`integrate_periodic`](crate::integrate_periodic) finds the response directly.
///
/// ```
/// use mechid_integrate::{Newmark, SystemWithForces, TermForces, periodic_orbit};
/// use mechid_model::{InitialState, Sdof};
/// use mechid_signal::{Record, Sampling};
///
/// // ẍ + 0.1 ẋ + x + x³ = F; F is such that x = cos 2t is a response.
/// let linear = Sdof::new(1.0, 0.1, 1.0)?.system();
/// let hardening = TermForces::new(&"k3: x1^3".parse()?, &[1.0])?;
/// let system = SystemWithForces::new(&linear).with(hardening)?;
/// let sampling = Sampling::new(std::f64::consts::PI / 400.0, 400)?;
/// let force = |k: usize| {
///     let (s, c) = (2.0 * sampling.time(k)).sin_cos();
///     -4.0 * c - 0.2 * s + c + c.powi(3)
/// };
/// let force = Record::from_channel(sampling, (0..400).map(force).collect())?;
/// let near = InitialState::new([0.9].to_vec().into(), [0.0].to_vec().into())?;
/// let orbit = periodic_orbit(&Newmark::AVERAGE_ACCELERATION, &system, &force, &near, 0)?;
/// let start = orbit.response().displacement().channel(0)[0];
/// assert!((start - 1.0).abs() < 1e-3, "{start}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`integrate`](crate::integrate()); [`IntegrateError::NoOrbit`] if Newton's method
/// does not converge from `guess`, and [`IntegrateError::NoPeriodicState`] if the orbits are not
/// isolated.
///
/// # Source
/// Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), sections 6.3 (shooting) and 7.1
/// (Floquet theory); Sánchez, Net, García-Archilla & Simó, "Newton–Krylov continuation of periodic
/// orbits for Navier–Stokes flows", *J. Comput. Phys.* 201 (2004), for many degrees of freedom.
pub fn periodic_orbit<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    guess: &InitialState,
    settling: usize,
) -> Result<PeriodicOrbit, IntegrateError> {
    with_scheme_error(force.into(), |force| {
        let table = ForceTable::periodic(scheme, system.dof(), force)?;
        let motion = Motion::zeros(table.sampling().len(), system.dof());
        closed(scheme, system, table, motion, guess, settling)
    })
}

/// Finds a periodic response as [`periodic_orbit`] does, but for selected degrees of freedom: the
/// force has one column (N) for each degree of freedom in `dofs.forced`, the response one for each
/// in `dofs.observed`.
///
/// # Errors
/// The errors of [`periodic_orbit`]; [`IntegrateError::DofOutside`] and
/// [`IntegrateError::ForcedTwice`].
pub fn periodic_orbit_selected<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    dofs: SelectedDofs<'a>,
    force: impl Into<SampledForce<'a>>,
    guess: &InitialState,
    settling: usize,
) -> Result<PeriodicOrbit, IntegrateError> {
    dofs.check(system.dof())?;
    with_scheme_error(force.into(), |force| {
        let table = ForceTable::periodic(scheme, dofs.forced.len(), force)?;
        let table = table.acting_on(dofs.forced, system.dof());
        let motion = Motion::observed(table.sampling().len(), system.dof(), dofs.observed);
        closed(scheme, system, table, motion, guess, settling)
    })
}

/// Finds an orbit, and estimates the error of its largest multiplier from a second search with
/// twice the step.
fn with_scheme_error(
    force: SampledForce<'_>,
    find: impl Fn(SampledForce<'_>) -> Result<PeriodicOrbit, IntegrateError>,
) -> Result<PeriodicOrbit, IntegrateError> {
    let mut orbit = find(force)?;
    let twice = force.with_twice_the_step();
    let coarse = twice
        .and_then(|[samples, middle]| find(SampledForce::with_mid_step(&samples, &middle)).ok());
    let largest = orbit.multipliers.first().copied();
    orbit.scheme_error = coarse.zip(largest).and_then(|(coarse, largest)| {
        let change = |m: &Complex<f64>| (m - largest).norm().min((m.conj() - largest).norm());
        coarse.multipliers.iter().map(change).min_by(f64::total_cmp)
    });
    Ok(orbit)
}

fn closed(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: ForceTable<'_>,
    motion: Motion<'_>,
    guess: &InitialState,
    settling: usize,
) -> Result<PeriodicOrbit, IntegrateError> {
    let dof = system.dof();
    guess.check_dof(dof)?;
    let mut shooting = Shooting::new(scheme, system, table)?;
    let start = shooting.settle(guess, settling)?;
    let (state, multipliers, multiplier_error) = if dof <= limits::MONODROMY_DOF {
        let (state, mut multipliers) = by_whole_derivative(&mut shooting, start)?;
        multipliers.truncate(2 * dof);
        let error =
            multipliers.first().map_or(0.0, |largest| limits::MONODROMY_ERROR * largest.norm());
        (state, multipliers, error)
    } else {
        let state = by_products(&mut shooting, start)?;
        let largest = largest_multiplier(&mut shooting, &state)?;
        let (multipliers, error) =
            largest.map_or((vec![], f64::INFINITY), |(value, error)| (vec![value], error));
        (state, multipliers, error)
    };
    let response = shooting.response(&state, motion)?;
    Ok(PeriodicOrbit { response, multipliers, multiplier_error, scheme_error: None })
}

/// Returns the periodic state near `state` and the multipliers, largest first.
fn by_whole_derivative(
    shooting: &mut Shooting<'_>,
    mut state: DVector<f64>,
) -> Result<(DVector<f64>, Vec<Complex<f64>>), IntegrateError> {
    let mut monodromy = None;
    let mut gap = shooting.gap(&state)?;
    for _ in 0..limits::ORBIT_NEWTON_STEPS {
        let missed = Shooting::largest_modulus(&gap);
        if missed <= limits::ORBIT_GAP && monodromy.is_some() {
            break;
        }
        let derivative = whole_derivative(shooting, &state)?;
        let step = newton_step(shooting.period(), &derivative, &gap)?;
        monodromy = Some(derivative);
        let Some([next, next_gap]) = nearer(shooting, &state, &step, missed)? else { break };
        (state, gap) = (next, next_gap);
    }
    let missed = Shooting::largest_modulus(&gap);
    let Some(monodromy) = monodromy.filter(|_| missed <= limits::ORBIT_GAP_ROUNDING) else {
        return Err(IntegrateError::NoOrbit { period: shooting.period(), missed });
    };
    let mut multipliers = RealSchur::new(monodromy)?.eigenvalues();
    multipliers.sort_by(|one, other| other.norm().total_cmp(&one.norm()));
    Ok((state, multipliers))
}

/// Returns the derivative of the state at the end of the period with respect to the state at the
/// beginning, both relative to the scales.
fn whole_derivative(
    shooting: &mut Shooting<'_>,
    state: &DVector<f64>,
) -> Result<DMatrix<f64>, IntegrateError> {
    let len = state.len();
    let mut derivative = DMatrix::zeros(len, len);
    for j in 0..len {
        let mut moved = |by: f64| {
            let mut moved = state.clone();
            moved[j] += by * shooting.scales[j];
            shooting.pass(&moved, 0)
        };
        let difference = moved(limits::SHOOTING_DIFFERENCE)? - moved(-limits::SHOOTING_DIFFERENCE)?;
        let column =
            difference.component_div(&shooting.scales) / (2.0 * limits::SHOOTING_DIFFERENCE);
        derivative.set_column(j, &column);
    }
    Ok(derivative)
}

/// Returns the Newton step that closes the orbit of the linearised map, in units of the scales.
fn newton_step(
    period: f64,
    derivative: &DMatrix<f64>,
    gap: &DVector<f64>,
) -> Result<DVector<f64>, IntegrateError> {
    let len = gap.len();
    let factored = (DMatrix::identity(len, len) - derivative).lu();
    let smallest = factored.u().diagonal().abs().min();
    let rounding = limits::SHOOTING_DIFFERENCE * limits::SHOOTING_DIFFERENCE;
    if smallest.is_nan() || smallest <= rounding {
        let size = derivative.norm().max(1.0);
        return Err(IntegrateError::NoPeriodicState {
            period,
            reciprocal_condition: smallest / size,
            rounding: rounding / size,
        });
    }
    // The solution exists: the pivots were checked above.
    Ok(factored.solve(gap).unwrap_or_else(|| DVector::zeros(len)))
}

/// Returns the state after the largest fraction of `step` that reduces the gap, and the new gap.
fn nearer(
    shooting: &mut Shooting<'_>,
    state: &DVector<f64>,
    step: &DVector<f64>,
    missed: f64,
) -> Result<Option<[DVector<f64>; 2]>, IntegrateError> {
    let mut part = 1.0;
    while part >= limits::ORBIT_NEWTON_FRACTION {
        let next = state + step.component_mul(&shooting.scales) * part;
        match shooting.gap(&next) {
            Ok(gap) if Shooting::largest_modulus(&gap) < missed => return Ok(Some([next, gap])),
            // The change of the state was too large if a time step from the new state has no
            // solution.
            Ok(_) | Err(IntegrateError::NotSolved { .. }) => part *= 0.5,
            Err(other) => return Err(other),
        }
    }
    Ok(None)
}

/// Returns the periodic state near `state`, without forming the matrix of the derivative of the
/// state over a period.
fn by_products(
    shooting: &mut Shooting<'_>,
    mut state: DVector<f64>,
) -> Result<DVector<f64>, IntegrateError> {
    let rounding = limits::SHOOTING_DIFFERENCE * limits::SHOOTING_DIFFERENCE;
    let most = shooting.most_vectors();
    let mut gap = shooting.gap(&state)?;
    for _ in 0..limits::ORBIT_NEWTON_STEPS {
        let missed = Shooting::largest_modulus(&gap);
        if missed <= limits::ORBIT_GAP {
            break;
        }
        let step =
            gmres::solve(&gap, limits::ORBIT_GMRES_RESIDUAL, most, |direction, derivative| {
                shooting.derivative(&state, direction, derivative)
            })?;
        log::debug!(
            "relative change of the state over a period: {missed:.1e}; Newton step from {} Krylov vectors, relative \
             residual {:.1e}",
            step.products,
            step.residual
        );
        if step.reciprocal_condition <= rounding {
            return Err(IntegrateError::NoPeriodicState {
                period: shooting.period(),
                reciprocal_condition: step.reciprocal_condition,
                rounding,
            });
        }
        let Some([next, next_gap]) = nearer(shooting, &state, &step.vector, missed)? else { break };
        (state, gap) = (next, next_gap);
    }
    let missed = Shooting::largest_modulus(&gap);
    if missed <= limits::ORBIT_GAP_ROUNDING {
        return Ok(state);
    }
    Err(IntegrateError::NoOrbit { period: shooting.period(), missed })
}

/// Returns the largest multiplier of the orbit through `state`, and its residual; `None` if numbers
/// overflow.
fn largest_multiplier(
    shooting: &mut Shooting<'_>,
    state: &DVector<f64>,
) -> Result<Option<(Complex<f64>, f64)>, IntegrateError> {
    let most = shooting.most_vectors().min(limits::MULTIPLIER_VECTORS).min(state.len());
    let mut space = Arnoldi::new(numbered_start_vector(state.len(), 0), most);
    loop {
        let more = space
            .extend(|direction, derivative| shooting.derivative(state, direction, derivative))?;
        if more && !space.size().is_multiple_of(limits::MULTIPLIER_CHECK_INTERVAL) {
            continue;
        }
        let Some(Dominant { value, residual, .. }) = space.dominant() else { return Ok(None) };
        if !more || residual <= limits::MULTIPLIER_RESIDUAL * value.norm().max(1.0) {
            return Ok(Some((value, residual)));
        }
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::{SparseSystem, band};
    use mechid_signal::{Record, Sampling};

    use super::*;
    use crate::nonlinear::system_with_forces::SystemWithForces;
    use crate::nonlinear::term_forces::TermForces;
    use crate::schemes::bathe::Bathe;
    use crate::schemes::houbolt::Houbolt;
    use crate::schemes::newmark::Newmark;
    use crate::schemes::runge_kutta::RungeKutta4;

    /// The state and the largest multiplier that are found in Krylov spaces are compared with those
    /// from the derivative formed as a matrix.
    #[test]
    fn products_lead_to_the_orbit_of_the_whole_derivative() {
        let dof = 12;
        let stiffness = band(dof, &[(-1, -40.0), (0, 90.0), (1, -40.0)]);
        let chain = SparseSystem::new(band(dof, &[(0, 1.0)]), band(dof, &[(0, 1.0)]), stiffness);
        let chain = chain.unwrap();
        let terms = "k3: x3^3, k: gap((x6-x7), 0.02)".parse().unwrap();
        let terms = TermForces::new(&terms, &[300.0, 50.0]).unwrap();
        let system = SystemWithForces::new(&chain).with(terms).unwrap();
        let sampling = Sampling::new(0.02, 60).unwrap();
        let turn = |k: usize| std::f64::consts::TAU * k as f64 / 60.0;
        let force = (0..60).map(|k| 8.0 * turn(k).cos() + 5.0 * (2.0 * turn(k)).sin()).collect();
        let force = Record::from_channel(sampling, force).unwrap();
        let schemes: [&dyn Scheme; 4] = [
            &Newmark::AVERAGE_ACCELERATION,
            &Houbolt::default(),
            &Bathe::HALVES,
            &RungeKutta4::LINEAR,
        ];
        for scheme in schemes {
            let prepared = || {
                let table = ForceTable::periodic(scheme, 1, (&force).into()).unwrap();
                let mut shooting =
                    Shooting::new(scheme, &system, table.acting_on(&[2], dof)).unwrap();
                let start = shooting.settle(&InitialState::rest(dof), 3).unwrap();
                (shooting, start)
            };
            let (mut shooting, start) = prepared();
            let (judge, multipliers) = by_whole_derivative(&mut shooting, start).unwrap();
            let (mut shooting, start) = prepared();
            let found = by_products(&mut shooting, start).unwrap();
            let missed = (&found - &judge).component_div(&shooting.scales).amax();
            assert!(missed < 1e-9, "{}: {missed:e}", scheme.name());
            let (largest, error) = largest_multiplier(&mut shooting, &found).unwrap().unwrap();
            let gap = (largest.norm() - multipliers[0].norm()).abs();
            // For a matrix without symmetry, the error of an eigenvalue may be a small multiple of
            // its residual, so the first limit is larger.
            assert!(gap < 1e-5 && error < 1e-6, "{}: {gap:e} {error:e}", scheme.name());
            assert!(largest.norm() > 0.1, "{largest}");
        }
    }
}
