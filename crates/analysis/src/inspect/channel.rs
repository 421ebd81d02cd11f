//! Measures of one channel.

use std::f64::consts::TAU;

use mechid_signal::{
    Clipping, Record, RunningStatistics, Sampling, SignalError, Spectrum, clipping, repetition,
};
use serde::Serialize;

use crate::extremes::Extremes;

/// Maximum number of reported spectral lines of a channel.
const STRONGEST: usize = 3;

/// Ratio of amplitudes: a spectral line is reported only if its amplitude is more than this ratio
/// times the amplitude of the strongest line.
const FAINTEST: f64 = 0.01;

/// Measures of a channel.
#[derive(Debug, Serialize)]
pub struct Channel {
    /// Column.
    pub column: usize,
    /// Name.
    pub name: String,
    /// Description of the channel in the file, in addition to its name.
    pub about: String,
    /// Mean, in the unit of the channel.
    pub mean: f64,
    /// RMS value, in the unit of the channel.
    pub rms: f64,
    /// Largest magnitude, in the unit of the channel.
    pub peak: f64,
    /// Peak over RMS, a ratio; 1.41 for a sine. `None` for a channel of zeros.
    pub crest_factor: Option<f64>,
    /// Smallest sample, in the unit of the channel.
    pub minimum: f64,
    /// Largest sample, in the unit of the channel.
    pub maximum: f64,
    /// Clipping of the channel; `None` if it was not clipped.
    pub clipping: Option<Cut>,
    /// The strongest lines of the spectrum, the strongest first.
    pub spectrum_peaks: Vec<SpectrumPeak>,
    /// Period of the channel; `None` if it does not repeat.
    pub period: Option<Period>,
    /// `true` if the channel was searched for lines and a period.
    #[serde(skip)]
    pub spectral: bool,
}

/// A line of a spectrum that is higher than its neighbours.
#[derive(Debug, Serialize)]
pub struct SpectrumPeak {
    /// Frequency in cycles per sample, a pure number.
    pub cycles_per_sample: f64,
    /// Frequency, in Hz; `None` without a time axis.
    pub frequency_hz: Option<f64>,
    /// Amplitude of the sine, in the unit of the channel.
    pub amplitude: f64,
}

/// Clipping of a channel by an amplifier or a converter.
#[derive(Debug, Serialize)]
pub struct Cut {
    /// Value at which the channel is clipped, with its sign, in the unit of the channel.
    pub level: f64,
    /// Number of clipped samples: those with the value `level` in runs of at least three samples.
    pub samples: usize,
}

/// Period after which a channel repeats.
#[derive(Debug, Serialize)]
pub struct Period {
    /// Number of samples.
    pub samples: usize,
    /// Length, in s; `None` without a time axis.
    pub seconds: Option<f64>,
    /// RMS difference from one period to the next, over √2 times the RMS about the mean; a ratio.
    pub mismatch: f64,
}

/// Statistics of a channel, gathered block by block.
#[derive(Debug, Default)]
pub struct Gathered {
    levels: RunningStatistics,
    /// The first samples, in which spectral lines and the period are detected; empty if the channel
    /// is not searched for them.
    held: Vec<f64>,
    /// Extreme values over time; `None` if no picture is drawn.
    extremes: Option<Extremes>,
}

/// A channel and its curves.
#[derive(Debug)]
pub struct Measured {
    /// The channel.
    pub channel: Channel,
    /// Amplitude spectrum.
    pub lines: AmplitudeSpectrum,
    /// Extreme values over time; `None` if the channel is not drawn.
    pub extremes: Option<Extremes>,
}

impl Gathered {
    /// Creates statistics before the first sample of a window of `window` samples; `drawn` states
    /// whether the channel is plotted.
    pub(crate) fn new(window: usize, drawn: bool) -> Self {
        Self { extremes: drawn.then(|| Extremes::new(window)), ..Self::default() }
    }

    /// Adds the next samples to the statistics, and stores only the first `hold` samples of the
    /// channel.
    pub(crate) fn push(&mut self, values: &[f64], hold: usize) -> Result<(), SignalError> {
        self.levels.push(values)?;
        if let Some(extremes) = &mut self.extremes {
            extremes.push(values);
        }
        let more = hold.saturating_sub(self.held.len()).min(values.len());
        self.held.extend_from_slice(&values[..more]);
        Ok(())
    }
}

