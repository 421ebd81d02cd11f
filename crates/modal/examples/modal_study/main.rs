//! Coverage, scatter and counts of the modal estimator over many records with known modes.
//!
//! `cargo run --release -p mechid-modal --example modal_study -- SEEDS [CASE] [FIRST]` prints one
//! row per case. The scatter is divided by an independent Cramér–Rao bound (`bound.rs`), the bias
//! by the scatter. The modal masses are those of the first response and the first force. In the row
//! "sensor noise only", the noise model has no unmeasured forces, and the number of modes is given.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

mod bound;
#[path = "../../tests/suite/generator.rs"]
mod generator;
#[path = "../../tests/suite/score.rs"]
mod score;

use mechid_modal::{DrivingPoint, ModalConstraint, ModalSettings};

use bound::Bound;
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
        "| Test | Records | f hold | ζ hold | Shapes hold | Masses hold | f over bound | ζ over bound | Bias | Modes found | False modes |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let all = ModalSettings::default();
    let points = [(0, 0), (3, 1)].map(|(output, input)| DrivingPoint::new(output, input));
    let known = ModalSettings {
        constraints: vec![
            ModalConstraint::RealShapes { derivative: 2 },
            ModalConstraint::Reciprocity { points: points.to_vec() },
        ],
        ..all.clone()
    };
    let mut tests = [0, 0];
    for case in generator::cases() {
        if !case.name.contains(&wanted) {
            continue;
        }
        let seeds = first..first + seeds;
        // Unmeasured forces act at different points in each record, so the bound is averaged over
        // all records. There is no bound for noise on the forces, because this noise is part of the
        // inputs of the model.
        let most = if case.unmeasured > 0.0 { u64::MAX } else { BOUND_SEEDS };
        let records: Vec<u64> = seeds.clone().take(most as usize).collect();
        let bound = (case.force_noise == 0.0).then(|| Bound::of(&case, &records));
        let mut row = |name: &str, settings: &ModalSettings| {
            let score = Score::with(&case, seeds.clone(), settings);
            print_row(name, &score, bound.as_ref());
            (0..2).for_each(|k| tests[k] += score.tests[k]);
        };
        row(case.name, &all);
        if case.name.contains("reciprocal") {
            row("the same, constraints imposed", &known);
        }
        if case.unmeasured > 0.0 {
            let modes = Some(case.in_band().len());
            let sensors = ModalSettings { unmeasured_forces: false, modes, ..all.clone() };
            row("the same, sensor noise alone as model", &sensors);
        }
    }
    println!("\nOf {} tests of true constraints {} reject at 5 %.", tests[0], tests[1]);
}

fn print_row(name: &str, score: &Score, bound: Option<&Bound>) {
    let ratio = |deviation: Vec<f64>, bound: Option<&Vec<f64>>| {
        let Some(bound) = bound else { return "–".to_owned() };
        let ratios = deviation.iter().zip(bound).map(|(deviation, bound)| deviation / bound);
        let fold = |(low, high): (f64, f64), ratio: f64| (low.min(ratio), high.max(ratio));
        let (low, high) = ratios.fold((f64::INFINITY, 0.0), fold);
        format!("{low:.2} to {high:.2}")
    };
    let biases = [&score.frequency, &score.damping].map(|errors| errors.bias());
    let bias = biases.iter().flatten().map(|value| value.abs()).fold(0.0, f64::max);
    let shapes = match score.shape_coverage() {
        share if share.is_nan() => "–".to_owned(),
        share => format!("{share:.1}"),
    };
    println!(
        "| {} | {} | {:.1} | {:.1} | {shapes} | {:.1} | {} | {} | {bias:.2} | {:.2} | {} |",
        name.replacen('x', "×", 1),
        score.records,
        score.frequency.coverage(),
        score.damping.coverage(),
        score.mass.coverage(),
        ratio(score.frequency.deviation(), bound.map(|bound| &bound.frequency)),
        ratio(score.damping.deviation(), bound.map(|bound| &bound.damping)),
        score.found_share(),
        score.false_modes,
    );
}
