//! Coverage, scatter and counts of the modal estimator over many records with known modes.
//!
//! `cargo run --release -p mechid-modal --example modal_study -- SEEDS [CASE] [FIRST]` prints one
//! row per case. The scatter is divided by an independent Cramér–Rao bound (`bound.rs`), the bias
//! by the scatter. The row "sensor noise only" leaves unmeasured forces out of the noise model.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

mod bound;
#[path = "../../tests/suite/generator.rs"]
mod generator;
#[path = "../../tests/suite/score.rs"]
mod score;

use std::ops::Range;
use std::time::Instant;

use mechid_modal::{DrivingPoint, ModalConstraint, ModalSettings};

use bound::Bound;
use generator::Case;
use score::Score;

/// Number of records over which the bound is averaged, for structures with the same noise in every
/// record.
const BOUND_SEEDS: u64 = 3;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seeds = arguments.first().and_then(|text| text.parse().ok()).unwrap_or(10);
    let wanted = arguments.get(1).cloned().unwrap_or_default();
    let first: u64 = arguments.get(2).and_then(|text| text.parse().ok()).unwrap_or(0);
    println!(
        "{:32} {:>5} {:>6} {:>6} {:>6} {:>13} {:>13} {:>9} {:>9} {:>7} {:>5} {:>5} {:>6}",
        "case",
        "seeds",
        "f %",
        "zeta %",
        "shape%",
        "sd/bound f",
        "sd/bound z",
        "|bias| f",
        "|bias| z",
        "found %",
        "false",
        "none",
        "s"
    );
    let all = ModalSettings::default();
    let sensors = ModalSettings { unmeasured_forces: false, ..all.clone() };
    let points = [(0, 0), (3, 1)].map(|(output, input)| DrivingPoint { output, input });
    let known = ModalSettings {
        constraints: vec![
            ModalConstraint::RealShapes { derivative: 2 },
            ModalConstraint::Reciprocity { points: points.to_vec() },
        ],
        ..all.clone()
    };
    for case in generator::cases() {
        if !case.name.contains(&wanted) {
            continue;
        }
        let seeds = first..first + seeds;
        // Unmeasured forces act at other places in every record. Noise on the forces is part of the
        // model's inputs: no such bound exists for it.
        let most = if case.unmeasured > 0.0 { u64::MAX } else { BOUND_SEEDS };
        let records: Vec<u64> = seeds.clone().take(most as usize).collect();
        let bound = (case.force_noise == 0.0).then(|| Bound::of(&case, &records));
        let row = |name: &str, settings: &ModalSettings| {
            print_row(name, &case, seeds.clone(), settings, bound.as_ref());
        };
        row(case.name, &all);
        if case.name.contains("reciprocal") {
            row("  the same, constraints imposed", &known);
        }
        if case.unmeasured > 0.0 {
            row("  the same, sensor noise only", &sensors);
        }
    }
}

fn print_row(
    name: &str,
    case: &Case,
    seeds: Range<u64>,
    settings: &ModalSettings,
    bound: Option<&Bound>,
) {
    let start = Instant::now();
    let score = Score::with(case, seeds, settings);
    let seconds = start.elapsed().as_secs_f64() / score.records as f64;
    let ratio = |deviation: Vec<f64>, bound: Option<&Vec<f64>>| {
        let Some(bound) = bound else { return "-".to_owned() };
        let ratios = deviation.iter().zip(bound).map(|(deviation, bound)| deviation / bound);
        let fold = |(low, high): (f64, f64), ratio: f64| (low.min(ratio), high.max(ratio));
        let (low, high) = ratios.fold((f64::INFINITY, 0.0), fold);
        format!("{low:.2}..{high:.2}")
    };
    let largest = |values: Vec<f64>| values.iter().map(|value| value.abs()).fold(0.0, f64::max);
    println!(
        "{:32} {:>5} {:>6.1} {:>6.1} {:>6.1} {:>13} {:>13} {:>9.2} {:>9.2} {:>7.2} {:>5} {:>5} {:>6.2}",
        name,
        score.records,
        score.frequency.coverage(),
        score.damping.coverage(),
        score.shape_coverage(),
        ratio(score.frequency.deviation(), bound.map(|bound| &bound.frequency)),
        ratio(score.damping.deviation(), bound.map(|bound| &bound.damping)),
        largest(score.frequency.bias()),
        largest(score.damping.bias()),
        score.found_share(),
        score.false_modes,
        score.refused,
        seconds,
    );
    let [tests, rejected] = score.tests;
    if tests > 0 {
        println!("  {tests} tests of constraints, {rejected} reject at 5 %");
    }
}
