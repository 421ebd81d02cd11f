//! Cost of a step and of its preparation for many degrees of freedom and for nonlinear forces.
//!
//! Prints times. The last lines are ratios of times: a chain against a loop written by hand,
//! nonlinear steps against linear steps, and SciPy against this crate if `MECHID_BENCH_PYTHON`
//! names a Python interpreter with SciPy.

#![allow(clippy::print_stdout, reason = "a bench reports")]

use std::hint::black_box;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::Instant;

use mechid_integrate::*;
use mechid_model::{InitialState, SecondOrderSystem, SparseSystem, band, triplets};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;
use nalgebra_sparse::csr::CsrMatrix;

const DT: f64 = 1e-3;

/// Returns whether every measurement runs only once, as in `cargo test`.
fn is_tried_only() -> bool {
    !std::env::args().any(|word| word == "--bench")
}

/// Work that is timed.
type Job<'a> = Box<dyn FnMut() + 'a>;

fn job<'a, T>(mut run: impl FnMut() -> T + 'a) -> Job<'a> {
    Box::new(move || drop(black_box(run())))
}

/// Returns the shortest of several runs of each job, in seconds. Other load on the computer can
/// only add time, and because the jobs run in turn, it affects all of them.
fn seconds<const N: usize>(mut jobs: [Job<'_>; N]) -> [f64; N] {
    let mut fastest = [f64::INFINITY; N];
    let begin = Instant::now();
    for turn in 0..200 {
        for (fastest, job) in fastest.iter_mut().zip(&mut jobs) {
            let start = Instant::now();
            job();
            *fastest = fastest.min(start.elapsed().as_secs_f64());
        }
        if is_tried_only() || turn >= 2 && begin.elapsed().as_secs_f64() > 3.0 {
            break;
        }
    }
    fastest
}

/// Ratio that is printed at the end, and its required value.
struct Ratio {
    what: String,
    ratio: f64,
    goal: &'static str,
}

fn damped(stiffness: CsrMatrix<f64>) -> SparseSystem {
    let mass = band(stiffness.nrows(), &[(0, 1.0)]);
    SparseSystem::new(mass, &stiffness * 1e-4, stiffness).expect("regular")
}

fn chain(n: usize) -> SparseSystem {
    damped(band(n, &[(-1, -900.0), (0, 2000.0), (1, -900.0)]))
}

/// Returns a grid of masses; if `skew`, its stiffness matrix has unsymmetric cross-coupling, like
/// that of seals.
fn grid(side: usize, skew: bool) -> SparseSystem {
    let across = if skew { 90.0 } else { 0.0 };
    let at = |i: usize, j: usize| i * side + j;
    let mut entries = vec![];
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        entries.push((at(i, j), at(i, j), 3800.0));
        let neighbours =
            [(i + 1 < side).then(|| at(i + 1, j)), (j + 1 < side).then(|| at(i, j + 1))];
        for next in neighbours.into_iter().flatten() {
            entries.extend([(at(i, j), next, -900.0 - across), (next, at(i, j), -900.0 + across)]);
        }
    }
    damped(triplets(side * side, entries).expect("inside"))
}

fn force(steps: usize) -> Record {
    let values = (0..=steps).map(|k| (k as f64).sin()).collect();
    Record::from_channel(Sampling::new(DT, steps + 1).expect("valid"), values).expect("finite")
}

