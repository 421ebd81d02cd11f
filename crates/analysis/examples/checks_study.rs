//! Study of how often the checks of an identification warn, on records that the model fits and on
//! records that it does not fit.
//!
//! `cargo run --release -p mechid-analysis --example checks_study -- RUNS [NAME]` prints, for each
//! kind of record, the percentage of `RUNS` seeded records with any warning and with a warning of
//! each subject.

#![allow(clippy::print_stdout, reason = "the table is the result")]

use std::collections::BTreeMap;
use std::error::Error;

use mechid_analysis::identify::{KnownMass, Method, SampleFit, Source};
use mechid_analysis::{Identify, Measurement, ResponseQuantity, identify};
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::{exact_harmonic_periodic, exact_zoh_periodic, random_stable};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

/// Samples per period.
const PERIOD: usize = 128;

/// Highest line of the force.
const LAST: usize = 40;

/// A kind of record, and how it is identified.
struct Case {
    name: &'static str,
    /// Truth about the estimate.
    truth: Truth,
    machine: Machine,
    periods: usize,
    /// Ratio of the RMS of the noise to the RMS of the channel, for the response and for the force.
    noise: [f64; 2],
    how: Identify,
    /// Responses that are measured.
    responses: &'static [ResponseQuantity],
}

/// Truth about an estimate.
enum Truth {
    /// The model fits the record, and the estimator has no noticeable bias.
    Right,
    /// The model fits the record, and noise biases the estimator.
    Biased,
    /// The model does not fit the record.
    Wrong,
}

enum Machine {
    Linear(SecondOrderSystem),
    /// Machine with a second mass, not measured, whose spring has this damping (N·s/m).
    Hidden(f64),
    /// Machine with a cubic spring. The value is the ratio of two RMS values: that of the cubic
    /// spring force to that of the linear spring force.
    Cubic(f64),
    /// The response is late by this number of samples.
    Late(usize),
}

type Outcome<T> = Result<T, Box<dyn Error>>;

fn oscillator(damping_ratio: f64) -> SecondOrderSystem {
    // The natural frequency is exactly that of line 12 of the period.
    let omega = 12.0 * sampling().omega0();
    let (m, k) = (10.0, 10.0 * omega * omega);
    Sdof::new(m, 2.0 * damping_ratio * m * omega, k).expect("positive mass").system()
}

fn sampling() -> Sampling {
    Sampling::new(0.02, PERIOD).expect("positive step")
}

fn with_a_second_mass(damping: f64) -> SecondOrderSystem {
    let of = |a: f64, b: f64, c: f64| DMatrix::from_row_slice(2, 2, &[a, b, b, c]);
    let (m, c, k) =
        (of(10.0, 0.0, 1.0), of(178.0 + damping, -damping, damping), of(9000.0, -1500.0, 1500.0));
    SecondOrderSystem::new(m, c, k).expect("invertible mass")
}

impl Machine {
    fn dof(&self) -> usize {
        match self {
            Machine::Linear(system) => system.dof(),
            _ => 1,
        }
    }

    /// Returns one period of displacement, velocity and acceleration for one period of a force.
    fn responses(&self, force: &Record, held: bool) -> Outcome<[Record; 3]> {
        let of = |system: &SecondOrderSystem, force: &Record| -> Outcome<[Record; 3]> {
            let all = match held {
                true => exact_zoh_periodic(system, force)?,
                false => exact_harmonic_periodic(system, force)?,
            };
            Ok([all.displacement(), all.velocity(), all.acceleration()].map(Clone::clone))
        };
        match self {
            Machine::Linear(system) => of(system, force),
            Machine::Hidden(damping) => {
                let zeros = vec![0.0; force.len()];
                let both = Record::from_channels(force.sampling(), &[force.channel(0), &zeros])?;
                let all = of(&with_a_second_mass(*damping), &both)?;
                let first = |r: &Record| Record::from_channel(r.sampling(), r.channel(0).to_vec());
                let [x, v, a] = &all;
                Ok([first(x)?, first(v)?, first(a)?])
            }
            Machine::Cubic(share) => {
                // The steady state is computed by iteration: each pass subtracts the cubic spring
                // force of the last displacement from the excitation of the linear machine.
                let system = oscillator(0.05);
                let k = system.stiffness()[(0, 0)];
                let linear = of(&system, force)?;
                let power: f64 = linear[0].data().iter().map(|x| x * x).sum();
                let cubed: f64 = linear[0].data().iter().map(|x| x.powi(6)).sum();
                let cubic = share * k * (power / cubed).sqrt();
                let mut all = linear;
                for _ in 0..50 {
                    let restoring = all[0].data().map(|x| cubic * x.powi(3));
                    all = of(&system, &Record::new(force.sampling(), force.data() - restoring)?)?;
                }
                Ok(all)
            }
            Machine::Late(samples) => {
                let later = |r: &Record| {
                    let shifted = |k: usize| r.data()[((k + r.len() - samples) % r.len(), 0)];
                    Record::from_channel(r.sampling(), (0..r.len()).map(shifted).collect())
                };
                let all = of(&oscillator(0.05), force)?;
                let [x, v, a] = &all;
                Ok([later(x)?, later(v)?, later(a)?])
            }
        }
    }
}

