//! The periodic steady state, solved for instead of waited for.

use mechid_model::Response;
use mechid_signal::Sampling;

use crate::driver::Sampled;
use crate::force::ForceTable;
use crate::period::Period;
use crate::run::{Motion, Run};
use crate::transition::Transition;
use crate::{IntegrateError, SampledForce, Scheme, System};

/// The response is kept when its first state repeats to this part of itself: a tenth of what is
/// promised.
const CLOSED: f64 = 1e-13;

/// The response that repeats with the force, whose samples are one period (samples × n, in N).
///
/// Over one period the scheme is an affine map of its own state, z_N = Φ z_0 + g. The state that
/// repeats solves (I − Φ) z_0 = g; g comes from one pass from rest, the response from a second one.
/// So it costs about two passes, plus the powers of a matrix of twice the degrees of freedom (three
/// times for Houbolt and Wilson θ). Where rounding over the period, divided by a damping that is
/// all but nothing, leaves a gap, the gap is taken through the same solve and the pass repeated.
///
/// # Errors
/// Those of [`integrate`](crate::integrate()); [`IntegrateError::LinearOnly`] if the system has
/// nonlinear forces; and [`IntegrateError::NoPeriodicState`] if the free
/// motion repeats too: a rigid body, or a scheme that sees an undamped mode exactly on a line.
///
/// # Source
/// Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), on shooting for periodic solutions;
/// of a linear system the first step of it is exact.
pub fn integrate_periodic<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
) -> Result<Response, IntegrateError> {
    if !system.nonlinear_forces().is_empty() {
        return Err(IntegrateError::LinearOnly { what: "the periodic steady state" });
    }
    let table = ForceTable::periodic(scheme, system.dof(), force.into())?;
    let (samples, dof) = (table.sampling().len(), system.dof());
    let mut run = Run::new(scheme, system, table.sampling().dt())?;
    let period = Period::of(&Transition::of(run.stepper()), dof, table.sampling())?;
    let mut motion = Motion::zeros(samples, dof);
    run.step(&table, samples - 1)?;
    run.restart(&period.at_rest(&run.state));
    run.advance(&table, 0, samples, &mut motion)?;
    let mut start = period.repeat(&run.state);
    let mut missed_before = f64::INFINITY;
    // The first pass yields the answer; more only where rounding over the period leaves a gap.
    for _ in 0..4 {
        run.restart(&start);
        motion.set(0, &start);
        run.advance(&table, 0, samples, &mut motion)?;
        let gap: Vec<f64> = run.state.iter().zip(&start).map(|(end, begin)| end - begin).collect();
        let correction = period.repeat(&gap);
        let missed = period.norm(&correction) / period.norm(&start);
        if missed <= CLOSED || missed > 0.1 * missed_before || !missed.is_finite() {
            break;
        }
        missed_before = missed;
        start.iter_mut().zip(correction).for_each(|(z, dz)| *z += dz);
    }
    motion.into_response(&table)
}

/// Integrates as [`integrate_periodic`] does, for a force given as a function of time with the period of
/// `sampling`; `force(t, f)` writes the n components at t (s) into `f` (N).
///
/// # Errors
/// Those of [`integrate_periodic`]; [`IntegrateError::NotFinite`] if the function yields a NaN or
/// infinity.
pub fn integrate_periodic_function(
    scheme: &dyn Scheme,
    system: &dyn System,
    sampling: Sampling,
    mut force: impl FnMut(f64, &mut [f64]),
) -> Result<Response, IntegrateError> {
    let sampled = Sampled::of(scheme, system.dof(), sampling, &mut force)?;
    integrate_periodic(scheme, system, sampled.force())
}
