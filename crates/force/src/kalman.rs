//! Force and motion together, by Kalman filter and smoother.

use mechid_model::SecondOrderSystem;
use mechid_signal::correlation::whiteness;
use mechid_signal::{Extent, Record, Spectrum};
use nalgebra::DMatrix;

use crate::augmented::{Augmented, Tuned};
use crate::band::{BandFilter, within_band};
use crate::error::ForceError;
use crate::force_information::ErrorSpectrum;
use crate::force_model::{ForceModel, LowPass};
use crate::identified::IdentifiedForce;
use crate::intermittent::quiet;
use crate::limits::{INNOVATION_LAGS, INNOVATIONS_SETTLED};
use crate::measurement::{Measurement, Start};
use crate::noise::{Noise, channel_sizes};
use crate::transfer::Transfer;
use crate::unexplained::Residual;

/// Choice of the levels of noise and force.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Tuning {
    /// Noise and model of the forces by maximum likelihood (innovations form).
    ///
    /// The noise of the channels is proportional to their size; each force has its own size.
    Likelihood,
    /// The noise of each channel is known (one standard deviation, in the channel's unit); the
    /// model of the forces is estimated by maximum likelihood.
    NoiseKnown(Vec<f64>),
    /// Noise and model given.
    Given {
        /// Standard deviation of the noise, one per channel, in the channel's unit.
        noise_std: Vec<f64>,
        /// Spectrum of the forces.
        model: ForceModel,
    },
}

/// Identified force and motion, and their tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct KalmanForce {
    /// The force, with its standard error.
    pub force: IdentifiedForce,
    /// Displacement of every degree of freedom, in m, measured or not.
    pub displacement: Record,
    /// Velocity of every degree of freedom, in m/s, measured or not.
    pub velocity: Record,
    /// Standard deviation of the noise, one per channel, in the unit of the channel.
    pub noise_std: Vec<f64>,
    /// Prior spectrum of the forces.
    pub model: ForceModel,
    /// Frequency, in Hz, below which the noise of the channels exceeds the force; 0 if the channels
    /// show even a constant force, `None` if they show the force at no frequency.
    pub seen_from_hz: Option<f64>,
    /// Log-likelihood of the measurement, dimensionless, without constants.
    pub log_likelihood: f64,
    /// Probability that the prediction errors of a correct model are at least as correlated from
    /// sample to sample as those of this result; `None` for a short record and for a force that
    /// acts only during a part of the record.
    pub whiteness_p_value: Option<f64>,
}

