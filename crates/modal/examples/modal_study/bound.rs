//! Cramér–Rao bound of natural frequencies and damping ratios, from the true structure alone.
//!
//! The bound is independent of the estimator. The derivatives come from records that the generator
//! makes without noise. The derivatives with respect to f and ζ are central differences; those with
//! respect to shapes, participations and initial states are exact, because the record is linear in
//! them. All modes count, also those outside the band; the other unknowns are the complex shapes,
//! the complex participations of all forces but one, and the complex state of every mode at the
//! start of the record.
//!
//! # Source
//! Kay, *Fundamentals of Statistical Signal Processing: Estimation Theory* (1993), section 15.7
//! (complex Gaussian data of known covariance).

use std::f64::consts::TAU;

use mechid_signal::Record;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};

use crate::generator::Case;

type C = Complex<f64>;

/// Cramér–Rao bound: smallest standard deviations of f (Hz) and ζ of each mode in the band.
pub struct Bound {
    pub frequency: Vec<f64>,
    pub damping: Vec<f64>,
}

impl Bound {
    /// Returns the bound of f and ζ of each mode as the root-mean-square value over the records of
    /// `seeds`.
    pub fn of(case: &Case, seeds: &[u64]) -> Self {
        let modes = case.frequency_hz.len();
        let mut variance = vec![0.0; 2 * modes];
        for &seed in seeds {
            let information = information(case, seed);
            let size = information.nrows();
            let factor = information.cholesky().expect("the poles are determined");
            let covariance = factor.solve(&DMatrix::identity(size, size));
            for (k, sum) in variance.iter_mut().enumerate() {
                *sum += covariance[(k, k)] / seeds.len() as f64;
            }
        }
        let root = |first: usize| -> Vec<f64> {
            case.in_band().iter().map(|mode| variance[2 * mode + first].sqrt()).collect()
        };
        Self { frequency: root(0), damping: root(1) }
    }
}

/// Returns the Fisher information of f and ζ of all modes, mode by mode.
fn information(case: &Case, seed: u64) -> DMatrix<f64> {
    if !case.roving {
        return of_record(case, seed);
    }
    let points = case.participation[0].len();
    (0..points).map(|point| of_record(&case.at_point(point), case.seed_at(seed, point))).sum()
}

/// Returns the Fisher information of f and ζ of all modes in one record.
fn of_record(case: &Case, seed: u64) -> DMatrix<f64> {
    let clean = Case { noise: 0.0, unmeasured: 0.0, force_noise: 0.0, ..case.clone() };
    let lines = |case: &Case| -> DMatrix<C> { case.lines(seed).outputs().clone() };
    let modes = case.frequency_hz.len();
    let poles: Vec<DMatrix<C>> = (0..2 * modes)
        .map(|k| {
            let at = |sign: f64| {
                let mut moved = clean.clone();
                let list = if k % 2 == 0 { &mut moved.frequency_hz } else { &mut moved.damping };
                let step = 1e-5 * list[k / 2];
                list[k / 2] += sign * step;
                (lines(&moved), step)
            };
            let ((plus, step), (minus, _)) = (at(1.0), at(-1.0));
            (plus - minus) / C::from(2.0 * step)
        })
        .collect();
    let shared: Vec<DMatrix<C>> =
        poles.into_iter().chain(shared_derivatives(&clean, seed)).collect();
    let own = own_derivatives(&clean, seed);
    let covariance = noise_covariance(case, seed);
    match covariance {
        Covariance::Diagonal(variance) => by_output(&shared, &own, &variance, 2 * modes),
        Covariance::Full(all) => by_line(&shared, &own, &all, 2 * modes),
    }
}

/// Returns the spectral lines of the record of one mode alone, for a given shape and participation.
fn of_mode(
    case: &Case,
    seed: u64,
    mode: usize,
    shape: Vec<C>,
    participation: Vec<f64>,
) -> DMatrix<C> {
    let alone = Case {
        frequency_hz: vec![case.frequency_hz[mode]],
        damping: vec![case.damping[mode]],
        shape: vec![shape],
        participation: vec![participation],
        ..case.clone()
    };
    alone.lines(seed).outputs().clone()
}

