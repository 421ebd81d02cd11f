//! Errors of common tools relative to those of maximum likelihood, on the same records.
//!
//! `cargo run --release -p mechid-modal --example modal_rivals -- SEEDS` compares root-mean-square
//! errors of f and ζ, mode by mode; with FOLDER after SEEDS, it writes the records, the true modes
//! and the estimated modes to this folder instead, for `sdypy_ema.py`. The common tools are:
//!
//! - random forces: frequency responses by H1 from Hann-windowed segments that overlap by half,
//!   then pLSCF, with the best of three segment lengths;
//! - hits: one block from each hit, with an exponential window, H1 over the hits, then pLSCF, with
//!   the best of four windows. The damping that the window adds is subtracted from the poles.
//!
//! The common tools have an advantage: their poles are chosen with the true modes known, as the
//! cluster nearest to each true pole, and the best setting is chosen mode by mode by the errors
//! themselves.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

#[path = "../../tests/suite/generator.rs"]
mod generator;

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};

use mechid_modal::plscf::{ResponseTable, plscf};
use mechid_modal::{ModalSettings, identify_modes};
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use generator::{Case, Excitation};

type C = Complex<f64>;

/// Damping ratio above which a pole of the common tools does not belong to a mode.
const MAX_DAMPING: f64 = 0.2;

fn main() {
    let seeds: u64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(20);
    let folder = std::env::args().nth(2).map(PathBuf::from);
    for case in
        [generator::one_by_one(), generator::pair(8), generator::pair(30), generator::hammer()]
    {
        match &folder {
            None => compare(&case, seeds),
            Some(folder) => write(&case, seeds, folder).unwrap(),
        }
    }
}

