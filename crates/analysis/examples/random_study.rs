//! Study of random tests of machines with light and heavy damping: coverage of the intervals, the
//! same records fitted by averaged frequency responses, and the effects of noise on the force and
//! of coloured noise.
//!
//! ```text
//! cargo run --release -p mechid-analysis --example random_study -- 1000
//! cargo run --release -p mechid-analysis --example random_study -- 300 force
//! ```
//! The second argument chooses a table (`segments`, `force` or `colour`), and the third argument
//! chooses the rows that contain this text. Without these arguments, all tables and rows are
//! computed.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use mechid_analysis::frf::Estimator;
use mechid_analysis::{
    Identified, Identify, Measurement, ResponseQuantity, Segmentation, identify,
};
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_signal::noise::Colour;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{DMatrix, dmatrix};
use rayon::prelude::*;

/// Number of samples of a record, 500 per second.
const SAMPLES: usize = 8192;
/// Time step, in s.
const DT: f64 = 0.002;
const QUANTITY: ResponseQuantity = ResponseQuantity::Displacement;

/// Ratios of the RMS of the noise to the RMS of the signal, for force and response.
#[derive(Clone, Copy)]
struct Noise {
    force: f64,
    response: f64,
    colour: Colour,
}

impl Noise {
    fn white(force: f64) -> Self {
        Self { force, response: 0.01, colour: Colour::White }
    }
}

fn main() {
    let runs = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(200);
    let table = std::env::args().nth(2);
    let wanted = |name: &str| table.as_ref().is_none_or(|table| table == name);
    let machines: Vec<(String, SecondOrderSystem)> = [0.001, 0.01, 0.1]
        .map(|ratio| (format!("ζ = {} %", 100.0 * ratio), oscillator(ratio)))
        .into_iter()
        .chain([("two forces at a time".to_owned(), two())])
        .collect();
    println!("{runs} records of {SAMPLES} samples each");
    if wanted("segments") {
        heading("fit");
        let eight = [("eight forces at a time".to_owned(), eight())];
        for (name, system) in machines.iter().chain(&eight) {
            for (fit, how) in fits() {
                study(&format!("{name} | {fit}"), system, runs, &how, Noise::white(0.0));
            }
        }
    }
    if wanted("force") {
        heading("noise on the force");
        for (name, system) in &machines {
            for force in [0.0, 0.001, 0.005, 0.01, 0.02] {
                let row = format!("{name} | {} %", 100.0 * force);
                study(&row, system, runs, &Identify::default(), Noise::white(force));
            }
        }
    }
    if wanted("colour") {
        heading("noise on the response");
        // The noise x follows x_k = 0.9 x_(k−1) + e_k, with white e.
        let autoregressive = Colour::LowPass { corner_hz: -(0.9_f64.ln()) / (TAU * DT) };
        let colours = [
            ("white", Colour::White),
            ("AR(0.9)", autoregressive),
            ("1/f", Colour::PowerLaw { exponent: 1.0 }),
        ];
        for (name, system) in &machines {
            for (of_colour, colour) in colours {
                let noise = Noise { force: 0.0, response: 0.05, colour };
                let row = format!("{name} | 5 % of {of_colour}");
                study(&row, system, runs, &Identify::default(), noise);
            }
        }
    }
}

fn heading(second: &str) {
    println!();
    println!(
        "| machine | {second} | intervals that hold (%) | damping ratio: bias, scatter (%) | a warning (%) |"
    );
    println!("|---|---|---|---|---|");
}

