//! Entries of M, C and K with a degree of freedom that no sensor reads.

use std::f64::consts::TAU;

use mechid_estimate::Unknowns;
use mechid_estimate::likelihood::entries::{Channels, identify_entries};
use mechid_estimate::likelihood::{LikelihoodEstimate, Settings};
use mechid_model::{Matrix, ResponseQuantity, SecondOrderSystem};
use mechid_problems::steady_lines::eliminated;
use nalgebra::{Complex, DMatrix, dmatrix};

use super::generator::{measured, random_phases};

fn system() -> SecondOrderSystem {
    let mass = dmatrix![2.0, 0.0, 0.0; 0.0, 1.5, 0.0; 0.0, 0.0, 1.2];
    let stiffness = dmatrix![5e4, -2e4, 0.0; -2e4, 4.5e4, -2.5e4; 0.0, -2.5e4, 2.5e4];
    let damping = &mass * 0.8 + &stiffness * 1.5e-4;
    SecondOrderSystem::new(mass, damping, stiffness).unwrap()
}

/// Returns the unknowns of a chain with proportional damping: the matrices are symmetric.
fn chain() -> Unknowns {
    let mut unknowns = Unknowns::unknown_mass(3).unwrap();
    for matrix in [Matrix::Mass, Matrix::Stiffness] {
        unknowns = unknowns.symmetric(matrix).unwrap();
    }
    for (row, column) in [(0, 1), (0, 2), (1, 2)] {
        unknowns = unknowns.fix(Matrix::Mass, row, column, 0.0).unwrap();
    }
    unknowns.fix(Matrix::Stiffness, 0, 2, 0.0).unwrap().proportional_damping().unwrap()
}

/// Identifies the entries from the force on mass 1 and the accelerations of masses 1 and 3.
fn identified(unknowns: &Unknowns, seed: u64) -> LikelihoodEstimate {
    let exact = system();
    let omega: Vec<f64> = (8..=320).map(|line| TAU * 0.125 * f64::from(line)).collect();
    let phases = random_phases(omega.len(), 1, seed);
    let force = phases.clone().insert_columns(1, 2, Complex::default());
    let all = eliminated([exact.mass(), exact.damping(), exact.stiffness()], &omega, &force);
    let quantity = ResponseQuantity::Acceleration;
    let outputs = DMatrix::from_fn(omega.len(), 2, |row, at| {
        all[(row, 2 * at)] * quantity.per_displacement(omega[row])
    });
    let data = measured(&omega, phases, outputs, 0.005, seed + 70);
    let near =
        SecondOrderSystem::new(exact.mass() * 1.1, exact.damping() * 1.5, exact.stiffness() * 0.95);
    let channels = Channels { sensors: vec![(0, quantity), (2, quantity)], forces: vec![0] };
    let settings = Settings { spread: 1.1, ..Settings::default() };
    identify_entries(&data, unknowns, &near.unwrap(), &channels, &settings).unwrap()
}

#[test]
fn entries_are_found_where_the_unmeasured_mass_is_known() {
    let unknowns = chain().fix(Matrix::Mass, 1, 1, 1.5).unwrap();
    let exact = system();
    let mut squares = Vec::new();
    for seed in 0..8 {
        let estimate = identified(&unknowns, seed);
        assert!(estimate.combinations.is_empty(), "{:?}", estimate.combinations);
        for p in &estimate.parameters {
            let index = |at: usize| p.name.as_bytes()[at] as usize - usize::from(b'1');
            let truth = match p.name.as_str() {
                "alpha" => 0.8,
                "beta" => 1.5e-4,
                name if name.starts_with('m') => exact.mass()[(index(1), index(2))],
                _ => exact.stiffness()[(index(1), index(2))],
            };
            squares.push(((p.value - truth) / p.standard_error.unwrap()).powi(2));
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // The mean of 72 squares with a mean of 1 each is between 0.5 and 1.6 with a probability of
    // 0.999.
    assert_eq!(squares.len(), 72);
    assert!((0.5..1.6).contains(&mean), "{mean}");
}

/// The displacement of a mass without a sensor may be scaled by any factor, so only combinations of
/// the entries of this mass are determined.
#[test]
fn the_scale_of_an_unmeasured_motion_is_undetermined() {
    let estimate = identified(&chain(), 1);
    assert_eq!(estimate.combinations.len(), 1);
    assert_eq!(estimate.combinations[0].parameters, ["k12", "m22", "k22", "k23"]);
    assert_eq!(estimate.combinations[0].determined.len(), 3);
    let m11 = estimate.parameter("m11").unwrap();
    assert!((m11.value - 2.0).abs() < 4.0 * m11.standard_error.unwrap());
}
