//! Coverage of intervals and scatter over the Cramér–Rao bound of machines of named elements, and the time of
//! a rotor of 200 degrees of freedom.
//!
//! `cargo run --release -p mechid-estimate --example machine_study -- 300 200 200` for 300 seeds of the chain of
//! five, 200 of the chain of three with everything unknown, 200 of all others: rotor, frame, joint.

#![allow(dead_code, unused_imports, reason = "the modules are those of the tests")]
#![allow(clippy::print_stdout, reason = "a study prints")]

#[path = "../tests/suite/machine/chain.rs"]
mod chain;
#[path = "../tests/suite/machine/frame.rs"]
mod frame;
#[path = "../tests/suite/machine/generator.rs"]
mod generator;
#[path = "../tests/suite/machine/joint.rs"]
mod joint;
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
    let start = Instant::now();
    let judged = judge(&chain::truth_with_bound(), count(0), chain::fit_with_bound);
    row("five masses, an absent spring, k >= 0", count(0), start, &judged);
    let start = Instant::now();
    let judged =
        judge(&rotor::truth_of_unbalance(), count(2), |seed| rotor::fit_unbalance(&small, seed));
    row("rotor, unbalance at 8 speeds, 3 runs", count(2), start, &judged);
    for (name, is_relative) in [("absolute", [false; 2]), ("relative", [true; 2])] {
        let start = Instant::now();
        let judged = judge(&frame::truth(), count(2), |seed| frame::fit(is_relative, seed));
        row(&format!("frame on a table, {name} accelerations"), count(2), start, &judged);
    }
    let start = Instant::now();
    let judged = judge(&joint::truth(), count(2), joint::fit);
    row("joint of two measured beams", count(2), start, &judged);
    let told = |p: Option<f64>| p.is_some_and(|p| p < 0.01);
    for away in [0.0, 5.0] {
        let prior = |seed| {
            let estimate = chain::fit_with_prior(seed, away)?;
            estimate.parameter("s1.k")?.prior?.p_value
        };
        let wrong = (0..count(0)).filter(|seed| told(prior(*seed))).count();
        println!("prior {away} standard deviations away: told in {wrong} of {}", count(0));
    }
    let soft = rotor::Rotor::new(13, 0.99);
    let of_soft =
        |seed| Some(rotor::fit(&rotor::shaken(&small, 120, seed), &soft).ok()?.likelihood);
    let start = Instant::now();
    let judged = judge(&rotor::truth(), count(2), of_soft);
    row("rotor, E wrong by 1 %, scaled intervals", count(2), start, &judged);
    let misfit = |seed| of_soft(seed).and_then(|estimate| estimate.misfit_p_value);
    let wrong = (0..count(2)).filter(|seed| told(misfit(*seed))).count();
    println!("rotor, E wrong by 1 %: misfit told in {wrong} of {}", count(2));
    for noise in [NoiseSource::WhiteResidual, NoiseSource::SmoothResidual] {
        let start = Instant::now();
        let settings = Settings { noise, ..Settings::default() };
        let judged = judge(&chain::truth(), count(0) / 3, |seed| chain::fit(seed, &settings));
        row(&format!("five masses, {noise:?}"), count(0) / 3, start, &judged);
    }
}
