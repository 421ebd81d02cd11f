//! Study of faults in the measuring chain: does `identify` warn if they make the result wrong?
//!
//! ```text
//! cargo run --release -p mechid-analysis --example fault_study -- 200
//! ```
//! prints, for tests with several periods and for random tests of one machine, the percentage of 95
//! % intervals that contain the true value, the error of the worst parameter, and the percentages
//! of records with any warning and with a warning of each subject. A second argument chooses the
//! rows that contain this text.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use std::collections::BTreeMap;
use std::error::Error;

use mechid_analysis::{Identify, Measurement, ResponseQuantity, identify};
use mechid_model::SecondOrderSystem;
use mechid_problems::{Fault, RandomTest, exact_harmonic_periodic};
use mechid_signal::noise::Colour;
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::dmatrix;
use rayon::prelude::*;

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Time step, in s.
const DT: f64 = 0.002;
/// Number of samples of a period (`PERIOD`), and of a whole record (`SAMPLES`): eight periods, or a
/// random test.
const PERIOD: usize = 1024;
const SAMPLES: usize = 8 * PERIOD;
const QUANTITY: ResponseQuantity = ResponseQuantity::Displacement;

#[derive(Clone, Copy, PartialEq)]
enum Test {
    Periods,
    Random,
}

/// Channels that have the fault.
#[derive(Clone, Copy, PartialEq)]
enum On {
    Force,
    Response,
    Both,
}

fn machine() -> SecondOrderSystem {
    let mass = dmatrix![10.0, 0.0; 0.0, 8.0];
    let damping = dmatrix![30.0, -8.0; -12.0, 25.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5];
    SecondOrderSystem::new(mass, damping, stiffness).expect("an invertible mass")
}

fn faults() -> Vec<(String, On, Option<Fault>)> {
    let mut all = vec![("none".to_owned(), On::Both, None)];
    let mut add = |name: String, on, fault| all.push((name, on, Some(fault)));
    for part in [0.002, 0.01, 0.05] {
        let name = format!("crosstalk of {} %", 100.0 * part);
        add(format!("{name} between the forces"), On::Force, Fault::Crosstalk { part });
        add(format!("{name} between the responses"), On::Response, Fault::Crosstalk { part });
    }
    for size in [0.02, 0.1, 0.5] {
        let fault = Fault::RunOut { rotation_hz: 23.4375, amplitudes: vec![size, 0.5 * size] };
        add(format!("run-out of {} %, on lines", 100.0 * size), On::Response, fault);
        let fault = Fault::RunOut { rotation_hz: 23.7, amplitudes: vec![size, 0.5 * size] };
        add(format!("run-out of {} %, between lines", 100.0 * size), On::Response, fault);
    }
    let colours = [
        ("AR(0.9)", Colour::LowPass { corner_hz: -(0.9_f64.ln()) / (std::f64::consts::TAU * DT) }),
        ("1/f", Colour::PowerLaw { exponent: 1.0 }),
    ];
    for (name, colour) in colours {
        let fault = Fault::Noise { level: 0.05, colour };
        add(format!("noise of 5 %, {name}"), On::Response, fault);
    }
    for end in [0.05, 0.5, 5.0] {
        add(format!("drift by {} %", 100.0 * end), On::Response, Fault::Drift { end });
        add(format!("drift of the forces by {} %", 100.0 * end), On::Force, Fault::Drift { end });
    }
    for samples in [0.01, 0.1, 1.0] {
        add(format!("delay of {samples} samples"), On::Response, Fault::Delay { samples });
    }
    for part in [0.98, 0.9, 0.6] {
        let name = format!("clipping at {} % of the peak", 100.0 * part);
        add(name.clone(), On::Response, Fault::Clipping { part });
        add(format!("{name}, forces"), On::Force, Fault::Clipping { part });
    }
    for samples in [1, 10] {
        add(format!("{samples} samples lost, all channels"), On::Both, Fault::Lost { samples });
        add(format!("{samples} samples lost, responses"), On::Response, Fault::Lost { samples });
    }
    for gaps in [1, 20] {
        let fault = Fault::Held { gaps, samples: 5 };
        add(format!("last value held for 5 samples, {gaps} times"), On::Response, fault);
    }
    for bits in [8, 10, 12] {
        add(format!("steps of {bits} bits, all channels"), On::Both, Fault::Steps { bits });
    }
    add("wrong sign of the responses".into(), On::Response, Fault::Gain { factor: -1.0 });
    all
}