impl Measured {
    /// Measures a channel. Its time step, in s, may be unknown; its period may be `given`.
    pub(crate) fn new(
        column: usize,
        name: String,
        about: String,
        gathered: Gathered,
        dt: Option<f64>,
        given: Option<usize>,
    ) -> Result<Self, SignalError> {
        let Gathered { levels, held, extremes } = gathered;
        let (spectral, repeats, cut) = (!held.is_empty(), repetition(&held), clipping(&held));
        let period = repeats.map(|r| r.period).or(given.filter(|period| *period <= held.len()));
        let mean = held.iter().sum::<f64>() / held.len() as f64;
        let lines = AmplitudeSpectrum::new(held, mean, period)?;
        let channel = Channel {
            column,
            name,
            about,
            mean: levels.mean(),
            rms: levels.rms(),
            peak: levels.peak(),
            crest_factor: levels.crest_factor(),
            minimum: levels.minimum(),
            maximum: levels.maximum(),
            clipping: cut.map(|Clipping { level, samples }| Cut { level, samples }),
            spectrum_peaks: lines.strongest(dt),
            period: repeats.map(|r| Period {
                samples: r.period,
                seconds: dt.map(|dt| r.period as f64 * dt),
                mismatch: r.mismatch,
            }),
            spectral,
        };
        Ok(Self { channel, lines, extremes })
    }
}

/// Maximum difference of amplitudes that count as equal, relative to the largest amplitude.
const EQUAL: f64 = 1e-9;

/// Spectrum about the mean: of whole periods if the channel is periodic or a period is given,
/// otherwise of all samples weighted by a Hann window.
#[derive(Debug)]
pub struct AmplitudeSpectrum {
    /// Amplitudes of the lines from 0 Hz on.
    amplitude: Vec<f64>,
    /// Number of transformed samples.
    samples: usize,
    period: Option<usize>,
}

impl AmplitudeSpectrum {
    fn new(mut values: Vec<f64>, mean: f64, period: Option<usize>) -> Result<Self, SignalError> {
        if let Some(period) = period {
            values.truncate(values.len() / period * period);
        }
        let samples = values.len();
        if samples == 0 {
            return Ok(Self { amplitude: Vec::new(), samples, period });
        }
        for (k, value) in values.iter_mut().enumerate() {
            // The weights have mean 1, so that a sine keeps its amplitude.
            let weight = match period {
                Some(_) => 1.0,
                None => 1.0 - (TAU * k as f64 / samples as f64).cos(),
            };
            *value = weight * (*value - mean);
        }
        let record = Record::from_channel(Sampling::new(1.0, samples)?, values)?;
        let spectrum = Spectrum::from_record(&record);
        let amplitude = (0..spectrum.len()).map(|n| spectrum.line(n, 0).norm()).collect();
        Ok(Self { amplitude, samples, period })
    }

    /// Returns the highest of the lines that exceed their neighbours, the strongest first.
    fn strongest(&self, dt: Option<f64>) -> Vec<SpectrumPeak> {
        let at = |n: usize| self.amplitude.get(n).copied().unwrap_or(0.0);
        let strongest = self.amplitude.iter().skip(1).copied().fold(0.0, f64::max);
        // Lines whose amplitudes differ only by rounding are sorted by frequency.
        let level = |n: usize| (at(n) / strongest / EQUAL).round();
        let is_peak = |n: &usize| level(*n) >= level(n - 1).max(level(n + 1));
        let mut peaks: Vec<usize> = (1..self.amplitude.len())
            .filter(|n| is_peak(n) && at(*n) > FAINTEST * strongest)
            .collect();
        peaks.sort_by(|a, b| level(*b).total_cmp(&level(*a)));
        let strongest = peaks.into_iter().take(STRONGEST);
        strongest
            .map(|n| SpectrumPeak {
                cycles_per_sample: self.cycles_per_sample(n),
                frequency_hz: dt.map(|dt| self.cycles_per_sample(n) / dt),
                amplitude: at(n),
            })
            .collect()
    }

    fn cycles_per_sample(&self, n: usize) -> f64 {
        n as f64 / self.samples as f64
    }

    /// Returns the number of samples of the period averaged in [`points`](Self::points); `None`
    /// without a period.
    pub fn period(&self) -> Option<usize> {
        self.period
    }

    /// Returns the frequency (cycles per sample) and the amplitude of every line except the mean. A
    /// periodic channel has only the lines of its mean period.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let every = self.period.map_or(1, |period| self.samples / period);
        let lines = self.amplitude.iter().copied().enumerate().step_by(every).skip(1);
        lines.map(|(n, amplitude)| (self.cycles_per_sample(n), amplitude))
    }
}
