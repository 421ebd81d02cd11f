//! Records of a known modal structure: a window cut out of a long, exactly band-limited steady
//! state.
//!
//! The generator is independent of the estimator: the response is the closed modal sum on the lines
//! of a period four times as long, so that the record is open and leaks as a measured one does.
#![allow(dead_code, reason = "the study and the tests use different cases")]

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling, Spectrum};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

type C = Complex<f64>;

/// Excitation of the structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excitation {
    /// White forces up to 0.9 of half the sampling rate.
    Random,
    /// Hits at irregular instants; the record starts during the decay after an earlier hit.
    Hammer { hits: usize },
}

/// A structure and its test.
#[derive(Debug, Clone)]
pub struct Case {
    pub name: &'static str,
    pub frequency_hz: Vec<f64>,
    pub damping: Vec<f64>,
    /// `[mode][output]`.
    pub shape: Vec<Vec<C>>,
    /// `[mode][input]`.
    pub participation: Vec<Vec<f64>>,
    pub band_hz: [f64; 2],
    pub rate_hz: f64,
    pub samples: usize,
    pub excitation: Excitation,
    /// Sensor noise, relative to the root-mean-square of each output.
    pub noise: f64,
    /// Pole of the noise of sensors and measured forces (first-order autoregression).
    pub colour: f64,
    /// Level of two unmeasured white forces, relative to the measured forces.
    pub unmeasured: f64,
    /// Noise of the measured forces, relative to their root-mean-square.
    pub force_noise: f64,
    /// Delays of the outputs behind the forces, in samples; the list is repeated if there are more
    /// outputs than delays.
    pub delays: Vec<f64>,
    /// `true` for one record for each struck point; `false` for one record with all forces.
    pub roving: bool,
}

/// Draws standard normal numbers.
pub struct Normal(ChaCha8Rng);

