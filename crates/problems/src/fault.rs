//! Faults of measuring chains, added to ideal records.

use std::f64::consts::TAU;

use mechid_signal::noise::Colour;
use mechid_signal::{NoiseLevel, Record, Spectrum, noise};
use nalgebra::{Complex, DMatrix};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::error::ProblemError;

/// A fault of a measuring chain that affects all channels of a record.
///
/// A level is a fraction of the RMS value of a channel unless stated otherwise, so that one fault
/// suits a force and a displacement.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// Crosstalk: every channel contains a fraction of each other channel.
    Crosstalk {
        /// Fraction, a ratio.
        part: f64,
    },
    /// Run-out: the surface under the probes is not round. It adds sines at the rotation frequency
    /// and its multiples, with phases drawn from the seed.
    RunOut {
        /// Speed of rotation, in Hz.
        rotation_hz: f64,
        /// Ratio of each amplitude to the RMS value of the channel (pure number): first at the
        /// rotation frequency, then at each of its multiples.
        amplitudes: Vec<f64>,
    },
    /// Gaussian noise.
    Noise {
        /// Ratio of the RMS of the noise to the RMS of the channel (pure number).
        level: f64,
        /// Colour of the noise.
        colour: Colour,
    },
    /// The zero drifts along a straight line.
    Drift {
        /// Drift from the first sample to the last, divided by the RMS value of the channel (pure
        /// number).
        end: f64,
    },
    /// The channels are delayed.
    ///
    /// The record is assumed to be one or several whole periods.
    Delay {
        /// Delay, in samples (pure number), possibly fractional.
        samples: f64,
    },
    /// An amplifier clips at a limit.
    Clipping {
        /// Limit as a fraction of the largest magnitude of each channel.
        part: f64,
    },
    /// Samples are lost without a replacement: later samples come too early, and the end of the
    /// record is filled with samples from its beginning, as in a record of whole periods.
    Lost {
        /// Number of samples lost, all at one position drawn from the seed.
        samples: usize,
    },
    /// A converter repeats its last value.
    Held {
        /// Number of gaps, at positions drawn from the seed.
        gaps: usize,
        /// Number of samples in a gap.
        samples: usize,
    },
    /// The gain, or its sign, is wrong.
    Gain {
        /// Ratio of the values to those without the fault (pure number).
        factor: f64,
    },
    /// A converter quantises the values; its range is ± 1.5 times the largest magnitude.
    Steps {
        /// Number of bits.
        bits: u8,
    },
}

impl Fault {
    /// Returns the record with the fault; random values are drawn from `seed`.
    ///
    /// # Errors
    /// [`ProblemError::Signal`] if a level or a colour is out of range.
    ///
    /// # Source
    /// Ours.
    pub fn apply(&self, record: &Record, seed: u64) -> Result<Record, ProblemError> {
        let (sampling, len) = (record.sampling(), record.len());
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let rms = |channel: usize| mechid_signal::measures::rms(record.channel(channel));
        let mut data = record.data().clone();
        match self {
            Self::Crosstalk { part } => {
                let sums = DMatrix::from_fn(len, 1, |k, _| data.row(k).sum());
                for mut column in data.column_iter_mut() {
                    column.zip_apply(&sums, |value, sum| *value += part * (sum - *value));
                }
            }
            Self::RunOut { rotation_hz, amplitudes } => {
                for (channel, mut column) in data.column_iter_mut().enumerate() {
                    let omega = |n: i32| TAU * f64::from(n) * rotation_hz * sampling.dt();
                    add_run_out(column.as_mut_slice(), omega, amplitudes, rms(channel), rng);
                }
            }
            Self::Noise { level, colour } => {
                return Ok(noise::add(record, NoiseLevel::FractionOfRms(*level), *colour, seed)?);
            }
            Self::Drift { end } => {
                for (channel, mut column) in data.column_iter_mut().enumerate() {
                    let drift = end * rms(channel);
                    for (k, value) in column.iter_mut().enumerate() {
                        *value += drift * k as f64 / (len - 1) as f64;
                    }
                }
            }
            Self::Delay { samples } => return delayed(record, *samples),
            Self::Clipping { part } => {
                for mut column in data.column_iter_mut() {
                    let limit = part * column.amax();
                    column.apply(|value| *value = value.clamp(-limit, limit));
                }
            }
            Self::Lost { samples } => {
                let first = rng.random_range(0..len);
                let come_early = |k: usize| if k < first { k } else { (k + samples) % len };
                data = DMatrix::from_fn(len, data.ncols(), |k, c| data[(come_early(k), c)]);
            }
            Self::Held { gaps, samples } => {
                for _ in 0..*gaps {
                    hold(&mut data, rng.random_range(1..len), *samples);
                }
            }
            Self::Gain { factor } => data *= *factor,
            Self::Steps { bits } => {
                for mut column in data.column_iter_mut() {
                    let step =
                        3.0 * column.amax().max(f64::MIN_POSITIVE) / 2_f64.powi(i32::from(*bits));
                    column.apply(|value| *value = (*value / step).round() * step);
                }
            }
        }
        Ok(Record::new(sampling, data)?)
    }
}

