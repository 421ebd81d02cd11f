//! Forces that are held or linear between samples, judged by exact responses.

use std::f64::consts::TAU;

use mechid_analysis::identify::{Acquisition, OpenFit, Source};
use mechid_analysis::{Identified, Identify, Measurement, ResponseQuantity, identify};
use mechid_checks::{Alternative, Cause, Finding};
use mechid_model::{Discretisation, Sdof};
use mechid_signal::{NoiseLevel, Sampling, noise};
use rayon::prelude::*;

/// 3 kg at 8 Hz with a damping ratio of 0.05.
fn light() -> Sdof {
    let omega = TAU * 8.0;
    Sdof::new(3.0, 2.0 * 0.05 * omega * 3.0, 3.0 * omega * omega).unwrap()
}

/// White force of 30 s at 100 Hz from rest, held or linear between its samples, and a response with 0.3 % noise.
fn simulated(between: Discretisation, kind: ResponseQuantity, seed: u64) -> Measurement {
    let sampling = Sampling::from_rate_hz(100.0, 3000).unwrap();
    let force = noise::white(sampling, 1, 100.0, seed).unwrap();
    let response = match between {
        Discretisation::ZeroOrderHold => light().held_force_response(&force, 0.0, 0.0),
        _ => light().linear_force_response(&force, 0.0, 0.0),
    };
    let response = response.unwrap();
    let response = match kind {
        ResponseQuantity::Displacement => response.displacement(),
        ResponseQuantity::Velocity => response.velocity(),
        ResponseQuantity::Acceleration => response.acceleration(),
    };
    let noisy = noise::add_white(response, NoiseLevel::FractionOfRms(0.003), seed + 1000);
    Measurement::from_records(&force, &[(kind, &noisy.unwrap())]).unwrap()
}

fn cause(found: &Identified) -> Option<Cause> {
    let checks = found.summary().checks.iter().filter(|check| check.is_conspicuous());
    let mut causes = checks.filter_map(|check| match &check.finding {
        Finding::Alternative(Alternative { cause, .. }) => Some(cause.clone()),
        _ => None,
    });
    causes.next()
}

/// Number of parameters whose 95 % interval holds.
fn held(found: &Identified, truth: [f64; 3]) -> usize {
    let holds = |(name, exact): (&str, f64)| {
        let [low, high] = found.estimate().parameter(name).unwrap().interval(0.95).unwrap();
        usize::from((low..=high).contains(&exact))
    };
    ["m", "c", "k"].into_iter().zip(truth).map(holds).sum()
}

fn open(between: Option<Discretisation>, coupled: &[&str]) -> Identify {
    let ac_coupling = coupled.iter().map(|text| text.parse().unwrap()).collect();
    let acquisition = Acquisition { between_samples: between, ac_coupling };
    Identify::from(Source::Open(OpenFit { acquisition, ..OpenFit::default() }))
}

/// Of 24 intervals of 95 %, fewer than 20 hold with a probability of 0.006.
#[test]
fn a_simulated_force_is_named_and_allowed_for() {
    let truth = [light().mass(), light().damping(), light().stiffness()];
    for (between, kind) in [
        (Discretisation::FirstOrderHold, ResponseQuantity::Acceleration),
        (Discretisation::ZeroOrderHold, ResponseQuantity::Displacement),
    ] {
        let holding = (0..8_u64).into_par_iter().map(|seed| {
            let test = [simulated(between, kind, seed)];
            let found = identify(&test, &open(Some(between), &[])).unwrap();
            assert_eq!(cause(&found), None);
            held(&found, truth)
        });
        let holding: usize = holding.sum();
        assert!(holding >= 20, "{between}, {kind}: {holding}");
        let usual = identify(&[simulated(between, kind, 0)], &Identify::default()).unwrap();
        let expected = Some(Cause::BetweenSamples { between_samples: between });
        assert_eq!(cause(&usual), expected, "{}", usual.summary().all_checks());
    }
}
