//! Two storeys on a shake table, identified from absolute and from relative accelerations.

use std::f64::consts::TAU;

use mechid_estimate::likelihood::machine::identify_machine;
use mechid_estimate::likelihood::{LikelihoodEstimate, Settings};
use mechid_model::ResponseQuantity::Acceleration;
use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
use mechid_problems::steady_lines::eliminated;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix, dmatrix};

use super::generator::{measured, random_phases};
use super::judge::judge;

const MASSES: [f64; 2] = [120.0, 100.0];
const STIFFNESSES: [f64; 2] = [2e5, 1.5e5];
const DAMPINGS: [f64; 2] = [150.0, 90.0];

/// Delay of the logger of the roof, in s, if it has a separate clock.
const DELAY: f64 = 0.013;

/// Returns the accelerations of the storeys, each relative to the table or absolute, under the
/// acceleration of the table. The channel of the roof is delayed by `delay` (s).
fn data(is_relative: [bool; 2], delay: f64, seed: u64) -> LineData {
    let omega: Vec<f64> = (5..=160).map(|line| TAU * 0.1 * f64::from(line)).collect();
    let ground = random_phases(omega.len(), 1, 2000 + seed);
    let shear = |[first, second]: [f64; 2]| dmatrix![first + second, -second; -second, second];
    let mass = dmatrix![MASSES[0], 0.0; 0.0, MASSES[1]];
    // The table has the displacement x_g and the acceleration a. The force −M ι a, with a vector ι
    // of ones, causes the relative motion z; the absolute motion is x = z + x_g.
    let force = DMatrix::from_fn(omega.len(), 2, |row, at| -ground[(row, 0)] * MASSES[at]);
    let relative = eliminated([&mass, &shear(DAMPINGS), &shear(STIFFNESSES)], &omega, &force);
    let outputs = DMatrix::from_fn(omega.len(), 2, |row, at| {
        let of_relative = relative[(row, at)] * -omega[row] * omega[row];
        let of_ground = if is_relative[at] { Complex::default() } else { ground[(row, 0)] };
        let late = if at == 1 { omega[row] * delay } else { 0.0 };
        (of_relative + of_ground) * Complex::cis(-late)
    });
    measured(&omega, ground, outputs, 0.01, seed)
}

/// Identifies the frame with a known first mass. No force is measured, so a known mass must set the
/// scale.
pub fn fit(is_relative: [bool; 2], seed: u64) -> Option<LikelihoodEstimate> {
    fit_of_clocks(is_relative, None, seed)
}

/// Identifies the frame; `delay` is the unknown delay of the roof with its bounds.
fn fit_of_clocks(
    is_relative: [bool; 2],
    delay: Option<FreeCoefficient>,
    seed: u64,
) -> Option<LikelihoodEstimate> {
    let free = |start: f64| FreeCoefficient::from_start(start).at_least(0.0);
    let machine = Machine::new(["first", "roof"])
        .with("m1", Element::mass("first", MASSES[0]))
        .with("m2", Element::mass("roof", free(80.0)))
        .with("s1", Element::spring_damper(["first", "support"], free(1.5e5), free(100.0)))
        .with("s2", Element::spring_damper(["first", "roof"], free(1.5e5), free(100.0)));
    let sensor = |dof: &str, is_relative: bool| {
        let sensor = Sensor::new(dof, Acceleration);
        if is_relative { sensor.relative_to_support() } else { sensor }
    };
    let late = if delay.is_some() { DELAY } else { 0.0 };
    let mut sensors = vec![sensor("first", is_relative[0]), sensor("roof", is_relative[1])];
    if let Some(delay) = delay {
        sensors[1].delay = delay.into();
    }
    let instruments = Instruments {
        sensors,
        inputs: vec![Input::Support { name: "table".into(), quantity: Acceleration }],
        ..Instruments::default()
    };
    let data = data(is_relative, late, seed);
    Some(identify_machine(&data, &machine, &instruments, &Settings::default()).ok()?.likelihood)
}

pub fn truth() -> Vec<(String, f64)> {
    let named = [
        ("m2", MASSES[1]),
        ("s1.k", STIFFNESSES[0]),
        ("s1.c", DAMPINGS[0]),
        ("s2.k", STIFFNESSES[1]),
        ("s2.c", DAMPINGS[1]),
    ];
    named.map(|(name, value)| (name.to_owned(), value)).to_vec()
}

#[test]
fn absolute_and_relative_accelerations_give_the_frame() {
    for is_relative in [[false, false], [true, true], [true, false]] {
        let judged = judge(&truth(), 12, |seed| fit(is_relative, seed));
        // The probability that fewer than 51 of 60 intervals of 95 % contain the truth is 0.002.
        assert!(judged.failed == 0 && judged.coverage >= 0.85, "{is_relative:?} {judged:?}");
        assert!((0.75..1.3).contains(&judged.scatter), "{is_relative:?} {judged:?}");
    }
}

/// The unknown delay of the roof channel is identified together with the frame. The reference is
/// the delay that the generator added to this channel.
#[test]
fn the_delay_of_a_logger_with_a_clock_of_its_own_is_found() {
    let delay = || FreeCoefficient::from_start(0.0).at_least(-0.05).at_most(0.05);
    let truth = [truth(), vec![("roof.delay".to_owned(), DELAY)]].concat();
    let judged = judge(&truth, 12, |seed| fit_of_clocks([false; 2], Some(delay()), seed));
    // The probability that fewer than 61 of 72 intervals of 95 % contain the truth is 0.001.
    assert!(judged.failed == 0 && judged.coverage >= 0.85, "{judged:?}");
    let error = fit_of_clocks([false; 2], Some(delay()), 0).unwrap();
    assert!(error.parameter("roof.delay").unwrap().standard_error.unwrap() < 1e-4);
}