/// Writes the records of a case (forces, then responses), its true modes and the estimates.
fn write(case: &Case, seeds: u64, folder: &Path) -> std::io::Result<()> {
    let name = case.name.split(',').next().unwrap_or_default().replace(' ', "-");
    let [low, high] = case.band_hz;
    let mut modes = format!("seed,frequency_hz,damping_ratio\nband,{low},{high}\n");
    for mode in case.in_band() {
        modes += &format!("true,{},{}\n", case.frequency_hz[mode], case.damping[mode]);
    }
    for seed in 0..seeds {
        let (forces, motion) = case.record(seed);
        let names = |of: &str, record: &Record| {
            (1..=record.channels()).map(|k| format!("{of}{k}")).collect::<Vec<_>>().join(",")
        };
        let mut text = format!("{},{}\n", names("f", &forces), names("a", &motion));
        for k in 0..forces.len() {
            let row = forces.data().row(k).iter().chain(&motion.data().row(k)).copied().collect();
            let row: Vec<f64> = row;
            text += &row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        fs::write(folder.join(format!("{name}-{seed}.csv")), text)?;
        let estimate = identify_modes(&case.lines(seed), &ModalSettings::default()).unwrap();
        for mode in estimate.modes() {
            let (f, zeta) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
            modes += &format!("{seed},{f},{zeta}\n");
        }
    }
    fs::write(folder.join(format!("{name}.modes.csv")), modes)
}

/// Prints the ratios of the errors for all modes together, then one line for each mode of a case.
fn compare(case: &Case, seeds: u64) {
    let settings = case.settings();
    let modes = case.in_band();
    let mut own = vec![Squares::default(); modes.len()];
    let mut usual = vec![vec![Squares::default(); modes.len()]; settings.len()];
    for seed in 0..seeds {
        let estimate = identify_modes(&case.lines(seed), &ModalSettings::default()).unwrap();
        let poles: Vec<C> = estimate.modes().iter().map(|mode| mode.pole).collect();
        add(case, &modes, &poles, &mut own);
        let (forces, motion) = case.record(seed);
        for (setting, squares) in settings.iter().zip(&mut usual) {
            add(case, &modes, &setting.poles(case, &forces, &motion), squares);
        }
    }
    println!(
        "{}, {seeds} records: RMS errors of the usual tool over those of identify_modes",
        case.name
    );
    // Over all modes, errors of f are relative to the half-width of the mode and errors of ζ are
    // relative to ζ. The setting is the best one for all modes together.
    let widths: Vec<f64> =
        modes.iter().map(|mode| case.damping[*mode] * case.frequency_hz[*mode]).collect();
    let pooled = |squares: &[Squares]| {
        let f = squares.iter().zip(&widths).map(|(s, width)| (s.frequency() / width).powi(2));
        let dampings = modes.iter().map(|mode| case.damping[*mode]);
        let z = squares.iter().zip(dampings).map(|(s, z)| (s.damping() / z).powi(2));
        [f.sum::<f64>().sqrt(), z.sum::<f64>().sqrt()]
    };
    let ours = pooled(&own);
    let best = usual.iter().map(|squares| pooled(squares));
    let best = best.fold([f64::INFINITY; 2], |a, b| [a[0].min(b[0]), a[1].min(b[1])]);
    println!("   all       f {:7.1}  zeta {:7.1}", best[0] / ours[0], best[1] / ours[1]);
    for (k, mode) in modes.iter().enumerate() {
        let best = |part: fn(&Squares) -> f64| {
            let values = usual.iter().map(|squares| part(&squares[k]));
            values.fold(f64::INFINITY, f64::min) / part(&own[k])
        };
        println!(
            "{:8.1} Hz  f {:7.1}  zeta {:7.1}   (ours: f {:.1e} Hz, zeta {:.3} %; missed {} of {})",
            case.frequency_hz[*mode],
            best(Squares::frequency),
            best(Squares::damping),
            own[k].frequency(),
            100.0 * own[k].damping() / case.damping[*mode],
            seeds as usize - usual.iter().map(|squares| squares[k].count).max().unwrap_or(0),
            seeds,
        );
    }
}

/// Sums of squared errors.
#[derive(Debug, Clone, Copy, Default)]
struct Squares {
    frequency: f64,
    damping: f64,
    count: usize,
}

impl Squares {
    fn frequency(&self) -> f64 {
        (self.frequency / self.count as f64).sqrt()
    }

    fn damping(&self) -> f64 {
        (self.damping / self.count as f64).sqrt()
    }
}

/// Adds, for each mode, the error of the nearest pole within five half-widths; each pole is used
/// once.
fn add(case: &Case, modes: &[usize], poles: &[C], squares: &mut [Squares]) {
    let mut rest = poles.to_vec();
    for (mode, square) in modes.iter().zip(squares) {
        let truth = case.poles()[*mode];
        let distance = |pole: &C| (pole - truth).norm() / -truth.re;
        let nearest =
            (0..rest.len()).min_by(|a, b| distance(&rest[*a]).total_cmp(&distance(&rest[*b])));
        if let Some(pole) =
            nearest.filter(|k| distance(&rest[*k]) < 5.0).map(|k| rest.swap_remove(k))
        {
            let size = pole.norm();
            square.frequency += (size / TAU - case.frequency_hz[*mode]).powi(2);
            square.damping += (-pole.re / size - case.damping[*mode]).powi(2);
            square.count += 1;
        }
    }
}

/// Method of the common tools to compute frequency responses.
enum Setting {
    /// Hann-windowed segments of a length in samples.
    Hann(usize),
    /// Blocks of this length (in samples) from each hit, and the value of the exponential window at
    /// the end of a block.
    Exponential(usize, f64),
}

impl Case {
    fn settings(&self) -> Vec<Setting> {
        match self.excitation {
            Excitation::Random => {
                vec![Setting::Hann(1024), Setting::Hann(2048), Setting::Hann(4096)]
            }
            Excitation::Hammer { .. } => {
                let ends = [0.01, 0.1, 0.5, 1.0].into_iter();
                ends.map(|end| Setting::Exponential(800, end)).collect()
            }
        }
    }
}

impl Setting {
    /// Returns the pole of each cluster over all model orders, without the damping that the window
    /// adds.
    fn poles(&self, case: &Case, forces: &Record, motion: &Record) -> Vec<C> {
        let (starts, len, decay) = match *self {
            Self::Hann(len) => (
                (0..).map(|k| k * len / 2).take_while(|k| k + len <= case.samples).collect(),
                len,
                0.0,
            ),
            Self::Exponential(len, end) => {
                (hits(forces, len), len, -f64::ln(end) / (len as f64 / case.rate_hz))
            }
        };
        let window = |k: usize| match self {
            Self::Hann(len) => (std::f64::consts::PI * k as f64 / *len as f64).sin().powi(2),
            Self::Exponential(..) => (-decay * k as f64 / case.rate_hz).exp(),
        };
        let table = responses(case, [forces, motion], &starts, len, window);
        let orders: Vec<usize> = (4..=40).step_by(2).collect();
        let Ok(models) = plscf(&table, &orders) else { return Vec::new() };
        let clusters = models.clusters(MAX_DAMPING, 0.2);
        clusters.iter().map(|cluster| cluster.pole.pole + decay).collect()
    }
}

/// Returns the starts of blocks, a few samples before each hit.
fn hits(forces: &Record, len: usize) -> Vec<usize> {
    let force = forces.channel(0);
    let largest = force.iter().copied().fold(0.0, f64::max);
    let mut starts: Vec<usize> = Vec::new();
    for (k, value) in force.iter().enumerate() {
        let is_new = starts.last().is_none_or(|last| k > last + len);
        if *value > 0.2 * largest && is_new && k >= 5 && k - 5 + len <= force.len() {
            starts.push(k - 5);
        }
    }
    starts
}

/// Returns the frequency responses by H1 in the band.
fn responses(
    case: &Case,
    [forces, motion]: [&Record; 2],
    starts: &[usize],
    len: usize,
    window: impl Fn(usize) -> f64,
) -> ResponseTable {
    let lines = |record: &Record, start: usize| {
        let part = record.window(start, len).unwrap();
        let mut data = part.data().clone();
        for (k, mut row) in data.row_iter_mut().enumerate() {
            row *= window(k);
        }
        Spectrum::from_record(&Record::new(part.sampling(), data).unwrap()).lines().clone()
    };
    let spacing = case.rate_hz / len as f64;
    let first = (case.band_hz[0] / spacing).ceil() as usize;
    let last = (case.band_hz[1] / spacing).floor() as usize;
    let (inputs, outputs) = (forces.channels(), motion.channels());
    let mut power = vec![DMatrix::<C>::zeros(inputs, inputs); last - first + 1];
    let mut cross = vec![DMatrix::<C>::zeros(outputs, inputs); last - first + 1];
    for &start in starts {
        let (f, y) = (lines(forces, start), lines(motion, start));
        for line in first..=last {
            let (f, y) = (f.row(line).transpose(), y.row(line).transpose());
            power[line - first] += &f * f.adjoint();
            cross[line - first] += &y * f.adjoint();
        }
    }
    let omega = (first..=last).map(|line| TAU * spacing * line as f64).collect();
    let responses = power.into_iter().zip(cross);
    let responses = responses
        .map(|(power, cross)| {
            // The power matrix P is Hermitian, so that H P = C is equivalent to P Hᴴ = Cᴴ.
            power.lu().solve(&cross.adjoint()).expect("the forces are independent").adjoint()
        })
        .collect();
    ResponseTable::new(omega, responses).unwrap()
}
