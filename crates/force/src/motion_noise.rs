//! Effect of noise in a complete response on the force from the equation of motion.

use std::collections::BTreeMap;

use mechid_model::{Discretisation, Response, SecondOrderSystem};
use mechid_signal::{Extent, Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::continuous::continuous;
use crate::discretised::{Solution, discretised};
use crate::error::ForceError;
use crate::identified::IdentifiedForce;

/// Standard deviation of the noise in each channel of a complete motion; the noise is white and
/// independent from channel to channel.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionNoise {
    pub(crate) displacement: DVector<f64>,
    pub(crate) velocity: DVector<f64>,
    pub(crate) acceleration: DVector<f64>,
}

impl MotionNoise {
    /// Creates standard deviations of the displacement (m), velocity (m/s) and acceleration (m/s²)
    /// of every degree of freedom. If the acceleration was not measured, its list is empty.
    ///
    /// # Errors
    /// [`ForceError::NotPositive`] for a level that is not positive and finite.
    pub fn new(
        displacement: Vec<f64>,
        velocity: Vec<f64>,
        acceleration: Vec<f64>,
    ) -> Result<Self, ForceError> {
        let mut levels = displacement.iter().chain(&velocity).chain(&acceleration);
        if let Some(&value) = levels.find(|level| !(**level > 0.0 && level.is_finite())) {
            return Err(ForceError::NotPositive { what: "noise level", value });
        }
        Ok(Self {
            displacement: displacement.into(),
            velocity: velocity.into(),
            acceleration: acceleration.into(),
        })
    }

    pub(crate) fn check(levels: &DVector<f64>, dofs: usize) -> Result<(), ForceError> {
        if levels.len() == dofs {
            return Ok(());
        }
        Err(ForceError::ChannelCount { record: dofs, described: levels.len() })
    }
}

/// Computes [`continuous`], with the standard error due to noise in the response.
///
/// ```text
/// var F̂ᵢ = Σⱼ (Mᵢⱼ² σ²_ẍⱼ + Cᵢⱼ² σ²_ẋⱼ + Kᵢⱼ² σ²_xⱼ)
/// ```
///
/// The variance is in N², for every sample. It is exact, because the force is linear in the
/// response.
///
/// # Errors
/// The errors of [`continuous`]; [`ForceError::ChannelCount`] if a noise level is missing.
///
/// # Source
/// Dissertation eq. (4.8.1), and the variance of a sum of independent parts.
///
/// ```
/// use mechid_force::{MotionNoise, continuous_with_noise};
/// use mechid_model::{Response, SecondOrderSystem};
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dmatrix;
///
/// let still = Record::from_channel(Sampling::new(0.1, 3)?, vec![0.0; 3])?;
/// let response = Response::new(still.clone(), still.clone(), still)?;
/// let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![3.0], dmatrix![6.0])?;
/// let noise = MotionNoise::new(vec![0.5], vec![2.0], vec![1.0])?;
/// let force = continuous_with_noise(&system, &response, &noise)?;
/// // (2·1)² + (3·2)² + (6·0.5)² = 7².
/// assert_eq!(force.standard_error().unwrap().channel(0), [7.0; 3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn continuous_with_noise(
    system: &SecondOrderSystem,
    response: &Response,
    noise: &MotionNoise,
) -> Result<IdentifiedForce, ForceError> {
    let force = continuous(system, response)?;
    let mut variance = DVector::zeros(system.dof());
    for (matrix, levels) in [
        (system.mass(), &noise.acceleration),
        (system.damping(), &noise.velocity),
        (system.stiffness(), &noise.displacement),
    ] {
        MotionNoise::check(levels, system.dof())?;
        variance += through(matrix, levels);
    }
    let error = variance.map(f64::sqrt);
    let sampling = response.sampling();
    let error = DMatrix::from_fn(sampling.len(), system.dof(), |_, i| error[i]);
    Ok(force.with_standard_error(Some(Record::new(sampling, error)?)))
}

