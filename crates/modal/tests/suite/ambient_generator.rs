//! Ambient records of a known structure: an exact discretisation of its modes under white forces,
//! and a band-limited steady state for accelerations.

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling, transform};
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Structure with its forces.
#[derive(Clone)]
pub struct Structure {
    pub frequencies_hz: Vec<f64>,
    pub dampings: Vec<f64>,
    /// Outputs × modes.
    pub shapes: DMatrix<Complex<f64>>,
    /// Modal force per unit of each white force, modes × forces.
    pub forces: DMatrix<f64>,
}

/// Quantity that the sensors measure.
#[derive(Clone, Copy, PartialEq)]
pub enum Quantity {
    Displacement,
    Velocity,
    Acceleration,
}

/// Noise of the sensors: a first-order autoregression.
#[derive(Clone, Copy)]
pub struct Noise {
    /// Root-mean-square of the noise, relative to that of each channel.
    pub level: f64,
    /// Pole of the autoregression: 0 for white noise, negative for noise that rises with frequency.
    pub pole: f64,
}

impl From<f64> for Noise {
    fn from(level: f64) -> Self {
        Self { level, pole: 0.5 }
    }
}

impl Structure {
    pub fn poles(&self) -> Vec<Complex<f64>> {
        let pole = |(f, z): (&f64, &f64)| Complex::new(-z, (1.0 - z * z).sqrt()) * (f * TAU);
        self.frequencies_hz.iter().zip(&self.dampings).map(pole).collect()
    }

    /// Returns a record of displacements or velocities. The modal states are advanced exactly from
    /// sample to sample; in each step, white forces add a random change with the exact covariance.
    pub fn record(
        &self,
        quantity: Quantity,
        rate_hz: f64,
        len: usize,
        noise: impl Into<Noise>,
        seed: u64,
    ) -> Record {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (poles, dt) = (self.poles(), 1.0 / rate_hz);
        let modes = poles.len();
        let power = &self.forces * self.forces.transpose();
        let stationary = real_covariance(&poles, &power, |sum| -sum.inv());
        let increment =
            real_covariance(&poles, &power, |sum| ((sum * dt).exp() - Complex::from(1.0)) / sum);
        let (first, step) = (root(stationary), root(increment));
        let mut draw =
            |size: usize| DVector::from_fn(size, |_, _| StandardNormal.sample(&mut random));
        let mut state = complex(&(first * draw(2 * modes)));
        let factors: Vec<Complex<f64>> = poles.iter().map(|l| (l * dt).exp()).collect();
        let residues: Vec<DVector<Complex<f64>>> = (0..modes)
            .map(|r| {
                let derivative = match quantity {
                    Quantity::Displacement => Complex::from(1.0),
                    Quantity::Velocity => poles[r],
                    Quantity::Acceleration => panic!("white forces make it infinite"),
                };
                self.shapes.column(r) * (derivative / Complex::new(0.0, 2.0 * poles[r].im))
            })
            .collect();
        let outputs = self.shapes.nrows();
        let mut data = DMatrix::zeros(len, outputs);
        for t in 0..len {
            for (r, residue) in residues.iter().enumerate() {
                for (i, psi) in residue.iter().enumerate() {
                    data[(t, i)] += 2.0 * (psi * state[r]).re;
                }
            }
            let added = complex(&(&step * draw(2 * modes)));
            for r in 0..modes {
                state[r] = factors[r] * state[r] + added[r];
            }
        }
        with_noise(data, rate_hz, noise.into(), seed)
    }

