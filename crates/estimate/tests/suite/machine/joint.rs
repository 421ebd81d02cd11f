//! An unknown joint between two free parts whose receptances were measured.

use std::f64::consts::TAU;

use mechid_estimate::likelihood::machine::{MeasuredReceptance, identify_joined};
use mechid_estimate::likelihood::{LikelihoodEstimate, Settings};
use mechid_model::ResponseQuantity;
use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
use mechid_problems::steady_lines::eliminated;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};

use super::generator::{complex_noise, measured, random_phases};
use super::judge::judge;

const STIFFNESS: f64 = 5e6;
const DAMPING: f64 = 40.0;

/// Number of nodes of each beam.
const NODES: usize = 9;

/// Returns M, C and K of a free steel beam with this length (m) and a square section of 20 mm. The
/// Euler–Bernoulli elements have deflection and slope at each node, and the damping is proportional
/// to the stiffness.
fn beam(length: f64) -> [DMatrix<f64>; 3] {
    let (n, l) = (2 * NODES, length / (NODES - 1) as f64);
    let (area, inertia) = (4e-4, 0.02_f64.powi(4) / 12.0);
    let k = nalgebra::dmatrix![
        12.0, 6.0 * l, -12.0, 6.0 * l;
        6.0 * l, 4.0 * l * l, -6.0 * l, 2.0 * l * l;
        -12.0, -6.0 * l, 12.0, -6.0 * l;
        6.0 * l, 2.0 * l * l, -6.0 * l, 4.0 * l * l
    ] * (2.1e11 * inertia / l.powi(3));
    let m = nalgebra::dmatrix![
        156.0, 22.0 * l, 54.0, -13.0 * l;
        22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l;
        54.0, 13.0 * l, 156.0, -22.0 * l;
        -13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l
    ] * (7850.0 * area * l / 420.0);
    let (mut mass, mut stiffness) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    for element in 0..NODES - 1 {
        for (whole, part) in [(&mut mass, &m), (&mut stiffness, &k)] {
            let mut block = whole.view_mut((2 * element, 2 * element), (4, 4));
            block += part;
        }
    }
    [mass, &stiffness * 2e-6, stiffness]
}

/// Returns M, C and K of both beams side by side; if `is_joined`, the joint connects their ends.
fn whole(is_joined: bool) -> [DMatrix<f64>; 3] {
    let (parts, n) = ([beam(0.8), beam(0.6)], 2 * NODES);
    let mut all = [0, 1, 2].map(|which| {
        let mut matrix = DMatrix::zeros(2 * n, 2 * n);
        matrix.view_mut((0, 0), (n, n)).copy_from(&parts[0][which]);
        matrix.view_mut((n, n), (n, n)).copy_from(&parts[1][which]);
        matrix
    });
    if is_joined {
        for (which, value) in [(1, DAMPING), (2, STIFFNESS)] {
            let (i, j) = (n - 2, n);
            for (row, column, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
                all[which][(row, column)] += sign * value;
            }
        }
    }
    all
}

/// Returns the receptances of the separate free beams at their ends, with 0.2 % noise.
fn parts(omega: &[f64], seed: u64) -> MeasuredReceptance {
    let n = 2 * NODES;
    let ends = [0, n - 2, n, 2 * n - 2];
    let [m, c, k] = whole(false);
    let mut receptance: Vec<DMatrix<Complex<f64>>> = vec![DMatrix::zeros(4, 4); omega.len()];
    for (column, dof) in ends.into_iter().enumerate() {
        let mut force = DMatrix::zeros(omega.len(), 2 * n);
        force.column_mut(dof).fill(Complex::new(1.0, 0.0));
        let all = eliminated([&m, &c, &k], omega, &force);
        for (row, table) in receptance.iter_mut().enumerate() {
            for (at, end) in ends.into_iter().enumerate() {
                table[(at, column)] = all[(row, end)];
            }
        }
    }
    let variance: Vec<DMatrix<f64>> =
        receptance.iter().map(|table| table.map(|h| (0.002 * h.norm()).powi(2))).collect();
    for (row, table) in receptance.iter_mut().enumerate() {
        let noise = complex_noise(4, 4, 100_000 * (seed + 1) + row as u64);
        *table += noise.zip_map(&variance[row], |z, v| z * v.sqrt());
    }
    MeasuredReceptance { receptance, variance: Some(variance) }
}

/// Identifies the joint between two beams from the receptances of the separate beams and from the
/// responses at both outer ends of the joined beams.
pub fn fit(seed: u64) -> Option<LikelihoodEstimate> {
    let omega: Vec<f64> = (10..=200).map(|line| TAU * 2.0 * f64::from(line)).collect();
    let n = 2 * NODES;
    let force = random_phases(omega.len(), 1, 3000 + seed);
    let mut forces = DMatrix::zeros(omega.len(), 2 * n);
    forces.column_mut(0).copy_from(&force.column(0));
    let [m, c, k] = whole(true);
    let outputs = eliminated([&m, &c, &k], &omega, &forces).select_columns(&[0, 2 * n - 2]);
    let data: LineData = measured(&omega, force, outputs, 0.002, 7000 + seed);
    let free = |start: f64| FreeCoefficient::from_start(start).at_least(0.0);
    let mut machine = Machine::new(["a1", "a9", "b1", "b9"])
        .with("joint", Element::spring_damper(["a9", "b1"], free(2e6), free(20.0)));
    machine.measured = machine.dofs.clone();
    let sensor = |dof| Sensor::new(dof, ResponseQuantity::Displacement);
    let instruments = Instruments {
        sensors: ["a1", "b9"].map(sensor).to_vec(),
        inputs: vec![Input::force("a1")],
        ..Instruments::default()
    };
    let part = parts(&omega, seed);
    let settings = Settings::default();
    Some(identify_joined(&data, &machine, &instruments, &part, &settings).ok()?.likelihood)
}

pub fn truth() -> Vec<(String, f64)> {
    vec![("joint.k".into(), STIFFNESS), ("joint.c".into(), DAMPING)]
}

#[test]
fn the_joint_of_two_measured_beams_is_found() {
    let judged = judge(&truth(), 10, fit);
    // The probability that fewer than 16 of 20 intervals of 95 % contain the truth is 0.003.
    assert!(judged.failed == 0 && judged.coverage >= 0.8, "{judged:?}");
    assert!((0.6..1.5).contains(&judged.scatter) && judged.bias < 4.0, "{judged:?}");
    let estimate = fit(3).unwrap();
    let stiffness = estimate.parameter("joint.k").unwrap();
    assert!(stiffness.standard_error.unwrap() < 0.05 * STIFFNESS, "{stiffness:?}");
    assert!((estimate.misfit_ratio.unwrap() - 1.0).abs() < 0.3, "{:?}", estimate.misfit_ratio);
}
