//! Coverage and errors of modes from responses alone, compared with covariance-driven subspace
//! models (SSI-cov) of the order that is best when the true modes are known.
//!
//! `cargo run --release -p mechid-modal --example ambient_study -- SEEDS [CASE [FOLDER]]`; with a
//! FOLDER the records, the true modes and the estimated modes are written there instead, for
//! `pyoma2_ssi.py`.

#![allow(clippy::print_stdout, reason = "a study prints its table")]

#[path = "../../tests/suite/ambient_generator.rs"]
mod ambient_generator;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ambient_generator::{Quantity, Structure};
use mechid_modal::ambient::{AmbientSettings, identify_ambient, ssi_cov};
use mechid_modal::indicators::mac;
use mechid_modal::stabilisation::{Pole, Stabilisation};
use mechid_signal::Record;
use nalgebra::{Complex, dmatrix};

/// Structure, quantity, sampling rate, number of samples and noise of a case.
struct Case {
    name: &'static str,
    structure: Structure,
    quantity: Quantity,
    rate_hz: f64,
    len: usize,
    noise: f64,
}

impl Case {
    fn record(&self, seed: u64) -> Record {
        match self.quantity {
            Quantity::Acceleration => {
                self.structure.accelerations(self.rate_hz, self.len, self.noise, seed)
            }
            quantity => self.structure.record(quantity, self.rate_hz, self.len, self.noise, seed),
        }
    }
}

fn cases() -> Vec<Case> {
    let tower = Structure {
        frequencies_hz: vec![1.1, 3.2, 3.3, 6.0],
        dampings: vec![0.015, 0.01, 0.012, 0.01],
        shapes: dmatrix![
            0.3, 0.4, -0.8, 0.9;
            0.6, 0.9, -0.6, -0.6;
            0.8, -0.6, 0.5, -0.5;
            1.0, -0.9, 0.9, 0.8
        ]
        .map(Complex::from),
        forces: dmatrix![1.0, 0.2, -0.4; 0.5, 3.0, 1.0; -1.0, 1.0, 3.0; 6.0, -2.0, 5.0],
    };
    let mut turned = tower.clone();
    for (index, entry) in turned.shapes.iter_mut().enumerate() {
        *entry *= Complex::cis(0.3 * (index as f64).sin());
    }
    let single = Structure {
        frequencies_hz: vec![2.0, 4.7, 8.1],
        dampings: vec![0.02, 0.01, 0.01],
        shapes: dmatrix![1.0, 0.8, -0.9].map(Complex::from),
        forces: dmatrix![1.0, 0.3; 2.0, -2.0; -3.0, 6.0],
    };
    let case = |name, structure: &Structure, quantity, rate_hz, seconds: f64, noise| Case {
        name,
        structure: structure.clone(),
        quantity,
        rate_hz,
        len: (rate_hz * seconds) as usize,
        noise,
    };
    vec![
        case("tower, velocities", &tower, Quantity::Velocity, 25.0, 300.0, 0.05),
        case("tower, accelerations", &tower, Quantity::Acceleration, 20.0, 300.0, 0.1),
        case("complex shapes, displacements", &turned, Quantity::Displacement, 20.0, 400.0, 0.02),
        case("one sensor, velocities", &single, Quantity::Velocity, 30.0, 200.0, 0.05),
        case("tower, ten times as long", &tower, Quantity::Acceleration, 20.0, 3000.0, 0.1),
    ]
}

/// Estimates of one mode over the seeds.
#[derive(Clone, Default)]
struct Tally {
    found: usize,
    covered: [usize; 2],
    intervals: usize,
    squares: [f64; 2],
    sums: [f64; 2],
    predicted: [f64; 2],
    shapes: [usize; 2],
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize| arguments.get(k).and_then(|text| text.parse::<usize>().ok());
    let seeds = number(0).unwrap_or(4) as u64;
    let chosen = number(1);
    let folder = arguments.get(2).map(PathBuf::from);
    for (index, case) in cases().iter().enumerate() {
        if chosen.is_some_and(|chosen| chosen != index) {
            continue;
        }
        match &folder {
            None => study(case, seeds),
            Some(folder) => write(case, seeds, folder).unwrap(),
        }
    }
}

