//! Coverage, scatter and counts of the modal estimator over many records with known modes.
//!
//! `cargo run --release -p mechid-modal --example modal_study -- SEEDS [CASE] [FIRST]` prints one row per case.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

#[path = "../tests/suite/generator.rs"]
mod generator;
#[path = "../tests/suite/score.rs"]
mod score;

use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seeds = arguments.first().and_then(|text| text.parse().ok()).unwrap_or(10);
    let wanted = arguments.get(1).cloned().unwrap_or_default();
    let first: u64 = arguments.get(2).and_then(|text| text.parse().ok()).unwrap_or(0);
    println!(
        "{:34} {:>5} {:>6} {:>6} {:>6} {:>12} {:>12} {:>12} {:>12} {:>7} {:>6} {:>6}",
        "case",
        "seeds",
        "f %",
        "zeta %",
        "shape%",
        "scatter/se f",
        "scatter/se z",
        "bias/sd f",
        "bias/sd z",
        "found %",
        "false",
        "s"
    );
    for case in generator::cases() {
        if !case.name.contains(&wanted) {
            continue;
        }
        let start = Instant::now();
        let score = score::Score::of(&case, first..first + seeds);
        let range = |values: &[f64]| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("{low:.2}..{high:.2}")
        };
        println!(
            "{:34} {:>5} {:>6.1} {:>6.1} {:>6.1} {:>12} {:>12} {:>12} {:>12} {:>7.1} {:>6} {:>6.2}",
            case.name,
            score.records,
            score.frequency.coverage(),
            score.damping.coverage(),
            score.shape_coverage(),
            range(&score.frequency.scatter()),
            range(&score.damping.scatter()),
            range(&score.frequency.bias()),
            range(&score.damping.bias()),
            score.found_share(),
            score.false_modes,
            start.elapsed().as_secs_f64() / score.records as f64,
        );
    }
}
