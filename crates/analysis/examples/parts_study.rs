//! Do the parts of the data disagree where the model is wrong, and only there; and do the intervals that their scatter
//! widens hold?
//!
//! ```text
//! cargo run --release -p mechid-analysis --example parts_study -- 200 [NAME]
//! ```
//! For each row: runs with a factor of exactly 1, runs with any warning, the median factor, and the share of 95 %
//! intervals of mass, damping and stiffness that hold the values of the machine, without the factor and with it.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use mechid_analysis::identify::{HitFit, OpenFit, Source};
use mechid_analysis::{
    AnalysisError, Identified, Identify, Measurement, ResponseQuantity, identify,
};
use mechid_checks::Subject;
use mechid_problems::{FaultyOscillator, HammerTest};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::DMatrix;
use rayon::prelude::*;

const KIND: ResponseQuantity = ResponseQuantity::Displacement;
const SAMPLES: usize = 2048;
const PERIOD: usize = 512;
/// Band of the force over the sampling rate.
const BAND: f64 = 0.35;

/// What is recorded.
#[derive(Debug, Clone, Copy)]
enum Test {
    /// Open records, the masses of which differ from the machine's by these fractions.
    Records(&'static [f64]),
    /// Periods of one record.
    Periods(usize),
    /// Twelve hits of a hammer.
    Hits,
}

fn measured([force, response]: [Record; 2], seed: u64) -> Result<Measurement, AnalysisError> {
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), seed)?;
    Measurement::from_records(&force, &[(KIND, &noisy)])
}

fn run(
    test: Test,
    machine: &FaultyOscillator,
    band: f64,
    seed: u64,
) -> Result<Identified, AnalysisError> {
    let sampling = |samples| Sampling::new(0.002, samples).expect("positive step");
    let (records, source) = match test {
        Test::Records(masses) => {
            let record = |(at, added): (usize, &f64)| {
                let (machine, seed) = (
                    FaultyOscillator { mass: machine.mass * (1.0 + added), ..*machine },
                    100 * seed + at as u64,
                );
                let both = machine.measure(sampling(SAMPLES), 4 * SAMPLES, SAMPLES, band, seed);
                measured(both.expect("a record"), seed + 50)
            };
            let records = masses.iter().enumerate().map(record).collect::<Result<_, _>>()?;
            (records, Source::Open(OpenFit::default()))
        }
        Test::Periods(count) => {
            let both = machine.measure(sampling(count * PERIOD), PERIOD, 4 * PERIOD, band, seed);
            let record = measured(both.expect("a record"), seed + 50_000)?.period(PERIOD)?;
            (vec![record], Source::default())
        }
        Test::Hits => {
            let test = HammerTest {
                frequencies_hz: vec![25.0],
                damping_ratios: vec![0.02],
                shapes: DMatrix::from_element(1, 1, machine.mass.sqrt().recip()),
                sampling: sampling(12 * 1000),
                quantity: KIND,
                hits: 12,
                peak: 500.0,
                duration: 0.004,
                force_noise: 0.5,
            };
            let record = test.measure(0, 0, seed).expect("a record");
            (
                vec![measured([record.force, record.response], seed + 50_000)?],
                Source::Hits(HitFit::default()),
            )
        }
    };
    identify(&records, &Identify::from(source))
}

fn row(name: &str, test: Test, machine: &FaultyOscillator, band: f64, runs: u64) {
    let run = |seed| {
        run(test, machine, band, seed).inspect_err(|error| println!("seed {seed}: {error}")).ok()
    };
    let all: Vec<Identified> = (0..runs).into_par_iter().filter_map(run).collect();
    let scale = |found: &Identified| found.summary().fit.error_scale;
    let percent = |is: &dyn Fn(&Identified) -> bool| {
        100.0 * all.iter().filter(|found| is(found)).count() as f64 / all.len() as f64
    };
    let mut factors: Vec<f64> = all.iter().map(scale).collect();
    factors.sort_by(f64::total_cmp);
    let truth = [("m", machine.mass), ("c", machine.damping), ("k", machine.stiffness)];
    let cells = truth.map(|(name, value)| {
        let of = |found: &Identified| found.estimate().parameter(name).expect("a parameter");
        let narrow = percent(&|found| {
            let estimate = of(found);
            (estimate.value - value).abs() < 1.96 * estimate.standard_error / scale(found)
        });
        let wide = percent(&|found| {
            let [low, high] = of(found).interval(0.95).expect("a level");
            (low..=high).contains(&value)
        });
        format!("{name} {narrow:5.1} {wide:5.1}")
    });
    println!(
        "{name:<34} | {} runs | factor 1: {:5.1} % | warned: {:5.1} % | median factor {:6.2} | {}",
        all.len(),
        percent(&|found| scale(found) == 1.0),
        percent(&|found| found.checks().iter().any(|check| check.is_conspicuous())),
        factors.get(all.len() / 2).copied().unwrap_or(f64::NAN),
        cells.join(" | ")
    );
    let first =
        all.first().and_then(|found| found.checks().iter().find(|c| c.subject == Subject::Parts));
    println!("    {}", first.map_or("no parts", |check| &check.text));
}

fn main() {
    let runs = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(100);
    let wanted = std::env::args().nth(2).unwrap_or_default();
    let right = FaultyOscillator::linear();
    let drifts = FaultyOscillator { drift: 0.01, ..right };
    let hardens = FaultyOscillator { cubic: 1e8, ..right };
    let rubs = FaultyOscillator { friction: 5.0, ..right };
    let hides = FaultyOscillator { hidden_mass: 1.0, ..right };
    let rows = [
        ("right: one random record", Test::Records(&[0.0]), right, BAND),
        ("right: three random records", Test::Records(&[0.0; 3]), right, BAND),
        ("right: eight periods", Test::Periods(8), right, BAND),
        ("right: three periods", Test::Periods(3), right, BAND),
        ("right: one period", Test::Periods(1), right, BAND),
        ("right: hits", Test::Hits, right, BAND),
        ("stiffness drifts by 1 %, random", Test::Records(&[0.0]), drifts, BAND),
        ("stiffness drifts by 1 %, periods", Test::Periods(8), drifts, BAND),
        ("added weight of 2 % in one of two", Test::Records(&[0.01, -0.01]), right, BAND),
        ("hardening, random", Test::Records(&[0.0]), hardens, BAND),
        ("hardening, periods", Test::Periods(8), hardens, BAND),
        ("friction, random", Test::Records(&[0.0]), rubs, BAND),
        ("friction, periods", Test::Periods(8), rubs, BAND),
        ("mode above the band, random", Test::Records(&[0.0]), hides, 0.09),
        ("mode above the band, periods", Test::Periods(8), hides, 0.09),
    ];
    for (name, test, machine, band) in rows {
        if name.contains(&wanted) {
            row(name, test, &machine, band, runs);
        }
    }
}