/// Runs Newmark's method on a chain, written by hand: three products, Thomas' algorithm, two sums.
fn by_hand(n: usize, steps: usize) -> Vec<[f64; 2]> {
    let (h, q) = (0.5 * DT, 0.25 * DT * DT);
    let (off, diagonal) = (-900.0, 2000.0);
    let scale = 1e-4 * h + q;
    let (m_off, m_diagonal) = (scale * off, 1.0 + scale * diagonal);
    let mut factor = vec![0.0; n];
    let mut pivot = vec![m_diagonal; n];
    for i in 1..n {
        factor[i] = m_off / pivot[i - 1];
        pivot[i] = m_diagonal - factor[i] * m_off;
    }
    let reciprocal: Vec<f64> = pivot.iter().map(|p| 1.0 / p).collect();
    let [mut x, mut v, mut a, mut r] = [(); 4].map(|()| vec![0.0; n]);
    let mut kept = Vec::with_capacity(steps);
    for k in 0..steps {
        for i in 0..n {
            x[i] += DT * v[i] + q * a[i];
            v[i] += h * a[i];
        }
        for i in 0..n {
            let product = |y: &[f64]| {
                let below = if i > 0 { y[i - 1] } else { 0.0 };
                let above = if i + 1 < n { y[i + 1] } else { 0.0 };
                off * (below + above) + diagonal * y[i]
            };
            r[i] = -1e-4 * product(&v) - product(&x);
        }
        r[0] += ((k + 1) as f64).sin();
        for i in 1..n {
            r[i] -= factor[i] * r[i - 1];
        }
        a[n - 1] = r[n - 1] * reciprocal[n - 1];
        for i in (0..n - 1).rev() {
            a[i] = (r[i] - m_off * a[i + 1]) * reciprocal[i];
        }
        for i in 0..n {
            x[i] += q * a[i];
            v[i] += h * a[i];
        }
        kept.push([x[0], x[n - 1]]);
    }
    kept
}

