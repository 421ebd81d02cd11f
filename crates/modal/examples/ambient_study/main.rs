//! Coverage and errors of modes from responses alone, compared with covariance-driven subspace
//! models (SSI-cov) of the order that is best when the true modes are known.
//!
//! `cargo run --release -p mechid-modal --example ambient_study -- SEEDS [CASE [FOLDER]]`; with
//! FOLDER, the example writes the records, the true modes and the estimated modes to this folder
//! instead, for `pyoma2_ssi.py`.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a study prints its table")]

#[path = "../../tests/suite/ambient_generator.rs"]
mod ambient_generator;

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use ambient_generator::{Noise, Quantity, Structure};
use mechid_modal::PartsComparison;
use mechid_modal::ambient::{
    AmbientEstimate, AmbientMode, AmbientSettings, identify_ambient, ssi_cov,
};
use mechid_modal::indicators::mac;
use mechid_modal::stabilisation::{Pole, Stabilisation};
use mechid_signal::Record;
use nalgebra::{Complex, DMatrix, DVector, dmatrix};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Structure, quantity, sampling rate, number of samples and noise of a case.
struct Case {
    name: &'static str,
    structure: Structure,
    quantity: Quantity,
    rate_hz: f64,
    len: usize,
    noise: Noise,
    /// Number of samples of the moving mean that is applied to the record; 1 for white forces. A
    /// longer mean has the effect of forces whose spectrum has zeros.
    mean: usize,
}

