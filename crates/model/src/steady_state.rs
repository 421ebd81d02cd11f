//! Steady state of a linear system, line by line.

use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::{ModelError, Response, SecondOrderSystem};

/// Computes the periodic response to a `force` of samples × n (N), which is band-limited between
/// its samples. Each line has the amplitude X_n = (K − ω²M + iωC)⁻¹ F_n; the response is exact up
/// to rounding and needs no time step.
///
/// For an unstable system the equations have a solution, too, but no real response converges to it.
///
/// Lines without force have no response, so that a system with rigid-body modes is allowed if the
/// force has no mean.
///
/// ```
/// use mechid_model::{Sdof, exact_periodic};
/// use mechid_signal::{Record, Sampling};
///
/// // F = 3 cos ωt N at resonance, ω = π/2 rad/s: x = 3 sin ωt / (c ω).
/// let omega = std::f64::consts::FRAC_PI_2;
/// let machine = Sdof::new(2.0, 0.5, 2.0 * omega * omega)?.system();
/// let force = (0..8).map(|k| 3.0 * (omega * 0.5 * f64::from(k)).cos()).collect();
/// let force = Record::from_channel(Sampling::new(0.5, 8)?, force)?;
/// let response = exact_periodic(&machine, &force)?;
/// assert!((response.displacement().channel(0)[2] - 3.0 / (0.5 * omega)).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ModelError::ForceChannels`] if the force does not have one channel per degree of freedom;
/// [`ModelError::SingularDynamicStiffness`] if a line excites an undamped system at its natural
/// frequency; [`ModelError::Signal`] if the response overflows.
///
/// # Source
/// Dissertation eqs. (4.6.9)–(4.6.10).
pub fn exact_periodic(system: &SecondOrderSystem, force: &Record) -> Result<Response, ModelError> {
    let dof = system.dof();
    if force.channels() != dof {
        return Err(ModelError::ForceChannels { got: force.channels(), dof });
    }
    let forces = Spectrum::from_record(force);
    let mut motions = [(); 3].map(|()| DMatrix::<Complex<f64>>::zeros(forces.len(), dof));
    for n in 0..forces.len() {
        let driven = forces.lines().row(n).transpose();
        if driven.iter().all(|f| f.norm() == 0.0) {
            continue;
        }
        let displacement = (system.receptance(forces.omega(n))? * driven).transpose();
        let i_omega = Complex::new(0.0, forces.omega(n));
        motions[0].set_row(n, &displacement);
        motions[1].set_row(n, &(&displacement * i_omega));
        motions[2].set_row(n, &(displacement * (i_omega * i_omega)));
    }
    let record = |lines| Spectrum::from_lines(force.sampling(), lines)?.to_record();
    let [x, v, a] = motions.map(record);
    Response::new(x?, v?, a?)
}