/// Returns the times of SciPy for the factorisation and for a step, in seconds.
fn scipy(kind: &str, size: usize, steps: usize) -> Option<[f64; 2]> {
    let python = std::env::var("MECHID_BENCH_PYTHON").ok()?;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/scale/scipy_steps.py");
    let mut child = Command::new(python)
        .arg(script)
        .env("OMP_NUM_THREADS", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    writeln!(child.stdin.take()?, "{kind} {size} {steps}").ok()?;
    let answer = child.wait_with_output().ok()?.stdout;
    let mut numbers = std::str::from_utf8(&answer).ok()?.split_whitespace().map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}

fn ours(system: &dyn System, force: &Record, dofs: SelectedDofs<'_>) -> mechid_model::Response {
    let rest = InitialState::rest(system.dof());
    let scheme = Newmark::AVERAGE_ACCELERATION;
    integrate_selected(&AllowUnstable(&scheme), system, dofs, force, &rest).expect("stable")
}

/// Returns the time of one step of each system, in seconds, from a long record and a short one.
fn per_step<const N: usize>(
    systems: [&dyn System; N],
    steps: usize,
    dofs: SelectedDofs<'_>,
) -> [f64; N] {
    let (short, long) = (force(1), force(steps + 1));
    let begin = seconds(systems.map(|system| job(|| ours(system, &short, dofs))));
    let end = seconds(systems.map(|system| job(|| ours(system, &long, dofs))));
    std::array::from_fn(|k| (end[k] - begin[k]) / steps as f64)
}

fn sparse(ratios: &mut Vec<Ratio>) {
    println!(
        "Newmark, force at one degree of freedom, response at two: µs per step, ms to prepare"
    );
    let scale = if is_tried_only() { 100 } else { 1 };
    for (kind, size, steps) in [
        ("chain", 1_000, 2_000),
        ("chain", 10_000, 500),
        ("chain", 100_000, 60),
        ("grid", 100, 100),
        ("skew-grid", 100, 100),
    ] {
        let (size, steps) = ((size / scale).max(10), (steps / scale).max(3));
        let system = match kind {
            "chain" => chain(size),
            _ => grid(size, kind == "skew-grid"),
        };
        let n = system.dof();
        let dofs = SelectedDofs { forced: &[0], observed: &[0, n - 1] };
        let scheme = Newmark::AVERAGE_ACCELERATION;
        let name = format!("{kind} of {n}");
        let (short, long) = (force(1), force(steps + 1));
        let [begin, end, prepare, hand] = seconds([
            job(|| ours(&system, &short, dofs)),
            job(|| ours(&system, &long, dofs)),
            job(|| scheme.prepare(&system, DT).expect("stable")),
            // The loop by hand is for chains only; for a grid its time is not printed.
            job(|| by_hand(n, if kind == "chain" { steps } else { 1 })),
        ]);
        let (step, hand) = ((end - begin) / steps as f64, hand / steps as f64);
        println!("{name:<16} mechid      {:10.2} µs {:9.2} ms", 1e6 * step, 1e3 * prepare);
        if kind == "chain" {
            println!("{name:<16} by hand     {:10.2} µs", 1e6 * hand);
            ratios.push(Ratio {
                what: format!("{name}: our step over that by hand"),
                ratio: step / hand,
                goal: "",
            });
        }
        if let Some([factored, theirs]) = scipy(kind, size, steps) {
            println!("{name:<16} SciPy       {:10.2} µs {:9.2} ms", 1e6 * theirs, 1e3 * factored);
            ratios.push(Ratio {
                what: format!("{name}: SciPy's step over ours"),
                ratio: theirs / step,
                goal: if kind == "chain" { "5 at least" } else { "2 at least" },
            });
            ratios.push(Ratio {
                what: format!("{name}: preparation over SciPy's factorisation and 100 steps"),
                ratio: prepare / (factored + 100.0 * theirs),
                goal: "1 at most",
            });
        }
    }
}

/// Euler–Bernoulli beams in two planes, coupled by gyroscopic terms: `n` degrees of freedom, 4 for
/// each node.
fn rotor(n: usize) -> SparseSystem {
    let nodes = n / 4;
    let (length, stiff, heavy) = (0.1, 2e3, 0.5);
    let element = [
        [12.0, 6.0 * length, -12.0, 6.0 * length],
        [6.0 * length, 4.0 * length * length, -6.0 * length, 2.0 * length * length],
        [-12.0, -6.0 * length, 12.0, -6.0 * length],
        [6.0 * length, 2.0 * length * length, -6.0 * length, 4.0 * length * length],
    ];
    let mut k = vec![];
    for node in 0..nodes - 1 {
        for plane in 0..2 {
            let dof = |local: usize| 4 * (node + local / 2) + 2 * plane + local % 2;
            for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                k.push((dof(i), dof(j), stiff * element[i][j]));
            }
        }
    }
    let (mut m, mut c) = (vec![], vec![]);
    for node in 0..nodes {
        for plane in 0..2 {
            let at = 4 * node + 2 * plane;
            m.extend([(at, at, heavy), (at + 1, at + 1, 1e-3 * heavy)]);
            c.extend([(at, at, 0.5), (at + 1, at + 1, 1e-3)]);
            k.push((at, at, 200.0));
        }
        let (first, second) = (4 * node + 1, 4 * node + 3);
        c.extend([(first, second, 0.01), (second, first, -0.01)]);
    }
    let [m, c, k] = [m, c, k].map(|entries| triplets(4 * nodes, entries).expect("inside"));
    SparseSystem::new(m, c, k).expect("regular")
}

/// Runs Newmark's method on Duffing's oscillator, written by hand: Newton's method solves for the
/// acceleration, with the tangent, until the equation holds to twelve digits.
fn duffing_by_hand([m, c, k, cubic]: [f64; 4], force: &[f64]) -> [Vec<f64>; 3] {
    let (h, q) = (0.5 * DT, 0.25 * DT * DT);
    let [mut xs, mut vs, mut accelerations] = [(); 3].map(|()| vec![0.0; force.len()]);
    let (mut x, mut v, mut a) = (0.0, 0.0, force[0] / m);
    accelerations[0] = a;
    for i in 1..force.len() {
        let (x_hat, v_hat) = (x + DT * v + q * a, v + h * a);
        for _ in 0..20 {
            (x, v) = (x_hat + q * a, v_hat + h * a);
            let left = force[i] - m * a - c * v - k * x - cubic * x * x * x;
            if left.abs() <= 1e-12 * m * a.abs() {
                break;
            }
            a += left / (m + h * c + q * (k + 3.0 * cubic * x * x));
        }
        (xs[i], vs[i], accelerations[i]) = (x, v, a);
    }
    [xs, vs, accelerations]
}