/// Identifies forces and motion together by the augmented Kalman filter with smoother.
///
/// Each force is a stationary process with a band from 0 up to a corner frequency ([`ForceModel`]),
/// continuous in time, without an assumption between samples. Order and corner of the band, the
/// sizes of the forces and the noise are those of maximum likelihood. If the force acts only during
/// a part of the record, the noise is estimated from the other part. The smoother uses the whole
/// record for every instant. The standard error comes from the model.
///
/// For a structure on springs, accelerations and velocities do not show a constant force, and their
/// noise exceeds the response to a slow force. Without a displacement, the force and its standard
/// error are therefore restricted to frequencies above [`KalmanForce::seen_from_hz`]
/// ([`IdentifiedForce::band_hz`]), unless the measurement has its own band
/// ([`Measurement::in_band`]). A force whose spectrum is not one band, such as a weaker force in
/// addition to a strong sinusoid, has correlated prediction errors
/// ([`KalmanForce::whiteness_p_value`]); the standard error is then too small. The variance of the
/// force in a band is the sum of three terms: its value far from the ends of the record; the
/// variance of the whole force at each instant minus its median over the record, if positive; and
/// the variance of slower errors that leak into the band at the ends of the record.
///
/// Cost: linear in the record. With c channels and m = 2n + (order × forces) states, a pass takes
/// about 2m³ + 2cm² operations per sample until the variances converge, then m² + 2cm; tuning takes
/// some hundred passes. Memory is m numbers per sample, m² until the variances converge. No
/// allocation per sample.
///
/// # Errors
/// [`ForceError::MoreForcesThanMeasurements`], [`ForceError::NoForcedDof`],
/// [`ForceError::NoSuchDof`], [`ForceError::TooShort`]; [`ForceError::Unseen`] if the channels
/// cannot separate the forces; [`ForceError::Silent`] if all channels are zero;
/// [`ForceError::NotPositive`], [`ForceError::ChannelCount`], [`ForceError::ModelCount`] and
/// [`ForceError::ModelOrder`] for a given tuning; [`ForceError::NoLikelihood`],
/// [`ForceError::StepTooLong`] and [`ForceError::Unstable`] if the filter or the transition over
/// one step overflows (the system may be unstable, but its free response must not grow by more than
/// about e⁵ within a step).
///
/// # Source
/// Lourens, Reynders, De Roeck, Degrande & Lombaert (2012), An augmented Kalman filter for force
/// identification in structural dynamics, Mechanical Systems and Signal Processing 27. Force
/// models beyond the random walk: Nayek, Chakraborty & Narasimhan (2019), A Gaussian process latent
/// force model for joint input-state estimation, the same journal 128. Likelihood: Schweppe (1965).
pub fn kalman(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    start: Start,
    tuning: &Tuning,
) -> Result<KalmanForce, ForceError> {
    measured.check(system.dof(), forced)?;
    let samples = measured.sampling().len();
    if samples < 3 {
        return Err(ForceError::TooShort { samples, needed: 3 });
    }
    if measured.record().data().iter().all(|y| *y == 0.0) {
        return Err(ForceError::Silent);
    }
    let mut scale = match tuning {
        Tuning::Likelihood => channel_sizes(measured.record()),
        Tuning::NoiseKnown(noise) => known(measured, noise)?,
        Tuning::Given { noise_std, model } => {
            model.check(forced.len())?;
            known(measured, noise_std)?
        }
    };
    check_seen(system, measured, forced, &scale)?;
    let mut augmented = Augmented::new(system, measured, forced, start, &scale)?;
    let mut tuned = match tuning {
        Tuning::Likelihood => augmented.most_likely(None)?,
        Tuning::NoiseKnown(_) => augmented.most_likely(Some(1.0))?,
        Tuning::Given { model, .. } => augmented.given(model)?,
    };
    let (known, of) = (*tuning != Tuning::Likelihood, (system, measured, forced));
    let quiet_noise = (!known).then(|| quiet_part_noise(&augmented, &tuned, of, &scale)).flatten();
    if let Some(noise) = quiet_noise {
        scale.iter_mut().for_each(|level| *level *= noise);
        augmented = Augmented::new(system, measured, forced, start, &scale)?;
        tuned = augmented.most_likely(Some(1.0))?;
    }
    let smoothed = smoothed(&augmented, system, measured, forced, &scale, &tuned)?;
    let residual = measured.exceeds(forced).then(|| {
        let motion = [&smoothed.displacement, &smoothed.velocity, smoothed.force.record()];
        Residual::from_motion(system, measured, motion, known.then_some(&smoothed.noise_std[..]))
    });
    let points =
        augmented.posterior_points(&tuned, (known || quiet_noise.is_some()).then_some(1.0))?;
    let force = match points.len() {
        0 | 1 => smoothed.force,
        _ => mixed(&augmented, &smoothed.force, system.dof(), forced, &points)?,
    };
    let whiteness_p_value =
        if quiet_noise.is_some() { None } else { whiteness_p_value(&augmented, &tuned) };
    let mut force = force.with_residual(residual);
    if let Some(band_hz) = measured.band_hz().or_else(|| measured.shown(smoothed.seen_from_hz)) {
        let process = LowPass::new(tuned.model.order)?;
        let errors = augmented.information().errors(&tuned.model, &process, tuned.noise);
        force = in_band(force, forced, band_hz, &errors)?;
    }
    Ok(KalmanForce { force, whiteness_p_value, ..smoothed })
}