/// Returns forces (N) and displacements (m) without noise; the responses are delayed by `late`
/// samples.
fn exact(test: Test, late: f64, seed: u64) -> Outcome<[Record; 2]> {
    let delay = Fault::Delay { samples: late };
    let system = machine();
    match test {
        Test::Random => {
            let sampling = Sampling::new(DT, SAMPLES)?;
            let rig = RandomTest { system, sampling, quantity: QUANTITY, force: 100.0 };
            // The delay shifts one whole period cyclically, so no samples are missing at the
            // beginning.
            let [force, response] = rig.period(seed)?;
            let response = delay.apply(&response, seed)?;
            let first = SAMPLES / 2 + 1;
            Ok([force.window(first, SAMPLES)?, response.window(first, SAMPLES)?])
        }
        Test::Periods => {
            let sampling = Sampling::new(DT, PERIOD)?;
            let of = |channel: u64| {
                let phases = Phases::Random { seed: 2 * seed + channel };
                Multisine::flat(1..=200, 10.0, phases)?.sample(sampling)
            };
            let (first, second) = (of(0)?, of(1)?);
            let force = Record::from_channels(sampling, &[first.channel(0), second.channel(0)])?;
            let response = exact_harmonic_periodic(&system, &force)?;
            let response = delay.apply(response.displacement(), seed)?;
            let periods = SAMPLES / PERIOD;
            Ok([force.repeated(periods)?, response.repeated(periods)?])
        }
    }
}

struct Run {
    /// Fraction of the 95 % intervals that contain the true value.
    holding: f64,
    /// Largest error of a parameter relative to the largest entry of its matrix.
    off: f64,
    warnings: Vec<String>,
}

fn run(test: Test, fault: Option<&Fault>, on: On, seed: u64) -> Outcome<Run> {
    let late = match fault {
        Some(Fault::Delay { samples }) => *samples,
        _ => 0.0,
    };
    let [mut force, mut response] = exact(test, late, seed)?;
    response = noise::add_white(&response, NoiseLevel::FractionOfRms(0.005), seed + 1_000_000)?;
    if let Some(fault) = fault.filter(|fault| !matches!(fault, Fault::Delay { .. })) {
        if on != On::Response {
            force = fault.apply(&force, seed)?;
        }
        if on != On::Force {
            response = fault.apply(&response, seed)?;
        }
    }
    let record = Measurement::from_records(&force, &[(QUANTITY, &response)])?;
    let record = if test == Test::Periods { record.period(PERIOD)? } else { record };
    let identified = identify(&[record], &Identify::default())?;
    let system = machine();
    let parameters = identified.estimate().parameters();
    let count = parameters.len() as f64;
    let (mut holding, mut off) = (0.0, 0.0_f64);
    for p in parameters {
        let matrix = system.matrix(p.parameter.matrix());
        let truth = matrix[(p.parameter.row(), p.parameter.column())];
        let [low, high] = p.interval(0.95)?;
        holding += f64::from(u8::from((low..=high).contains(&truth)));
        off = off.max((p.value - truth).abs() / matrix.amax());
    }
    let checks = identified.summary().checks.iter().filter(|check| check.is_conspicuous());
    let mut warnings: Vec<String> = checks.map(|check| check.subject.to_string()).collect();
    warnings.sort_unstable();
    warnings.dedup();
    Ok(Run { holding: holding / count, off, warnings })
}

fn main() {
    let runs: u64 = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(100);
    let wanted = std::env::args().nth(2).unwrap_or_default();
    println!("{runs} records of each kind");
    for (test, name) in [(Test::Periods, "8 periods"), (Test::Random, "random")] {
        println!();
        println!(
            "| {name}: fault | intervals that hold (%) | worst parameter off by (%) | any warning (%) | \
             of (%) |"
        );
        println!("|---|---|---|---|---|");
        for (fault, on, what) in faults().iter().map(|(name, on, fault)| (name, *on, fault)) {
            if format!("{name}: {fault}").contains(&wanted) {
                row(fault, runs, |seed| run(test, what.as_ref(), on, seed));
            }
        }
    }
}

fn row(name: &str, runs: u64, run: impl Fn(u64) -> Outcome<Run> + Send + Sync) {
    let all: Vec<Outcome<Run>> = (0..runs).into_par_iter().map(run).collect();
    let (mut counts, mut errors) = (BTreeMap::new(), BTreeMap::new());
    let mut good = Vec::new();
    for one in all {
        match one {
            Ok(run) => good.push(run),
            Err(error) => *errors.entry(error.to_string()).or_insert(0) += 1,
        }
    }
    good.iter().flat_map(|run| &run.warnings).for_each(|of| *counts.entry(of).or_insert(0) += 1);
    let percent = |count: usize| 100.0 * count as f64 / runs as f64;
    let mean = |of: &dyn Fn(&Run) -> f64| good.iter().map(of).sum::<f64>() / good.len() as f64;
    let warned = good.iter().filter(|run| !run.warnings.is_empty()).count();
    let of: Vec<String> =
        counts.iter().map(|(subject, count)| format!("{subject} {:.0}", percent(*count))).collect();
    println!(
        "| {name} | {:.1} | {:.2} | {:.0} | {} |",
        100.0 * mean(&|run| run.holding),
        100.0 * mean(&|run| run.off),
        percent(warned),
        of.join(", ")
    );
    for (error, count) in errors {
        println!("{name}: {count} of {runs} refused: {error}");
    }
}
