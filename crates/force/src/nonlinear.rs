//! Force from the equation of motion with nonlinear terms, sample by sample.

use mechid_model::{NonlinearSystem, Response};
use mechid_signal::Record;
use nalgebra::DMatrix;

use crate::continuous::check_dof;
use crate::error::ForceError;
use crate::identified::IdentifiedForce;
use crate::motion_noise::{MotionNoise, through};

/// Computes F̂ = M ẍ + C ẋ + K x + Σ θ f(q, q̇) at every sample.
///
/// The force is exact if the response satisfies equilibrium at the sampled instants, as for
/// [`continuous`](crate::continuous()).
///
/// Cost: three products of samples × n by n × n, and one value of each term for each sample.
///
/// # Errors
/// [`ForceError::Dof`] if the response has another number of degrees of freedom.
///
/// # Source
/// Dissertation eq. (4.8.1), with nonlinear terms; Masri & Caughey (1979), Journal of Applied
/// Mechanics 46, 433–447 (the restoring force from the motion).
///
/// ```
/// use mechid_force::continuous_nonlinear;
/// use mechid_model::{NonlinearSystem, Response, Sdof};
/// use mechid_signal::{Record, Sampling};
///
/// // x = cos 3t on m = 2, c = 0.5, k = 8 and 4 x³, which is 3 cos 3t + cos 9t.
/// let sampling = Sampling::new(0.1, 20)?;
/// let wave =
///     |f: fn(f64) -> f64| Record::from_channel(sampling, sampling.times().map(f).collect());
/// let response = Response::new(
///     wave(|t| (3.0 * t).cos())?,
///     wave(|t| -3.0 * (3.0 * t).sin())?,
///     wave(|t| -9.0 * (3.0 * t).cos())?,
/// )?;
/// let linear = Sdof::new(2.0, 0.5, 8.0)?.system();
/// let system = NonlinearSystem::new(linear, "k3: x^3".parse()?, vec![4.0])?;
/// let force = continuous_nonlinear(&system, &response)?;
/// for (t, f) in sampling.times().zip(force.record().channel(0)) {
///     let truth = -7.0 * (3.0 * t).cos() + (9.0 * t).cos() - 1.5 * (3.0 * t).sin();
///     assert!((f - truth).abs() < 1e-13);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn continuous_nonlinear(
    system: &NonlinearSystem,
    response: &Response,
) -> Result<IdentifiedForce, ForceError> {
    check_dof(system.linear(), response)?;
    Ok(IdentifiedForce::from_record(system.force(response)?))
}

/// Computes [`continuous_nonlinear`], with the standard error due to noise in the response: like
/// [`continuous_with_noise`](crate::continuous_with_noise) with the
/// [tangents](NonlinearSystem::tangents) of each sample instead of C and K.
///
/// The standard error is of first order in the noise: if the force is not linear in the response
/// within one standard deviation of the noise, the noise also changes the mean of the force.
///
/// # Errors
/// The errors of [`continuous_nonlinear`]; [`ForceError::ChannelCount`] if a noise level is
/// missing.
///
/// # Source
/// Dissertation eq. (4.8.1), and the delta method.
pub fn continuous_nonlinear_with_noise(
    system: &NonlinearSystem,
    response: &Response,
    noise: &MotionNoise,
) -> Result<IdentifiedForce, ForceError> {
    let force = continuous_nonlinear(system, response)?;
    for levels in [&noise.displacement, &noise.velocity, &noise.acceleration] {
        MotionNoise::check(levels, system.dof())?;
    }
    let inertia = through(system.linear().mass(), &noise.acceleration);
    let sampling = response.sampling();
    let sample =
        |record: &Record, k: usize| -> Vec<f64> { record.data().row(k).iter().copied().collect() };
    let mut error = DMatrix::zeros(sampling.len(), system.dof());
    for (k, mut row) in error.row_iter_mut().enumerate() {
        let (x, v) = (sample(response.displacement(), k), sample(response.velocity(), k));
        let [stiffness, damping] = system.tangents(&x, &v);
        let variance = &inertia
            + through(&damping, &noise.velocity)
            + through(&stiffness, &noise.displacement);
        row.copy_from(&variance.map(f64::sqrt).transpose());
    }
    Ok(force.with_standard_error(Some(Record::new(sampling, error)?)))
}

#[cfg(test)]
mod tests {
    use mechid_model::Sdof;
    use mechid_signal::{Sampling, noise};

    use super::*;

    #[test]
    fn a_standard_error_is_the_scatter_of_noisy_motions() {
        let linear = Sdof::new(2.0, 0.5, 8.0).unwrap().system();
        let terms = "k3: x^3, c2: |v| v".parse().unwrap();
        let system = NonlinearSystem::new(linear, terms, vec![4.0, 0.7]).unwrap();
        let sampling = Sampling::new(0.2, 8).unwrap();
        let wave = |f: fn(f64) -> f64| {
            Record::from_channel(sampling, sampling.times().map(f).collect()).unwrap()
        };
        let clean = [
            wave(|t| (3.0 * t).cos()),
            wave(|t| -3.0 * (3.0 * t).sin()),
            wave(|t| -9.0 * (3.0 * t).cos()),
        ];
        let [x, v, a] = clean.clone();
        let truth = Response::new(x, v, a).unwrap();
        let levels = [1e-3, 2e-3, 5e-3];
        let stated = MotionNoise::new(vec![levels[0]], vec![levels[1]], vec![levels[2]]).unwrap();
        let found = continuous_nonlinear_with_noise(&system, &truth, &stated).unwrap();
        let runs = 4000;
        let mut squares = [0.0; 8];
        for seed in 0..runs {
            let [x, v, a] = [0, 1, 2].map(|which| {
                let level = noise::NoiseLevel::StandardDeviation(levels[which]);
                noise::add_white(&clean[which], level, 3 * seed + which as u64).unwrap()
            });
            let noisy = Response::new(x, v, a).unwrap();
            let force = continuous_nonlinear(&system, &noisy).unwrap();
            let both = force.record().channel(0).iter().zip(found.record().channel(0));
            for (sum, (noisy, clean)) in squares.iter_mut().zip(both) {
                *sum += (noisy - clean).powi(2);
            }
        }
        for (sum, stated) in squares.iter().zip(found.standard_error().unwrap().channel(0)) {
            let scatter = (sum / runs as f64).sqrt();
            // The standard deviation of 4000 runs has an error of 1.1 %.
            assert!((scatter / stated - 1.0).abs() < 0.045, "{scatter}, {stated}");
        }
    }
}
