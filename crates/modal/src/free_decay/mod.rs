//! Frequencies, damping and shapes from a record in which no force acts.

mod aperiodic;
mod autoregression;
mod backbone;
mod error;
mod estimate;
mod fit;
mod initial_poles;
mod limits;
mod poles;
mod restart;
mod select;

use mechid_signal::Record;
use mechid_signal::SignalError;
use mechid_signal::measures::{peak, power_of_two};
use nalgebra::DMatrix;

use self::aperiodic::{Aperiodic, aperiodic, information};
pub use self::backbone::{Backbone, BackbonePoint};
pub use self::error::FreeDecayError;
pub use self::estimate::{DecayChannel, DecayMode, FreeDecayEstimate, Onset};
use self::fit::{Data, Fit};
use self::limits::{FINE, FREE_DECAY_SURE, MAX_STEPS, MOST_MODES, MOST_SAMPLES, SAMPLES_PER_MODE};
use self::restart::{restart, shock};
use self::select::Search;

/// Settings of [`free_decay`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct FreeDecay {
    /// Number of modes; if `None`, the likelihood chooses it.
    pub modes: Option<usize>,
    /// Maximum number of modes if the number is not given.
    pub max_modes: usize,
    /// `true` if each channel has an unknown constant.
    pub offset: bool,
}

impl Default for FreeDecay {
    /// Returns the default settings: the likelihood chooses up to ten modes, and each channel has a
    /// constant.
    fn default() -> Self {
        Self { modes: None, max_modes: 10, offset: true }
    }
}

/// Identifies the modes of a free response, a sum of decaying oscillations and noise, samples ×
/// channels of one quantity in any unit.
///
/// The modes of all channels share their poles; shapes and constants follow linearly from them.
/// Each channel has a separate noise level and, if its residual is coloured, a separate
/// autoregression. Poles, noise levels and autoregressions are maximum-likelihood estimates with
/// the corresponding standard errors. A further mode is accepted if it raises the likelihood by
/// more than a limit; noise alone exceeds this limit with a probability of 0.1 %. Searches start
/// from poles of the Hankel matrix of the record and from the strongest decay in the residual.
///
/// Modes that do not oscillate (overdamped ones) are not part of the model. The memory needed is a
/// few times the size of the record.
///
/// ```
/// use mechid_modal::free_decay::{FreeDecay, free_decay};
/// use mechid_signal::{NoiseLevel, Record, Sampling, noise};
///
/// // 5 Hz, damping ratio 0.02, two channels that move against one another.
/// let (omega, zeta) = (5.0 * std::f64::consts::TAU, 0.02f64);
/// let x = |t: f64| (-zeta * omega * t).exp() * (omega * (1.0 - zeta * zeta).sqrt() * t).cos();
/// let sampling = Sampling::new(0.01, 400)?;
/// let channels = [1.0, -0.5].map(|size| sampling.times().map(|t| size * x(t)).collect::<Vec<_>>());
/// let record = Record::from_channels(sampling, &channels)?;
/// let measured = noise::add_white(&record, NoiseLevel::FractionOfRms(0.02), 1)?;
///
/// let estimate = free_decay(&measured, &FreeDecay::default())?;
/// let [mode] = estimate.modes() else { panic!("{} modes", estimate.modes().len()) };
/// let [low, high] = mode.mode.natural_frequency_hz.interval(0.99)?;
/// assert!(low < 5.0 && 5.0 < high && high - low < 0.01);
/// assert!((mode.mode.mode.shape()[1].re + 0.5).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FreeDecayError::SilentChannel`] if a channel is constant, [`SignalError::TooShort`],
/// [`FreeDecayError::TooLong`], [`FreeDecayError::NumberOfModes`] if the requested number of modes
/// is zero or too large, [`FreeDecayError::NoOscillation`] if decays without oscillation describe
/// the response better, [`FreeDecayError::NoDecay`] if no oscillation exceeds the noise,
/// [`FreeDecayError::ExcitedAgain`] if there is a second excitation instead of one decay,
/// [`FreeDecayError::Grows`] if most of the response grows, [`FreeDecayError::NotConverged`] if the
/// record does not determine the number of modes.
///
/// # Source
/// Juang & Pappa (1985), Journal of Guidance, Control, and Dynamics 8, 620–627 (initial poles);
/// Golub & Pereyra (1973), SIAM Journal on Numerical Analysis 10, 413–432 (separable least
/// squares); Davies (1987), Biometrika 74, 33–43 (tests where a parameter exists under the
/// alternative only).
pub fn free_decay(
    record: &Record,
    settings: &FreeDecay,
) -> Result<FreeDecayEstimate, FreeDecayError> {
    let asked = checked_number_of_modes(record, settings)?;
    let samples = record.len();
    let units = units(record)?;
    let scaled = |k: usize, c: usize| record.channel(c)[k] / units[c][0] / units[c][1];
    let data = Data {
        samples: DMatrix::from_fn(samples, record.channels(), scaled),
        constant: settings.offset,
    };
    let most = asked.min(samples / SAMPLES_PER_MODE);
    let failed = FreeDecayError::NotConverged { searches: 1, steps: MAX_STEPS };
    let search = Search::new(&data);
    let mut excited_again = None;
    let best = match settings.modes {
        Some(modes) => search.exactly(modes).ok_or(failed.clone())?,
        None => {
            let selected = search.best(most).ok_or(failed.clone())?;
            check_oscillation(&data, &selected.best.fit, record.sampling().dt())?;
            if selected.best.fit.poles.is_empty() {
                if let Some((sample, p_value)) = shock(&data, &selected.best.fit) {
                    let seconds = record.sampling().time(sample);
                    return Err(FreeDecayError::ExcitedAgain { seconds, p_value });
                }
                let needed = select::least_gain(samples, record.channels());
                return Err(FreeDecayError::NoDecay {
                    samples,
                    gained: selected.first_gain,
                    needed,
                });
            }
            // A coloured noise model may absorb the effect of a second hit. The search for a second
            // hit therefore uses the fit with white noise, and the hit must lower the criterion by
            // more than coloured noise does.
            let surplus = selected.white.criterion(&data) - selected.best.criterion(&data);
            excited_again = restart(&data, &selected.white.fit)
                .filter(|(_, decrease)| *decrease > surplus)
                .map(|(sample, _)| sample);
            selected.best
        }
    };
    let scale: Vec<f64> = units.iter().map(|[power, rms]| power * rms).collect();
    let fit = data.refined(&best.fit.poles, &best.fit.noise, FINE).ok_or(failed.clone())?;
    let estimate = estimate::estimate(record, &data, &fit, &scale).ok_or(failed)??;
    let estimate = estimate.with_restart(excited_again);
    for mode in estimate.modes() {
        let growth = &mode.mode.growth_rate;
        if mode.energy_share > 0.5 && growth.value > FREE_DECAY_SURE * growth.standard_error {
            return Err(FreeDecayError::Grows {
                frequency_hz: mode.mode.damped_frequency_hz.value,
                growth_rate: growth.value,
                standard_error: growth.standard_error,
            });
        }
    }
    Ok(estimate)
}

