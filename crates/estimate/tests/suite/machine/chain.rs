//! A chain of five known masses: springs and dampers from one force and two sensors.

use std::f64::consts::TAU;

use mechid_estimate::likelihood::machine::identify_machine;
use mechid_estimate::likelihood::{LikelihoodEstimate, NoiseSource, Settings};
use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::steady_lines::eliminated;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::generator::{measured, random_phases};
use super::judge::judge;

pub const MASSES: [f64; 5] = [2.0, 1.5, 1.8, 1.2, 1.0];
pub const STIFFNESSES: [f64; 5] = [4e4, 3e4, 2.5e4, 3.5e4, 2e4];
pub const DAMPINGS: [f64; 5] = [6.0, 4.0, 5.0, 3.0, 4.0];

pub fn chain(values: &[f64; 5]) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(5, 5);
    for (at, value) in values.iter().enumerate() {
        matrix[(at, at)] += value;
        if at > 0 {
            matrix[(at - 1, at - 1)] += value;
            matrix[(at - 1, at)] -= value;
            matrix[(at, at - 1)] -= value;
        }
    }
    matrix
}

/// Returns data with the force on mass 1 and the displacements of masses 1 and 5, which have 0.5 %
/// noise.
pub fn data(stiffnesses: &[f64; 5], seed: u64) -> LineData {
    let omega: Vec<f64> = (4..=400).map(|line| TAU * 0.125 * f64::from(line)).collect();
    let phases = random_phases(omega.len(), 1, 1000 + seed);
    let force = phases.clone().insert_columns(1, 4, Complex::default());
    let mass = DMatrix::from_diagonal(&MASSES.to_vec().into());
    let all = eliminated([&mass, &chain(&DAMPINGS), &chain(stiffnesses)], &omega, &force);
    measured(&omega, phases, all.select_columns(&[0, 4]), 0.005, seed)
}

/// Returns the chain with one initial value for all springs, and one for all dampers.
pub fn machine() -> Machine {
    let mut machine = Machine::new(["x1", "x2", "x3", "x4", "x5"]);
    let dofs = machine.dofs.clone();
    for (at, dof) in dofs.iter().enumerate() {
        let before = if at == 0 { "support" } else { &dofs[at - 1] };
        let (k, c) = (FreeCoefficient::from_start(3e4), FreeCoefficient::from_start(4.0));
        let link = Element::spring_damper([before, dof], k.at_least(0.0), c.at_least(0.0));
        machine = machine
            .with(&format!("m{}", at + 1), Element::mass(dof, MASSES[at]))
            .with(&format!("s{}", at + 1), link);
    }
    machine
}

pub fn instruments() -> Instruments {
    Instruments {
        sensors: ["x1", "x5"].map(|dof| Sensor::new(dof, ResponseQuantity::Displacement)).to_vec(),
        inputs: vec![Input::force("x1")],
        ..Instruments::default()
    }
}

pub fn truth() -> Vec<(String, f64)> {
    let of = |at: usize| {
        [(format!("s{}.k", at + 1), STIFFNESSES[at]), (format!("s{}.c", at + 1), DAMPINGS[at])]
    };
    (0..5).flat_map(of).collect()
}

pub fn fit(seed: u64, settings: &Settings) -> Option<LikelihoodEstimate> {
    let data = data(&STIFFNESSES, seed);
    Some(identify_machine(&data, &machine(), &instruments(), settings).ok()?.likelihood)
}

/// Identifies the chain with an additional spring from the last mass to the support. The true chain
/// does not have this spring, so the bound `k >= 0` is active in about half of the experiments.
pub fn fit_with_bound(seed: u64) -> Option<LikelihoodEstimate> {
    let free = FreeCoefficient::from_start(1e3).at_least(0.0);
    let machine = machine().with("absent", Element::spring(["x5", "support"], free));
    let data = data(&STIFFNESSES, seed);
    let settings = Settings::default();
    Some(identify_machine(&data, &machine, &instruments(), &settings).ok()?.likelihood)
}

/// Truth of [`fit_with_bound`].
pub fn truth_with_bound() -> Vec<(String, f64)> {
    [truth(), vec![("absent".into(), 0.0)]].concat()
}

