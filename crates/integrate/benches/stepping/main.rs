//! Cost of a step of every scheme, against hand-written loops, for several numbers of degrees of
//! freedom n.
//!
//! Prints ns per step; the last lines are the ratios to the fastest loop written by hand. All
//! compared loops run in turn within one run of the program.

#![allow(clippy::print_stdout, reason = "a bench reports")]

mod by_hand;

use std::hint::black_box;
use std::time::Instant;

use mechid_integrate::*;
use mechid_model::{InitialState, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

const SAMPLES: usize = 1_000_000;

/// Total time of the loops that are compared, in seconds.
const SECONDS: f64 = 4.0;

/// Largest acceptable ratio of the time of a step to that of the fastest loop written by hand.
const GOAL: f64 = 1.2;

fn schemes() -> Vec<(&'static str, Box<dyn Scheme>)> {
    let wilson = WilsonTheta::new(1.4).expect("θ ≥ 1");
    let alpha = GeneralisedAlpha::new(0.8).expect("in range");
    vec![
        ("Newmark", Box::new(Newmark::AVERAGE_ACCELERATION)),
        ("Runge-Kutta, linear", Box::new(RungeKutta4::LINEAR)),
        ("Runge-Kutta, supplied", Box::new(RungeKutta4::SUPPLIED)),
        ("central difference", Box::new(CentralDifference::default())),
        ("Houbolt", Box::new(Houbolt::default())),
        ("Wilson", Box::new(wilson)),
        ("generalised-α", Box::new(alpha)),
        ("Bathe", Box::new(Bathe::HALVES)),
        ("matrix exponential", Box::new(MatrixExponential::LINEAR)),
    ]
}

/// Returns a lightly damped system of `dof` masses. Stiff springs couple neighbouring masses, weak
/// springs couple all other pairs, and the natural frequencies are at most about 60 rad/s.
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

/// Returns whether every measurement runs only once, as in `cargo test`.
fn is_tried_only() -> bool {
    !std::env::args().any(|word| word == "--bench")
}

/// Work that is timed, with its name.
type Timed<'a> = (String, Box<dyn FnMut() + 'a>);

fn timed<'a, T>(name: impl Into<String>, mut run: impl FnMut() -> T + 'a) -> Timed<'a> {
    (name.into(), Box::new(move || drop(black_box(run()))))
}