/// Returns the derivatives with respect to the participations of all forces but the first, and to
/// the initial states. All outputs share these unknowns and the poles.
fn shared_derivatives(case: &Case, seed: u64) -> Vec<DMatrix<C>> {
    let inputs = case.participation[0].len();
    let mut all = Vec::new();
    for (mode, shape) in case.shape.iter().enumerate() {
        for turn in [C::new(1.0, 0.0), C::i()] {
            let turned: Vec<C> = shape.iter().map(|value| value * turn).collect();
            for input in 1..inputs {
                let unit = (0..inputs).map(|other| f64::from(u8::from(other == input))).collect();
                all.push(of_mode(case, seed, mode, turned.clone(), unit));
            }
            all.push(decay(case, mode, &turned));
        }
    }
    all
}

/// Returns the derivatives with respect to the real and imaginary part of each mode's shape. The
/// column of an output is the derivative of this output with respect to its own shape entry.
fn own_derivatives(case: &Case, seed: u64) -> Vec<DMatrix<C>> {
    let outputs = case.shape[0].len();
    let turns = [C::new(1.0, 0.0), C::i()];
    let modes = 0..case.shape.len();
    let all = modes.flat_map(|mode| turns.map(|turn| (mode, turn)));
    all.map(|(mode, turn)| {
        of_mode(case, seed, mode, vec![turn; outputs], case.participation[mode].clone())
    })
    .collect()
}

/// Returns the spectral lines of the free decay of a mode from the start of the record.
fn decay(case: &Case, mode: usize, shape: &[C]) -> DMatrix<C> {
    let pole = case.poles()[mode];
    let (forces, _) = case.record(0);
    let data = DMatrix::from_fn(case.samples, shape.len(), |k, output| {
        2.0 * (shape[output] * (pole * (k as f64 / case.rate_hz)).exp()).re
    });
    let record = Record::new(forces.sampling(), data).unwrap();
    LineData::from_open_record(None, &record, case.band_hz).unwrap().outputs().clone()
}

/// Power of an unmeasured force on one line, in unitary lines: the amplitude S of the sinusoid has
/// E|S|² = 2, so that the power is 1, and half of this power is at the negative frequency.
const LINE_POWER: f64 = 0.5;

enum Covariance {
    /// Variance of each output on each line, lines × outputs.
    Diagonal(DMatrix<f64>),
    /// Covariance of the outputs on each line.
    Full(Vec<DMatrix<C>>),
}

/// Returns the covariance of the noise on the lines: sensors and unmeasured forces.
fn noise_covariance(case: &Case, seed: u64) -> Covariance {
    let quiet = Case { noise: 0.0, force_noise: 0.0, ..case.clone() };
    let (_, motion) = quiet.record(seed);
    let data = case.lines(seed);
    let outputs = motion.data().ncols();
    let spread: Vec<f64> =
        motion.data().column_iter().map(|c| case.noise * c.variance().sqrt()).collect();
    let sensor = DMatrix::from_fn(data.len(), outputs, |line, output| {
        let delay = C::cis(-data.omega()[line] / case.rate_hz);
        let colour = (1.0 - case.colour.powi(2)) / (1.0 - case.colour * delay).norm_sqr();
        colour * spread[output].powi(2)
    });
    if case.unmeasured == 0.0 {
        return Covariance::Diagonal(sensor);
    }
    let hidden = case.hidden_participation(seed);
    let period = (4 * case.samples) as f64;
    let step = TAU * case.rate_hz / period;
    // The record is a window of a process with independent lines on a grid four times as fine: the
    // power of a line of the record is the sum of the powers of the fine lines, weighted by the
    // squared transform of the window.
    const REACH: i64 = 400;
    let responses: Vec<DMatrix<C>> = {
        let last = (data.omega()[data.len() - 1] / step) as i64 + REACH + 1;
        (0..=last).map(|line| case.response(line as f64 * step, &hidden)).collect()
    };
    let weight: Vec<f64> =
        (-REACH..=REACH).map(|shift| window_power(shift, case.samples)).collect();
    let of_line = |line: usize| {
        let centre = (data.omega()[line] / step).round() as i64;
        let mut sum = DMatrix::from_diagonal(&sensor.row(line).transpose().map(C::from));
        for (shift, weight) in (-REACH..=REACH).zip(&weight) {
            let place = (centre + shift).unsigned_abs() as usize;
            if let Some(response) = responses.get(place).filter(|_| *weight > 1e-12) {
                sum += response * response.adjoint() * C::from(LINE_POWER * weight);
            }
        }
        sum
    };
    Covariance::Full((0..data.len()).map(of_line).collect())
}