/// Identifies the chain with a prior of 1 % on the first spring. The mean of the prior is `away`
/// standard deviations above the truth.
pub fn fit_with_prior(seed: u64, away: f64) -> Option<LikelihoodEstimate> {
    let data = data(&STIFFNESSES, seed);
    let settings = Settings::default();
    let machine = machine_with_prior(away);
    Some(identify_machine(&data, &machine, &instruments(), &settings).ok()?.likelihood)
}

/// Machine of [`fit_with_prior`].
pub fn machine_with_prior(away: f64) -> Machine {
    let deviation = 0.01 * STIFFNESSES[0];
    let mut machine = machine();
    machine.elements[1].1 = Element::spring_damper(
        ["support", "x1"],
        FreeCoefficient::from_start(3e4).with_prior(STIFFNESSES[0] + away * deviation, deviation),
        FreeCoefficient::from_start(4.0).at_least(0.0),
    );
    machine
}

#[test]
fn a_bound_is_active_in_half_of_the_experiments() {
    let estimates: Vec<_> = (0..20).into_par_iter().map(fit_with_bound).collect();
    let judged = judge(&truth_with_bound(), 20, |seed| estimates[seed as usize].clone());
    assert!(judged.failed == 0 && judged.coverage >= 0.9, "{judged:?}");
    let is_active = |estimate: &Option<LikelihoodEstimate>| {
        estimate.as_ref().unwrap().parameter("absent").unwrap().at_bound
    };
    let active = estimates.iter().filter(|estimate| is_active(estimate)).count();
    // The probability that the bound is active in fewer than 4 or more than 16 of 20 experiments is
    // 0.003.
    assert!((4..=16).contains(&active), "{active}");
}

#[test]
fn a_prior_that_is_wrong_by_five_standard_deviations_is_told() {
    let p_value = |away: f64, seed: u64| {
        let estimate = fit_with_prior(seed, away).unwrap();
        estimate.parameter("s1.k").unwrap().prior.unwrap().p_value.unwrap()
    };
    assert!((0..4).all(|seed| p_value(5.0, seed) < 1e-4));
    assert!((0..4).all(|seed| p_value(0.5, seed) > 0.01));
}

/// At least 90 % of 200 intervals of 95 % contain the truth. For independent intervals, the
/// probability of fewer is 0.002.
#[test]
fn intervals_of_springs_and_dampers_hold() {
    let judged = judge(&truth(), 20, |seed| fit(seed, &Settings::default()));
    assert!(judged.failed == 0 && judged.coverage >= 0.9, "{judged:?}");
    // The probability that at most 14 of 20 intervals contain the truth is 3e-4.
    assert!(judged.worst_coverage >= 0.7 && judged.worst_scatter < 1.6, "{judged:?}");
    assert!((0.85..1.15).contains(&judged.scatter), "{judged:?}");
}

/// If the noise is estimated from the residual, at least 87 % of 80 intervals contain the truth.
/// The probability of fewer is 0.002 if the coverage of the intervals is 95 %, and 0.94 if it is 80
/// %.
#[test]
fn unknown_noise_is_found_from_the_residual() {
    for noise in [NoiseSource::WhiteResidual, NoiseSource::SmoothResidual] {
        let settings = Settings { noise, ..Settings::default() };
        let judged = judge(&truth(), 8, |seed| fit(seed, &settings));
        assert!(judged.failed == 0 && judged.coverage >= 0.87, "{noise:?} {judged:?}");
        assert!((0.8..1.2).contains(&judged.scatter), "{noise:?} {judged:?}");
    }
}

#[test]
fn the_misfit_is_that_of_the_noise() {
    let estimate = fit(3, &Settings::default()).unwrap();
    let ratio = estimate.misfit_ratio.unwrap();
    assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
    assert!(estimate.misfit_p_value.unwrap() > 1e-4);
    assert!(estimate.agreeing() >= 2 && estimate.combinations.is_empty());
    assert!(estimate.relative_residual.iter().all(|r| (r - 0.005).abs() < 0.001));
}

