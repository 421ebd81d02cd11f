//! A chain of five known masses: springs and dampers from one force and two sensors.

use std::f64::consts::TAU;

use mechid_estimate::likelihood::machine::{MachineEstimate, identify_machine};
use mechid_estimate::likelihood::{NoiseSource, Settings};
use mechid_model::ResponseQuantity;
use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::generator::{measured, random_phases, responses};

pub const MASSES: [f64; 5] = [2.0, 1.5, 1.8, 1.2, 1.0];
const STIFFNESSES: [f64; 5] = [4e4, 3e4, 2.5e4, 3.5e4, 2e4];
const DAMPINGS: [f64; 5] = [6.0, 4.0, 5.0, 3.0, 4.0];

fn chain(values: &[f64; 5]) -> DMatrix<f64> {
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

/// Force on mass 1, displacements of masses 1 and 5 with 0.5 % noise.
fn data(stiffnesses: &[f64; 5], seed: u64) -> LineData {
    let omega: Vec<f64> = (4..=400).map(|line| TAU * 0.125 * f64::from(line)).collect();
    let phases = random_phases(omega.len(), 1, 1000 + seed);
    let force = phases.clone().insert_columns(1, 4, Complex::default());
    let mass = DMatrix::from_diagonal(&MASSES.to_vec().into());
    let all = responses([&mass, &chain(&DAMPINGS), &chain(stiffnesses)], &omega, &force);
    measured(&omega, phases, all.select_columns(&[0, 4]), 0.005, seed)
}

/// The chain with springs and dampers that start at one value each.
fn machine() -> Machine {
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

fn instruments() -> Instruments {
    Instruments {
        sensors: ["x1", "x5"].map(|dof| Sensor::new(dof, ResponseQuantity::Displacement)).to_vec(),
        inputs: vec![Input::force("x1")],
        ..Instruments::default()
    }
}

fn fit(seed: u64, settings: &Settings) -> MachineEstimate {
    identify_machine(&data(&STIFFNESSES, seed), &machine(), &instruments(), settings).unwrap()
}

/// Share of intervals that hold, and the root mean square of the errors over the standard errors, over all
/// parameters and seeds.
fn judge(seeds: u64, settings: &Settings) -> (f64, f64) {
    let truth: Vec<f64> = (0..5).flat_map(|at| [STIFFNESSES[at], DAMPINGS[at]]).collect();
    let all: Vec<(f64, f64)> = (0..seeds)
        .into_par_iter()
        .flat_map_iter(|seed| {
            let estimate = fit(seed, settings).likelihood;
            let judged = estimate.parameters.into_iter().zip(&truth).map(|(p, truth)| {
                let held = (p.interval[0]..=p.interval[1]).contains(truth);
                let z = (p.value - truth) / p.standard_error.unwrap();
                (f64::from(u8::from(held)), z * z)
            });
            judged.collect::<Vec<_>>()
        })
        .collect();
    let count = all.len() as f64;
    let sums = all.iter().fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    (sums.0 / count, (sums.1 / count).sqrt())
}

/// Of 200 intervals of 95 % fewer than 90 % hold with a probability of 0.002 if they are independent.
#[test]
fn intervals_of_springs_and_dampers_hold() {
    let (held, scatter) = judge(20, &Settings::default());
    assert!((0.9..=1.0).contains(&held), "{held}");
    assert!((0.85..1.15).contains(&scatter), "{scatter}");
}

#[test]
fn unknown_noise_is_found_from_the_residual() {
    for noise in [NoiseSource::WhiteResidual, NoiseSource::SmoothResidual] {
        let settings = Settings { noise, ..Settings::default() };
        let (held, scatter) = judge(12, &settings);
        assert!((0.87..=1.0).contains(&held), "{noise:?} {held}");
        assert!((0.8..1.2).contains(&scatter), "{noise:?} {scatter}");
    }
}

#[test]
fn the_misfit_is_that_of_the_noise() {
    let estimate = fit(3, &Settings::default()).likelihood;
    let ratio = estimate.misfit_ratio.unwrap();
    assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
    assert!(estimate.misfit_p_value.unwrap() > 1e-4);
    assert!(estimate.agreeing() >= 2 && estimate.combinations.is_empty());
    assert!(estimate.relative_residual.iter().all(|r| (r - 0.005).abs() < 0.001));
}