impl Case {
    /// Returns the subjects of the warnings.
    fn warnings(&self, seed: u64) -> Outcome<Vec<String>> {
        let dof = self.machine.dof();
        let channel = |channel: usize| -> Outcome<Vec<f64>> {
            let phases = Phases::Random { seed: 1000 * seed + channel as u64 };
            let force = Multisine::flat(1..=LAST, 10.0, phases)?.sample(sampling())?;
            Ok(force.channel(0).to_vec())
        };
        let channels: Vec<Vec<f64>> = (0..dof).map(channel).collect::<Outcome<_>>()?;
        let channels: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
        let force = Record::from_channels(sampling(), &channels)?;
        let held =
            matches!(&self.how.source, Source::Samples(how) if how.between_samples.is_some());
        let noisy = |record: &Record, level: f64, stream: u64| -> Outcome<Record> {
            let all = record.repeated(if held { 1 } else { self.periods })?;
            if level == 0.0 {
                return Ok(all);
            }
            Ok(noise::add_white(&all, NoiseLevel::FractionOfRms(level), 8 * seed + stream)?)
        };
        // If the force is held between the samples, its noise is a part of the force that acts on
        // the machine, but the measured force does not contain it.
        let clean = force.repeated(self.periods)?;
        let noisy_force = noisy(if held { &clean } else { &force }, self.noise[1], 0)?;
        let (exact, force) = match held {
            true => (self.machine.responses(&noisy_force, true)?, clean),
            false => (self.machine.responses(&force, false)?, noisy_force),
        };
        let mut measured = Vec::new();
        for kind in self.responses {
            let at = kind.derivative_order();
            measured.push((*kind, noisy(&exact[at], self.noise[0], 1 + at as u64)?));
        }
        let measured: Vec<_> = measured.iter().map(|(kind, record)| (*kind, record)).collect();
        let test = Measurement::from_records(&force, &measured)?;
        let test =
            if matches!(self.how.source, Source::Samples(_)) { test } else { test.period(PERIOD)? };
        let found = identify(&[test], &self.how)?;
        let warned = found.checks().iter().filter(|check| check.is_conspicuous());
        let mut subjects: Vec<String> = warned.map(|check| check.subject.to_string()).collect();
        subjects.dedup();
        Ok(subjects)
    }

    fn row(&self, runs: u64) -> String {
        let (mut any, mut failed, mut counts) = (0, 0, BTreeMap::<String, u64>::new());
        for seed in 0..runs {
            match self.warnings(seed) {
                Ok(subjects) => {
                    any += u64::from(!subjects.is_empty());
                    subjects.into_iter().for_each(|s| *counts.entry(s).or_default() += 1);
                }
                Err(_) => failed += 1,
            }
        }
        let percent = |count: u64| format!("{:.1}", 100.0 * count as f64 / runs as f64);
        let failures = (failed > 0).then(|| format!("failed {}", percent(failed)));
        let each: Vec<String> = counts
            .iter()
            .map(|(subject, count)| format!("{subject} {}", percent(*count)))
            .chain(failures)
            .collect();
        let kind = match self.truth {
            Truth::Right => "right",
            Truth::Biased => "biased",
            Truth::Wrong => "wrong",
        };
        let each = each.join(", ");
        format!("| {} | {kind} | {} | {each} |", self.name, percent(any))
    }
}

