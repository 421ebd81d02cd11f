//! Force from the equation of motion, sample by sample.

use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::Record;

use crate::error::ForceError;
use crate::identified::IdentifiedForce;

/// Computes F̂ = M ẍ + C ẋ + K x at every sample.
///
/// The force is exact if the response satisfies equilibrium at the sampled instants. Newmark,
/// Houbolt, central difference and Runge-Kutta responses do; Wilson's θ method does not: it
/// enforces equilibrium at t + θΔt, so that its response gives a different force even with the
/// exact matrices.
///
/// Cost: three products of samples × n by n × n.
///
/// # Errors
/// [`ForceError::Dof`] if the response has another number of degrees of freedom.
///
/// # Source
/// Dissertation eq. (4.8.1).
///
/// ```
/// use mechid_force::continuous;
/// use mechid_model::{Response, SecondOrderSystem};
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dmatrix;
///
/// // x = cos 3t, on m = 2, c = 0.5, k = 8: F = (8 − 2·9) cos 3t − 0.5·3 sin 3t.
/// let sampling = Sampling::new(0.1, 20)?;
/// let wave =
///     |f: fn(f64) -> f64| Record::from_channel(sampling, sampling.times().map(f).collect());
/// let response = Response::new(
///     wave(|t| (3.0 * t).cos())?,
///     wave(|t| -3.0 * (3.0 * t).sin())?,
///     wave(|t| -9.0 * (3.0 * t).cos())?,
/// )?;
/// let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![0.5], dmatrix![8.0])?;
/// let force = continuous(&system, &response)?;
/// for (t, f) in sampling.times().zip(force.record().channel(0)) {
///     assert!((f - (-10.0 * (3.0 * t).cos() - 1.5 * (3.0 * t).sin())).abs() < 1e-13);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn continuous(
    system: &SecondOrderSystem,
    response: &Response,
) -> Result<IdentifiedForce, ForceError> {
    check_dof(system, response)?;
    let mut force = response.acceleration().data() * system.mass().transpose();
    force.gemm(1.0, response.velocity().data(), &system.damping().transpose(), 1.0);
    force.gemm(1.0, response.displacement().data(), &system.stiffness().transpose(), 1.0);
    Ok(IdentifiedForce::from_record(Record::new(response.sampling(), force)?))
}

pub(crate) fn check_dof(system: &SecondOrderSystem, response: &Response) -> Result<(), ForceError> {
    if system.dof() == response.dof() {
        return Ok(());
    }
    Err(ForceError::Dof { system: system.dof(), response: response.dof() })
}
