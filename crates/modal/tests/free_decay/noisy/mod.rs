//! Exactly known free decays under noise: number of modes, coverage of the intervals, and scatter
//! relative to the Cramér–Rao bound.

use std::f64::consts::TAU;

use mechid_modal::free_decay::{DecayMode, FreeDecay, FreeDecayError, free_decay};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Number of samples of a record.
const LEN: usize = 1000;
/// Time step, in s.
const DT: f64 = 0.002;
/// Minimum ratio of the amplitude of a mode to its standard error at the Cramér–Rao bound, combined
/// over all channels; responses with a weaker mode are not used.
const VISIBLE: f64 = 10.0;
/// Coefficient a of the coloured noise x_k = a x_{k−1} + e_k.
const COLOUR: f64 = 0.9;

/// Kind of experiment.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub modes: usize,
    pub channels: usize,
    /// Ratio of the standard deviation of the noise to the RMS of each channel.
    pub noise: f64,
    /// `true` for the noise x_k = 0.9 x_{k−1} + e_k, `false` for white noise.
    pub coloured: bool,
    /// `true` if the two modes are one to two half-power bandwidths apart.
    pub close: bool,
}

/// Results of many experiments.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    pub runs: usize,
    pub too_few: usize,
    pub too_many: usize,
    /// Errors divided by the standard deviations of the Cramér–Rao bound: first of the frequencies,
    /// then of the damping ratios.
    pub errors: [Vec<f64>; 2],
    /// Number of intervals that contain the true value, and number of all intervals: for
    /// frequencies, damping ratios, and the parts of shape entries.
    pub held: [[usize; 2]; 3],
    /// Number of tested residuals. The field `alarms` counts the residuals that are not white, and
    /// the residuals that are larger at the beginning, both with p < 0.01.
    pub tested: usize,
    pub alarms: [usize; 2],
}

/// A sum of decays: λ of each mode, and its complex amplitude in each channel.
struct Truth {
    lambda: Vec<Complex<f64>>,
    amplitude: DMatrix<Complex<f64>>,
    offset: Vec<f64>,
}

impl Case {
    pub fn name(&self) -> String {
        let plural = |count: usize, thing: &str| match count {
            1 => format!("1 {thing}"),
            _ => format!("{count} {thing}s"),
        };
        let modes = match self.close {
            true => "close pair".into(),
            false => plural(self.modes, "mode"),
        };
        let noise = if self.coloured { "AR(0.9)" } else { "white" };
        let channels = plural(self.channels, "channel");
        format!("{modes}, {channels}, {:.1} % {noise}", 100.0 * self.noise)
    }

    /// Runs seeded experiments, each with a different response.
    pub fn run(&self, runs: usize) -> Outcome {
        let all: Vec<Outcome> =
            (0..runs as u64).into_par_iter().map(|seed| self.experiment(seed)).collect();
        let mut sum = Outcome::default();
        for one in all {
            sum.runs += one.runs;
            sum.too_few += one.too_few;
            sum.too_many += one.too_many;
            sum.tested += one.tested;
            sum.alarms = [0, 1].map(|i| sum.alarms[i] + one.alarms[i]);
            for (sum, one) in sum.errors.iter_mut().zip(one.errors) {
                sum.extend(one);
            }
            for (sum, one) in sum.held.iter_mut().flatten().zip(one.held.as_flattened()) {
                *sum += one;
            }
        }
        sum
    }

    fn experiment(&self, seed: u64) -> Outcome {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let (truth, clean, levels, bound) = self.visible(rng);
        let mut noisy = clean;
        for (mut column, level) in noisy.column_iter_mut().zip(&levels) {
            let noise = noise(rng, self.coloured);
            column.iter_mut().zip(noise).for_each(|(x, e)| *x += level * e);
        }
        let record = Record::new(Sampling::new(DT, LEN).unwrap(), noisy).unwrap();
        let mut outcome = Outcome { runs: 1, ..Outcome::default() };
        let found = match free_decay(&record, &FreeDecay::default()) {
            Ok(found) => found,
            Err(FreeDecayError::NoDecay { .. }) => {
                outcome.too_few = 1;
                return outcome;
            }
            Err(other) => panic!("{}, seed {seed}: {other}", self.name()),
        };
        outcome.tested = found.channels().len();
        for channel in found.channels() {
            outcome.alarms[0] += usize::from(channel.whiteness.p_value < 0.01);
            outcome.alarms[1] += usize::from(channel.onset.p_value < 0.01);
        }
        outcome.too_few = usize::from(found.modes().len() < self.modes);
        outcome.too_many = usize::from(found.modes().len() > self.modes);
        if found.modes().len() == self.modes {
            for (at, mode) in found.modes().iter().enumerate() {
                truth.compare(at, mode, &bound, &mut outcome);
            }
        }
        outcome
    }