/// Writes the records of a case, and its modes: true ones and estimates.
fn write(case: &Case, seeds: u64, folder: &Path) -> std::io::Result<()> {
    let name = case.name.replace(',', "").replace(' ', "-");
    let mut modes = format!("seed,frequency_hz,damping_ratio\nrate,{},\n", case.rate_hz);
    for (hz, zeta) in case.structure.frequencies_hz.iter().zip(&case.structure.dampings) {
        modes += &format!("true,{hz},{zeta}\n");
    }
    for seed in 0..seeds {
        let record = case.record(1000 + seed);
        let mut text = String::new();
        for row in record.data().row_iter() {
            text += &row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        fs::write(folder.join(format!("{name}-{seed}.csv")), text)?;
        let Ok(estimate) = identify_ambient(&record, &AmbientSettings::default()) else { continue };
        for mode in estimate.modes {
            let (f, zeta) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
            modes += &format!("{seed},{f},{zeta}\n");
        }
    }
    fs::write(folder.join(format!("{name}.modes.csv")), modes)
}

fn study(case: &Case, seeds: u64) {
    let truth = &case.structure;
    let modes = truth.frequencies_hz.len();
    let mut tallies = vec![Tally::default(); modes];
    let mut subspace = SubspaceErrors::new(modes);
    let (mut spurious, mut failed) = (0, 0);
    let (mut seconds, mut leakage) = (0.0, 0.0);
    for seed in 0..seeds {
        let record = case.record(1000 + seed);
        let clock = Instant::now();
        let estimate = identify_ambient(&record, &AmbientSettings::default());
        seconds += clock.elapsed().as_secs_f64();
        let Ok(estimate) = estimate else {
            failed += 1;
            continue;
        };
        leakage += estimate.leakage_share / seeds as f64;
        subspace.add(0, &estimate.stabilisation, truth);
        for (row, block_rows) in [20, 40, 80].into_iter().enumerate() {
            let orders: Vec<usize> = (1..=20).map(|half| 2 * half).collect();
            let samples = record.without_mean().into_data();
            if let Some(models) = ssi_cov(&samples, 1.0 / case.rate_hz, block_rows, &orders) {
                subspace.add(row + 1, &models, truth);
            }
        }
        let mut taken = vec![false; estimate.modes.len()];
        for (r, tally) in tallies.iter_mut().enumerate() {
            let (f, zeta) = (truth.frequencies_hz[r], truth.dampings[r]);
            let shape = truth.shapes.column(r).into_owned();
            let distance = |index: &usize| {
                let mode = &estimate.modes[*index];
                let gap = (mode.natural_frequency_hz.value / f - 1.0).abs();
                gap + 0.02 * (1.0 - mac(mode.shape.shape(), &shape))
            };
            let free = (0..taken.len()).filter(|index| !taken[*index]);
            let Some(best) = free.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
                continue;
            };
            let mode = &estimate.modes[best];
            if (mode.natural_frequency_hz.value / f - 1.0).abs() > 2.0 * zeta {
                continue;
            }
            taken[best] = true;
            tally.add(mode, [f, zeta], &shape);
        }
        spurious += taken.iter().filter(|taken| !**taken).count();
    }
    let mean = seconds / seeds as f64;
    println!(
        "\n{}: {seeds} seeds, {spurious} false modes, {failed} failed, {mean:.2} s each, leakage {leakage:.3}",
        case.name
    );
    println!(
        "  f Hz    ζ %   ζωT | found  cover f  ζ  shape % | scatter/s.e. f  ζ | bias/s.d. f  ζ | RMS % f  ζ | SSI best order/ours f  ζ (order, rows)"
    );
    for (r, tally) in tallies.iter().enumerate() {
        let duration = case.len as f64 / case.rate_hz;
        let decay_times =
            truth.dampings[r] * truth.frequencies_hz[r] * std::f64::consts::TAU * duration;
        tally.print([truth.frequencies_hz[r], truth.dampings[r]], decay_times, subspace.best(r));
    }
}

impl Tally {
    fn add(
        &mut self,
        mode: &mechid_modal::ambient::AmbientMode,
        truth: [f64; 2],
        shape: &nalgebra::DVector<Complex<f64>>,
    ) {
        self.found += 1;
        let values = [mode.natural_frequency_hz, mode.damping_ratio];
        for (k, value) in values.into_iter().enumerate() {
            let error = value.value / truth[k] - 1.0;
            self.squares[k] += error * error;
            self.sums[k] += error;
            if let Some([low, high]) = value.interval() {
                self.intervals += usize::from(k == 0);
                self.covered[k] += usize::from(low <= truth[k] && truth[k] <= high);
                self.predicted[k] += (value.standard_error().unwrap_or(0.0) / truth[k]).powi(2);
            }
        }
        let reference = mode.shape.largest_entry();
        let exact = shape / shape[reference];
        let p = shape.len();
        for i in (0..p).filter(|i| *i != reference) {
            let gap = mode.shape.shape()[i] - exact[i];
            for (part, row) in [(gap.re, i), (gap.im, p + i)] {
                let error = mode.shape.covariance()[(row, row)].sqrt();
                self.shapes[0] += usize::from(part.abs() < 1.96 * error);
                self.shapes[1] += 1;
            }
        }
    }

