//! What can be said of one channel.

use std::f64::consts::TAU;

use mechid::signal::{Record, Sampling, SignalError, Spectrum, repetition};
use serde::Serialize;

use crate::commands::levels::Levels;

/// Spectral lines told of a channel.
const STRONGEST: usize = 3;

/// Weaker lines are not told, as a part of the strongest one.
const FAINTEST: f64 = 0.01;

/// The measures of a channel.
#[derive(Debug, Serialize)]
pub struct Channel {
    pub column: usize,
    pub name: String,
    /// What the file says of it beyond its name.
    pub about: String,
    pub mean: f64,
    pub rms: f64,
    pub peak: f64,
    /// Peak over RMS; 1.41 for a sine. Nothing for a channel of zeros.
    pub crest_factor: Option<f64>,
    pub minimum: f64,
    pub maximum: f64,
    /// The strongest lines of the spectrum, the strongest first.
    pub spectrum_peaks: Vec<SpectrumPeak>,
    /// Nothing if it does not repeat.
    pub period: Option<Period>,
}

/// A line of a spectrum that is higher than its neighbours.
#[derive(Debug, Serialize)]
pub struct SpectrumPeak {
    pub cycles_per_sample: f64,
    /// Nothing without a time axis.
    pub frequency_hz: Option<f64>,
    /// Of the sine, in the unit of the channel.
    pub amplitude: f64,
}

/// After how long a channel repeats.
#[derive(Debug, Serialize)]
pub struct Period {
    pub samples: usize,
    /// Nothing without a time axis.
    pub seconds: Option<f64>,
    /// RMS difference from one period to the next, over √2 times the RMS about the mean.
    pub mismatch: f64,
}

/// What is gathered of a channel, block by block.
#[derive(Debug, Default)]
pub struct Gathered {
    levels: Levels,
    /// The first samples, which are looked at together.
    held: Vec<f64>,
    mean_of_held: f64,
}

impl Gathered {
    /// The next samples; whole blocks are held until there are `hold` of them.
    pub fn push(&mut self, values: &[f64], hold: usize) -> Result<(), SignalError> {
        self.levels.push(values)?;
        if self.held.len() < hold {
            self.held.extend_from_slice(values);
            self.mean_of_held = self.levels.mean();
        }
        Ok(())
    }
}

impl Channel {
    /// Measures a channel whose step, in s, may be unknown, and of which a period may be `given`.
    pub fn of(
        column: usize,
        name: String,
        about: String,
        gathered: Gathered,
        dt: Option<f64>,
        given: Option<usize>,
    ) -> Result<Self, SignalError> {
        let Gathered { levels, held, mean_of_held } = gathered;
        let repeats = repetition(&held);
        let period = repeats.map(|r| r.period).or(given.filter(|period| *period <= held.len()));
        let spectrum_peaks = spectrum_peaks(held, mean_of_held, period, dt)?;
        let Levels { peak, minimum, maximum, .. } = levels;
        Ok(Self {
            column,
            name,
            about,
            mean: levels.mean(),
            rms: levels.rms(),
            peak,
            crest_factor: (peak > 0.0).then(|| peak / levels.rms()),
            minimum,
            maximum,
            spectrum_peaks,
            period: repeats.map(|r| Period {
                samples: r.period,
                seconds: dt.map(|dt| r.period as f64 * dt),
                mismatch: r.mismatch,
            }),
        })
    }
}

/// Amplitudes closer than this, relative to the largest, are one.
const EQUAL: f64 = 1e-9;

/// The strongest local maxima of the spectrum about the mean: of whole periods where the channel
/// repeats or somebody says so, otherwise of all samples weighted by a Hann window.
fn spectrum_peaks(
    mut values: Vec<f64>,
    mean: f64,
    period: Option<usize>,
    dt: Option<f64>,
) -> Result<Vec<SpectrumPeak>, SignalError> {
    if let Some(period) = period {
        values.truncate(values.len() / period * period);
    }
    let len = values.len();
    for (k, value) in values.iter_mut().enumerate() {
        // The window's mean is 1, so that a sine keeps its amplitude.
        let weight = match period {
            Some(_) => 1.0,
            None => 1.0 - (TAU * k as f64 / len as f64).cos(),
        };
        *value = weight * (*value - mean);
    }
    let spectrum = Spectrum::of(&Record::from_channel(Sampling::new(1.0, len)?, values)?);
    let amplitude: Vec<f64> = (0..spectrum.len()).map(|n| spectrum.line(n, 0).norm()).collect();
    let at = |n: usize| amplitude.get(n).copied().unwrap_or(0.0);
    let strongest = amplitude.iter().skip(1).copied().fold(0.0, f64::max);
    // Lines of the same amplitude but for rounding stand in order.
    let level = |n: usize| (at(n) / strongest / EQUAL).round();
    let mut peaks: Vec<usize> = (1..amplitude.len())
        .filter(|n| level(*n) >= level(n - 1).max(level(n + 1)) && at(*n) > FAINTEST * strongest)
        .collect();
    peaks.sort_by(|a, b| level(*b).total_cmp(&level(*a)));
    let told = peaks.into_iter().take(STRONGEST);
    Ok(told
        .map(|n| {
            let cycles_per_sample = n as f64 / len as f64;
            SpectrumPeak {
                cycles_per_sample,
                frequency_hz: dt.map(|dt| cycles_per_sample / dt),
                amplitude: at(n),
            }
        })
        .collect())
}