    /// Returns a response whose modes are all visible, its samples, the standard deviation of the
    /// noise of each channel, and the Cramér–Rao bounds of frequency (Hz) and damping ratio of each
    /// mode.
    fn visible(&self, rng: &mut ChaCha8Rng) -> (Truth, DMatrix<f64>, Vec<f64>, Vec<[f64; 2]>) {
        loop {
            let truth = self.draw(rng);
            let clean = truth.samples();
            let level = |c: usize| {
                let x = clean.column(c).add_scalar(-truth.offset[c]);
                self.noise * x.norm() / (LEN as f64).sqrt()
            };
            let levels: Vec<f64> = (0..self.channels).map(level).collect();
            if let Some(bound) = truth.bound(&levels, self.coloured) {
                return (truth, clean, levels, bound);
            }
        }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Truth {
        let mut lambda: Vec<Complex<f64>> = Vec::new();
        let pole = |hz: f64, zeta: f64| TAU * hz * Complex::new(-zeta, (1.0 - zeta * zeta).sqrt());
        if self.close {
            let hz = rng.random_range(0.05..0.3) / DT;
            let zetas = [0, 1].map(|_| rng.random_range(0.003f64..0.02));
            let apart = rng.random_range(1.0..2.0) * (zetas[0] + zetas[1]) * hz;
            lambda = vec![pole(hz, zetas[0]), pole(hz + apart, zetas[1])];
        }
        while lambda.len() < self.modes {
            let hz = rng.random_range(0.01..0.4) / DT;
            let next = pole(hz, 10f64.powf(rng.random_range(-3.0..-1.0)));
            let resolved = |other: &Complex<f64>| {
                let widths = next.re.abs() + other.re.abs() + 2.0 * TAU / (LEN as f64 * DT);
                (next.im - other.im).abs() > widths
            };
            if lambda.iter().all(resolved) {
                lambda.push(next);
            }
        }
        lambda.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        let amplitude = DMatrix::from_fn(self.modes, self.channels, |_, _| {
            let size = rng.random_range(0.3..1.0) * if rng.random() { 1.0 } else { -1.0 };
            Complex::from_polar(size, rng.random_range(-0.5..0.5))
        });
        let offset = (0..self.channels).map(|_| rng.random_range(-1.0..1.0)).collect();
        Truth { lambda, amplitude, offset }
    }
}

impl Truth {
    fn samples(&self) -> DMatrix<f64> {
        DMatrix::from_fn(LEN, self.offset.len(), |k, c| {
            let t = k as f64 * DT;
            let decay =
                |(r, l): (usize, &Complex<f64>)| (self.amplitude[(r, c)] * (l * t).exp()).re;
            self.offset[c] + self.lambda.iter().enumerate().map(decay).sum::<f64>()
        })
    }

