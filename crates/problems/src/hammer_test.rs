//! A hammer test with a response in closed form.

use std::f64::consts::{PI, TAU};

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{Complex, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::ProblemError;

/// Hits of a hammer, half-sines of force, on a structure with given modes.
///
/// Each mode is an oscillator, whose response to a half-sine has a closed form. The sum is computed
/// at eight times the sampling rate, with the same anti-aliasing filter for force and response.
#[derive(Debug, Clone, PartialEq)]
pub struct HammerTest {
    /// Natural frequency of each mode, in Hz.
    pub frequencies_hz: Vec<f64>,
    /// Damping ratio of each mode, a pure number below 1.
    pub damping_ratios: Vec<f64>,
    /// Shapes, degrees of freedom × modes, for modal masses of 1, in 1/√kg.
    pub shapes: DMatrix<f64>,
    /// Time axis of the record.
    pub sampling: Sampling,
    /// Quantity of the response.
    pub quantity: ResponseQuantity,
    /// Number of hits, at equal time intervals plus a random part.
    pub hits: usize,
    /// Mean peak of the hits, in N.
    pub peak: f64,
    /// Mean duration of a pulse, in s.
    pub duration: f64,
    /// Standard deviation of the noise of the force, in N.
    pub force_noise: f64,
}

/// Deliberate fault of a hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MadeFault {
    /// The hammer bounced.
    Double,
    /// The force is clipped.
    Overload,
}

/// A record of a [`HammerTest`].
#[derive(Debug, Clone)]
pub struct HammerRecord {
    /// Force on the degree of freedom that the hammer hits, in N.
    pub force: Record,
    /// Response of all degrees of freedom, samples × degrees of freedom.
    pub response: Record,
    /// Beginning of each hit, in s, and its fault.
    pub hits: Vec<(f64, Option<MadeFault>)>,
}

/// A half-sine of force.
#[derive(Debug, Clone, Copy)]
struct Pulse {
    peak: f64,
    start: f64,
    duration: f64,
}

impl HammerTest {
    /// Number of computed samples per sample of the record.
    const FINER: usize = 8;
    /// Half length of the filter, in samples of the record.
    const SPAN: usize = 16;

    /// Returns the system with these modes: M = Φ⁻ᵀ Φ⁻¹, C = Φ⁻ᵀ diag(2ζω) Φ⁻¹, K = Φ⁻ᵀ diag(ω²)
    /// Φ⁻¹.
    ///
    /// # Errors
    /// [`ProblemError::Model`] if the shapes are not independent.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 2 (orthogonality of modes).
    pub fn system(&self) -> Result<SecondOrderSystem, ProblemError> {
        let inverse = self.shapes.clone().lu().try_inverse().unwrap_or_else(|| {
            // M becomes NaN if the matrix of the mode shapes has no inverse, and the constructor of
            // the system rejects it.
            DMatrix::from_element(self.shapes.nrows(), self.shapes.ncols(), f64::NAN)
        });
        let of = |modal: &dyn Fn(f64, f64) -> f64| {
            let modes = self.frequencies_hz.iter().zip(&self.damping_ratios);
            let diagonal: Vec<f64> = modes.map(|(hz, zeta)| modal(TAU * hz, *zeta)).collect();
            inverse.transpose() * DMatrix::from_diagonal(&DVector::from(diagonal)) * &inverse
        };
        let (mass, damping) = (of(&|_, _| 1.0), of(&|omega, zeta| 2.0 * zeta * omega));
        Ok(SecondOrderSystem::new(mass, damping, of(&|omega, _| omega * omega))?)
    }

    /// Returns a record of hits on degree of freedom `dof` (counted from 0), with `faults` double
    /// hits or overloads; each seed gives another record. The response has no noise.
    ///
    /// # Errors
    /// [`ProblemError::Signal`] if the record does not fit in memory.
    ///
    /// # Panics
    /// If there is no such degree of freedom.
    ///
    /// # Source
    /// Clough & Penzien, *Dynamics of Structures*, the chapters on impulsive loading and on modal
    /// superposition.
    pub fn measure(
        &self,
        dof: usize,
        faults: usize,
        seed: u64,
    ) -> Result<HammerRecord, ProblemError> {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let between = self.sampling.duration() / self.hits as f64;
        let mut order: Vec<usize> = (0..self.hits).collect();
        for at in (1..order.len()).rev() {
            order.swap(at, rng.random_range(0..=at));
        }
        let (mut pulses, mut hits, mut overloads) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..self.hits {
            let start = between * (number as f64 + rng.random_range(0.05..0.15));
            let peak = self.peak * rng.random_range(0.6..1.4);
            let pulse =
                Pulse { peak, start, duration: self.duration * rng.random_range(0.85..1.15) };
            pulses.push(pulse);
            let bad = order[..faults.min(self.hits)].contains(&number);
            let fault = bad.then(|| {
                if rng.random_bool(0.5) { MadeFault::Double } else { MadeFault::Overload }
            });
            match fault {
                Some(MadeFault::Double) => pulses.push(Pulse {
                    peak: peak * rng.random_range(0.1..0.8),
                    start: start + pulse.duration + rng.random_range(0.005..0.06),
                    duration: pulse.duration,
                }),
                Some(MadeFault::Overload) => {
                    overloads.push((start, pulse.duration, peak * rng.random_range(0.4..0.85)));
                }
                None => {}
            }
            hits.push((start, fault));
        }
        let (force, response) = self.filtered(dof, &pulses)?;
        let level = NoiseLevel::StandardDeviation(self.force_noise);
        let force = noise::add_white(&force, level, seed)?;
        let (dt, mut force) = (self.sampling.dt(), force.into_data());
        for (start, duration, level) in overloads {
            let samples = (start / dt) as usize..((start + duration) / dt) as usize + 2;
            for f in force.column_mut(0).as_mut_slice()[samples].iter_mut() {
                *f = f.min(level);
            }
        }
        Ok(HammerRecord { force: Record::new(self.sampling, force)?, response, hits })
    }

