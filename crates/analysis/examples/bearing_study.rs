//! Study of many seeded rig tests of each of fourteen published films: coverage of the 95 %
//! intervals, scatter relative to the Cramér–Rao bound, false alarms of the likelihood-ratio test,
//! and the effect of a baseline that is not subtracted.
//!
//! ```text
//! cargo run --release -p mechid-analysis --example bearing_study -- 1000
//! ```

use std::f64::consts::TAU;

use mechid_analysis::bearing::Coefficients;
use mechid_analysis::{
    BearingData, IdentifiedBearing, IdentifyBearing, Measurement, ResponseQuantity,
    identify_bearing,
};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::output_error;
use mechid_problems::rig::{BearingRig, RigTest, Shakers};
use mechid_signal::{Record, Sampling};
use mechid_spectra::{FrequencyData, Lines, NoiseSpectrum, RepeatedPeriods};
use nalgebra::{DMatrix, Matrix2};
use rayon::prelude::*;

const PERIOD: usize = 256;
const PERIODS: usize = 8;
/// Amplitude of the force on each line, in N.
const AMPLITUDE: f64 = 20.0;
/// Inertia of the fluid, in kg.
const INERTIA: f64 = 3.0;

fn sampling() -> Sampling {
    Sampling::from_rate_hz(1024.0, PERIOD).expect("a positive rate")
}

fn lines() -> Vec<usize> {
    (6..=50).step_by(2).collect()
}

/// Returns K and C of the films of Lund and Thomsen. Their dimensionless coefficients are converted
/// for a journal diameter of 0.1 m, a viscosity of 0.02 Pa·s and 3000 rev/min.
fn films() -> Vec<(String, [Matrix2<f64>; 2])> {
    let table = include_str!("../../bearing/tests/lund_thomsen_1978.csv");
    let row = |line: &str| {
        let (name, numbers) = line.split_once(',').expect("a name first");
        let v: Vec<f64> = numbers.split(',').map(|n| n.parse().expect("a number")).collect();
        let (clearance, speed_hz) = (if v[1] > 0.0 { 200e-6 } else { 100e-6 }, 50.0);
        let load = 0.02 * speed_hz * 0.1 * v[0] * 0.1 * (0.05_f64 / clearance).powi(2) / v[2];
        let k = load / clearance;
        let c = k / (TAU * speed_hz);
        let film =
            [Matrix2::new(v[5], v[6], v[7], v[8]) * k, Matrix2::new(v[9], v[10], v[10], v[11]) * c];
        (format!("{} | {} | {}", name, v[0], v[2]), film)
    };
    table.lines().skip(1).map(row).collect()
}

fn periods(rig: &BearingRig) -> Vec<RigTest> {
    let one = |(shakers, seed)| {
        rig.period(sampling(), &lines(), AMPLITUDE, shakers, seed).expect("lines below Nyquist")
    };
    [(Shakers::X, 1), (Shakers::Y, 2)].map(one).to_vec()
}

fn data(rig: &BearingRig, periods: &[RigTest], seed: u64) -> BearingData {
    let test = |(at, period): (u64, &RigTest)| {
        let test = rig.measured(period, PERIODS, 10 * seed + at).expect("a short record");
        let responses = [
            (ResponseQuantity::Displacement, &test.displacement),
            (ResponseQuantity::Acceleration, &test.acceleration),
        ];
        let test = Measurement::from_records(&test.force, &responses).expect("two columns each");
        test.period(PERIOD).expect("whole periods")
    };
    let tests: Vec<Measurement> = (0..).zip(periods).map(test).collect();
    BearingData::from_records(&tests, &settings(rig, Coefficients::Automatic))
        .expect("tests in x and y")
}

fn settings(rig: &BearingRig, coefficients: Coefficients) -> IdentifyBearing {
    IdentifyBearing {
        stator_mass: rig.stator_mass,
        rotation_hz: Some(rig.rotation_hz),
        coefficients,
        ..IdentifyBearing::default()
    }
}

