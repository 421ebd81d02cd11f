//! Hundreds of noisy experiments on nonlinear systems of known truth.
//!
//! `MECHID_RUNS=1000` repeats the studies with 1000 runs; without this variable, each study has
//! fewer runs.

use mechid_estimate::Unknowns;
use mechid_model::{Matrix, ResponseQuantity, Terms};
use mechid_nonlinear::{
    Criterion, EquationErrorOptions, NonlinearEstimate, SteadyExperiments, SteppedRecord,
    Weighting, distortion, equation_error, output_error, select_terms,
};
use mechid_signal::{Extent, NoiseLevel, Record, Sampling, noise};
use mechid_spectra::Lines;
use rayon::prelude::*;

use crate::stepped::{random_phases, steady};

const LEN: usize = 1024;
const PERIODS: usize = 4;
const DISPLACEMENT: ResponseQuantity = ResponseQuantity::Displacement;

fn sampling() -> Sampling {
    // Line 100 is at 1 rad/s.
    Sampling::new(std::f64::consts::TAU * 100.0 / LEN as f64, LEN).unwrap()
}

pub fn runs(in_suite: u64) -> u64 {
    std::env::var("MECHID_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(in_suite)
}

/// Returns force and displacement of the steady motion ẍ + 0.16 ẋ + x + k₃ x³ = F. The force has
/// odd lines up to 201; x is about 1.
fn duffing(cubic: f64) -> (Record, Record) {
    let force = random_phases((1..=201).step_by(2), 0.06, 3);
    steady(sampling(), &[force], |x, v, f| [f[0] - 0.16 * v[0] - x[0] - cubic * x[0].powi(3)])
}

/// Returns forces and displacements of two masses of 1 and 1.5 that have springs to the ground, and
/// a linear and a cubic spring between the two masses.
fn coupled() -> (Record, Record) {
    let force = [5, 6].map(|seed| random_phases((1..=201).step_by(2), 0.06, seed));
    steady(sampling(), &force, |x, v, f| {
        let (dx, dv) = (x[0] - x[1], v[0] - v[1]);
        let between = 0.5 * dx + 0.06 * dv + 0.4 * dx.powi(3);
        [
            f[0] - 0.12 * v[0] - 0.7 * x[0] - between,
            (f[1] - 0.15 * v[1] - 1.2 * x[1] + between) / 1.5,
        ]
    })
}

/// Returns periods with white noise on force and response, in fractions of their RMS values.
fn noisy((force, response): &(Record, Record), level: f64, seed: u64) -> (Record, Record) {
    let with = |record: &Record, seed: u64| {
        let level = NoiseLevel::FractionOfRms(level);
        noise::add_white(&record.repeated(PERIODS).unwrap(), level, seed).unwrap()
    };
    (with(force, 2 * seed), with(response, 2 * seed + 1))
}

fn steady_data(force: &Record, response: &Record, last: usize) -> SteadyExperiments {
    let lines = Lines::new(sampling(), 1..=last).unwrap();
    let mut data = SteadyExperiments::new(&lines, force.channels(), DISPLACEMENT);
    data.push(force, response).unwrap();
    data
}

/// Returns the output-error fit to the mean period; the search starts from the equation-error
/// estimate.
fn identify(
    (force, response): &(Record, Record),
    unknowns: &Unknowns,
    terms: &Terms,
) -> NonlinearEstimate {
    let data = steady_data(force, response, 201);
    let options = EquationErrorOptions::default();
    let start = equation_error(&data, unknowns, terms, &options).unwrap();
    let (force, response) = (force.clone(), response.clone());
    let record = SteppedRecord { force, response, extent: Extent::WholePeriod, periods: PERIODS };
    let found = output_error(&[record], DISPLACEMENT, &start).unwrap().estimate;
    // An estimated initial state depends only on the first block; this does not affect the
    // intervals of the other parameters.
    let freedom = found.linear().degrees_of_freedom();
    assert!(freedom >= 5, "{freedom} degrees of freedom, {:?}", found.standard_errors());
    found
}

/// Returns for each parameter: the name, the coverage of the 95 % interval, the bias, and the
/// stated standard error. Bias and standard error are divided by the standard deviation of the
/// estimates.
pub fn judge(found: &[NonlinearEstimate], truth: &[(&str, f64)]) -> Vec<(String, f64, f64, f64)> {
    let runs = found.len() as f64;
    truth
        .iter()
        .map(|(name, truth)| {
            let all: Vec<_> = found.iter().map(|f| f.parameter(name).unwrap().estimate).collect();
            let mean = all.iter().map(|p| p.value).sum::<f64>() / runs;
            let square = all.iter().map(|p| (p.value - mean).powi(2)).sum::<f64>();
            let deviation = (square / (runs - 1.0)).sqrt();
            let inside = |p: &&mechid_numerics::Uncertain| {
                let [low, high] = p.interval(0.95).unwrap();
                low <= *truth && *truth <= high
            };
            let coverage = all.iter().filter(inside).count() as f64 / runs;
            let stated = (all.iter().map(|p| p.standard_error.powi(2)).sum::<f64>() / runs).sqrt();
            ((*name).to_owned(), coverage, (mean - truth) / deviation, stated / deviation)
        })
        .collect()
}

#[track_caller]
pub fn assert_honest(judged: &[(String, f64, f64, f64)], runs: u64) {
    // The limits allow for three standard deviations of the coverage, and of the bias.
    let slack = 3.0 * (0.05 * 0.95 / runs as f64).sqrt();
    for (name, coverage, bias, stated) in judged {
        let told = format!("{name}: {coverage:.3}, bias {bias:.3} σ, stated {stated:.3} σ");
        assert!((0.95 - slack.max(0.02)..=0.95 + slack.max(0.02)).contains(coverage), "{told}");
        assert!(bias.abs() < 0.1 + 3.0 / (runs as f64).sqrt(), "{told}");
    }
}

#[test]
#[allow(clippy::print_stderr, reason = "the study by hand is read")]
fn intervals_of_a_duffing_oscillator_hold() {
    let (clean, runs) = (duffing(0.3), runs(30));
    let (unknowns, terms) = (Unknowns::unknown_mass(1).unwrap(), "k3: x^3".parse().unwrap());
    let found: Vec<_> = (0..runs)
        .into_par_iter()
        .map(|seed| identify(&noisy(&clean, 0.01, seed), &unknowns, &terms))
        .collect();
    let judged = judge(&found, &[("m", 1.0), ("c", 0.16), ("k", 1.0), ("k3", 0.3)]);
    eprintln!("{runs} runs: {judged:.3?}");
    assert_honest(&judged, runs);
}

#[test]
#[allow(clippy::print_stderr, reason = "the study by hand is read")]
fn intervals_of_a_cubic_spring_between_two_masses_hold() {
    let (clean, runs) = (coupled(), runs(24));
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let unknowns = [(0, 1), (1, 0)]
        .into_iter()
        .try_fold(unknowns, |u, (row, column)| u.fix(Matrix::Mass, row, column, 0.0))
        .unwrap();
    let terms = "kc: (x1-x2)^3".parse().unwrap();
    let found: Vec<_> = (0..runs)
        .into_par_iter()
        .map(|seed| identify(&noisy(&clean, 0.01, 5000 + seed), &unknowns, &terms))
        .collect();
    let truth = [
        ("m11", 1.0),
        ("m22", 1.5),
        ("c11", 0.18),
        ("c12", -0.06),
        ("c22", 0.21),
        ("k11", 1.2),
        ("k12", -0.5),
        ("k21", -0.5),
        ("k22", 1.7),
        ("kc", 0.4),
    ];
    let judged = judge(&found, &truth);
    eprintln!("{runs} runs: {judged:.3?}");
    assert_honest(&judged, runs);
}

#[test]
#[allow(clippy::print_stderr, reason = "the study by hand is read")]
fn terms_that_are_not_there_are_not_selected() {
    let (clean, runs) = (duffing(0.3), runs(40));
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let candidates: Terms =
        "k2: x^2, k3: x^3, k5: x^5, c2: |v| v, c3: v^3, cx: x^2 v".parse().unwrap();
    let wrong: Vec<String> = (0..runs)
        .into_par_iter()
        .filter_map(|seed| {
            let (force, response) = noisy(&clean, 0.01, 9000 + seed);
            let data = steady_data(&force, &response, 201);
            let (given, weighting) = (Terms::none(), Weighting::Automatic);
            let by = Criterion::Information;
            let found = select_terms(&data, &unknowns, &given, &candidates, by, weighting).unwrap();
            let names: Vec<&str> = found.terms.iter().map(|term| term.name()).collect();
            (names != ["k3"]).then(|| names.join(" "))
        })
        .collect();
    eprintln!("{runs} runs: {} wrong, {wrong:?}", wrong.len());
    assert!(wrong.len() as f64 <= 0.05 * runs as f64, "{wrong:?}");
}

#[test]
#[allow(clippy::print_stderr, reason = "the study by hand is read")]
fn a_linear_system_is_called_nonlinear_rarely_and_a_cubic_one_always() {
    let runs = runs(100);
    for (clean, nonlinear) in [(duffing(0.0), false), (duffing(0.02), true)] {
        let named: Vec<bool> = (0..runs)
            .into_par_iter()
            .map(|seed| {
                let (force, response) = noisy(&clean, 0.01, 20_000 + seed);
                let lines = Lines::new(sampling(), 1..=201).unwrap();
                let unknowns = Unknowns::unknown_mass(1).unwrap();
                let seen =
                    distortion(&lines, &[[&force, &response]], DISPLACEMENT, &unknowns).unwrap();
                seen.kind().is_some_and(|kind| !nonlinear || kind.name == "cubic stiffness of x1")
            })
            .collect();
        let share = named.iter().filter(|named| **named).count() as f64 / runs as f64;
        eprintln!("{runs} runs, nonlinear {nonlinear}: named in {share}");
        assert!(if nonlinear { share > 0.99 } else { share <= 0.02 }, "{nonlinear}: {share}");
    }
}