/// Returns the probability that white innovations have at least the correlations of the innovations
/// under a tuning: the smallest probability of all channels, times the number of channels. `None`
/// for a record that is too short.
///
/// # Source
/// Durbin & Koopman (2012), *Time Series Analysis by State Space Methods*, section 2.12 (diagnostic
/// checks of innovations); Ljung & Box (1978), Biometrika 65, 297–303.
fn whiteness_p_value(augmented: &Augmented, tuned: &Tuned) -> Option<f64> {
    let innovations = augmented.innovations(tuned)?;
    let channels = augmented.channels();
    let of_channel = |channel: usize| -> Option<f64> {
        let all = innovations.iter().skip(channel).step_by(channels).copied();
        let settled: Vec<f64> = all.skip(INNOVATIONS_SETTLED).collect();
        Some(whiteness(&settled, INNOVATION_LAGS).ok()?.p_value)
    };
    let p_values = (0..channels).map(of_channel).collect::<Option<Vec<f64>>>()?;
    Some((channels as f64 * p_values.into_iter().fold(1.0, f64::min)).min(1.0))
}

/// Returns the noise of the part of the record in which no force acts, in the scales of the
/// channels; `None` for a stationary force, and for a force that acts in the whole record.
fn quiet_part_noise(
    augmented: &Augmented,
    tuned: &Tuned,
    (system, measured, forced): (&SecondOrderSystem, &Measurement, &[usize]),
    scale: &[f64],
) -> Option<f64> {
    let part = measured.part(quiet(augmented, tuned)?).ok()?;
    let alone = Augmented::new(system, &part, forced, Start::InMotion, scale).ok()?;
    alone.noise_without_force().filter(|noise| *noise > 0.0 && noise.is_finite())
}

/// Returns the part of the force in a band. The variance of this part is the sum of three terms:
/// the variance in the band far from the ends of the record; the variance of the whole force at
/// each instant minus its median over the record, if positive; and the variance of slower errors
/// that leak into the band at the ends of the record.
fn in_band(
    force: IdentifiedForce,
    forced: &[usize],
    band_hz: [f64; 2],
    errors: &ErrorSpectrum,
) -> Result<IdentifiedForce, ForceError> {
    let record = within_band(force.record(), band_hz, Extent::Open)?;
    let (sampling, len) = (record.sampling(), record.len());
    // This function has the slope 1 at the first sample and the slope 0 at the last one. It
    // therefore forms a corner with its mirror image at the first sample only.
    let corner: Vec<f64> =
        (0..len).map(|k| sampling.time(k) * (1.0 - 0.5 * k as f64 / len as f64)).collect();
    let corner = BandFilter { sampling, band_hz, extent: Extent::Open }.apply(&corner)?;
    let mut error = DMatrix::zeros(len, record.channels());
    for (f, &dof) in forced.iter().enumerate() {
        let whole = force.standard_error().map_or(&[][..], |error| error.channel(dof));
        let mut sorted: Vec<f64> = whole.iter().map(|error| error * error).collect();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.get(len / 2).copied().unwrap_or(0.0);
        let (variance, rate) = (errors.within(f, band_hz), errors.rate_below(f, band_hz[0]));
        for (k, value) in whole.iter().enumerate() {
            let ends = rate * (corner[k].powi(2) + corner[len - 1 - k].powi(2));
            error[(k, dof)] = (variance + (value * value - middle).max(0.0) + ends).sqrt();
        }
    }
    let error = Record::new(sampling, error)?;
    Ok(force.replaced(record).with_standard_error(Some(error)).with_band(band_hz))
}

/// Returns the stated noise levels, or an error if they are not possible.
fn known(measured: &Measurement, noise: &[f64]) -> Result<Vec<f64>, ForceError> {
    let spectrum = Spectrum::from_record(measured.record());
    let level = Noise::PerChannel(noise.to_vec()).resolve(measured, &spectrum, &[])?;
    Ok(level.unwrap_or_default())
}

/// Checks at one arbitrary frequency that the forces can be separated. Forces that cannot be
/// separated at this frequency cannot be separated at any other.
pub(crate) fn check_seen(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    scale: &[f64],
) -> Result<(), ForceError> {
    let transfer = Transfer { system, channels: measured.channels(), forced, scale };
    let omega = 0.3 / measured.sampling().dt();
    match transfer.inverse(0, omega) {
        Err(ForceError::NotTransmitted { dof, .. }) => Err(ForceError::Unseen { dof }),
        _ => Ok(()),
    }
}

