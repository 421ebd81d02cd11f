//! Modes of a machine if no force acts on some degrees of freedom and no mass is known. Results
//! other than the modes are not given.

use std::f64::consts::TAU;

use mechid_analysis::identify::{Band, LineChoice, Method};
use mechid_analysis::{
    AnalysisError, Channels, HitRule, Identified, Identify, IdentifyResponses, Measurement,
    ResponseQuantity, Segmentation, frf, identify, identify_responses,
};
use mechid_model::SecondOrderSystem;
use mechid_problems::machines::{Support, chain};
use mechid_problems::{HammerTest, exact_harmonic_periodic};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::{DMatrix, dmatrix};
use rayon::prelude::*;

const DOFS: usize = 3;
const PERIOD: usize = 256;
const PERIODS: usize = 8;

fn machine() -> SecondOrderSystem {
    chain(DOFS, Support::Fixed, 0.02, 3)
}

/// Exact steady displacements under a multisine force on the first mass; `on_response` is the ratio
/// of the noise to the RMS of each displacement.
fn record(seed: u64, on_response: f64) -> Measurement {
    let period = Sampling::new(0.008, PERIOD).unwrap();
    let lines = Multisine::flat(1..=70, 10.0, Phases::Random { seed }).unwrap();
    let shaker = lines.sample(period).unwrap();
    let mut force = DMatrix::zeros(PERIOD, DOFS);
    force.set_column(0, &shaker.column(0));
    let force = Record::new(period, force).unwrap();
    let motion = exact_harmonic_periodic(&machine(), &force).unwrap();
    let mut x = motion.displacement().repeated(PERIODS).unwrap();
    if on_response > 0.0 {
        x = noise::add_white(&x, NoiseLevel::FractionOfRms(on_response), 1000 + seed).unwrap();
    }
    let responses = [(ResponseQuantity::Displacement, &x)];
    let test = Measurement::from_records(&force.repeated(PERIODS).unwrap(), &responses).unwrap();
    test.period(PERIOD).unwrap()
}

fn from_frf() -> Identify {
    Identify::responses(Default::default(), Segmentation::default())
}

/// Natural frequencies in Hz, and damping ratios.
fn truth(system: &SecondOrderSystem) -> Vec<[f64; 2]> {
    let modes = system.modes().unwrap();
    modes.iter().map(|mode| [mode.natural_frequency() / TAU, mode.damping_ratio()]).collect()
}

fn equations(found: &Identified) -> Vec<usize> {
    found.summary().unscaled.clone().map_or(Vec::new(), |unscaled| unscaled.equations)
}

/// The fit of a record without noise gives the natural frequencies, damping ratios and shapes of
/// the machine, but no parameters and no system.
#[test]
fn modes_are_those_of_the_machine_and_nothing_else_is_given() {
    let exact = machine();
    let methods = [Method::MaximumLikelihood, Method::LeastSquares];
    for how in [from_frf(), Identify::spectra(methods[0]), Identify::spectra(methods[1])] {
        let found = identify(&[record(1, 0.0)], &how).unwrap();
        assert_eq!(equations(&found), [1, 2, 3]);
        let told = found.summary();
        assert!(told.parameters.is_empty() && told.system.is_none(), "{found}");
        // Rows with unknown factors cannot be tested for symmetry.
        assert!(told.checks.iter().all(|check| check.subject.to_string() != "symmetry"));
        assert!(told.covariance.as_ref().unwrap().parameters.is_empty());
        for (mode, exact) in told.modes.iter().zip(exact.modes().unwrap()) {
            let hz = mode.row.natural_frequency_hz.value * TAU / exact.natural_frequency();
            let damping = mode.row.damping_ratio.value / exact.damping_ratio();
            assert!((hz - 1.0).abs() < 1e-8 && (damping - 1.0).abs() < 1e-6, "{found}");
            for (entry, exact) in mode.shape.iter().zip(exact.shape().iter()) {
                let [re, im] = entry.value;
                assert!((re - exact.re).hypot(im - exact.im) < 1e-6, "{found}");
            }
        }
        let text = found.to_string();
        for absent in ["m11", "k23", "kg", "N/m"] {
            assert!(!text.contains(absent), "{absent} in {text}");
        }
        assert!(text.contains("2 displacement 3"), "{text}");
        let note = "note: no force acts on degrees of freedom 2 and 3, and their masses are not known: the modes do \
                    not depend on this, but rows 1, 2 and 3 of M, C and K have an unknown scale, so they are \
                    not reported; state masses (`mass`), or apply a force on each of them";
        assert!(text.contains(note), "{text}");
        let json = serde_json::to_value(&found).unwrap();
        assert_eq!(json["unscaled"]["degrees_of_freedom"], serde_json::json!([2, 3]));
        assert!(json.get("system").is_none(), "{json}");
        for refused in [found.system().err(), found.machine().err(), found.model().err()] {
            assert!(matches!(refused, Some(AnalysisError::Unscaled { .. })), "{refused:?}");
        }
    }
}