impl Case {
    fn record(&self, seed: u64) -> Record {
        let white = match self.quantity {
            Quantity::Acceleration => {
                self.structure.accelerations(self.rate_hz, self.len, self.noise, seed)
            }
            quantity => self.structure.record(quantity, self.rate_hz, self.len, self.noise, seed),
        };
        ambient_generator::moving_mean(&white, self.mean)
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
    let mut random = ChaCha8Rng::seed_from_u64(1);
    // Each force drives all modes, so that the modal forces of distant modes are correlated, too.
    let bridge = Structure {
        frequencies_hz: vec![1.1, 1.7, 2.6, 3.2, 3.3, 4.8, 6.0, 7.1],
        dampings: vec![0.01; 8],
        shapes: DMatrix::from_fn(8, 8, |i, r| {
            Complex::from((PI * (r as f64 + 0.5) * (i as f64 + 1.0) / 8.0).sin())
        }),
        forces: DMatrix::from_fn(8, 5, |_, _| StandardNormal.sample(&mut random)),
    };
    let case = |name, structure: &Structure, quantity, rate_hz, seconds: f64, level: f64| Case {
        name,
        structure: structure.clone(),
        quantity,
        rate_hz,
        len: (rate_hz * seconds) as usize,
        noise: level.into(),
        mean: 1,
    };
    let with_pole = |name, pole| {
        let case = case(name, &tower, Quantity::Acceleration, 20.0, 300.0, 0.1);
        Case { noise: Noise { pole, ..case.noise }, ..case }
    };
    vec![
        case("tower, velocities, 300 s", &tower, Quantity::Velocity, 25.0, 300.0, 0.05),
        case("tower, accelerations, 300 s", &tower, Quantity::Acceleration, 20.0, 300.0, 0.1),
        case(
            "complex shapes, displacements, 400 s",
            &turned,
            Quantity::Displacement,
            20.0,
            400.0,
            0.02,
        ),
        case("one sensor, velocities, 200 s", &single, Quantity::Velocity, 30.0, 200.0, 0.05),
        case("tower, accelerations, 3,000 s", &tower, Quantity::Acceleration, 20.0, 3000.0, 0.1),
        with_pole("the same, 300 s, white noise", 0.0),
        with_pole("the same, noise that rises with frequency", -0.5),
        with_pole("the same, noise that falls steeply", 0.9),
        case("bridge, accelerations, 300 s", &bridge, Quantity::Acceleration, 20.0, 300.0, 0.1),
        case(
            "tower, accelerations, noise 0.2 %",
            &tower,
            Quantity::Acceleration,
            20.0,
            300.0,
            0.002,
        ),
        case(
            "bridge, accelerations, noise 0.2 %",
            &bridge,
            Quantity::Acceleration,
            20.0,
            300.0,
            0.002,
        ),
        Case {
            mean: 12,
            ..case("one sensor, coloured forces", &single, Quantity::Velocity, 30.0, 200.0, 0.05)
        },
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
    let mut studies = Vec::new();
    let cases = cases();
    for (index, case) in cases.iter().enumerate() {
        if chosen.is_some_and(|chosen| chosen != index) {
            continue;
        }
        match &folder {
            None => studies.push(Study::new(case, seeds)),
            Some(folder) => write(case, seeds, folder).unwrap(),
        }
    }
    println!(
        "| Test | Records | f hold | ζ hold | Shapes hold | f over error | ζ over error | SSI | Modes found | False modes |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    studies.iter().for_each(Study::print_row);
    println!(
        "\n| Test | f, Hz | ζ | ζωT | f hold | ζ hold | Shapes hold | f over error | ζ over error | f bias | ζ bias | f RMS, % | ζ RMS, % | f of SSI | ζ of SSI | Orders, block rows |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    studies.iter().for_each(Study::print_modes);
    println!(
        "\n| Test | Records | Halves that differ | Spectra that do not fit |\n|---|---|---|---|"
    );
    for Study { case, seeds, changed, unfit, .. } in &studies {
        println!("| {} | {seeds} | {changed} | {unfit} |", case.name);
    }
}

/// Writes the records, the true modes and the estimated modes of a case to files.
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

/// Results of one case.
struct Study<'a> {
    case: &'a Case,
    seeds: u64,
    modes: Vec<ModeResult>,
    false_modes: usize,
    /// Number of records whose halves differ according to the test of [`PartsComparison`].
    changed: usize,
    /// Number of records for which the test of the fitted spectrum rejects the fit at the 1 %
    /// level.
    unfit: usize,
}

/// Results of one mode.
struct ModeResult {
    decay_times: f64,
    found: usize,
    /// Percentages of intervals that contain the true value: f, ζ and shape.
    coverage: [f64; 3],
    /// Ratio of scatter to standard error, for f and ζ.
    scatter: [f64; 2],
    /// Ratio of bias to scatter, for f and ζ.
    bias: [f64; 2],
    /// Relative root-mean-square errors of f and ζ.
    rms: [f64; 2],
    subspace: [BestSubspace; 2],
}

impl<'a> Study<'a> {
    fn new(case: &'a Case, seeds: u64) -> Self {
        let truth = &case.structure;
        let modes = truth.frequencies_hz.len();
        let mut tallies = vec![Tally::default(); modes];
        let mut subspace = SubspaceErrors::new(modes);
        let (mut false_modes, mut failed, mut changed, mut unfit) = (0, 0, 0, 0);
        let mut seconds = 0.0;
        for seed in 0..seeds {
            let record = case.record(1000 + seed);
            let clock = Instant::now();
            let estimate = identify_ambient(&record, &AmbientSettings::default());
            seconds += clock.elapsed().as_secs_f64();
            let Ok(estimate) = estimate else {
                failed += 1;
                continue;
            };
            subspace.add_all(&record, &estimate.stabilisation, truth);
            let taken = tally_modes(&mut tallies, &estimate.modes, truth);
            false_modes += estimate.modes.len() - taken;
            changed += usize::from(halves_differ(&record, &estimate));
            unfit += usize::from(estimate.misfit.is_some_and(|misfit| misfit.p_value < 0.01));
        }
        let seconds = seconds / seeds as f64;
        eprintln!("{}: {seconds:.2} s a record, {failed} failed", case.name);
        let duration = case.len as f64 / case.rate_hz;
        let result = |(r, tally): (usize, &Tally)| {
            let decay_rate = truth.dampings[r] * truth.frequencies_hz[r] * std::f64::consts::TAU;
            tally.result(decay_rate * duration, subspace.best(r))
        };
        let modes = tallies.iter().enumerate().map(result).collect();
        Self { case, seeds, modes, false_modes, changed, unfit }
    }

    fn print_row(&self) {
        let range = |value: &dyn Fn(&ModeResult) -> f64, digits: usize| {
            let fold = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
            let (low, high) = self.modes.iter().map(value).fold((f64::INFINITY, 0.0), fold);
            if low > high { "–".to_owned() } else { format!("{low:.digits$} to {high:.digits$}") }
        };
        let found: usize = self.modes.iter().map(|mode| mode.found).sum();
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {:.2} | {} |",
            self.case.name,
            self.seeds,
            range(&|mode| mode.coverage[0], 1),
            range(&|mode| mode.coverage[1], 1),
            range(&|mode| mode.coverage[2], 1),
            range(&|mode| mode.scatter[0], 2),
            range(&|mode| mode.scatter[1], 2),
            range(&|mode| mode.subspace[1].rms / mode.rms[1], 2),
            percent(found, self.seeds as usize * self.modes.len()),
            self.false_modes,
        );
    }

    fn print_modes(&self) {
        let truth = &self.case.structure;
        for (r, mode) in self.modes.iter().enumerate() {
            let [f, zeta] = &mode.subspace;
            println!(
                "| {} | {} | {} | {:.0} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {:.4} | {:.2} | {:.2} | {:.2} | {}, {}; {}, {} |",
                self.case.name,
                truth.frequencies_hz[r],
                truth.dampings[r],
                mode.decay_times,
                mode.coverage[0],
                mode.coverage[1],
                mode.coverage[2],
                mode.scatter[0],
                mode.scatter[1],
                mode.bias[0],
                mode.bias[1],
                100.0 * mode.rms[0],
                100.0 * mode.rms[1],
                f.rms / mode.rms[0],
                zeta.rms / mode.rms[1],
                f.order,
                f.block_rows,
                zeta.order,
                zeta.block_rows,
            );
        }
    }
}

fn halves_differ(record: &Record, estimate: &AmbientEstimate) -> bool {
    let len = record.len() / 2;
    let [first, second] = [0, len].map(|start| record.window(start, len).unwrap());
    PartsComparison::of_ambient(estimate, [&first, &second]).is_ok_and(|halves| halves.differ())
}

/// Assigns to each true mode the nearest estimate that is not assigned to another mode; returns the
/// number of assigned modes.
fn tally_modes(tallies: &mut [Tally], modes: &[AmbientMode], truth: &Structure) -> usize {
    let mut taken = vec![false; modes.len()];
    for (r, tally) in tallies.iter_mut().enumerate() {
        let (f, zeta) = (truth.frequencies_hz[r], truth.dampings[r]);
        let shape = truth.shapes.column(r).into_owned();
        let distance = |index: &usize| {
            let mode = &modes[*index];
            let gap = (mode.natural_frequency_hz.value / f - 1.0).abs();
            gap + 0.02 * (1.0 - mac(mode.shape.shape(), &shape))
        };
        let free = (0..taken.len()).filter(|index| !taken[*index]);
        let Some(best) = free.min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
        let mode = &modes[best];
        if (mode.natural_frequency_hz.value / f - 1.0).abs() <= 2.0 * zeta {
            taken[best] = true;
            tally.add(mode, [f, zeta], &shape);
        }
    }
    taken.iter().filter(|taken| **taken).count()
}

fn percent(count: usize, of: usize) -> f64 {
    100.0 * count as f64 / of as f64
}

impl Tally {
    fn add(&mut self, mode: &AmbientMode, truth: [f64; 2], shape: &DVector<Complex<f64>>) {
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

    fn result(&self, decay_times: f64, subspace: [BestSubspace; 2]) -> ModeResult {
        let n = self.found as f64;
        let mean = self.sums.map(|sum| sum / n);
        let scatter = [0, 1].map(|k| (self.squares[k] / n - mean[k] * mean[k]).max(0.0).sqrt());
        let predicted = self.predicted.map(|sum| (sum / self.intervals as f64).sqrt());
        ModeResult {
            decay_times,
            found: self.found,
            coverage: [
                percent(self.covered[0], self.intervals),
                percent(self.covered[1], self.intervals),
                percent(self.shapes[0], self.shapes[1]),
            ],
            scatter: [0, 1].map(|k| scatter[k] / predicted[k]),
            bias: [0, 1].map(|k| mean[k] / scatter[k]),
            rms: self.squares.map(|sum| (sum / n).sqrt()),
            subspace,
        }
    }
}

/// Numbers of block rows of the additional subspace models.
const BLOCK_ROWS: [usize; 3] = [20, 40, 80];

/// Number of settings of the subspace models: the setting of the estimate, then one for each entry
/// of `BLOCK_ROWS`.
const ROWS: usize = 1 + BLOCK_ROWS.len();

/// Largest half order of a subspace model.
const MAX_HALF_ORDER: usize = 24;

/// Sums of the squared relative errors of f and of ζ, and number of estimates, for each mode, each
/// setting and each half order (half of the model order).
struct SubspaceErrors {
    sums: Vec<[[[f64; 3]; MAX_HALF_ORDER]; ROWS]>,
    records: usize,
}

impl SubspaceErrors {
    fn new(modes: usize) -> Self {
        Self { sums: vec![[[[0.0; 3]; MAX_HALF_ORDER]; ROWS]; modes], records: 0 }
    }

    /// Adds the subspace models of a record: the models of the estimate, and models with other
    /// numbers of block rows.
    fn add_all(&mut self, record: &Record, of_estimate: &Stabilisation, truth: &Structure) {
        self.add(0, of_estimate, truth);
        let orders: Vec<usize> = (1..=20).map(|half| 2 * half).collect();
        let samples = record.without_mean().into_data();
        for (row, block_rows) in (1..).zip(BLOCK_ROWS) {
            let models = ssi_cov(&samples, record.sampling().dt(), block_rows, &orders);
            if let Some(models) = models {
                self.add(row, &models, truth);
            }
        }
    }

    /// Adds, for each true mode, the nearest pole of each order.
    fn add(&mut self, row: usize, models: &Stabilisation, truth: &Structure) {
        self.records += usize::from(row == 0);
        let all = truth.poles();
        for (r, exact) in all.iter().copied().enumerate() {
            for half in 0..MAX_HALF_ORDER {
                let poles = models.poles().iter().filter(|p| p.order == 2 * half + 2);
                let distance = |p: Complex<f64>| (p - exact).norm();
                let nearest = poles
                    .map(|p| &p.pole)
                    .min_by(|a, b| distance(a.pole).total_cmp(&distance(b.pole)));
                // A pole is not an estimate of this mode if its distance is at least three times
                // the decay rate, if it is nearer to another mode, or if it has another shape:
                // below the true order, one pole represents two modes.
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

    /// Returns the smallest RMS errors of f and ζ of one mode over the orders and settings that find
    /// every mode in 90 % of the records.
    fn best(&self, mode: usize) -> [BestSubspace; 2] {
        let seen = |row: usize, half: usize| {
            self.sums.iter().all(|sums| sums[row][half][2] > 0.9 * self.records as f64)
        };
        [0, 1].map(|k| {
            let mut best = BestSubspace { rms: f64::INFINITY, order: 0, block_rows: 0 };
            for (row, halves) in self.sums[mode].iter().enumerate() {
                for (half, sums) in halves.iter().enumerate() {
                    let rms = (sums[k] / sums[2]).sqrt();
                    if seen(row, half) && rms < best.rms {
                        let block_rows = row.checked_sub(1).map_or(0, |other| BLOCK_ROWS[other]);
                        best = BestSubspace { rms, order: 2 * half + 2, block_rows };
                    }
                }
            }
            best
        })
    }
}

/// Subspace models with the smallest error.
#[derive(Clone, Copy)]
struct BestSubspace {
    rms: f64,
    order: usize,
    /// Number of block rows; 0 for the models of the estimate.
    block_rows: usize,
}