/// Returns the standard errors of the Cramér–Rao bound for the entries of K, C and M, each matrix
/// row by row.
fn bound(rig: &BearingRig, periods: &[RigTest], count: usize) -> Vec<f64> {
    // The bound excludes the lines at multiples of the rotation frequency, because the
    // identification excludes them, too.
    let kept = lines().into_iter().filter(|line| {
        let turns = *line as f64 * sampling().line_spacing_hz() / rig.rotation_hz;
        (turns - turns.round()).abs() * rig.rotation_hz
            >= sampling().line_spacing_hz() * (1.0 - 1e-6)
            || turns < 0.5
    });
    let lines = Lines::new(sampling(), kept).expect("lines");
    let mean = 1.0 / (PERIODS as f64).sqrt();
    let force = (rig.force_noise.hypot(rig.stator_mass * rig.acceleration_noise)) * mean;
    let noise = NoiseSpectrum::white(
        sampling(),
        lines.as_slice(),
        ResponseQuantity::Displacement,
        &[rig.displacement_noise * mean; 2],
        &[force; 2],
    );
    let noise = noise.expect("variances");
    let one = |test: &RigTest| -> FrequencyData {
        let force = test.force.data() - test.acceleration.data() * rig.stator_mass;
        let force = Record::new(test.force.sampling(), force).expect("finite");
        let kind = ResponseQuantity::Displacement;
        let all = RepeatedPeriods::new(&lines, &force, &test.displacement, kind);
        all.and_then(|all| all.mean()?.with_noise(noise.clone())).expect("one period")
    };
    let all = one(&periods[0]).and(&one(&periods[1])).expect("two tests");
    let unknowns = match count {
        8 => Unknowns::known_mass(&DMatrix::zeros(2, 2)),
        _ => Unknowns::unknown_mass(2),
    };
    let fit = output_error(&all, &unknowns.expect("two degrees of freedom")).expect("exact data");
    let errors: Vec<f64> = fit.estimate.parameters().map(|p| p.standard_error).collect();
    // The errors are in the order M, C, K; the result is in the order K, C, M.
    errors.chunks(4).rev().flatten().copied().collect()
}

/// Results of many tests of one film.
#[derive(Default)]
struct Tally {
    tests: usize,
    intervals: usize,
    held: usize,
    squares: Vec<f64>,
    rejected: usize,
}

impl Tally {
    fn add(mut self, found: &IdentifiedBearing, truth: &[f64]) -> Self {
        self.squares.resize(truth.len(), 0.0);
        self.tests += 1;
        for ((row, exact), square) in
            found.summary().coefficients.iter().zip(truth).zip(&mut self.squares)
        {
            let [low, high] = row.estimate.interval.expect("noise is known");
            self.intervals += 1;
            self.held += usize::from((low..=high).contains(exact));
            *square += (row.estimate.value - exact).powi(2);
        }
        self.rejected += usize::from(found.inertia_test().expect("noise is known").p_value < 0.05);
        self
    }

    fn and(mut self, other: Self) -> Self {
        if self.tests == 0 {
            return other;
        }
        self.tests += other.tests;
        self.intervals += other.intervals;
        self.held += other.held;
        self.rejected += other.rejected;
        self.squares.iter_mut().zip(&other.squares).for_each(|(a, b)| *a += b);
        self
    }

    fn coverage(&self) -> f64 {
        100.0 * self.held as f64 / self.intervals as f64
    }

    /// Returns the ratio of the RMS error to the bound, over all coefficients.
    fn ratio(&self, bound: &[f64]) -> f64 {
        let each = self.squares.iter().zip(bound);
        let mean = each.map(|(s, b)| s / self.tests as f64 / (b * b)).sum::<f64>();
        (mean / bound.len() as f64).sqrt()
    }
}

fn many(runs: u64, run: impl Fn(u64) -> Tally + Sync) -> Tally {
    let all: Vec<Tally> = (0..runs).into_par_iter().map(&run).collect();
    all.into_iter().fold(Tally::default(), Tally::and)
}