/// Returns the fastest of several runs of each job, in ns per step. Other load on the computer can
/// only add time, and because the jobs run in turn, it affects all of them.
fn ns_per_step(steps: usize, seconds: f64, jobs: &mut [Timed<'_>]) -> Vec<f64> {
    let mut fastest = vec![f64::INFINITY; jobs.len()];
    let begin = Instant::now();
    for turn in 0..1000 {
        for (fastest, (_, job)) in fastest.iter_mut().zip(&mut *jobs) {
            let start = Instant::now();
            job();
            *fastest = fastest.min(start.elapsed().as_secs_f64());
        }
        if is_tried_only() || turn >= 5 && begin.elapsed().as_secs_f64() > seconds {
            break;
        }
    }
    fastest.into_iter().map(|seconds| seconds * 1e9 / steps as f64).collect()
}

/// One row of the last table.
struct Ratio {
    dof: usize,
    kept: &'static str,
    scheme: &'static str,
    ratio: f64,
}

/// Measures the time of a step for systems of `dof` degrees of freedom that store x, ẋ and ẍ
/// (`ALL`) or only x. Appends the ratios of Newmark and Runge–Kutta to `ratios`.
fn steps<const ALL: bool>(dof: usize, ratios: &mut Vec<Ratio>) {
    let kept = if ALL { "x, ẋ, ẍ" } else { "x alone" };
    // The number of samples is so large that the time of the factorisations does not matter.
    let samples = if dof <= 2 { SAMPLES } else { (2_000_000 / (dof * dof)).max(4000) };
    let samples = if is_tried_only() { samples / 100 } else { samples };
    let (system, force, middle) = (chain(dof), noise(samples, dof), noise(samples, dof));
    let rest = InitialState::rest(dof);
    let (system, force, middle, rest) = (&system, &force, &middle, &rest);
    let schemes = schemes();
    let hand = by_hand::loops::<ALL>(dof);
    let by_hand = hand.len();
    let mut jobs: Vec<Timed<'_>> = hand
        .into_iter()
        .map(|(name, run)| timed(format!("by hand: {name}"), move || run(system, force)))
        .collect();
    for (name, scheme) in &schemes {
        let force = match scheme.inner_instant() {
            None => SampledForce::from(force),
            Some(_) => SampledForce::with_mid_step(force, middle),
        };
        jobs.push(timed(*name, move || {
            // The preparation, stability check included, is done once and is not part of a step.
            let scheme = AllowUnstable(scheme.as_ref());
            match ALL {
                true => Some(integrate(&scheme, system, force, rest).expect("stable")),
                false => {
                    black_box(
                        integrate_displacement(&scheme, system, force, rest).expect("stable"),
                    );
                    None
                }
            }
        }));
    }
    let times = ns_per_step(samples, SECONDS, &mut jobs);
    let fastest = times[..by_hand].iter().copied().fold(f64::INFINITY, f64::min);
    println!(
        "\nn = {dof}, {kept}: ns per step, memory allocated within; ratio to the loop by hand"
    );
    for ((name, _), time) in jobs.iter().zip(&times) {
        // For more than two degrees of freedom, Runge–Kutta schemes are compared with the
        // Runge–Kutta loop, and all other schemes with the Newmark loop.
        let own = times[usize::from(name.contains("Runge"))];
        let ratio = time / if dof <= 2 { fastest } else { own };
        println!("{name:<42} {time:9.2}   {ratio:5.2}");
        let shown = ["Newmark", "Runge-Kutta, linear", "Runge-Kutta, supplied"];
        if let Some(scheme) = shown.into_iter().find(|shown| shown == name) {
            ratios.push(Ratio { dof, kept, scheme, ratio });
        }
    }
}

fn prepare() {
    println!("\nµs to prepare, stability check included");
    for dof in [1, 2, 10, 100] {
        let system = chain(dof);
        for (name, scheme) in schemes() {
            let mut jobs =
                [timed(name, || scheme.prepare(&system, 1e-3).expect("stable").state_len())];
            println!("n = {dof:<4} {name:<33} {:8.1}", ns_per_step(1, 0.1, &mut jobs)[0] / 1e3);
        }
    }
}

fn periodic() {
    println!("\npasses of Newmark that a periodic response takes");
    for (dof, samples) in [(1, 256), (1, 100_000), (2, 256), (2, 100_000), (10, 4096), (50, 1024)] {
        let (system, force) = (chain(dof), noise(samples, dof));
        let rest = InitialState::rest(dof);
        let scheme = AllowUnstable(&Newmark::AVERAGE_ACCELERATION);
        let mut jobs = [
            timed("pass", || integrate(&scheme, &system, &force, &rest)),
            timed("periodic", || integrate_periodic(&scheme, &system, &force)),
        ];
        let times = ns_per_step(samples, SECONDS, &mut jobs);
        println!("n = {dof:<4} N = {samples:<7} {:5.2}", times[1] / times[0]);
    }
}

fn main() {
    let mut ratios = Vec::new();
    prepare();
    periodic();
    for dof in [1, 2, 10, 30, 100] {
        steps::<true>(dof, &mut ratios);
        steps::<false>(dof, &mut ratios);
    }
    println!("\nratio of a step to the fastest loop by hand, goal {GOAL}");
    for Ratio { dof, kept, scheme, ratio } in ratios {
        println!("n = {dof:<4} {kept:<8} {scheme:<22} {ratio:5.2}");
    }
}
