//! Coverage of intervals and scatter over the Cramér–Rao bound of machines of named elements, and the time of
//! a rotor of 200 degrees of freedom.
//!
//! `cargo run --release -p mechid-estimate --example machine_study -- 300 200 200` for 300 seeds of the chain of
//! five, 200 of the chain of three with everything unknown, 200 of the rotor.

#![allow(dead_code, unused_imports, reason = "the modules are those of the tests")]
#![allow(clippy::print_stdout, reason = "a study prints")]

#[path = "../tests/suite/machine/chain.rs"]
mod chain;
#[path = "../tests/suite/machine/generator.rs"]
mod generator;
#[path = "../tests/suite/machine/judge.rs"]
mod judge;
#[path = "../tests/suite/machine/rotor.rs"]
mod rotor;

use std::time::Instant;

use judge::{Judged, judge};
use mechid_estimate::likelihood::{NoiseSource, Settings};

fn row(name: &str, seeds: u64, start: Instant, judged: &Judged) {
    println!(
        "{name:<44} {seeds:>4} {:>7.3} {:>7.3} {:>8.3} {:>8.3} {:>6} {:>8.1}",
        judged.held,
        judged.worst,
        judged.scatter,
        judged.worst_scatter,
        judged.failed,
        start.elapsed().as_secs_f64()
    );
}

fn main() {
    let seeds: Vec<u64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let count = |at: usize| seeds.get(at).copied().unwrap_or(20);
    println!(
        "{:<44} seeds    held   worst  scatter    worst failed  seconds",
        "errors over standard errors: scatter"
    );
    let rotor = rotor::Rotor::new(50, 1.0);
    let data = rotor::shaken(&rotor, 500, 0);
    let start = Instant::now();
    let estimate = rotor::fit(&data, &rotor);
    let searches = estimate.map_or(0, |estimate| estimate.likelihood.searches);
    println!(
        "rotor of 200 degrees of freedom, 500 lines, 4 probes: {:.2} s, {searches} searches",
        start.elapsed().as_secs_f64()
    );
    let start = Instant::now();
    let judged = judge(&chain::truth(), count(0), |seed| chain::fit(seed, &Settings::default()));
    row("five masses, two sensors, known noise", count(0), start, &judged);
    let start = Instant::now();
    let judged = judge(&chain::three_masses_truth(), count(1), chain::three_masses);
    row("three masses, all unknown, two sensors", count(1), start, &judged);
    let start = Instant::now();
    let small = rotor::Rotor::new(13, 1.0);
    let judged = judge(&rotor::truth(), count(2), |seed| {
        Some(rotor::fit(&rotor::shaken(&small, 120, seed), &small).ok()?.likelihood)
    });
    row("rotor, sixteen bearing coefficients", count(2), start, &judged);
    for noise in [NoiseSource::WhiteResidual, NoiseSource::SmoothResidual] {
        let start = Instant::now();
        let settings = Settings { noise, ..Settings::default() };
        let judged = judge(&chain::truth(), count(0) / 3, |seed| chain::fit(seed, &settings));
        row(&format!("five masses, {noise:?}"), count(0) / 3, start, &judged);
    }
}