/// Adds a sine at each multiple n of the rotation frequency. The angular frequency of the sine is
/// `omega(n)` rad per sample, and its amplitude is relative to `unit`.
fn add_run_out(
    column: &mut [f64],
    omega: impl Fn(i32) -> f64,
    amplitudes: &[f64],
    unit: f64,
    rng: &mut ChaCha8Rng,
) {
    for (multiple, amplitude) in (1..).zip(amplitudes) {
        let omega = omega(multiple);
        let phase = rng.random_range(0.0..TAU);
        for (k, value) in column.iter_mut().enumerate() {
            *value += amplitude * unit * (omega * k as f64 + phase).cos();
        }
    }
}

/// Returns the record delayed by a possibly fractional number of samples.
fn delayed(record: &Record, samples: f64) -> Result<Record, ProblemError> {
    let mut lines = Spectrum::from_record(record).lines().clone();
    for (n, mut line) in lines.row_iter_mut().enumerate() {
        line *= Complex::from_polar(1.0, -TAU * n as f64 * samples / record.len() as f64);
    }
    Ok(Spectrum::from_lines(record.sampling(), lines)?.to_record()?)
}

/// Overwrites `samples` rows from `first` on with the row before `first`.
fn hold(data: &mut DMatrix<f64>, first: usize, samples: usize) {
    for k in first..(first + samples).min(data.nrows()) {
        let last = data.row(first - 1).into_owned();
        data.set_row(k, &last);
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Multisine, Phases, Sampling};

    use super::*;

    fn two_sines() -> Record {
        let sampling = Sampling::new(0.001, 1000).unwrap();
        let sine = |line: usize| {
            Multisine::flat([line], 2.0, Phases::Schroeder).unwrap().sample(sampling).unwrap()
        };
        let (a, b) = (sine(5), sine(8));
        Record::from_channels(sampling, &[a.channel(0), b.channel(0)]).unwrap()
    }

    /// Each fault must change the spectral lines or the samples of a record as its definition
    /// states.
    #[test]
    fn faults_are_what_they_say() {
        let clean = two_sines();
        let line = |record: &Record, n: usize, c: usize| Spectrum::from_record(record).line(n, c);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;

        let crossed = Fault::Crosstalk { part: 0.1 }.apply(&clean, 1).unwrap();
        assert!(near(line(&crossed, 8, 0).norm(), 0.2) && near(line(&crossed, 5, 0).norm(), 2.0));

        let run_out = Fault::RunOut { rotation_hz: 20.0, amplitudes: vec![0.1, 0.05] };
        let seen = run_out.apply(&clean, 1).unwrap();
        let rms = 2.0_f64.sqrt();
        assert!(near(line(&seen, 20, 1).norm(), 0.1 * rms));
        assert!(near(line(&seen, 40, 0).norm(), 0.05 * rms));
        assert_ne!(run_out.apply(&clean, 2).unwrap(), seen);
        assert_eq!(run_out.apply(&clean, 1).unwrap(), seen);

        let drifted = Fault::Drift { end: 0.5 }.apply(&clean, 1).unwrap();
        let moved = drifted.data() - clean.data();
        assert!(near(moved[(0, 0)], 0.0) && near(moved[(999, 1)], 0.5 * rms));

        let late = Fault::Delay { samples: 2.5 }.apply(&clean, 1).unwrap();
        let turned = line(&late, 8, 1) / line(&clean, 8, 1);
        assert!(near(turned.arg(), -TAU * 8.0 * 2.5 / 1000.0) && near(turned.norm(), 1.0));

        let cut = Fault::Clipping { part: 0.9 }.apply(&clean, 1).unwrap();
        assert!(near(cut.data().amax(), 0.9 * clean.data().amax()));

        let lost = Fault::Lost { samples: 3 }.apply(&clean, 1).unwrap();
        let first = (0..1000).find(|k| lost.data().row(*k) != clean.data().row(*k)).unwrap();
        assert!((first..997).all(|k| lost.data().row(k) == clean.data().row(k + 3)));

        let held = Fault::Held { gaps: 1, samples: 4 }.apply(&clean, 1).unwrap();
        let other = (0..1000).filter(|k| held.data().row(*k) != clean.data().row(*k)).count();
        assert_eq!(other, 4);

        let turned = Fault::Gain { factor: -2.0 }.apply(&clean, 1).unwrap();
        assert_eq!(turned.data(), &(clean.data() * -2.0));

        let stepped = Fault::Steps { bits: 6 }.apply(&clean, 1).unwrap();
        let step = 3.0 * clean.column(0).amax() / 64.0;
        let off = |k: usize| stepped.channel(0)[k] - clean.channel(0)[k];
        assert!((0..1000).all(|k| off(k).abs() <= 0.5 * step * (1.0 + 1e-12)));
        let steps = |k: usize| stepped.channel(0)[k] / step;
        assert!((0..1000).all(|k| near(steps(k), steps(k).round())));

        let noise = Fault::Noise { level: 0.1, colour: Colour::White }.apply(&clean, 1).unwrap();
        let added = (noise.data() - clean.data()).column(0).norm() / 1000.0_f64.sqrt();
        assert!((added / (0.1 * rms) - 1.0).abs() < 0.1, "{added}");
    }
}
