//! Growth of the free motion of a linear system of any size, found from time steps.

use mechid_numerics::krylov::arnoldi::Arnoldi;
use mechid_numerics::krylov::start_vector::numbered_start_vector;
use mechid_signal::{Record, Sampling};
use nalgebra::DVector;

use crate::error::IntegrateError;
use crate::limits;
use crate::periodic::shooting::Shooting;
use crate::schemes::newmark::Newmark;
use crate::schemes::scheme::AllowUnstable;
use crate::stability::passive::is_passive;
use crate::stepping::sampled_force::ForceTable;
use crate::system::System;

/// Returns the growth factor of the fastest growing free motion of a linear `system` over the
/// period of `sampling` (a pure number above 1); `None` if no growth was found.
///
/// If M is symmetric and positive definite, and C and K are symmetric and positive semidefinite, no
/// motion grows. For other systems the largest eigenvalue of the map over a period is searched for
/// in the space of up to 40 Arnoldi vectors. The steps are those of the average acceleration
/// method: its motions grow if and only if the motions of the system grow. If many motions grow or
/// decay at about the same rate, these vectors may not suffice; the motion is then followed for 20
/// more periods. Growth that is slow compared with the period may be missed.
///
/// ```
/// use mechid_integrate::growth_per_period;
/// use mechid_model::{SparseSystem, band};
/// use mechid_signal::Sampling;
///
/// // The amplitude of each mass grows at the rate 0.1 1/s, over a period of 2 s.
/// let n = 400;
/// let (mass, damping) = (band(n, &[(0, 1.0)]), band(n, &[(0, -0.2)]));
/// let chain = SparseSystem::new(mass, damping, band(n, &[(-1, -90.0), (0, 190.0), (1, -90.0)]))?;
/// let growth = growth_per_period(&chain, Sampling::new(0.02, 100)?)?.unwrap();
/// assert!((growth - f64::exp(0.2)).abs() < 0.01, "{growth}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IntegrateError::LinearOnly`] if the system has nonlinear forces; otherwise those of
/// [`Scheme::prepare_unchecked`](crate::Scheme::prepare_unchecked).
///
/// # Source
/// Saad, *Numerical Methods for Large Eigenvalue Problems* (2011), section 6.2 (Arnoldi's
/// iteration), on the map of Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), section
/// 7.1.
pub fn growth_per_period(
    system: &dyn System,
    sampling: Sampling,
) -> Result<Option<f64>, IntegrateError> {
    if !system.nonlinear_forces().is_empty() {
        return Err(IntegrateError::LinearOnly { what: "the growth of free motion" });
    }
    if is_passive(system) {
        return Ok(None);
    }
    let zero_force = Record::from_channel(sampling, vec![0.0; sampling.len()])?;
    let average = Newmark::AVERAGE_ACCELERATION;
    let scheme = AllowUnstable(&average);
    let table = ForceTable::periodic(&scheme, 1, (&zero_force).into())?;
    let mut shooting = Shooting::new(&scheme, system, table.acting_on(&[0], system.dof()))?;
    let start = numbered_start_vector(shooting.scales.len(), 0);
    let start = shooting.measure(&start)?.component_div(&shooting.scales);
    if start.norm() < limits::VANISHED_MOTION {
        return Ok(None);
    }
    let mut space = Arnoldi::new(start, shooting.most_vectors().min(limits::GROWTH_VECTORS));
    loop {
        let more = space.extend(|begin, end| shooting.free(begin, end))?;
        if more && !space.size().is_multiple_of(limits::GROWTH_CHECK_INTERVAL) {
            continue;
        }
        let Some(found) = space.dominant() else { return Ok(Some(f64::INFINITY)) };
        let (factor, error) = (found.value.norm(), found.residual);
        log::debug!("after {} periods: {factor} within {error:.1e}", space.size());
        if factor - error > 1.0 + limits::GROWTH_ROUNDING {
            return Ok(Some(factor));
        }
        if factor + error < 1.0 {
            return Ok(None);
        }
        if !more {
            return followed(&mut shooting, found.vector.map(|part| part.re));
        }
    }
}