/// Computes [`discretised`], with the standard error due to noise in displacement and velocity.
///
/// The force of a sample is linear in the neighbouring samples, F̂(k) = Σₗ Aₗ z(k+l). Its variance
/// is the sum over l of the squared entries of Aₗ times the variances of the noise. The first and
/// last sample of an open record have a step on one side only, and thus a larger variance than the
/// others.
///
/// # Errors
/// The errors of [`discretised`]; [`ForceError::ChannelCount`] if a noise level is missing.
///
/// # Source
/// The equations of [`discretised`], and the variance of a sum of independent parts.
pub fn discretised_with_noise(
    system: &SecondOrderSystem,
    response: &Response,
    discretisation: Discretisation,
    extent: Extent,
    noise: &MotionNoise,
) -> Result<IdentifiedForce, ForceError> {
    let force = discretised(system, response, discretisation, extent)?;
    for levels in [&noise.displacement, &noise.velocity] {
        MotionNoise::check(levels, system.dof())?;
    }
    let sides = sides(&Solution::from_rule(system, response.sampling().dt(), discretisation)?);
    let samples = force.record().len();
    let at = |k: usize| error(system, response.sampling(), &sides, extent, noise, k);
    // All samples between the first and the last have the same standard error, so only three errors
    // are computed.
    let distinct = [at(0), at(1.min(samples - 1)), at(samples - 1)];
    let error = DMatrix::from_fn(samples, system.dof(), |k, i| {
        distinct[if k == 0 { 0 } else { 1 + usize::from(k + 1 == samples) }][i]
    });
    let error = Record::new(force.record().sampling(), error)?;
    Ok(force.with_standard_error(Some(error)))
}

/// Estimate of the force in a step, from the motion at the two ends of the step.
struct Side {
    /// Index of the step, relative to the step that begins with the sample: 0, or −1 for the
    /// previous step.
    step: isize,
    /// Weights of the states at the two ends of the step, n × 2n each.
    end_weights: [DMatrix<f64>; 2],
}

fn sides(solution: &Solution) -> Vec<Side> {
    let (start, end) = solution.inputs(-&solution.state);
    let (order, _) = solution.state.shape();
    let (next_start, next_end) = solution.inputs(DMatrix::identity(order, order));
    let mut sides = vec![Side { step: 0, end_weights: [start, next_start] }];
    if let (Some(end), Some(next)) = (end, next_end) {
        sides.push(Side { step: -1, end_weights: [end, next] });
    }
    sides
}

/// Returns the standard deviation of the force at sample k, in N, one per degree of freedom.
fn error(
    system: &SecondOrderSystem,
    sampling: Sampling,
    sides: &[Side],
    extent: Extent,
    noise: &MotionNoise,
    k: usize,
) -> DVector<f64> {
    let (n, len, dt) = (system.dof(), sampling.len() as isize, sampling.dt());
    let within = |side: &&Side| {
        let step = k as isize + side.step;
        extent == Extent::WholePeriod || (0..len - 1).contains(&step)
    };
    let sides: Vec<&Side> = sides.iter().filter(within).collect();
    // In a short period, the same sample may be both before and after another sample: its two
    // contributions are added before they are squared.
    let mut parts: BTreeMap<isize, DMatrix<f64>> = BTreeMap::new();
    for side in &sides {
        for (sample, part) in (k as isize + side.step..).zip(&side.end_weights) {
            let sum = parts.entry(sample.rem_euclid(len)).or_insert(DMatrix::zeros(n, 2 * n));
            *sum += part / sides.len() as f64;
        }
    }
    let levels = DVector::from_fn(2 * n, |j, _| {
        if j < n { noise.displacement[j] } else { dt * noise.velocity[j - n] }
    });
    let mut variance = DVector::zeros(n);
    for part in parts.values() {
        variance += through(&(system.mass() * part), &levels);
    }
    variance.map(|variance| variance.sqrt() / (dt * dt))
}

/// Returns Σⱼ (matrixᵢⱼ σⱼ)² of every row i.
pub(crate) fn through(matrix: &DMatrix<f64>, levels: &DVector<f64>) -> DVector<f64> {
    matrix.component_mul(matrix) * levels.component_mul(levels)
}