/// Returns the squared transform of a window of `samples` at `shift` quarters of a line.
fn window_power(shift: i64, samples: usize) -> f64 {
    let x = std::f64::consts::PI * shift as f64 / 4.0;
    let n = samples as f64;
    if shift == 0 { n } else { (x.sin() / (x / n).sin()).powi(2) / n }
}

/// Eliminates the last unknowns from the normal equations, and returns the equations of the first
/// `kept` unknowns (Schur complement).
fn schur(all: &DMatrix<f64>, kept: usize) -> DMatrix<f64> {
    let size = all.nrows();
    let scale: Vec<f64> =
        (0..size).map(|k| 1.0 / all[(k, k)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = DMatrix::from_fn(size, size, |a, b| all[(a, b)] * scale[a] * scale[b]);
    let rest = size - kept;
    let cross = scaled.view((kept, 0), (rest, kept)).into_owned();
    let own = scaled.view((kept, kept), (rest, rest)).into_owned();
    let solved = own.cholesky().expect("the other unknowns are determined").solve(&cross);
    let left = scaled.view((0, 0), (kept, kept)) - cross.transpose() * solved;
    DMatrix::from_fn(kept, kept, |a, b| left[(a, b)] / (scale[a] * scale[b]))
}

/// Returns the Fisher information of f and ζ for outputs whose noise is independent.
fn by_output(
    shared: &[DMatrix<C>],
    own: &[DMatrix<C>],
    variance: &DMatrix<f64>,
    kept: usize,
) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(shared.len(), shared.len());
    for output in 0..variance.ncols() {
        let columns: Vec<&DMatrix<C>> = shared.iter().chain(own).collect();
        let rows = 2 * variance.nrows();
        let whitened = DMatrix::from_fn(rows, columns.len(), |row, column| {
            let value = columns[column][(row / 2, output)];
            let part = if row % 2 == 0 { value.re } else { value.im };
            part * (2.0 / variance[(row / 2, output)]).sqrt()
        });
        sum += schur(&(whitened.transpose() * whitened), shared.len());
    }
    schur(&sum, kept)
}

/// Returns the Fisher information of f and ζ for outputs whose noise is correlated.
fn by_line(
    shared: &[DMatrix<C>],
    own: &[DMatrix<C>],
    covariance: &[DMatrix<C>],
    kept: usize,
) -> DMatrix<f64> {
    let outputs = covariance[0].nrows();
    let size = shared.len() + own.len() * outputs;
    let mut sum = DMatrix::zeros(size, size);
    for (line, covariance) in covariance.iter().enumerate() {
        let mut columns = DMatrix::zeros(outputs, size);
        for (k, derivative) in shared.iter().enumerate() {
            columns.set_column(k, &derivative.row(line).transpose());
        }
        for (k, derivative) in own.iter().enumerate() {
            for output in 0..outputs {
                let column = shared.len() + k * outputs + output;
                columns[(output, column)] = derivative[(line, output)];
            }
        }
        let factor = covariance.clone().cholesky().expect("a covariance is positive definite");
        let whitened = factor.l().solve_lower_triangular(&columns).expect("it is regular");
        let (re, im) = (whitened.map(|z| z.re), whitened.map(|z| z.im));
        sum += (re.transpose() * re + im.transpose() * im) * 2.0;
    }
    schur(&sum, kept)
}
