//! Study of the scatter between parts of the data: do the parts disagree only if the model is
//! wrong, and do intervals that are widened by this scatter contain the true values?
//!
//! ```text
//! cargo run --release -p mechid-analysis --example parts_study -- 200 [NAME]
//! ```
//! The study prints, for each kind of test: the percentage of runs whose intervals are not widened
//! (factor 1), the percentage of runs with any warning, the median factor, the percentages of 95 %
//! intervals of mass, damping and stiffness that contain the true values, and the terms that the
//! checks report as missing.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use mechid_analysis::identify::{HitFit, KnownMass, OpenFit, SegmentFit, Source};
use mechid_analysis::{
    AnalysisError, Identified, Identify, Measurement, ResponseQuantity, identify,
};
use mechid_checks::{Finding, Subject};
use mechid_problems::{FaultyOscillator, HammerTest};
use mechid_signal::{NoiseLevel, Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

const KIND: ResponseQuantity = ResponseQuantity::Displacement;
const SAMPLES: usize = 2048;
const PERIOD: usize = 512;
/// Ratio of the bandwidth of the force to the sampling rate.
const BAND: f64 = 0.35;

/// Kind of test.
#[derive(Debug, Clone, Copy)]
enum Test {
    /// Open records of machines whose masses differ from the nominal mass by these fractions.
    Records(&'static [f64]),
    /// One record with this number of periods.
    Periods(usize),
    /// Twelve hits of a hammer.
    Hits,
    /// Averages over segments of a random record.
    Segments,
    /// A sweep from rest.
    Sweep,
    /// Eight periods of a machine whose damping is structural.
    Structural,
    /// Eight periods of a machine; the fit uses its mass times this factor as a known mass.
    KnownMass(f64),
}

/// Loss factor in place of viscous damping.
const LOSS_FACTOR: f64 = 0.04;

/// Returns force (N) and displacement (m) in the steady state that the periodic `force` causes,
/// computed from the receptance; both have the length of `force`.
fn steady(machine: &FaultyOscillator, force: &Record, loss_factor: Option<f64>) -> [Record; 2] {
    let mut lines = Spectrum::from_record(force).lines().clone();
    for (line, mut value) in lines.row_iter_mut().enumerate() {
        let omega = line as f64 * force.sampling().omega0();
        let damping = loss_factor.map_or(machine.damping * omega, |eta| eta * machine.stiffness);
        let real = machine.stiffness - omega * omega * machine.mass;
        value /= Complex::new(real, damping);
    }
    let response = Spectrum::from_lines(force.sampling(), lines).and_then(|all| all.to_record());
    [force.clone(), response.expect("as long as the force")]
}

/// Returns force and response of a machine that a sweep excites from rest in the first half of the
/// record.
fn sweep(machine: &FaultyOscillator, sampling: Sampling) -> [Record; 2] {
    let long = sampling.with_len(4 * sampling.len()).expect("a longer record");
    let (end, rate) = (0.75 * sampling.len() as f64 * sampling.dt(), 0.3 / sampling.dt());
    let force = |t: f64| match t < end {
        true => 100.0 * (TAU * (5.0 * t + 0.5 * (rate - 5.0) / end * t * t)).sin(),
        false => 0.0,
    };
    let force = Record::from_channel(long, long.times().map(force).collect()).expect("as long");
    let window = |record: Record| {
        Record::from_channel(sampling, record.channel(0)[..sampling.len()].to_vec())
            .expect("a part")
    };
    steady(machine, &force, None).map(window)
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
    let random = |machine: &FaultyOscillator, seed| {
        let both = machine.measure(sampling(SAMPLES), 4 * SAMPLES, SAMPLES, band, seed);
        both.expect("a record")
    };
    let (records, source) = match test {
        Test::Records(masses) => {
            let record = |(at, added): (usize, &f64)| {
                let (machine, seed) = (
                    FaultyOscillator { mass: machine.mass * (1.0 + added), ..*machine },
                    100 * seed + at as u64,
                );
                measured(random(&machine, seed), seed + 50)
            };
            let records = masses.iter().enumerate().map(record).collect::<Result<_, _>>()?;
            (records, Source::Open(OpenFit::default()))
        }
        Test::Periods(count) => {
            let both = machine.measure(sampling(count * PERIOD), PERIOD, 4 * PERIOD, band, seed);
            let record = measured(both.expect("a record"), seed + 50_000)?.period(PERIOD)?;
            (vec![record], Source::default())
        }
        Test::KnownMass(factor) => {
            let both = machine.measure(sampling(8 * PERIOD), PERIOD, 4 * PERIOD, band, seed);
            let record = measured(both.expect("a record"), seed + 50_000)?.period(PERIOD)?;
            let mass = KnownMass { values: vec![Some(factor * machine.mass)] };
            return identify(&[record], &Identify { mass, ..Identify::default() });
        }
        Test::Segments => {
            let both = machine.measure(sampling(4 * SAMPLES), 16 * SAMPLES, SAMPLES, band, seed);
            let record = measured(both.expect("a record"), seed + 50_000)?;
            let source = Source::Segments(SegmentFit::default());
            return identify(&[record], &Identify::from(source));
        }
        Test::Sweep => {
            let record = measured(sweep(machine, sampling(SAMPLES)), seed + 50_000)?;
            (vec![record], Source::Open(OpenFit::default()))
        }
        Test::Structural => {
            let linear = FaultyOscillator::linear();
            let [force, _] =
                linear.measure(sampling(PERIOD), PERIOD, 0, band, seed).expect("a record");
            let one = steady(machine, &force, Some(LOSS_FACTOR));
            let eight = one.map(|record| {
                let values: Vec<f64> =
                    record.channel(0).iter().copied().cycle().take(8 * PERIOD).collect();
                Record::from_channel(sampling(8 * PERIOD), values).expect("as long")
            });
            let record = measured(eight, seed + 50_000)?.period(PERIOD)?;
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
    // The band is far below the natural frequency of the hidden mass on its spring, so this mass
    // moves with the machine.
    let mass = machine.mass + machine.hidden_mass;
    let truth = [("m", mass), ("c", machine.damping), ("k", machine.stiffness)];
    let is_estimated =
        |name: &str| all.first().is_some_and(|f| f.estimate().parameter(name).is_ok());
    let cells = truth.into_iter().filter(|(name, _)| is_estimated(name)).map(|(name, value)| {
        let of = |found: &Identified| found.estimate().parameter(name).expect("a parameter");
        let share = percent(&|found| {
            let [low, high] = of(found).interval(0.95).expect("a level");
            (low..=high).contains(&value)
        });
        format!("{name} {share:5.1}")
    });
    println!(
        "{name:<34} | {} runs | factor 1: {:5.1} % | warned: {:5.1} % | median factor {:6.2} | {}",
        all.len(),
        percent(&|found| scale(found) == 1.0),
        percent(&|found| found.checks().iter().any(|check| check.is_conspicuous())),
        factors.get(all.len() / 2).copied().unwrap_or(f64::NAN),
        cells.collect::<Vec<_>>().join(" | ")
    );
    let mut terms: BTreeMap<String, usize> = BTreeMap::new();
    let named = all.iter().flat_map(|found| found.checks()).filter(|check| check.is_conspicuous());
    for check in named {
        if let Finding::TermLeftOut(left_out) = &check.finding {
            *terms.entry(format!("{:?}", left_out.term)).or_default() += 1;
        }
    }
    println!("    {terms:?}");
    let wide = all.first().map(|found| {
        let each = found.estimate().parameters();
        each.map(|p| p.to_string()).collect::<Vec<_>>().join(", ")
    });
    println!("    {}", wide.unwrap_or_default());
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
        ("right: sweep", Test::Sweep, right, BAND),
        ("right: segments", Test::Segments, right, BAND),
        ("structural damping, periods", Test::Structural, right, BAND),
        ("right: known mass, periods", Test::KnownMass(1.0), right, BAND),
        ("known mass 2 % too large, periods", Test::KnownMass(1.02), right, BAND),
        ("stiffness drifts by 1 %, segments", Test::Segments, drifts, BAND),
        ("hardening, segments", Test::Segments, hardens, BAND),
        ("mode above the band, segments", Test::Segments, hides, 0.09),
    ];
    for (name, test, machine, band) in rows {
        if name.contains(&wanted) {
            row(name, test, &machine, band, runs);
        }
    }
}