/// If the mass matrix is diagonal, the measured force determines the scale of the equation of the
/// driven mass. A stated mass of another degree of freedom, right or wrong, changes only the
/// equation of that degree of freedom.
#[test]
fn a_stated_mass_scales_its_own_equation_and_no_mode() {
    let test = record(2, 0.01);
    let with = |mass: &str| {
        let how = Identify::spectra(Method::MaximumLikelihood).mass(mass.parse().unwrap());
        identify(std::slice::from_ref(&test), &how).unwrap()
    };
    let none = with("unknown,unknown,unknown");
    assert_eq!(equations(&none), [2, 3]);
    let named = |found: &Identified| -> Vec<String> {
        found.summary().parameters.iter().map(|p| p.name.clone()).collect()
    };
    let first = ["m11", "m12", "m13", "c11", "c12", "c13", "k11", "k12", "k13"];
    assert_eq!(named(&none), first);
    assert_eq!(none.summary().covariance.as_ref().unwrap().parameters.len(), 7);
    let exact = machine();
    for p in &none.summary().parameters {
        let matrix = mechid_model::Matrix::ALL.into_iter().find(|m| m.to_string() == p.matrix);
        let truth = exact.matrix(matrix.unwrap())[(0, p.column - 1)];
        match p.estimate.standard_error {
            Some(error) => assert!((p.estimate.value - truth).abs() < 4.0 * error, "{none}"),
            None => assert_eq!(p.estimate.value, 0.0),
        }
    }
    let one = with("unknown,3,unknown");
    assert_eq!(equations(&one), [3]);
    let all = with("unknown,3,0.02");
    assert!(all.summary().unscaled.is_none() && all.system().is_ok());
    assert_eq!(named(&all).len(), 27);
    for other in [&one, &all] {
        let modes = none.summary().modes.iter().zip(&other.summary().modes);
        for (a, b) in modes.map(|(a, b)| (&a.row, &b.row)) {
            for (a, b) in [
                (a.natural_frequency_hz, b.natural_frequency_hz),
                (a.damping_ratio, b.damping_ratio),
            ] {
                let error =
                    |u: mechid_analysis::identify::rows::Uncertain| u.standard_error.unwrap();
                // Each search stops when its step is a small part of a standard error; the two
                // results may differ by this part.
                assert!((a.value - b.value).abs() < 1e-2 * error(a), "{none}\n{other}");
                assert!((error(a) / error(b) - 1.0).abs() < 1e-2, "{none}\n{other}");
            }
        }
    }
}

/// Number of intervals that contain the true value, and number of all intervals.
fn held(all: &[Identified], system: &SecondOrderSystem) -> (usize, usize) {
    let truth = truth(system);
    let (mut held, mut total) = (0, 0);
    for found in all {
        assert!(found.summary().parameters.is_empty());
        for (mode, [hz, damping]) in found.summary().modes.iter().zip(&truth) {
            let pairs = [(mode.row.natural_frequency_hz, hz), (mode.row.damping_ratio, damping)];
            for (estimate, truth) in pairs {
                let [low, high] = estimate.interval.unwrap();
                held += usize::from((low..=high).contains(truth));
                total += 1;
            }
        }
    }
    (held, total)
}

/// In 100 runs with six nearly independent intervals each, the share of 95 % intervals that contain
/// the true value must be between 91.5 and 98 %. Both limits are more than three standard
/// deviations from 95 %.
#[test]
fn intervals_of_the_modes_hold() {
    for how in [from_frf(), Identify::spectra(Method::MaximumLikelihood)] {
        let run = |seed| identify(&[record(seed, 0.01)], &how).unwrap();
        let all: Vec<Identified> = (0..100).into_par_iter().map(run).collect();
        let (held, total) = held(&all, &machine());
        assert_eq!(total, 600);
        assert!((549..=588).contains(&held), "{held} of {total}");
        let warned = all.iter().filter(|f| f.checks().iter().any(|c| c.is_conspicuous())).count();
        assert!(warned <= 6, "{warned} of 100 warn");
    }
}

