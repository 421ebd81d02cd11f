//! Steady state under a band-limited force, line by line.

use mechid_model::{Response, SecondOrderSystem};
use mechid_numerics::check_size;
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::EstimateError;

/// Predicts displacement, velocity and acceleration of a machine in the steady state. The force (N)
/// between the samples of whole periods is band-limited, as in a fit of spectra.
///
/// For a record of even length the prediction is zero at half the sampling rate, because samples
/// have no phase at this frequency.
///
/// # Errors
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for a wrong number of channels,
/// [`EstimateError::Model`] if a line is at an undamped resonance, DC included.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapter 2 (the steady state under a periodic signal, line by line).
pub fn predict_periodic(
    system: &SecondOrderSystem,
    force: &Record,
) -> Result<Response, EstimateError> {
    check_size("channels of the force", system.dof(), force.channels())?;
    let forces = Spectrum::from_record(force);
    let mut lines = [(); 3].map(|()| DMatrix::zeros(forces.len(), system.dof()));
    for n in (0..forces.len()).filter(|n| 2 * n < force.len()) {
        let omega = forces.omega(n);
        let x = system.receptance(omega)? * forces.lines().row(n).transpose();
        for (power, quantity) in lines.iter_mut().enumerate() {
            let factor = Complex::new(0.0, omega).powi(power as i32);
            for (dof, z) in x.iter().enumerate() {
                quantity[(n, dof)] = z * factor;
            }
        }
    }
    let record = |lines| Spectrum::from_lines(force.sampling(), lines)?.to_record();
    let [x, v, a] = lines.map(record);
    Ok(Response::new(x?, v?, a?)?)
}
