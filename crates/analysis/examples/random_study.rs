//! Random tests of machines with light and heavy damping: do the intervals hold, and what does a fit of averaged
//! frequency responses make of the same records?
//!
//! ```text
//! cargo run --release -p mechid-analysis --example random_study -- 1000
//! ```
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use std::f64::consts::TAU;

use mechid_analysis::frf::Estimator;
use mechid_analysis::{
    Identified, Identify, Measurement, ResponseQuantity, Segmentation, identify,
};
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_signal::{NoiseLevel, Sampling, noise};
use nalgebra::dmatrix;
use rayon::prelude::*;

/// Samples of a record, 500 in a second.
const SAMPLES: usize = 8192;
/// Noise on the response over the response, in the RMS.
const LEVEL: f64 = 0.01;

fn main() {
    let runs = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(200);
    println!("{runs} records of {SAMPLES} samples each, {} % of noise", 100.0 * LEVEL);
    println!(
        "| machine | fit | intervals that hold (%) | damping ratio: bias, scatter (%) | a warning (%) |"
    );
    println!("|---|---|---|---|---|");
    for ratio in [0.001, 0.01, 0.1] {
        study(&format!("ζ = {} %", 100.0 * ratio), &oscillator(ratio), runs);
    }
    study("two forces at a time", &two(), runs);
}

/// 10 kg at 25 Hz.
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

fn study(name: &str, system: &SecondOrderSystem, runs: u64) {
    let fits = [
        ("ends of the record fitted", Identify::default()),
        ("H1, segments of 1024", Identify::responses(Estimator::H1, Segmentation::of(1024))),
        ("H1, segments of 4096", Identify::responses(Estimator::H1, Segmentation::of(4096))),
    ];
    for (fit, how) in fits {
        let all: Vec<Run> =
            (0..runs).into_par_iter().filter_map(|seed| one(system, seed, &how)).collect();
        let count = all.len() as f64;
        let mean = |of: &dyn Fn(&Run) -> f64| all.iter().map(of).sum::<f64>() / count;
        let (holding, bias) = (100.0 * mean(&|run| run.holding), 100.0 * mean(&|run| run.damping));
        let scatter = (1e4 * mean(&|run| run.damping.powi(2)) - bias * bias).max(0.0).sqrt();
        let warned = 100.0 * mean(&|run| f64::from(u8::from(run.warned)));
        println!("| {name} | {fit} | {holding:.1} | {bias:.3}, {scatter:.3} | {warned:.1} |");
        if all.len() as u64 != runs {
            println!("{} of {runs} fits failed", runs - all.len() as u64);
        }
    }
}

struct Run {
    /// Part of the 95 % intervals of the parameters that hold.
    holding: f64,
    /// Relative error of the damping ratio of the first mode.
    damping: f64,
    warned: bool,
}

fn one(system: &SecondOrderSystem, seed: u64, how: &Identify) -> Option<Run> {
    let quantity = ResponseQuantity::Displacement;
    let sampling = Sampling::new(0.002, SAMPLES).ok()?;
    let rig = RandomTest { system: system.clone(), sampling, quantity, force: 100.0 };
    let [force, response] = rig.measure(seed).ok()?;
    let level = NoiseLevel::FractionOfRms(LEVEL);
    let noisy = noise::add_white(&response, level, seed + 1_000_000).ok()?;
    let test = Measurement::from_records(&force, &[(quantity, &noisy)]).ok()?;
    let identified = identify(&[test], how).ok()?;
    let parameters = identified.estimate().parameters();
    let count = parameters.len() as f64;
    let holds = parameters.filter(|p| {
        let truth = system.matrix(p.parameter.matrix())[(p.parameter.row(), p.parameter.column())];
        p.interval(0.95).is_ok_and(|[low, high]| (low..=high).contains(&truth))
    });
    let ratio = |identified: &Identified| identified.summary().modes[0].row.damping_ratio.value;
    let truth = system.modes().ok()?[0].damping_ratio();
    Some(Run {
        holding: holds.count() as f64 / count,
        damping: ratio(&identified) / truth - 1.0,
        warned: identified.summary().checks.iter().any(|check| check.is_conspicuous()),
    })
}