impl Normal {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn next(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    pub fn uniform(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    fn complex(&mut self) -> C {
        C::new(self.next(), self.next())
    }
}

impl Case {
    /// Returns the poles, in rad/s.
    pub fn poles(&self) -> Vec<C> {
        let pole = |(hz, z): (&f64, &f64)| C::new(-z, (1.0 - z * z).sqrt()) * TAU * *hz;
        self.frequency_hz.iter().zip(&self.damping).map(pole).collect()
    }

    /// Returns the modes inside the band.
    pub fn in_band(&self) -> Vec<usize> {
        let inside = |mode: &usize| {
            let hz = self.frequency_hz[*mode];
            hz > self.band_hz[0] && hz < self.band_hz[1]
        };
        (0..self.frequency_hz.len()).filter(inside).collect()
    }

    /// Returns the accelerations per force at ω, outputs × inputs.
    pub fn response(&self, omega: f64, participation: &[Vec<f64>]) -> DMatrix<C> {
        let s = C::new(0.0, omega);
        let poles = self.poles();
        DMatrix::from_fn(self.shape[0].len(), participation[0].len(), |output, input| {
            let of_mode = |mode: usize| {
                let scale = C::new(0.0, 2.0 * poles[mode].im);
                let residue = self.shape[mode][output] * participation[mode][input] / scale;
                residue / (s - poles[mode]) + residue.conj() / (s - poles[mode].conj())
            };
            (0..poles.len()).map(of_mode).sum::<C>() * s * s
        })
    }

    /// Adds to `motion` the accelerations due to the forces on one line, mode by mode.
    fn add_response(
        &self,
        omega: f64,
        participation: &[Vec<f64>],
        forces: &DMatrix<C>,
        line: usize,
        motion: &mut DMatrix<C>,
    ) {
        let s = C::new(0.0, omega);
        for ((pole, shape), participation) in
            self.poles().iter().zip(&self.shape).zip(participation)
        {
            let force: C =
                participation.iter().enumerate().map(|(k, p)| forces[(line, k)] * p).sum();
            let scale = C::new(0.0, 2.0 * pole.im);
            let (direct, mirror) = (s * s * force / (s - pole), s * s * force / (s - pole.conj()));
            for (output, value) in shape.iter().enumerate() {
                let residue = value / scale;
                motion[(line, output)] += residue * direct + residue.conj() * mirror;
            }
        }
    }

    /// Returns the delay of an output, in samples.
    pub fn delay(&self, output: usize) -> f64 {
        self.delays.get(output % self.delays.len().max(1)).copied().unwrap_or(0.0)
    }

    /// Returns forces and accelerations of one record.
    pub fn record(&self, seed: u64) -> (Record, Record) {
        let mut normal = Normal::new(seed);
        let period = 4 * self.samples;
        let sampling = Sampling::from_rate_hz(self.rate_hz, period).unwrap();
        let forces = self.forces(&mut normal, sampling);
        let hidden = self.hidden(&mut normal);
        let disturbance = self.random_lines(&mut normal, sampling, 2);
        let mut motion = DMatrix::zeros(sampling.lines(), self.shape[0].len());
        for line in 1..sampling.lines() {
            let omega = TAU * line as f64 * self.rate_hz / period as f64;
            self.add_response(omega, &self.participation, &forces, line, &mut motion);
            if self.unmeasured > 0.0 {
                self.add_response(omega, &hidden, &disturbance, line, &mut motion);
            }
        }
        for (output, mut column) in motion.column_iter_mut().enumerate() {
            for (line, value) in column.iter_mut().enumerate() {
                *value *= C::cis(-TAU * line as f64 / period as f64 * self.delay(output));
            }
        }
        let cut = |lines: DMatrix<C>| {
            let all = Spectrum::from_lines(sampling, lines).unwrap().to_record().unwrap();
            all.window(period / 3, self.samples).unwrap()
        };
        let (forces, motion) = (cut(forces), cut(motion));
        let noisy = |record: Record, level: f64, normal: &mut Normal| {
            let (mut data, sampling) = (record.data().clone(), record.sampling());
            for mut column in data.column_iter_mut() {
                let spread = column.variance().sqrt();
                let mut state = normal.next();
                for value in column.iter_mut() {
                    *value += level * spread * state;
                    let fresh = normal.next() * (1.0 - self.colour * self.colour).sqrt();
                    state = self.colour * state + fresh;
                }
            }
            Record::new(sampling, data).unwrap()
        };
        let motion = noisy(motion, self.noise, &mut normal);
        (noisy(forces, self.force_noise, &mut normal), motion)
    }

    fn forces(&self, normal: &mut Normal, sampling: Sampling) -> DMatrix<C> {
        match self.excitation {
            Excitation::Random => self.random_lines(normal, sampling, self.participation[0].len()),
            Excitation::Hammer { hits } => self.hits(normal, sampling, hits),
        }
    }

    /// Returns the participations of the unmeasured forces of a record.
    pub fn hidden_participation(&self, seed: u64) -> Vec<Vec<f64>> {
        let mut normal = Normal::new(seed);
        let sampling = Sampling::from_rate_hz(self.rate_hz, 4 * self.samples).unwrap();
        self.forces(&mut normal, sampling);
        self.hidden(&mut normal)
    }

    /// Returns the lines of one record in the band, or of one record for each struck point.
    pub fn lines(&self, seed: u64) -> LineData {
        if self.roving {
            return self.roving_lines(seed);
        }
        let (forces, motion) = self.record(seed);
        LineData::from_open_record(Some(&forces), &motion, self.band_hz).unwrap()
    }

    fn hidden(&self, normal: &mut Normal) -> Vec<Vec<f64>> {
        let all = self.participation.iter().flatten();
        let power = all.clone().map(|value| value * value).sum::<f64>() / all.count() as f64;
        let level = self.unmeasured * power.sqrt();
        self.participation.iter().map(|_| (0..2).map(|_| level * normal.next()).collect()).collect()
    }

    fn random_lines(&self, normal: &mut Normal, sampling: Sampling, count: usize) -> DMatrix<C> {
        let last = (0.9 * (sampling.lines() - 1) as f64) as usize;
        let mut lines = DMatrix::zeros(sampling.lines(), count);
        for line in 1..=last {
            for column in 0..count {
                lines[(line, column)] = normal.complex();
            }
        }
        lines
    }

    fn hits(&self, normal: &mut Normal, sampling: Sampling, hits: usize) -> DMatrix<C> {
        const WIDTH: f64 = 2e-3;
        let length = self.samples as f64 / self.rate_hz;
        let start = (sampling.len() / 3) as f64 / self.rate_hz;
        let mut instants = vec![start - 0.3 * length / hits as f64];
        for hit in 0..hits {
            let part = hit as f64 + 0.1 + 0.5 * normal.uniform();
            instants.push(start + part * length / hits as f64);
        }
        let mut force = vec![0.0; sampling.len()];
        for instant in instants {
            let size = 0.7 + 0.6 * normal.uniform();
            for (k, value) in force.iter_mut().enumerate() {
                let x = (k as f64 / self.rate_hz - instant) / WIDTH;
                if x.abs() < 0.5 {
                    *value += size * (std::f64::consts::PI * x).cos().powi(2);
                }
            }
        }
        let record = Record::from_channel(sampling, force).unwrap();
        Spectrum::from_record(&record).lines().clone()
    }
}

/// Returns random real shapes and random participations, the same for every seed of a case.
fn structure(
    modes: usize,
    outputs: usize,
    inputs: usize,
    seed: u64,
) -> (Vec<Vec<C>>, Vec<Vec<f64>>) {
    let mut normal = Normal::new(seed);
    let shape =
        (0..modes).map(|_| (0..outputs).map(|_| C::from(normal.next())).collect()).collect();
    let row = |normal: &mut Normal| -> Vec<f64> {
        let sign = |normal: &mut Normal| if normal.uniform() < 0.5 { -1.0 } else { 1.0 };
        (0..inputs).map(|_| sign(normal) * (0.5 + normal.uniform())).collect()
    };
    let participation = (0..modes).map(|_| row(&mut normal)).collect();
    (shape, participation)
}

fn case(
    name: &'static str,
    frequency_hz: &[f64],
    damping: &[f64],
    [outputs, inputs]: [usize; 2],
    samples: usize,
) -> Case {
    let (shape, participation) = structure(frequency_hz.len(), outputs, inputs, 44);
    Case {
        name,
        frequency_hz: frequency_hz.to_vec(),
        damping: damping.to_vec(),
        shape,
        participation,
        band_hz: [20.0, 400.0],
        rate_hz: 1024.0,
        samples,
        excitation: Excitation::Random,
        noise: 0.02,
        colour: 0.5,
        unmeasured: 0.0,
        force_noise: 0.0,
        delays: Vec::new(),
        roving: false,
    }
}

/// Returns a test with one accelerometer, one force, five modes in the band and two modes outside
/// the band.
pub fn one_by_one() -> Case {
    let mut case = case(
        "1x1, modes outside the band",
        &[12.0, 48.0, 90.0, 131.0, 155.0, 210.0, 320.0],
        &[0.01, 0.008, 0.005, 0.004, 0.006, 0.005, 0.006],
        [1, 1],
        8192,
    );
    case.shape = [1.0, 0.9, -1.1, 0.8, 1.0, -0.9, 1.2].map(|x| vec![C::from(x)]).to_vec();
    case.participation = [1.0, 1.1, 0.9, 1.0, -0.8, 1.0, 0.9].map(|x| vec![x]).to_vec();
    case.band_hz = [25.0, 260.0];
    case
}

/// Returns a test with two forces on a structure with six modes; two of these modes are 1 % apart.
pub fn pair(outputs: usize) -> Case {
    case(
        if outputs == 8 { "8x2, pair 1 % apart" } else { "30x2, pair 1 % apart" },
        &[52.0, 87.0, 131.0, 132.3, 210.0, 305.0],
        &[0.008, 0.005, 0.004, 0.004, 0.003, 0.004],
        [outputs, 2],
        8192,
    )
}

/// Returns a test with little noise: three modes in the band, and a strong mode 5 % above the band.
pub fn beyond_the_edge() -> Case {
    let mut case = case(
        "8x2, strong mode outside",
        &[50.0, 110.0, 185.0, 210.0],
        &[0.008, 0.006, 0.007, 0.01],
        [8, 2],
        16384,
    );
    case.band_hz = [20.0, 200.0];
    case.noise = 1e-3;
    case
}

/// Returns a test with two forces, at accelerometers 0 and 3, on a structure with real shapes.
pub fn reciprocal() -> Case {
    let mut case = pair(8);
    case.name = "8x2, real and reciprocal";
    for (shape, participation) in case.shape.iter_mut().zip(&mut case.participation) {
        // The participations are at least 0.5 in modulus, so no force acts at a node of a mode.
        for (point, value) in [0, 3].into_iter().zip(&*participation) {
            shape[point] = C::from(*value);
        }
    }
    case
}

/// Returns a test with random forces on a structure that has `modes` modes at random distances in
/// the band from 20 to 400 Hz.
pub fn large([outputs, inputs]: [usize; 2], samples: usize, modes: usize) -> Case {
    let mut normal = Normal::new(5);
    let place = |k: usize, shift: f64| 25.0 * 15f64.powf((k as f64 + 0.4 * shift) / modes as f64);
    let frequency_hz: Vec<f64> = (0..modes).map(|k| place(k, normal.uniform())).collect();
    let damping: Vec<f64> = (0..modes).map(|_| 0.002 + 0.004 * normal.uniform()).collect();
    case("large", &frequency_hz, &damping, [outputs, inputs], samples)
}

/// Returns a test with hits at one point and twelve accelerometers.
pub fn hammer() -> Case {
    let mut case = case(
        "12x1 hammer",
        &[52.0, 87.0, 131.0, 170.0, 210.0, 305.0],
        &[0.008, 0.005, 0.004, 0.006, 0.003, 0.004],
        [12, 1],
        8192,
    );
    case.excitation = Excitation::Hammer { hits: 5 };
    case
}

/// Returns all cases of the study.
pub fn cases() -> Vec<Case> {
    let with = |name, change: &dyn Fn(&mut Case)| {
        let mut case = pair(8);
        case.name = name;
        change(&mut case);
        case
    };
    vec![
        one_by_one(),
        hammer(),
        roving(12),
        pair(8),
        pair(30),
        reciprocal(),
        beyond_the_edge(),
        with("8x2, unmeasured forces of 5 %", &|case| case.unmeasured = 0.05),
        with("8x2, noise of 3 % on the forces", &|case| case.force_noise = 0.03),
        with("8x2, responses early by half a sample", &|case| case.delays = vec![-0.5]),
        with("8x2, responses late by 0 to 0.7 samples", &|case| {
            case.delays = (0..8).map(|output| 0.1 * f64::from(output)).collect();
        }),
        with("8x2, 2 s instead of 8 s", &|case| case.samples = 2048),
        with("8x2, pair 0.3 % apart", &|case| case.frequency_hz[3] = 131.4),
    ]
}

/// Returns a test with one accelerometer at point 0 and a hammer that strikes one point after
/// another.
pub fn roving(points: usize) -> Case {
    let mut case = hammer();
    let mut normal = Normal::new(7);
    case.name = "1 accelerometer, hammer on 12 points";
    case.samples = 4096;
    case.roving = true;
    for (shape, participation) in case.shape.iter_mut().zip(&mut case.participation) {
        *participation = (0..points).map(|_| 0.4 + normal.uniform()).collect();
        *shape = vec![C::from(participation[0])];
    }
    case
}

impl Case {
    /// Returns the test of one struck point.
    pub fn at_point(&self, point: usize) -> Self {
        let participation = self.participation.iter().map(|all| vec![all[point]]).collect();
        Self { participation, roving: false, ..self.clone() }
    }

    /// Returns the seed of the record of a struck point.
    pub fn seed_at(&self, seed: u64, point: usize) -> u64 {
        100 * seed + point as u64
    }

    /// Returns one record for each struck point, one after another; in each record the inputs at
    /// the other points are zero.
    fn roving_lines(&self, seed: u64) -> LineData {
        let points = self.participation[0].len();
        let of_point = |point: usize| {
            let (force, motion) = self.at_point(point).record(self.seed_at(seed, point));
            let mut forces = DMatrix::zeros(force.len(), points);
            forces.column_mut(point).copy_from(&force.data().column(0));
            let forces = Record::new(force.sampling(), forces).unwrap();
            LineData::from_open_record(Some(&forces), &motion, self.band_hz).unwrap()
        };
        let first = of_point(0);
        (1..points).fold(first, |data, point| data.followed_by(&of_point(point)).unwrap())
    }

    /// Returns a table of frequency responses: one record of unit input for each column.
    pub fn table(&self, seed: u64, lines: usize) -> LineData {
        let mut normal = Normal::new(seed);
        let [low, high] = self.band_hz;
        let omega: Vec<f64> = (0..lines)
            .map(|k| TAU * (low + (high - low) * (k as f64 + 0.5) / lines as f64))
            .collect();
        let (outputs, inputs) = (self.shape[0].len(), self.participation[0].len());
        let responses: Vec<DMatrix<C>> =
            omega.iter().map(|omega| self.response(*omega, &self.participation)).collect();
        let mut column = |input: usize| {
            let mut motion =
                DMatrix::from_fn(lines, outputs, |line, output| responses[line][(output, input)]);
            for mut column in motion.column_iter_mut() {
                let level = self.noise * (column.norm_squared() / lines as f64).sqrt();
                column.iter_mut().for_each(|z| *z += normal.complex() * level / 2f64.sqrt());
            }
            let unit = DMatrix::from_fn(lines, inputs, |_, other| {
                C::from(f64::from(u8::from(other == input)))
            });
            LineData::new(omega.clone(), unit, motion, mechid_spectra::Transient::None).unwrap()
        };
        let first = column(0);
        (1..inputs).fold(first, |data, input| data.followed_by(&column(input)).unwrap())
    }

    /// Returns a free decay from random initial conditions, sampled exactly.
    pub fn decay(&self, seed: u64) -> LineData {
        let mut normal = Normal::new(seed);
        let sampling = Sampling::from_rate_hz(self.rate_hz, self.samples).unwrap();
        let (poles, outputs) = (self.poles(), self.shape[0].len());
        let loads: Vec<C> =
            poles.iter().map(|_| C::from_polar(1.0, 6.0 * normal.uniform())).collect();
        let mut data = DMatrix::from_fn(self.samples, outputs, |k, output| {
            let time = k as f64 / self.rate_hz;
            let of_mode = |mode: usize| {
                2.0 * (self.shape[mode][output] * loads[mode] * (poles[mode] * time).exp()).re
            };
            (0..poles.len()).map(of_mode).sum::<f64>()
        });
        for mut column in data.column_iter_mut() {
            let level = self.noise * column.variance().sqrt();
            column.iter_mut().for_each(|value| *value += level * normal.next());
        }
        let record = Record::new(sampling, data).unwrap();
        LineData::from_open_record(None, &record, self.band_hz).unwrap()
    }
}