fn cases() -> Vec<Case> {
    const X: &[ResponseQuantity] = &[ResponseQuantity::Displacement];
    const XVA: &[ResponseQuantity] = &[
        ResponseQuantity::Displacement,
        ResponseQuantity::Velocity,
        ResponseQuantity::Acceleration,
    ];
    let [ls, iv, ml] = [Method::LeastSquares, Method::Instrumental, Method::MaximumLikelihood]
        .map(Identify::spectra);
    let case = |name, periods, noise, how: &Identify| Case {
        name,
        truth: Truth::Right,
        machine: Machine::Linear(oscillator(0.05)),
        periods,
        noise,
        how: how.clone(),
        responses: X,
    };
    let two = |name, periods, noise, how: &Identify| Case {
        machine: Machine::Linear(random_stable(2, 5)),
        ..case(name, periods, noise, how)
    };
    let light = |name, noise, how: &Identify| Case {
        machine: Machine::Linear(oscillator(0.001)),
        ..case(name, 4, noise, how)
    };
    let lighter = |name, periods, noise, how: &Identify| Case {
        machine: Machine::Linear(oscillator(0.0001)),
        ..case(name, periods, noise, how)
    };
    let biased = |base: Case| Case { truth: Truth::Biased, ..base };
    let wrong = |machine, base: Case| Case { machine, truth: Truth::Wrong, ..base };
    let half = ml.clone().lines("1:20".parse().expect("lines"));
    let heavy = Identify { mass: KnownMass { values: vec![Some(11.0)] }, ..ml.clone() };
    let samples = Identify::samples();
    let held = SampleFit {
        between_samples: Some(mechid_model::Discretisation::ZeroOrderHold),
        ..SampleFit::default()
    };
    let steps = Identify::from(Source::Samples(held));
    let responses = Identify::responses(Default::default(), Default::default());
    let timed = |name, noise, how: &Identify| Case { responses: XVA, ..case(name, 4, noise, how) };
    vec![
        case("least squares, exact", 4, [0.0, 0.0], &ls),
        case("least squares, noise on force", 4, [0.0, 0.02], &ls),
        two("least squares, noise on force, 2 DOF", 4, [0.0, 0.02], &ls),
        case("instrumental, noise on response", 4, [0.02, 0.0], &iv),
        case("instrumental, noise on both", 4, [0.02, 0.02], &iv),
        two("instrumental, noise on both, 2 DOF", 8, [0.02, 0.02], &iv),
        case("likelihood, noise on response, 1 period", 1, [0.02, 0.0], &ml),
        case("likelihood, noise on response, 2 periods", 2, [0.02, 0.0], &ml),
        case("likelihood, noise on response", 4, [0.02, 0.0], &ml),
        case("likelihood, noise on response, 8 periods", 8, [0.02, 0.0], &ml),
        case("likelihood, noise on force", 4, [0.0, 0.02], &ml),
        case("likelihood, noise on both", 4, [0.02, 0.02], &ml),
        two("likelihood, noise on both, 2 DOF", 4, [0.02, 0.02], &ml),
        two("likelihood, noise on both, 2 DOF, 16 periods", 16, [0.02, 0.02], &ml),
        case("likelihood, half of the lines", 4, [0.02, 0.0], &half),
        lighter("lighter resonance on a line, exact", 1, [0.0, 0.0], &ls),
        lighter("lighter resonance on a line, noise on response", 4, [0.01, 0.0], &ml),
        lighter("lighter resonance on a line, noise on force, ls", 1, [0.0, 0.01], &ls),
        lighter("lighter resonance on a line, noise on force", 4, [0.0, 0.01], &ml),
        lighter("lighter resonance on a line, noise on both", 4, [0.01, 0.01], &ml),
        lighter("lighter resonance on a line, 1 period", 1, [0.01, 0.0], &ml),
        light("resonance on a line, 1 period", [0.01, 0.01], &ml),
        light("resonance on a line, noise on response", [0.02, 0.0], &ml),
        light("resonance on a line, noise on force", [0.0, 0.02], &ml),
        light("resonance on a line, noise on both", [0.02, 0.02], &ml),
        light("resonance on a line, instrumental", [0.002, 0.002], &iv),
        biased(light("resonance on a line, instrumental, much noise", [0.02, 0.02], &iv)),
        case("frequency responses, noise on response", 8, [0.02, 0.0], &responses),
        timed("samples, noise on force", [0.0, 0.02], &samples),
        timed("sample to sample, disturbance", [0.0, 0.02], &steps),
        biased(case("least squares, noise on response 2 %", 4, [0.02, 0.0], &ls)),
        biased(case("least squares, noise on response 10 %", 4, [0.1, 0.0], &ls)),
        wrong(
            Machine::Linear(oscillator(0.05)),
            case("mass wrong by a tenth", 4, [0.02, 0.0], &heavy),
        ),
        wrong(Machine::Hidden(2.0), case("hidden mass, likelihood", 4, [0.02, 0.0], &ml)),
        wrong(Machine::Hidden(20.0), case("damped hidden mass, 1 period", 1, [0.02, 0.0], &ml)),
        wrong(Machine::Hidden(20.0), case("damped hidden mass, 4 periods", 4, [0.02, 0.0], &ml)),
        wrong(
            Machine::Hidden(2.0),
            case("hidden mass, likelihood, noise on both", 4, [0.02, 0.02], &ml),
        ),
        wrong(Machine::Hidden(2.0), case("hidden mass, instrumental", 4, [0.02, 0.02], &iv)),
        wrong(Machine::Hidden(2.0), case("hidden mass, least squares, force", 4, [0.0, 0.02], &ls)),
        wrong(Machine::Hidden(2.0), timed("hidden mass, samples", [0.0, 0.02], &samples)),
        wrong(Machine::Hidden(2.0), timed("hidden mass, sample to sample", [0.0, 0.02], &steps)),
        wrong(Machine::Cubic(0.01), case("cubic spring 1 %", 4, [0.01, 0.0], &ml)),
        wrong(Machine::Cubic(0.03), case("cubic spring 3 %", 4, [0.01, 0.0], &ml)),
        wrong(Machine::Late(1), case("late by a sample", 4, [0.02, 0.0], &ml)),
    ]
}

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let runs: u64 = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let name = arguments.next().unwrap_or_default();
    println!("| Record | Truth | Any warning, % | Each, % |\n|---|---|---|---|");
    for case in cases().iter().filter(|case| case.name.contains(&name)) {
        println!("{}", case.row(runs));
    }
    Ok(())
}