/// Returns the given number of modes, or the maximum number if none is given. Refuses a number or a
/// record outside the limits.
fn checked_number_of_modes(record: &Record, settings: &FreeDecay) -> Result<usize, FreeDecayError> {
    let asked = settings.modes.unwrap_or(settings.max_modes);
    if asked == 0 || asked > MOST_MODES {
        return Err(FreeDecayError::NumberOfModes { modes: asked, most: MOST_MODES });
    }
    let (samples, most) = (record.len(), MOST_SAMPLES);
    if samples > most {
        return Err(FreeDecayError::TooLong { samples, most });
    }
    let needed = SAMPLES_PER_MODE * settings.modes.unwrap_or(1) + usize::from(settings.offset);
    if samples < needed {
        return Err(SignalError::TooShort { samples, needed }.into());
    }
    Ok(asked)
}

/// Refuses a response that one or two decays without oscillation describe better than the
/// identified oscillations, by the Bayesian information criterion.
fn check_oscillation(data: &Data, fit: &Fit, dt: f64) -> Result<(), FreeDecayError> {
    let residual = data.residual(fit);
    let squares = residual.column_iter().map(|e| e.norm_squared());
    let criterion_of_modes =
        information(data, squares, fit.poles.len() * (2 + 2 * data.channels()));
    match aperiodic(data).filter(|decays| decays.criterion < criterion_of_modes) {
        Some(Aperiodic { rates, .. }) => {
            let rates = rates.iter().map(|rate| rate.map(|value| value / dt)).collect();
            Err(FreeDecayError::NoOscillation { rates })
        }
        None => Ok(()),
    }
}

/// Returns, for each channel, a power of two near its peak, and its RMS about the mean divided by
/// this power.
fn units(record: &Record) -> Result<Vec<[f64; 2]>, FreeDecayError> {
    let unit = |channel: usize| {
        let x = record.channel(channel);
        let power = power_of_two(peak(x));
        let count = x.len() as f64;
        let mean = x.iter().map(|v| v / power).sum::<f64>() / count;
        let square: f64 = x.iter().map(|v| (v / power - mean).powi(2)).sum();
        let rms = (square / count).sqrt();
        if power > 0.0 && rms > f64::EPSILON * mean.abs() {
            Ok([power, rms])
        } else {
            Err(FreeDecayError::SilentChannel { channel, value: x[0] })
        }
    };
    (0..record.channels()).map(unit).collect()
}