/// Returns mean and variance of every state at every sample under a tuning, ordered by sample, and
/// the number of states.
fn states(augmented: &Augmented, tuned: &Tuned) -> Result<(Vec<f64>, Vec<f64>, usize), ForceError> {
    let process = LowPass::new(tuned.model.order)?;
    let space = augmented.started(augmented.space(&tuned.model, &process, tuned.noise, 10.0)?);
    let (mean, variance) = space.smooth(space.filter(augmented.data()));
    if mean.iter().chain(&variance).any(|value| !value.is_finite()) {
        return Err(ForceError::NoLikelihood);
    }
    Ok((mean, variance, space.states))
}

/// Returns the forces of the whole record, averaged over posterior models: mean and standard
/// deviation of the mixture. `best` is the force of the best model.
fn mixed(
    augmented: &Augmented,
    best: &IdentifiedForce,
    dofs: usize,
    forced: &[usize],
    points: &[(f64, Tuned)],
) -> Result<IdentifiedForce, ForceError> {
    let reference = best.record();
    let shape = reference.data().shape();
    let mut shift = DMatrix::<f64>::zeros(shape.0, shape.1);
    let mut square = shift.clone();
    for (weight, tuned) in points {
        let (means, variances, m) = states(augmented, tuned)?;
        for (f, (&dof, unit)) in forced.iter().zip(augmented.units()).enumerate() {
            let at = 2 * dofs + f * tuned.model.order;
            for k in 0..shape.0 {
                let by = means[k * m + at] * unit - reference.channel(dof)[k];
                shift[(k, dof)] += weight * by;
                square[(k, dof)] += weight * (variances[k * m + at] * unit * unit + by * by);
            }
        }
    }
    let error = square.zip_map(&shift, |square, shift| (square - shift * shift).max(0.0).sqrt());
    let force =
        IdentifiedForce::from_record(Record::new(reference.sampling(), reference.data() + shift)?);
    Ok(force.with_standard_error(Some(Record::new(reference.sampling(), error)?)))
}

/// Returns the motion and the forces of the whole record for a given tuning. The forces are not
/// restricted to a band.
fn smoothed(
    augmented: &Augmented,
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    scale: &[f64],
    tuned: &Tuned,
) -> Result<KalmanForce, ForceError> {
    let (mean, variance, m) = states(augmented, tuned)?;
    let (n, sampling) = (system.dof(), measured.sampling());
    let mut force = DMatrix::zeros(sampling.len(), n);
    let mut error = DMatrix::zeros(sampling.len(), n);
    for (f, (&dof, unit)) in forced.iter().zip(augmented.units()).enumerate() {
        let at = 2 * n + f * tuned.model.order;
        for k in 0..sampling.len() {
            force[(k, dof)] = mean[k * m + at] * unit;
            error[(k, dof)] = variance[k * m + at].sqrt() * unit;
        }
    }
    let motion = |first: usize, unit: f64| {
        let data = DMatrix::from_fn(sampling.len(), n, |k, i| mean[k * m + first + i] / unit);
        Record::new(sampling, data)
    };
    let force = IdentifiedForce::from_record(Record::new(sampling, force)?);
    let scaling: f64 = scale.iter().map(|s| s.ln()).sum();
    let process = LowPass::new(tuned.model.order)?;
    let errors = augmented.information().errors(&tuned.model, &process, tuned.noise);
    Ok(KalmanForce {
        force: force.with_standard_error(Some(Record::new(sampling, error)?)),
        displacement: motion(0, 1.0)?,
        velocity: motion(n, sampling.dt())?,
        noise_std: scale.iter().map(|s| s * tuned.noise).collect(),
        model: tuned.model.clone(),
        seen_from_hz: errors.lowest_hz(),
        log_likelihood: tuned.log_likelihood - sampling.len() as f64 * scaling,
        whiteness_p_value: None,
    })
}
