//! Simulated faults of measuring chains: each fault is reported, and no other.

use mechid_analysis::{Identify, Measurement, ResponseQuantity, identify};
use mechid_model::SecondOrderSystem;
use mechid_problems::{Fault, exact_harmonic_periodic};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::dmatrix;
use rayon::prelude::*;

const PERIOD: usize = 512;
const PERIODS: usize = 4;

fn machine() -> SecondOrderSystem {
    let mass = dmatrix![10.0, 0.5; 0.5, 8.0];
    let damping = dmatrix![30.0, -8.0; -12.0, 25.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5];
    SecondOrderSystem::new(mass, damping, stiffness).unwrap()
}

/// A record with a fault on the forces, on the responses, or on both.
fn record(fault: Option<&Fault>, on: [bool; 2], seed: u64) -> Measurement {
    let sampling = Sampling::new(0.002, PERIOD).unwrap();
    let of = |channel: u64| {
        let phases = Phases::Random { seed: 2 * seed + channel };
        Multisine::flat(1..=100, 10.0, phases).unwrap().sample(sampling).unwrap()
    };
    let (first, second) = (of(0), of(1));
    let force = Record::from_channels(sampling, &[first.channel(0), second.channel(0)]).unwrap();
    let exact = exact_harmonic_periodic(&machine(), &force).unwrap();
    let mut force = force.repeated(PERIODS).unwrap();
    let exact = exact.displacement().repeated(PERIODS).unwrap();
    let level = NoiseLevel::FractionOfRms(0.005);
    let mut response = noise::add_white(&exact, level, 1000 + seed).unwrap();
    if let Some(fault) = fault {
        for record in [&mut force, &mut response].into_iter().zip(on).filter(|of| of.1) {
            *record.0 = fault.apply(record.0, seed).unwrap();
        }
    }
    let responses = [(ResponseQuantity::Displacement, &response)];
    Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
}

/// Subjects of the warnings on a record with a fault on the forces, on the responses, or on both.
fn warnings(fault: Option<&Fault>, on: [bool; 2], seed: u64) -> Vec<String> {
    let found = identify(&[record(fault, on, seed)], &Identify::default()).unwrap();
    let warned = found.checks().iter().filter(|check| check.is_conspicuous());
    warned.map(|check| check.subject.to_string()).collect()
}

/// Reference: the generator, which knows the fault. The check for this kind of fault must warn.
#[test]
fn every_fault_is_told_by_a_check_that_is_meant_for_it() {
    let (force, response, both) = ([true, false], [false, true], [true, true]);
    let crosstalk = Fault::Crosstalk { part: 0.02 };
    let run_out = Fault::RunOut { rotation_hz: 40.0 * 500.0 / 512.0, amplitudes: vec![0.05, 0.02] };
    let lost = Fault::Lost { samples: 3 };
    for (fault, on, subject) in [
        (&crosstalk, force, "symmetry"),
        (&crosstalk, response, "symmetry"),
        (&run_out, response, "misfit"),
        (&Fault::Drift { end: 0.5 }, response, "periodicity"),
        (&Fault::Delay { samples: 0.2 }, response, "delay"),
        (&Fault::Clipping { part: 0.7 }, response, "range"),
        (&Fault::Clipping { part: 0.5 }, force, "range"),
        (&lost, both, "periodicity"),
        (&Fault::Held { gaps: 5, samples: 6 }, response, "periodicity"),
    ] {
        let told = |seed: &u64| {
            let warned = warnings(Some(fault), on, *seed);
            warned.iter().any(|warned| warned == subject)
        };
        let told = (0..8_u64).into_par_iter().filter(told).count();
        assert_eq!(told, 8, "{fault:?} on {on:?}: {subject}");
    }
}

/// Forces quantised by a converter of 8 bits, with the same error in all periods. The mean square
/// of 480 ratios of error to standard error has an expected value of about 1; it scatters by about
/// 0.12, because the errors of one record are correlated.
#[test]
fn intervals_hold_beside_forces_in_steps() {
    let machine = machine();
    let truth = [machine.mass(), machine.damping(), machine.stiffness()];
    let squares = |seed: u64| -> Vec<f64> {
        let record = record(Some(&Fault::Steps { bits: 8 }), [true, false], seed);
        let found = identify(&[record], &Identify::default()).unwrap();
        let of = |p: mechid_estimate::Estimated| {
            let exact =
                truth[p.parameter.matrix() as usize][(p.parameter.row(), p.parameter.column())];
            ((p.value - exact) / p.standard_error).powi(2)
        };
        found.estimate().parameters().map(of).collect()
    };
    let all: Vec<f64> = (0..40_u64).into_par_iter().flat_map_iter(squares).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    assert!((0.65..1.35).contains(&mean), "{mean}");
}

/// Reference: the generator. The modes are correct; only the negative mass shows the wrong sign of
/// the response.
#[test]
fn a_response_of_the_wrong_sign_is_told() {
    for seed in 0..8 {
        let warned = warnings(Some(&Fault::Gain { factor: -1.0 }), [false, true], seed);
        assert_eq!(warned, ["mass"], "{seed}");
    }
}

/// Reference: two families of tests with an error rate of 1 % each. The probability of warnings in
/// more than 8 of 150 records is below 0.01.
#[test]
fn records_without_a_fault_seldom_warn() {
    let warned = |seed: &u64| !warnings(None, [true, true], *seed).is_empty();
    let warned = (100..250_u64).into_par_iter().filter(warned).count();
    assert!(warned <= 8, "{warned} of 150");
}