/// The standard errors of natural frequencies and damping ratios agree with the errors of the modes
/// of the identified chain.
#[test]
fn modes_of_the_identified_chain_have_honest_errors() {
    let mass = DMatrix::from_diagonal(&MASSES.to_vec().into());
    let exact = SecondOrderSystem::new(mass, chain(&DAMPINGS), chain(&STIFFNESSES)).unwrap();
    let exact = exact.modes().unwrap();
    let mut squares = Vec::new();
    for seed in 0..6 {
        let data = data(&STIFFNESSES, seed);
        let settings = Settings::default();
        let estimate = identify_machine(&data, &machine(), &instruments(), &settings).unwrap();
        for (mode, exact) in estimate.modes().unwrap().iter().zip(&exact) {
            let gap = mode.mode.natural_frequency() - exact.natural_frequency();
            squares.push((gap / mode.natural_frequency_error).powi(2));
            let gap = mode.mode.damping_ratio() - exact.damping_ratio();
            squares.push((gap / mode.damping_ratio_error).powi(2));
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // The mean of 60 squares with a mean of 1 each is between 0.5 and 1.6 with a probability of
    // 0.999.
    assert!((0.5..1.6).contains(&mean), "{mean}");
}

/// Identifies a chain of three masses from one force and two sensors; all coefficients are unknown.
pub fn three_masses(seed: u64) -> Option<LikelihoodEstimate> {
    let [m, k, c] = [[2.0, 1.5, 1.2], [3e4, 2e4, 2.5e4], [6.0, 4.0, 3.0]];
    let omega: Vec<f64> = (8..=320).map(|line| TAU * 0.125 * f64::from(line)).collect();
    let phases = random_phases(omega.len(), 1, 4000 + seed);
    let force = phases.clone().insert_columns(1, 2, Complex::default());
    let shorter = |values: [f64; 3]| {
        let five = chain(&[values[0], values[1], values[2], 0.0, 0.0]);
        five.view((0, 0), (3, 3)).into_owned()
    };
    let mass = DMatrix::from_diagonal(&m.to_vec().into());
    let all = eliminated([&mass, &shorter(c), &shorter(k)], &omega, &force);
    let data = measured(&omega, phases, all.select_columns(&[0, 2]), 0.005, 5000 + seed);
    let free = |start: f64| FreeCoefficient::from_start(start).at_least(0.0);
    let mut machine = Machine::new(["x1", "x2", "x3"]);
    for (at, before) in ["support", "x1", "x2"].into_iter().enumerate() {
        let dof = format!("x{}", at + 1);
        let link = Element::spring_damper([before, &dof], free(2.5e4), free(4.0));
        machine = machine
            .with(&format!("m{}", at + 1), Element::mass(&dof, free(1.6)))
            .with(&format!("s{}", at + 1), link);
    }
    let sensors = ["x1", "x3"].map(|dof| Sensor::new(dof, ResponseQuantity::Displacement));
    let instruments = Instruments { sensors: sensors.to_vec(), ..instruments() };
    let settings = Settings::default();
    Some(identify_machine(&data, &machine, &instruments, &settings).ok()?.likelihood)
}

pub fn three_masses_truth() -> Vec<(String, f64)> {
    let [m, k, c] = [[2.0, 1.5, 1.2], [3e4, 2e4, 2.5e4], [6.0, 4.0, 3.0]];
    let of = |at: usize| {
        let place = at + 1;
        [
            (format!("m{place}"), m[at]),
            (format!("s{place}.k"), k[at]),
            (format!("s{place}.c"), c[at]),
        ]
    };
    (0..3).flat_map(of).collect()
}

/// At least 89 % of 108 intervals contain the truth. The probability of fewer is 0.008 if the
/// coverage of the intervals is 95 %, and 0.99 if it is 80 %.
#[test]
fn masses_springs_and_dampers_of_a_chain_with_an_unmeasured_mass() {
    let judged = judge(&three_masses_truth(), 12, three_masses);
    assert!(judged.failed == 0 && judged.coverage >= 0.89, "{judged:?}");
    assert!((0.82..1.18).contains(&judged.scatter), "{judged:?}");
}