fn nonlinear(ratios: &mut Vec<Ratio>) {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    let linear = SecondOrderSystem::new(one(1.0), one(0.2), one(400.0)).expect("regular");
    let cubic = TermForces::new(&"k3: x1^3".parse().expect("a term"), &[1e5]).expect("finite");
    let duffing = SystemWithForces::new(&linear).with(cubic).expect("inside");
    let steps = if is_tried_only() { 100 } else { 200_000 };
    let (force_1, rest) = (force(steps), InitialState::rest(1));
    println!("\nns per step, linear and with nonlinear forces");
    let schemes: [(&str, Box<dyn Scheme>); 4] = [
        ("Newmark", Box::new(Newmark::AVERAGE_ACCELERATION)),
        ("generalised-α", Box::new(GeneralisedAlpha::new(0.8).expect("in range"))),
        ("Bathe", Box::new(Bathe::HALVES)),
        ("Runge-Kutta", Box::new(RungeKutta4::LINEAR)),
    ];
    for (name, scheme) in &schemes {
        let once = |system: &dyn System| {
            integrate(scheme.as_ref(), system, &force_1, &rest).expect("solved")
        };
        let by_hand = || duffing_by_hand([1.0, 0.2, 400.0, 1e5], force_1.channel(0));
        let times = seconds([job(|| once(&linear)), job(|| once(&duffing)), job(by_hand)]);
        let [plain, hard, hand] = times.map(|seconds| 1e9 * seconds / steps as f64);
        println!("Duffing, {name:<16} {plain:8.1} {hard:8.1}   Newmark by hand {hand:8.1}");
        ratios.push(Ratio {
            what: format!("Duffing, {name}: nonlinear step over linear"),
            ratio: hard / plain,
            goal: "3 at most",
        });
        ratios.push(Ratio {
            what: format!("Duffing, {name}: nonlinear step over Newmark by hand"),
            ratio: hard / hand,
            goal: "",
        });
    }
    let shaft = rotor(200);
    let film = ForceFunction::new(vec![4, 6], |_, x, v, g| {
        let gap = 1.0 - 1e6 * (x[0] * x[0] + x[1] * x[1]).min(0.9e-6);
        let stiff = 50.0 / (gap * gap);
        g[0] = stiff * (x[0] + 0.5 * x[1]) + 2.0 * v[0] / gap;
        g[1] = stiff * (x[1] - 0.5 * x[0]) + 2.0 * v[1] / gap;
    });
    let floating = SystemWithForces::new(&shaft).with(film).expect("inside");
    let dofs = SelectedDofs { forced: &[100], observed: &[4, 6] };
    let steps = if is_tried_only() { 10 } else { 20_000 };
    let times = per_step([&shaft as &dyn System, &floating], steps, dofs);
    let [plain, hard] = times.map(|seconds| 1e9 * seconds);
    println!("a film on a rotor of 200, Newmark {plain:8.1} {hard:8.1}");
    ratios.push(Ratio {
        what: "a film on a rotor of 200: nonlinear step over linear".into(),
        ratio: hard / plain,
        goal: "1.5 at most",
    });
}

fn main() {
    let mut ratios = Vec::new();
    sparse(&mut ratios);
    nonlinear(&mut ratios);
    println!("\nratios and their goals");
    for Ratio { what, ratio, goal } in ratios {
        println!("{what:<70} {ratio:7.2}   {goal}");
    }
}