/// Returns the growth factor of a motion per period, if the energy of the motion in the second half
/// of the followed periods is more than [`limits::FOLLOWED_GROWTH`] times that in the first half.
fn followed(
    shooting: &mut Shooting<'_>,
    mut motion: DVector<f64>,
) -> Result<Option<f64>, IntegrateError> {
    let mut energies = [0.0; 2];
    for energy in &mut energies {
        for _ in 0..limits::FOLLOWED_PERIODS / 2 {
            let begin = motion.clone();
            shooting.free(begin.as_slice(), motion.as_mut_slice())?;
            *energy += motion.norm_squared();
        }
    }
    if !energies[1].is_finite() {
        return Ok(Some(f64::INFINITY));
    }
    let grown = energies[1] / energies[0];
    Ok((grown > limits::FOLLOWED_GROWTH).then(|| grown.powf(1.0 / limits::FOLLOWED_PERIODS as f64)))
}

#[cfg(test)]
mod tests {
    use mechid_model::{SparseSystem, band};
    use nalgebra_sparse::SparseEntryMut;

    use super::*;

    fn chain(damping: f64, at_one: f64, follower: f64) -> SparseSystem {
        let n = 200;
        let mut c = band(n, &[(-1, -0.2), (0, damping), (1, -0.2)]);
        if let Some(SparseEntryMut::NonZero(entry)) = c.get_entry_mut(70, 70) {
            *entry += at_one;
        }
        let mut k = band(n, &[(-1, -900.0), (0, 1900.0), (1, -900.0)]);
        for (row, column, sign) in [(20, 21, -1.0), (21, 20, 1.0)] {
            if let Some(SparseEntryMut::NonZero(entry)) = k.get_entry_mut(row, column) {
                *entry += sign * follower;
            }
        }
        SparseSystem::new(band(n, &[(0, 1.0)]), c, k).unwrap()
    }

    /// Returns the largest real part of all eigenvalues, in 1/s, as the reference.
    fn rightmost(system: &SparseSystem) -> f64 {
        let [m, c, k] =
            mechid_model::Matrix::ALL.map(|w| nalgebra::DMatrix::from(system.matrix(w)));
        let dense = mechid_model::SecondOrderSystem::new(m, c, k).unwrap();
        let poles = dense.eigenvalues().unwrap();
        poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn what_grows_by_itself_is_found_and_nothing_else() {
        let sampling = Sampling::new(0.01, 200).unwrap();
        // Each row has the damping of all masses, the additional damping of one mass, the
        // cross-coupled stiffness between two masses, and whether a motion grows.
        let machines = [
            (1.0, -60.0, 0.0, true),
            (1.0, -3.0, 0.0, false),
            (1.0, 0.0, 2000.0, true),
            (1.0, 0.0, 900.0, false),
            (0.6, 0.0, 0.0, false),
            (0.2, 0.0, 0.0, true),
        ];
        for (damping, at_one, follower, grows) in machines {
            let system = chain(damping, at_one, follower);
            let logarithm = rightmost(&system) * sampling.duration();
            assert_eq!(logarithm > 0.0, grows, "{damping} {at_one} {follower}");
            match growth_per_period(&system, sampling).unwrap() {
                // The growth found is not exact: the time steps make the frequencies a little too
                // low, and if many motions grow at about the same rate, the followed motion also
                // has parts that decay.
                Some(found) => {
                    assert!(grows && (found.ln() - logarithm).abs() < 0.1 * logarithm, "{found}");
                }
                None => assert!(!grows, "{damping} {at_one} {follower}: {logarithm}"),
            }
        }
    }

    /// The motion decreases to a fifteenth in each step, and in a period below the smallest
    /// positive number. The test expects that no growth is found.
    #[test]
    fn a_vanished_motion_does_not_grow() {
        let n = 100;
        let across = band(n, &[(-1, -1.0), (0, 2500.0), (1, 1.0)]);
        let system = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[(0, 100.0)]), across);
        let system = system.unwrap();
        let sampling = Sampling::new(0.035, 400).unwrap();
        assert_eq!(growth_per_period(&system, sampling).unwrap(), None);
    }

    #[test]
    fn a_machine_that_can_only_lose_energy_needs_no_search() {
        let n = 100;
        let free = band(n, &[(-1, -1.0), (0, 2.0), (1, -1.0)]);
        let system = SparseSystem::new(band(n, &[(0, 1.0)]), &free * 0.0, free).unwrap();
        let sampling = Sampling::new(0.01, 10).unwrap();
        assert_eq!(growth_per_period(&system, sampling).unwrap(), None);
    }
}