fn truth(film: &[Matrix2<f64>; 3], count: usize) -> Vec<f64> {
    let all = film.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>());
    all.take(count).collect()
}

#[allow(clippy::print_stdout, reason = "the table is what the example is for")]
fn main() {
    let runs: u64 = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(100);
    println!(
        "{runs} tests of each film and column, {PERIODS} periods of {PERIOD} samples in x and in y\n"
    );
    println!(
        "| Bearing | L/D | S | coverage of 8, % | over bound | coverage of 12, % | over bound | false alarms, % | found, % | baseline subtracted, % | not subtracted, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut pooled: [Tally; 4] = Default::default();
    let mut worst = [0.0_f64; 2];
    for (row, (name, [k, c])) in (0..).zip(films()) {
        let film = |inertia: f64| [k, c, Matrix2::new(1.0, 0.3, -0.4, 0.8) * inertia];
        let seed = |run: u64| 1_000_000 * row + run;
        let with = |rig: BearingRig, coefficients: Coefficients, count: usize| {
            let tests = periods(&rig);
            let (how, truth) = (settings(&rig, coefficients), truth(&rig.film, count));
            let tally = many(runs, |run| {
                let found = identify_bearing(&data(&rig, &tests, seed(run)), None, &how);
                Tally::default().add(&found.expect("a fit"), &truth)
            });
            let ratio = tally.ratio(&bound(&rig, &tests, count));
            (tally, ratio)
        };
        let (eight, of_eight) = with(BearingRig::new(film(0.0)), Coefficients::Eight, 8);
        let (twelve, of_twelve) = with(BearingRig::new(film(INERTIA)), Coefficients::Twelve, 12);
        let [kb, cb] = [Matrix2::new(6e6, 5e5, 3e5, 5e6), Matrix2::new(2e3, 100.0, 100.0, 1500.0)];
        let rig = BearingRig {
            baseline: [kb, cb, Matrix2::identity() * 0.4],
            ..BearingRig::new(film(INERTIA))
        };
        let dry = rig.dry();
        let (tests, dry_tests) = (periods(&rig), periods(&dry));
        let how = settings(&rig, Coefficients::Twelve);
        let exact = truth(&rig.film, 12);
        let baseline = |subtracted: bool| {
            many(runs, |run| {
                let test = data(&rig, &tests, seed(run));
                let base = subtracted.then(|| data(&dry, &dry_tests, 500_000 + seed(run)));
                let found = identify_bearing(&test, base.as_ref(), &how).expect("a fit");
                Tally::default().add(&found, &exact)
            })
        };
        let (subtracted, left) = (baseline(true), baseline(false));
        let share = |tally: &Tally| 100.0 * tally.rejected as f64 / tally.tests as f64;
        println!(
            "| {name} | {:.1} | {of_eight:.3} | {:.1} | {of_twelve:.3} | {:.1} | {:.1} | {:.1} | {:.1} |",
            eight.coverage(),
            twelve.coverage(),
            share(&eight),
            share(&twelve),
            subtracted.coverage(),
            left.coverage(),
        );
        worst = [worst[0].max(of_eight), worst[1].max(of_twelve)];
        let each = [eight, twelve, subtracted, left];
        for (all, one) in pooled.iter_mut().zip(each) {
            all.intervals += one.intervals;
            all.held += one.held;
            all.tests += one.tests;
            all.rejected += one.rejected;
        }
    }
    let [eight, twelve, subtracted, left] = &pooled;
    println!(
        "| all | | | {:.2} | ≤ {:.3} | {:.2} | ≤ {:.3} | {:.2} | {:.1} | {:.2} | {:.1} |",
        eight.coverage(),
        worst[0],
        twelve.coverage(),
        worst[1],
        100.0 * eight.rejected as f64 / eight.tests as f64,
        100.0 * twelve.rejected as f64 / twelve.tests as f64,
        subtracted.coverage(),
        left.coverage(),
    );
}