    /// Returns a record of accelerations. The record is one quarter of a period of the steady state
    /// under periodic forces that are white up to 90 % of half the sampling rate.
    pub fn accelerations(
        &self,
        rate_hz: f64,
        len: usize,
        noise: impl Into<Noise>,
        seed: u64,
    ) -> Record {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let long = 4 * len;
        let poles = self.poles();
        let inverse = transform::inverse(long);
        let (outputs, forces) = (self.shapes.nrows(), self.forces.ncols());
        let mut lines = vec![inverse.make_input_vec(); outputs];
        for k in 1..(0.9 * len as f64 * 2.0) as usize {
            let s = Complex::new(0.0, TAU * k as f64 * rate_hz / long as f64);
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let force = DVector::from_fn(forces, |_, _| Complex::new(normal(), normal()));
            let modal = self.forces.map(Complex::from) * force;
            for (r, pole) in poles.iter().enumerate() {
                for (i, line) in lines.iter_mut().enumerate() {
                    let psi = self.shapes[(i, r)] / Complex::new(0.0, 2.0 * pole.im);
                    let gain = psi / (s - pole) + psi.conj() / (s - pole.conj());
                    line[k] += s * s * gain * modal[r];
                }
            }
        }
        let mut data = DMatrix::zeros(len, outputs);
        for (i, line) in lines.iter_mut().enumerate() {
            let mut output = inverse.make_output_vec();
            inverse.process(line, &mut output).unwrap();
            data.column_mut(i).copy_from_slice(&output[len..2 * len]);
        }
        with_noise(data, rate_hz, noise.into(), seed)
    }
}

/// Adds the noise of each sensor.
fn with_noise(mut data: DMatrix<f64>, rate_hz: f64, noise: Noise, seed: u64) -> Record {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
    let len = data.nrows();
    for mut column in data.column_iter_mut() {
        let level = noise.level * (column.norm_squared() / len as f64).sqrt();
        let mut state: f64 = StandardNormal.sample(&mut random);
        for sample in column.iter_mut() {
            let fresh: f64 = StandardNormal.sample(&mut random);
            state = noise.pole * state + (1.0 - noise.pole * noise.pole).sqrt() * fresh;
            *sample += level * state;
        }
    }
    Record::new(Sampling::from_rate_hz(rate_hz, len).unwrap(), data).unwrap()
}

/// Returns the covariance of the real and imaginary parts of the modal states. `integral` returns
/// the integral of e^{(λ_a + λ_b)t} over the time in which the forces act, as a function of λ_a +
/// λ_b.
fn real_covariance(
    poles: &[Complex<f64>],
    power: &DMatrix<f64>,
    integral: impl Fn(Complex<f64>) -> Complex<f64>,
) -> DMatrix<f64> {
    let m = poles.len();
    let mut covariance = DMatrix::zeros(2 * m, 2 * m);
    for a in 0..m {
        for b in 0..m {
            let hermitian = integral(poles[a] + poles[b].conj()) * power[(a, b)];
            let plain = integral(poles[a] + poles[b]) * power[(a, b)];
            covariance[(a, b)] = 0.5 * (hermitian + plain).re;
            covariance[(m + a, m + b)] = 0.5 * (hermitian - plain).re;
            covariance[(a, m + b)] = 0.5 * (plain - hermitian).im;
            covariance[(m + b, a)] = covariance[(a, m + b)];
        }
    }
    covariance
}

/// Returns the lower triangle L of a covariance L Lᵀ that may be singular.
fn root(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let size = covariance.nrows();
    let ridge = 1e-13 * covariance.diagonal().amax();
    (covariance + DMatrix::identity(size, size) * ridge).cholesky().unwrap().l()
}

fn complex(parts: &DVector<f64>) -> Vec<Complex<f64>> {
    let m = parts.len() / 2;
    (0..m).map(|r| Complex::new(parts[r], parts[m + r])).collect()
}

/// Returns the means over `count` successive samples of a record. The spectrum of these means has
/// zeros, like a response to forces whose spectrum has zeros.
pub fn moving_mean(record: &Record, count: usize) -> Record {
    let len = record.len() + 1 - count;
    let mean =
        |k: usize, at: usize| record.channel(at)[k..k + count].iter().sum::<f64>() / count as f64;
    let sampling = record.sampling().with_len(len).unwrap();
    Record::new(sampling, DMatrix::from_fn(len, record.channels(), mean)).unwrap()
}