    fn print(&self, truth: [f64; 2], decay_times: f64, subspace: [(f64, usize, usize); 2]) {
        let n = self.found.max(1) as f64;
        let percent = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
        let mean = self.sums.map(|sum| sum / n);
        let rms = self.squares.map(|sum| (sum / n).sqrt());
        let scatter = [0, 1].map(|k| (self.squares[k] / n - mean[k] * mean[k]).max(0.0).sqrt());
        let predicted = self.predicted.map(|sum| (sum / self.intervals.max(1) as f64).sqrt());
        println!(
            "{:6.2} {:6.2} {:5.0} | {:4}  {:6.1} {:6.1} {:6.1} | {:6.2} {:6.2} | {:6.2} {:6.2} | {:7.4} {:6.2} | {:5.2} {:5.2} ({}, {}) ({}, {})",
            truth[0],
            100.0 * truth[1],
            decay_times,
            self.found,
            percent(self.covered[0], self.intervals),
            percent(self.covered[1], self.intervals),
            percent(self.shapes[0], self.shapes[1]),
            scatter[0] / predicted[0],
            scatter[1] / predicted[1],
            mean[0] / scatter[0],
            mean[1] / scatter[1],
            100.0 * rms[0],
            100.0 * rms[1],
            subspace[0].0 / rms[0],
            subspace[1].0 / rms[1],
            subspace[0].1,
            subspace[0].2,
            subspace[1].1,
            subspace[1].2,
        );
    }
}

/// Numbers of block rows of the subspace models: that of the estimate, then three others.
const ROWS: usize = 4;

/// Largest half order of a subspace model.
const HALF_ORDERS: usize = 24;

/// Squared relative errors of f and ζ by mode, setting and half order, with their number.
struct SubspaceErrors {
    sums: Vec<[[[f64; 3]; HALF_ORDERS]; ROWS]>,
    records: usize,
}

impl SubspaceErrors {
    fn new(modes: usize) -> Self {
        Self { sums: vec![[[[0.0; 3]; HALF_ORDERS]; ROWS]; modes], records: 0 }
    }

    /// Adds for each true mode the pole of each order that is nearest to it.
    fn add(&mut self, row: usize, models: &Stabilisation, truth: &Structure) {
        self.records += usize::from(row == 0);
        let all = truth.poles();
        for (r, exact) in all.iter().copied().enumerate() {
            for half in 0..HALF_ORDERS {
                let poles = models.poles().iter().filter(|p| p.order == 2 * half + 2);
                let distance = |p: Complex<f64>| (p - exact).norm();
                let nearest = poles
                    .map(|p| &p.pole)
                    .min_by(|a, b| distance(a.pole).total_cmp(&distance(b.pole)));
                // A pole that is farther away, nearer to another mode or has another shape is not
                // an estimate of this mode: below the true order, one pole represents two modes.
                let shape = truth.shapes.column(r).into_owned();
                let is_mode = |p: &&Pole| {
                    let gap = distance(p.pole);
                    gap < 3.0 * -exact.re
                        && all.iter().all(|other| (p.pole - other).norm() >= gap)
                        && mac(&p.vector, &shape) > 0.9
                };
                let Some(pole) = nearest.filter(is_mode) else { continue };
                let sums = &mut self.sums[r][row][half];
                sums[0] += (pole.pole.norm() / exact.norm() - 1.0).powi(2);
                sums[1] += (pole.damping_ratio() / truth.dampings[r] - 1.0).powi(2);
                sums[2] += 1.0;
            }
        }
    }

    /// Returns the smallest RMS errors of f and ζ of one mode over the orders and settings that
    /// find every mode in 90 % of the records, with order and block rows (0: those of the
    /// estimate).
    fn best(&self, mode: usize) -> [(f64, usize, usize); 2] {
        let seen = |row: usize, half: usize| {
            self.sums.iter().all(|sums| sums[row][half][2] > 0.9 * self.records as f64)
        };
        [0, 1].map(|k| {
            let mut best = (f64::INFINITY, 0, 0);
            for (row, halves) in self.sums[mode].iter().enumerate() {
                for (half, sums) in halves.iter().enumerate() {
                    let rms = (sums[k] / sums[2]).sqrt();
                    if seen(row, half) && rms < best.0 {
                        best = (rms, 2 * half + 2, [0, 20, 40, 80][row]);
                    }
                }
            }
            best
        })
    }
}
