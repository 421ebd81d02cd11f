//! Random tests: windows cut out of the closed-form steady state under a random force of a far longer period.

use mechid_analysis::identify::{Fit, Method};
use mechid_analysis::{
    AnalysisError, Identified, Identify, Measurement, ResponseQuantity, identify,
};
use mechid_estimate::frequency_domain::Pooling;
use mechid_model::Sdof;
use mechid_problems::RandomTest;
use mechid_signal::{Extent, NoiseLevel, Record, Sampling, noise};
use rayon::prelude::*;

const SAMPLES: usize = 2048;
const KIND: ResponseQuantity = ResponseQuantity::Displacement;

/// 10 kg at 25 Hz with a damping ratio of 0.01, sampled at 500 Hz.
fn rig() -> RandomTest {
    let omega = 25.0 * std::f64::consts::TAU;
    let system = Sdof::new(10.0, 0.02 * 10.0 * omega, 10.0 * omega * omega).unwrap().system();
    let sampling = Sampling::new(0.002, SAMPLES).unwrap();
    RandomTest { system, sampling, quantity: KIND, force: 100.0 }
}

/// A measurement with noise of 1 % on the response.
fn measured([force, response]: [Record; 2], seed: u64) -> Measurement {
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), seed + 100_000);
    Measurement::from_records(&force, &[(KIND, &noisy.unwrap())]).unwrap()
}

fn random_test(seed: u64) -> Measurement {
    measured(rig().measure(seed).unwrap(), seed)
}

fn holds(identified: &Identified, name: &str) -> bool {
    let truth = match name {
        "m" => rig().system.mass()[(0, 0)],
        "c" => rig().system.damping()[(0, 0)],
        _ => rig().system.stiffness()[(0, 0)],
    };
    let [low, high] = identified.estimate().parameter(name).unwrap().interval(0.95).unwrap();
    (low..=high).contains(&truth)
}

fn warns(identified: &Identified) -> bool {
    identified.summary().checks.iter().any(|check| check.is_conspicuous())
}

fn is_open(identified: &Identified) -> bool {
    identified.fitted().open
}

/// Of 100 intervals of 95 % fewer than 88 % hold with a probability of 0.003; a warning on right data is to be
/// seen in 1 of 50 records.
#[test]
fn a_random_test_needs_no_settings() {
    const RUNS: u64 = 100;
    let each: Vec<[bool; 5]> = (0..RUNS)
        .into_par_iter()
        .map(|seed| {
            let found = identify(&[random_test(seed)], &Identify::default()).unwrap();
            let [m, c, k] = ["m", "c", "k"].map(|name| holds(&found, name));
            [is_open(&found), m, c, k, warns(&found)]
        })
        .collect();
    let [open, m, c, k, warned] =
        [0, 1, 2, 3, 4].map(|at| each.iter().filter(|run| run[at]).count());
    assert_eq!(open, 100);
    assert!(m >= 88 && c >= 88 && k >= 88, "{m} {c} {k}");
    assert!(warned <= 5, "{warned} of 100 warn");
}

#[test]
fn several_records_have_ends_of_their_own() {
    let tests: Vec<Measurement> = (0..3).map(random_test).collect();
    let all = identify(&tests, &Identify::default()).unwrap();
    let one = identify(&tests[..1], &Identify::default()).unwrap();
    let error = |found: &Identified| found.estimate().parameter("k").unwrap().standard_error;
    assert!(is_open(&all) && !warns(&all), "{all}");
    // Three times the data.
    let gain = error(&one) / error(&all);
    assert!((1.2..2.4).contains(&gain), "{gain}");
}

#[test]
fn a_period_stays_one() {
    let open = |seed: u64| {
        let test = measured(rig().period(seed).unwrap(), seed);
        let how = Identify::spectra(Method::MaximumLikelihood);
        is_open(&identify(&[test], &how).unwrap())
    };
    let wrong = (0..60).into_par_iter().filter(|seed| open(*seed)).count();
    assert!(wrong <= 1, "{wrong} of 60");
    // Nor is a period that was given.
    let periods = random_test(0).period(SAMPLES).unwrap();
    assert!(!is_open(&identify(&[periods], &Identify::default()).unwrap()));
}

#[test]
fn settings_that_contradict_open_records_are_refused() {
    let open = |method| Identify {
        fit: Fit::Spectra {
            method,
            noise: Pooling::Automatic,
            extent: Some(Extent::Open),
            force_noise: None,
        },
        ..Identify::default()
    };
    let refused = |test: Measurement, how: &Identify| {
        let error = identify(&[test], how).unwrap_err();
        assert!(matches!(error, AnalysisError::Setting { setting: "extent", .. }), "{error}");
    };
    refused(random_test(0), &open(Some(Method::LeastSquares)));
    refused(random_test(0).period(SAMPLES).unwrap(), &open(None));
    let nonlinear = open(None).nonlinear("k3: x1^3".parse().unwrap());
    refused(random_test(0), &nonlinear);
    assert!(is_open(&identify(&[random_test(0)], &open(None)).unwrap()));
}
