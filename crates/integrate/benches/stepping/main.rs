//! Cost of a step: every scheme against hand-written loops, and how it grows with n.
//!
//! Prints a table of ns per step and ratios before criterion's own report.

#![allow(clippy::print_stdout, reason = "a bench reports")]

mod by_hand;

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mechid_integrate::*;
use mechid_model::{InitialState, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

const SAMPLES: usize = 1_000_000;
const SHORT: Duration = Duration::from_millis(500);

fn schemes() -> Vec<(&'static str, Box<dyn Scheme>)> {
    let wilson = WilsonTheta::new(1.4).expect("θ ≥ 1");
    vec![
        ("Newmark", Box::new(Newmark::AVERAGE_ACCELERATION)),
        ("central difference", Box::new(CentralDifference::default())),
        ("Houbolt", Box::new(Houbolt::default())),
        ("Wilson", Box::new(wilson)),
        ("Runge-Kutta, linear", Box::new(RungeKutta4::LINEAR)),
    ]
}

/// A lightly damped chain of `dof` masses, coupled throughout, |λ| up to about 60 rad/s.
fn chain(dof: usize) -> SecondOrderSystem {
    let stiffness = DMatrix::from_fn(dof, dof, |i, j| match i.abs_diff(j) {
        0 => 2000.0,
        1 => -900.0,
        gap => -1.0 / gap as f64,
    });
    SecondOrderSystem::new(DMatrix::identity(dof, dof), &stiffness * 1e-4, stiffness)
        .expect("regular")
}

fn noise(samples: usize, channels: usize) -> Record {
    // A fixed recurrence is enough: the cost of a step does not depend on the values.
    let mut seed = 1_u64;
    let data = DMatrix::from_fn(samples, channels, |_, _| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    });
    Record::new(Sampling::new(1e-3, samples).expect("valid"), data).expect("finite")
}

/// Returns whether every measurement is only to run once, as `cargo test` lets it; criterion looks for the
/// same word.
fn is_tried_only() -> bool {
    !std::env::args().any(|word| word == "--bench")
}

/// Fastest of several runs, in ns per step: what else the machine does only ever adds.
fn ns_per_step<T>(steps: usize, mut run: impl FnMut() -> T) -> f64 {
    let mut once = || {
        let start = Instant::now();
        black_box(run());
        start.elapsed().as_secs_f64()
    };
    let first = once();
    if is_tried_only() {
        return first * 1e9 / steps as f64;
    }
    // About a fifth of a second, at least 5 and at most 1000 runs.
    let runs = (0.2 / first).clamp(5.0, 1000.0) as usize;
    (0..runs).map(|_| once()).fold(first, f64::min) * 1e9 / steps as f64
}

fn ours(scheme: &dyn Scheme, system: &SecondOrderSystem, force: &Record) -> mechid_model::Response {
    integrate(scheme, system, force, &InitialState::rest(system.dof())).expect("stable")
}

fn table(_: &mut Criterion) {
    println!(
        "\nns per step, x, ẋ, ẍ stored, memory allocated within; ratio to the fastest by hand"
    );
    for dof in [1, 2, 3, 10, 30, 100] {
        // Enough of them for the factorisations not to count.
        let samples = if dof <= 2 { SAMPLES } else { (2_000_000 / (dof * dof)).max(4000) };
        let (system, force) = (chain(dof), noise(samples, dof));
        let hand: Vec<(&str, f64)> = by_hand::loops(dof)
            .into_iter()
            .map(|(name, run)| (name, ns_per_step(samples, || run(&system, &force))))
            .collect();
        let fastest = hand.iter().map(|(_, t)| *t).fold(f64::INFINITY, f64::min);
        for (name, time) in &hand {
            println!("n = {dof:<4} by hand: {name:<32} {time:8.2}   {:5.2}", time / fastest);
        }
        for (name, scheme) in schemes() {
            // Preparing, stability check included, is paid once and is not the cost of a step.
            let any = AllowUnstable(scheme.as_ref());
            let time = ns_per_step(samples, || ours(&any, &system, &force));
            // Beyond two degrees of freedom a scheme is held against its own sequence of kernels.
            let own = if name.starts_with("Runge") { hand[1].1 } else { hand[0].1 };
            let against = if dof <= 2 { fastest } else { own };
            println!("n = {dof:<4} {name:<41} {time:8.2}   {:5.2}", time / against);
        }
    }
    for dof in [1, 2, 10, 100] {
        let system = chain(dof);
        for (name, scheme) in schemes() {
            let time = ns_per_step(1, || scheme.prepare(&system, 1e-3).expect("stable"));
            println!("n = {dof:<4} prepare {name:<33} {:8.1} µs", time / 1e3);
        }
    }
    for (dof, samples) in [(1, 256), (1, 100_000), (2, 256), (2, 100_000), (10, 4096), (50, 1024)] {
        let (system, force) = (chain(dof), noise(samples, dof));
        let scheme = AllowUnstable(&Newmark::AVERAGE_ACCELERATION);
        let pass = ns_per_step(samples, || ours(&scheme, &system, &force));
        let all = ns_per_step(samples, || integrate_periodic(&scheme, &system, &force));
        println!("n = {dof:<4} N = {samples:<7} periodic: {:5.2} passes of Newmark", all / pass);
    }
}

fn per_step(c: &mut Criterion) {
    let mut group = c.benchmark_group("step");
    group.sample_size(10).warm_up_time(SHORT).measurement_time(SHORT);
    for (dof, samples) in [(1, SAMPLES), (2, SAMPLES), (10, 20_000), (100, 400)] {
        let (system, force) = (chain(dof), noise(samples, dof));
        group.throughput(Throughput::Elements(samples as u64));
        for (name, scheme) in schemes() {
            group.bench_function(BenchmarkId::new(name, dof), |b| {
                b.iter(|| ours(&AllowUnstable(scheme.as_ref()), &system, black_box(&force)));
            });
        }
        for (name, run) in by_hand::loops(dof) {
            group.bench_function(BenchmarkId::new(format!("by hand, {name}"), dof), |b| {
                b.iter(|| run(&system, black_box(&force)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, table, per_step);
criterion_main!(benches);