fn fits() -> [(&'static str, Identify); 4] {
    let segments = |len| Identify::responses(Estimator::H1, Segmentation::with_samples(len));
    [
        ("ends of the record fitted", Identify::default()),
        ("H1, segments of 1024", segments(1024)),
        ("H1, segments of 4096", segments(4096)),
        ("H1, length chosen", Identify::responses(Estimator::H1, Segmentation::default())),
    ]
}

/// Returns an oscillator of 10 kg with a natural frequency of 25 Hz and this damping ratio.
fn oscillator(ratio: f64) -> SecondOrderSystem {
    let omega = 25.0 * TAU;
    let oscillator = Sdof::new(10.0, 20.0 * ratio * omega, 10.0 * omega * omega);
    oscillator.expect("positive").system()
}

fn two() -> SecondOrderSystem {
    let mass = dmatrix![10.0, 0.0; 0.0, 8.0];
    let damping = dmatrix![30.0, -8.0; -12.0, 25.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5];
    SecondOrderSystem::new(mass, damping, stiffness).expect("an invertible mass")
}

/// Returns a chain of eight masses with modes from 17 to 99 Hz and damping ratios from 1.2 to 4.7
/// %.
fn eight() -> SecondOrderSystem {
    let stiffness = DMatrix::from_fn(8, 8, |i, j| match i.abs_diff(j) {
        0 => 4e5,
        1 => -2e5,
        _ => 0.0,
    });
    let mass = DMatrix::identity(8, 8) * 2.0;
    let damping = &stiffness * 1.5e-4 + &mass * 0.8;
    SecondOrderSystem::new(mass, damping, stiffness).expect("an invertible mass")
}

fn study(row: &str, system: &SecondOrderSystem, runs: u64, how: &Identify, noise: Noise) {
    if std::env::args().nth(3).is_some_and(|wanted| !row.contains(&wanted)) {
        return;
    }
    let all: Vec<Run> =
        (0..runs).into_par_iter().filter_map(|seed| one(system, seed, how, noise)).collect();
    let count = all.len() as f64;
    let mean = |of: &dyn Fn(&Run) -> f64| all.iter().map(of).sum::<f64>() / count;
    let (holding, bias) = (100.0 * mean(&|run| run.holding), 100.0 * mean(&|run| run.damping));
    let scatter = (1e4 * mean(&|run| run.damping.powi(2)) - bias * bias).max(0.0).sqrt();
    let warned = 100.0 * mean(&|run| f64::from(u8::from(!run.warnings.is_empty())));
    println!("| {row} | {holding:.1} | {bias:.3}, {scatter:.3} | {warned:.1} |");
    let subjects: BTreeSet<&String> = all.iter().flat_map(|run| &run.warnings).collect();
    for subject in subjects {
        let runs = all.iter().filter(|run| run.warnings.contains(subject)).count();
        println!("{row}: {runs} of {count} warn of {subject}");
    }
    if all.len() as u64 != runs {
        println!("{} of {runs} fits failed", runs - all.len() as u64);
    }
}

struct Run {
    /// Fraction of the 95 % intervals of the parameters that contain the true value.
    holding: f64,
    /// Relative error of the damping ratio of the first mode.
    damping: f64,
    /// Subjects of the checks that warn.
    warnings: BTreeSet<String>,
}

fn measure(system: &SecondOrderSystem, seed: u64, level: Noise) -> Option<[Record; 2]> {
    let sampling = Sampling::new(DT, SAMPLES).ok()?;
    let rig = RandomTest { system: system.clone(), sampling, quantity: QUANTITY, force: 100.0 };
    let [force, response] = rig.measure(seed).ok()?;
    let part = NoiseLevel::FractionOfRms;
    let force = noise::add_white(&force, part(level.force), seed + 2_000_000).ok()?;
    let seed = seed + 1_000_000;
    Some([force, noise::add(&response, part(level.response), level.colour, seed).ok()?])
}

fn one(system: &SecondOrderSystem, seed: u64, how: &Identify, noise: Noise) -> Option<Run> {
    let [force, response] = measure(system, seed, noise)?;
    let test = Measurement::from_records(&force, &[(QUANTITY, &response)]).ok()?;
    let identified = identify(&[test], how).ok()?;
    let parameters = identified.estimate().parameters();
    let count = parameters.len() as f64;
    let holds = parameters.filter(|p| {
        let truth = system.matrix(p.parameter.matrix())[(p.parameter.row(), p.parameter.column())];
        p.interval(0.95).is_ok_and(|[low, high]| (low..=high).contains(&truth))
    });
    let ratio = |identified: &Identified| identified.summary().modes[0].row.damping_ratio.value;
    let truth = system.modes().ok()?[0].damping_ratio();
    let warnings = identified.summary().checks.iter().filter(|check| check.is_conspicuous());
    Some(Run {
        holding: holds.count() as f64 / count,
        damping: ratio(&identified) / truth - 1.0,
        warnings: warnings.map(|check| check.subject.to_string()).collect(),
    })
}