    /// Returns the Cramér–Rao bounds of frequency and damping ratio of each mode; `None` if a mode
    /// is too weak to be visible.
    ///
    /// The bounds follow from the information of all samples about the real parameters: σ and ω of
    /// each mode and, for each channel, the real and imaginary part of each amplitude and the
    /// constant.
    fn bound(&self, levels: &[f64], coloured: bool) -> Option<Vec<[f64; 2]>> {
        let (modes, channels) = self.amplitude.shape();
        let (poles, own) = (2 * modes, 2 * modes + 1);
        let all = poles + own * channels;
        let mut information = DMatrix::zeros(all, all);
        for (c, level) in levels.iter().enumerate() {
            let mut rows = DMatrix::<f64>::zeros(LEN, poles + own);
            for k in 0..LEN {
                let t = k as f64 * DT;
                for r in 0..modes {
                    let e = (self.lambda[r] * t).exp();
                    let slope = self.amplitude[(r, c)] * e * t;
                    rows[(k, 2 * r)] = slope.re;
                    rows[(k, 2 * r + 1)] = -slope.im;
                    rows[(k, poles + 2 * r)] = e.re;
                    rows[(k, poles + 2 * r + 1)] = -e.im;
                }
                rows[(k, poles + 2 * modes)] = 1.0;
            }
            for mut column in rows.column_iter_mut().filter(|_| coloured) {
                // Standard deviation of the prediction errors, for noise of unit variance.
                let error = (1.0 - COLOUR * COLOUR).sqrt();
                for k in (1..LEN).rev() {
                    column[k] = (column[k] - COLOUR * column[k - 1]) / error;
                }
            }
            let products = rows.tr_mul(&rows) / (level * level);
            let place = |at: usize| if at < poles { at } else { at + own * c };
            for i in 0..poles + own {
                for j in 0..poles + own {
                    information[(place(i), place(j))] += products[(i, j)];
                }
            }
        }
        let scale = information.diagonal().map(|d: f64| 1.0 / d.sqrt());
        let scaled = DMatrix::from_fn(all, all, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.lu().solve(&DMatrix::identity(all, all))?;
        let covariance = DMatrix::from_fn(all, all, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        let seen = |r: usize| {
            let of = |c: usize| {
                let at = poles + own * c + 2 * r;
                let variance = 0.5 * (covariance[(at, at)] + covariance[(at + 1, at + 1)]);
                self.amplitude[(r, c)].norm_sqr() / variance
            };
            (0..channels).map(of).sum::<f64>() > VISIBLE * VISIBLE
        };
        if !(0..modes).all(seen) {
            return None;
        }
        let of_mode = |r: usize| {
            let (l, size) = (self.lambda[r], self.lambda[r].norm());
            let block = covariance.view((2 * r, 2 * r), (2, 2));
            let deviation = |slope: [f64; 2]| {
                let slope = DVector::from_row_slice(&slope);
                slope.dot(&(block * &slope)).sqrt()
            };
            let cube = size.powi(3);
            [
                deviation([l.re / size / TAU, l.im / size / TAU]),
                deviation([-l.im * l.im / cube, l.re * l.im / cube]),
            ]
        };
        Some((0..modes).map(of_mode).collect())
    }

    fn compare(&self, at: usize, found: &DecayMode, bound: &[[f64; 2]], outcome: &mut Outcome) {
        let lambda = self.lambda[at];
        let truth = [lambda.norm() / TAU, -lambda.re / lambda.norm()];
        let mode = &found.mode;
        for (i, found) in [&mode.natural_frequency_hz, &mode.damping_ratio].into_iter().enumerate()
        {
            outcome.errors[i].push((found.value - truth[i]) / bound[at][i]);
            let [low, high] = found.interval(0.95).unwrap();
            outcome.held[i][0] += usize::from(low <= truth[i] && truth[i] <= high);
            outcome.held[i][1] += 1;
        }
        let shape = mode.mode.shape();
        let reference = (0..shape.len()).find(|c| shape[*c] == Complex::from(1.0)).unwrap();
        let t = student(found.mode.damping_ratio.degrees_of_freedom);
        for c in (0..shape.len()).filter(|c| *c != reference) {
            let truth = self.amplitude[(at, c)] / self.amplitude[(at, reference)];
            let error = mode.shape_standard_error[c];
            for (gap, error) in
                [(shape[c].re - truth.re, error.re), (shape[c].im - truth.im, error.im)]
            {
                outcome.held[2][0] += usize::from(gap.abs() <= t * error);
                outcome.held[2][1] += 1;
            }
        }
    }
}

/// Returns half the width of a 95 % interval, in standard errors, for many degrees of freedom.
fn student(degrees_of_freedom: usize) -> f64 {
    1.96 + 2.4 / degrees_of_freedom as f64
}

/// Returns noise of unit variance.
pub fn noise(rng: &mut ChaCha8Rng, coloured: bool) -> Vec<f64> {
    let mut normal = || {
        // Box & Muller.
        let (u, v) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    };
    let mut x: Vec<f64> = (0..LEN).map(|_| normal()).collect();
    if coloured {
        for k in 1..LEN {
            x[k] = COLOUR * x[k - 1] + (1.0 - COLOUR * COLOUR).sqrt() * x[k];
        }
    }
    x
}

/// Returns the number of records of pure noise in which modes are identified by mistake.
pub fn found_in_noise(channels: usize, coloured: bool, runs: u64) -> usize {
    let found = |seed: &u64| {
        let rng = &mut ChaCha8Rng::seed_from_u64(*seed);
        let columns: Vec<Vec<f64>> = (0..channels).map(|_| noise(rng, coloured)).collect();
        let record = Record::from_channels(Sampling::new(DT, LEN).unwrap(), &columns).unwrap();
        !matches!(free_decay(&record, &FreeDecay::default()), Err(FreeDecayError::NoDecay { .. }))
    };
    (0..runs).into_par_iter().filter(found).count()
}

impl Outcome {
    /// Share of the experiments with the right number of modes, in %.
    pub fn right(&self) -> f64 {
        100.0 * (1.0 - (self.too_few + self.too_many) as f64 / self.runs as f64)
    }

    /// Share of the intervals that contain the truth, in %: of frequency, damping ratio and shape.
    pub fn coverage(&self) -> [f64; 3] {
        self.held.map(|[held, all]| 100.0 * held as f64 / all as f64)
    }

    /// Share of the residuals that are not white, and share of the residuals that are larger at the
    /// beginning, in %.
    pub fn alarm_rates(&self) -> [f64; 2] {
        self.alarms.map(|alarms| 100.0 * alarms as f64 / self.tested as f64)
    }

    /// Root mean square of the ratio of error to Cramér–Rao bound, for frequency and damping ratio.
    pub fn scatter(&self) -> [f64; 2] {
        let rms = |e: &Vec<f64>| (e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64).sqrt();
        [rms(&self.errors[0]), rms(&self.errors[1])]
    }
}
