//! A chain of forty masses in an open record; two springs and two dampers to the support are
//! unknown.

use mechid_estimate::likelihood::machine::{MachineEstimate, identify_machine};
use mechid_estimate::likelihood::{LikelihoodEstimate, Settings};
use mechid_model::elements::{
    Coefficient, Element, FreeCoefficient, Input, Instruments, Machine, Sensor,
};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact::exact_harmonic_periodic;
use mechid_signal::{NoiseLevel, Record, Sampling, Spectrum, noise};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::judge::judge;

const MASSES: usize = 40;
const STIFFNESS: f64 = 2e6;
const DAMPING: f64 = 300.0;

/// Masses whose springs and dampers towards the support are unknown.
const UNKNOWN: [usize; 2] = [0, 30];
const SENSORS: [usize; 3] = [0, 24, 39];
const FORCED: usize = 18;
const SAMPLES: usize = 1024;
const RATE_HZ: f64 = 512.0;

fn chain(value: f64) -> DMatrix<f64> {
    DMatrix::from_fn(MASSES, MASSES, |row, column| match row.abs_diff(column) {
        0 if row == MASSES - 1 => value,
        0 => 2.0 * value,
        1 => -value,
        _ => 0.0,
    })
}

/// Returns a window of the steady state under a random force whose period is four times as long as
/// the window. The displacements have 0.5 % noise.
fn data(seed: u64) -> LineData {
    let system =
        SecondOrderSystem::new(DMatrix::identity(MASSES, MASSES), chain(DAMPING), chain(STIFFNESS));
    let period = Sampling::from_rate_hz(RATE_HZ, 4 * SAMPLES).unwrap();
    let white = noise::white(period, 1, 10.0, seed).unwrap();
    let mut lines = Spectrum::from_record(&white).lines().clone();
    let last = lines.nrows() * 3 / 5;
    lines.rows_mut(last, lines.nrows() - last).fill(Complex::default());
    lines.row_mut(0).fill(Complex::default());
    let force = Spectrum::from_lines(period, lines).unwrap().to_record().unwrap();
    let mut forces = DMatrix::zeros(period.len(), MASSES);
    forces.column_mut(FORCED).copy_from(&force.data().column(0));
    let steady =
        exact_harmonic_periodic(&system.unwrap(), &Record::new(period, forces).unwrap()).unwrap();
    let readings = steady.displacement().data().select_columns(&SENSORS);
    let readings = Record::new(period, readings).unwrap();
    let [force, readings] =
        [&force, &readings].map(|record| record.window(SAMPLES / 2 + 1, SAMPLES).unwrap());
    let level = NoiseLevel::FractionOfRms(0.005);
    let readings = noise::add_white(&readings, level, seed + 100_000).unwrap();
    LineData::from_open_record(Some(&force), &readings, [2.0, 100.0]).unwrap()
}

fn machine() -> (Machine, Instruments) {
    let mut machine = Machine::new((0..MASSES).map(|at| format!("x{at}")));
    let dofs = machine.dofs.clone();
    for (at, dof) in dofs.iter().enumerate() {
        let before = if at == 0 { "support" } else { &dofs[at - 1] };
        let value = |truth: f64| match UNKNOWN.contains(&at) {
            true => Coefficient::from(FreeCoefficient::from_start(0.6 * truth).at_least(0.0)),
            false => Coefficient::Known(truth),
        };
        let link = Element::spring_damper([before, dof], value(STIFFNESS), value(DAMPING));
        machine =
            machine.with(&format!("m{at}"), Element::mass(dof, 1.0)).with(&format!("s{at}"), link);
    }
    let sensor = |at: usize| Sensor::new(&dofs[at], ResponseQuantity::Displacement);
    let instruments = Instruments {
        sensors: SENSORS.map(sensor).to_vec(),
        inputs: vec![Input::force(&dofs[FORCED])],
        ..Instruments::default()
    };
    (machine, instruments)
}

pub fn truth() -> Vec<(String, f64)> {
    let of = |at: &usize| [(format!("s{at}.k"), STIFFNESS), (format!("s{at}.c"), DAMPING)];
    UNKNOWN.iter().flat_map(of).collect()
}

pub fn estimate(seed: u64) -> Option<MachineEstimate> {
    let (machine, instruments) = machine();
    identify_machine(&data(seed), &machine, &instruments, &Settings::default()).ok()
}

pub fn fit(seed: u64) -> Option<LikelihoodEstimate> {
    Some(estimate(seed)?.likelihood)
}

#[test]
fn an_open_record_of_a_large_machine_is_identified() {
    let estimates: Vec<_> = (0..3).into_par_iter().map(fit).collect();
    let judged = judge(&truth(), 3, |seed| estimates[seed as usize].clone());
    // The probability that fewer than 9 of 12 intervals of 95 % contain the truth is 0.002.
    assert!(judged.failed == 0 && judged.coverage >= 0.75, "{judged:?}");
    assert!((0.4..1.8).contains(&judged.scatter) && judged.bias < 4.0, "{judged:?}");
    let stiffness = estimates[0].as_ref().unwrap().parameter("s30.k").unwrap();
    assert!(stiffness.standard_error.unwrap() < 0.02 * STIFFNESS, "{stiffness:?}");
}