fn struck(seed: u64) -> (HammerTest, Measurement) {
    let rig = HammerTest {
        frequencies_hz: vec![24.0, 61.0],
        damping_ratios: vec![0.01, 0.015],
        shapes: dmatrix![0.3, -0.2; 0.25, 0.35],
        sampling: Sampling::from_rate_hz(1024.0, 2560).unwrap(),
        quantity: ResponseQuantity::Acceleration,
        hits: 5,
        peak: 200.0,
        duration: 0.01,
        force_noise: 0.01,
    };
    let record = rig.measure(0, 2, seed).unwrap();
    let level = NoiseLevel::StandardDeviation(0.05);
    let response = noise::add_white(&record.response, level, 1_000_000 + seed).unwrap();
    let columns =
        [("f", record.force.channel(0)), ("a1", response.channel(0)), ("a2", response.channel(1))];
    let channels = Channels::new("f,0", ResponseQuantity::Acceleration, "a1,a2");
    let test = Measurement::from_columns(record.force.sampling(), &columns, &channels).unwrap();
    (rig, test)
}

/// At least 40 of 48 intervals of 95 % must contain the true value. If the intervals are right,
/// fewer than 40 contain it with a probability of 0.001.
#[test]
fn a_hammer_at_one_point_gives_the_modes() {
    let band = LineChoice::Band(Band { low_hz: 2.0, high_hz: 150.0 });
    let how = Identify::hits(HitRule::default()).lines(band);
    let run = |seed| identify(&[struck(seed).1], &how).unwrap();
    let all: Vec<Identified> = (0..12).into_par_iter().map(run).collect();
    let (held, total) = held(&all, &struck(0).0.system().unwrap());
    assert!(total == 48 && held >= 40, "{held} of {total}");
}

/// The response can be predicted for forces at the same points as in the test, but not at other
/// points.
#[test]
fn a_record_is_predicted_if_its_forces_are_those_that_acted() {
    let found = identify(&[record(3, 0.001)], &from_frf()).unwrap();
    let validation = found.validate(&record(4, 0.001)).unwrap();
    assert!(validation.channels.iter().all(|c| c.fit_percent > 99.0), "{validation:?}");
    let compared = found.compared().unwrap();
    let [measured, predicted] = [&compared[0].measured, &compared[0].predicted];
    let apart = (measured.data() - predicted.data()).norm();
    assert!(apart < 0.01 * measured.data().norm());

    let sampling = Sampling::new(0.008, PERIOD).unwrap();
    let responses = [("x1", 1.0), ("x2", 2.0), ("x3", 3.0)];
    let samples: Vec<Vec<f64>> = responses
        .iter()
        .map(|(_, part)| (0..PERIOD).map(|k| (part * k as f64).sin()).collect())
        .collect();
    let names = responses.iter().map(|(name, _)| *name);
    let columns: Vec<(&str, &[f64])> =
        names.zip(samples.iter().map(Vec::as_slice)).chain([("f", &samples[0][..])]).collect();
    let channels = Channels::new("0,f,0", ResponseQuantity::Displacement, "x1,x2,x3");
    let other = Measurement::from_columns(sampling, &columns, &channels).unwrap();
    let refused = found.validate(&other).unwrap_err();
    assert!(matches!(refused, AnalysisError::Unscaled { .. }), "{refused}");
    assert_eq!(refused.code(), "analysis.unscaled");
}

#[test]
fn tables_of_responses_to_one_force_give_the_modes() {
    let table = frf(&record(5, 0.01), &Default::default()).unwrap();
    let table = table.to_responses(&[]).unwrap();
    let found = identify_responses(&[table], &IdentifyResponses::default()).unwrap();
    let told = found.summary();
    assert!(told.parameters.is_empty() && told.system.is_none() && told.unscaled.is_some());
    for (mode, [hz, _]) in told.modes.iter().zip(truth(&machine())) {
        let estimate = mode.row.natural_frequency_hz;
        let apart = (estimate.value - hz).abs();
        assert!(apart < 4.0 * estimate.standard_error.unwrap(), "{found}");
    }
    assert!(matches!(found.machine(), Err(AnalysisError::Unscaled { .. })));
    assert!(found.to_string().contains("1 3+X") && !found.to_string().contains("k11"), "{found}");
}
