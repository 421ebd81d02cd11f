//! Time of the identification of the bearing in the frequency domain, from its records. The last
//! lines of the output show the time of the search for machines with many degrees of freedom.

#![allow(clippy::print_stdout, reason = "the last lines are the result")]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/suite/common/mod.rs"]
mod common;

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{equation_error, output_error};
use mechid_model::ResponseQuantity;
use mechid_problems::machines::{self, Support};
use mechid_signal::{NoiseLevel, Sampling, Spectrum, noise};
use mechid_spectra::{FrequencyData, Lines, Pooling, RepeatedPeriods};

use common::monte_carlo::{Estimator, Experiment};
use common::{bearing, displacements, forces, synthesise};

/// Times the identification of C and K, with their covariance, from 1,024 samples of two forces and
/// two displacements.
fn identify(c: &mut Criterion) {
    let system = bearing();
    let sampling = Sampling::new(0.05, 1024).unwrap();
    let mut group = c.benchmark_group("bearing from 1024 samples");
    group.sample_size(30);
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    for count in [64, 256] {
        let chosen: Vec<usize> = (1..=count).collect();
        let lines = Lines::new(sampling, chosen.clone()).unwrap();
        let amplitudes = forces(&chosen, 2, 1.0);
        let motion = displacements(&system, &lines.omega(), &amplitudes);
        let force = synthesise(sampling, &chosen, &amplitudes, ResponseQuantity::Displacement);
        let motion = synthesise(sampling, &chosen, &motion, ResponseQuantity::Displacement);
        let read = |lines: &Lines| {
            FrequencyData::read(lines, &force, &motion, ResponseQuantity::Displacement).unwrap()
        };
        group.bench_function(format!("{count} lines, everything included"), |b| {
            b.iter(|| {
                let lines = Lines::new(sampling, black_box(&chosen).iter().copied()).unwrap();
                equation_error(&read(&lines), &unknowns).unwrap()
            })
        });
        group.bench_function(format!("{count} lines, transform planned before"), |b| {
            b.iter(|| equation_error(&read(black_box(&lines)), &unknowns).unwrap())
        });
        let data = read(&lines);
        group.bench_function(format!("{count} lines, from amplitudes"), |b| {
            b.iter(|| equation_error(black_box(&data), &unknowns).unwrap())
        });
        // The Fourier transforms alone are the reference.
        group.bench_function(format!("{count} lines, four transforms alone"), |b| {
            b.iter(|| {
                (
                    Spectrum::from_record(black_box(&force)),
                    Spectrum::from_record(black_box(&motion)),
                )
            })
        });
    }
    group.finish();
}

/// Times each estimator: one estimate of the bearing from 16 noisy periods of 256 samples, 127
/// lines.
fn estimators(c: &mut Criterion) {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let experiment = Experiment::new(system, unknowns, 16, 0.01);
    let periods = experiment.measure(1);
    let mut group = c.benchmark_group("bearing from 16 periods");
    group.sample_size(20);
    group.bench_function("measure", |b| b.iter(|| experiment.measure(black_box(1))));
    for estimator in
        [Estimator::LeastSquares, Estimator::InstrumentalVariables, Estimator::MaximumLikelihood]
    {
        group.bench_function(format!("{estimator:?}"), |b| {
            b.iter(|| experiment.estimate(black_box(&periods), estimator))
        });
    }
    group.finish();
}

/// Times the maximum-likelihood search for all entries of M, C and K, from 4 periods of a fixed
/// chain with a force on every mass.
fn many_degrees_of_freedom(_: &mut Criterion) {
    const LINES: usize = 500;
    let mut before: Option<(usize, f64)> = None;
    for (dof, goal) in [(2, ""), (5, ""), (10, ", 2 s at most"), (20, ", 20 s at most")] {
        let system = machines::chain(dof, Support::Fixed, 0.02, 1);
        let test = machines::steady_test("held chain", system, false, LINES, 1).unwrap();
        let response = machines::repeated(&test.displacement, 4).unwrap();
        let response = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), 1).unwrap();
        let force = machines::repeated(&test.force, 4).unwrap();
        let lines = Lines::new(test.force.sampling(), test.lines.iter().copied()).unwrap();
        let quantity = ResponseQuantity::Displacement;
        let periods = RepeatedPeriods::new(&lines, &force, &response, quantity).unwrap();
        let data = periods.mean_with_noise(Pooling::AllLines).unwrap();
        let unknowns = Unknowns::unknown_mass(dof).unwrap();
        let seconds = (0..3).map(|_| {
            let start = Instant::now();
            black_box(output_error(&data, &unknowns).unwrap());
            start.elapsed().as_secs_f64()
        });
        let seconds = seconds.fold(f64::INFINITY, f64::min);
        let slope = before.map_or(String::new(), |(m, then)| {
            let slope = (seconds / then).ln() / (dof as f64 / m as f64).ln();
            format!(", grows as n^{slope:.1}")
        });
        println!("maximum likelihood of {dof} degrees of freedom: {seconds:.3} s{slope}{goal}");
        before = Some((dof, seconds));
    }
}

criterion_group!(benches, identify, estimators, many_degrees_of_freedom);
criterion_main!(benches);