    /// Returns the force on one degree of freedom and the responses of all degrees of freedom, both
    /// after the anti-aliasing filter.
    fn filtered(&self, dof: usize, pulses: &[Pulse]) -> Result<(Record, Record), ProblemError> {
        let (n, finer) = (self.shapes.nrows(), Self::FINER);
        let margin = Self::SPAN * finer;
        let dt = self.sampling.dt() / finer as f64;
        let count = self.sampling.len() * finer + 2 * margin;
        let time = |k: usize| (k as f64 - margin as f64) * dt;
        let mut fine: DMatrix<f64> = DMatrix::zeros(count, n + 1);
        for k in 0..count {
            fine[(k, n)] = pulses.iter().map(|pulse| pulse.force(time(k))).sum();
        }
        for (mode, (hz, zeta)) in self.frequencies_hz.iter().zip(&self.damping_ratios).enumerate() {
            let oscillator = Oscillator { omega: TAU * hz, zeta: *zeta };
            let shape = self.shapes.column(mode);
            for k in 0..count {
                let modal: f64 =
                    pulses.iter().map(|p| oscillator.response(p, time(k), self.quantity)).sum();
                for response in 0..n {
                    fine[(k, response)] += shape[response] * shape[dof] * modal;
                }
            }
        }
        let weights = low_pass(finer, margin);
        let sampled = |channel: usize, k: usize| -> f64 {
            let samples = fine.column(channel);
            weights.iter().zip(&samples.as_slice()[k * finer..]).map(|(w, x)| w * x).sum()
        };
        let record = |channels: std::ops::Range<usize>| {
            let values = DMatrix::from_fn(self.sampling.len(), channels.len(), |k, channel| {
                sampled(channels.start + channel, k)
            });
            Record::new(self.sampling, values)
        };
        Ok((record(n..n + 1)?, record(0..n)?))
    }
}

/// Returns the weights of a low-pass filter with a Blackman window; the cutoff frequency is half
/// the sampling rate of the record.
fn low_pass(finer: usize, margin: usize) -> Vec<f64> {
    let weight = |k: usize| {
        let at = k as f64 - margin as f64;
        let x = PI * at / finer as f64;
        let sinc = if at == 0.0 { 1.0 } else { x.sin() / x };
        let turn = PI * at / (margin as f64 + 1.0);
        sinc * (0.42 + 0.5 * turn.cos() + 0.08 * (2.0 * turn).cos())
    };
    let weights: Vec<f64> = (0..=2 * margin).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
}

impl Pulse {
    fn force(&self, t: f64) -> f64 {
        let passed = (t - self.start) / self.duration;
        if (0.0..=1.0).contains(&passed) { self.peak * (PI * passed).sin() } else { 0.0 }
    }
}

/// Oscillator q̈ + 2ζω q̇ + ω² q = F, the equation of one mode.
struct Oscillator {
    omega: f64,
    zeta: f64,
}

impl Oscillator {
    /// Returns the response from rest to a half-sine: the sum of the responses to two sines. The
    /// first sine begins at the same time as the pulse, the second begins half a period of the sine
    /// later.
    fn response(&self, pulse: &Pulse, t: f64, quantity: ResponseQuantity) -> f64 {
        let begun = self.to_sine(pulse, t - pulse.start);
        let ended = self.to_sine(pulse, t - pulse.start - pulse.duration);
        let [x, v] = [begun[0] + ended[0], begun[1] + ended[1]];
        match quantity {
            ResponseQuantity::Displacement => x,
            ResponseQuantity::Velocity => v,
            ResponseQuantity::Acceleration => {
                pulse.force(t) - 2.0 * self.zeta * self.omega * v - self.omega * self.omega * x
            }
        }
    }

    /// Returns displacement and velocity `t` seconds after the beginning of a sinusoidal force. The
    /// oscillator is at rest before the force begins.
    fn to_sine(&self, pulse: &Pulse, t: f64) -> [f64; 2] {
        if t <= 0.0 {
            return [0.0; 2];
        }
        let (omega, decay) = (self.omega, self.zeta * self.omega);
        let drive = PI / pulse.duration;
        let receptance =
            Complex::new(omega * omega - drive * drive, 2.0 * decay * drive).inv() * pulse.peak;
        let steady = receptance * Complex::cis(drive * t);
        // The free motion is added, so that displacement and velocity are zero at the beginning.
        let damped = omega * (1.0 - self.zeta * self.zeta).sqrt();
        let (x0, v0) = (-receptance.im, -drive * receptance.re);
        let sine = (v0 + decay * x0) / damped;
        let (s, c) = (damped * t).sin_cos();
        let free = (-decay * t).exp();
        let x = free * (x0 * c + sine * s);
        let v = free * ((damped * sine - decay * x0) * c - (damped * x0 + decay * sine) * s);
        [steady.im + x, drive * steady.re + v]
    }
}
