//! Identifies the modes of a frame of eight storeys from one shaker and eight accelerometers.
//!
//! Prints each natural frequency and damping ratio with its standard error, the true frequency
//! beside it, then the full result with shapes and checks.
//!
//! `cargo run --package mechid --example 02_modes_of_a_test`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::model::SecondOrderSystem;
use mechid::signal::{Multisine, Phases, Record, Sampling, lines, noise};
use mechid::{Acceleration, Channels, Measurement, ModesSettings};
use nalgebra::DMatrix;

const STOREYS: usize = 8;
const NAMES: [&str; STOREYS] = ["a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8"];

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let frame = frame()?;

    // The shaker excites the top storey from 1 to 25 Hz; the accelerometers have white noise.
    let sampling = Sampling::from_rate_hz(64.0, 1024)?;
    let shaker = Multisine::flat(lines::band(sampling, 1.0, 25.0), 20.0, Phases::Schroeder)?;
    let shaker = shaker.sample(sampling)?;
    let mut forces = DMatrix::zeros(sampling.len(), STOREYS);
    forces.column_mut(STOREYS - 1).copy_from(&shaker.column(0));
    let response = mechid::exact_periodic(&frame, &Record::new(sampling, forces)?)?;
    let noise = noise::white(sampling, STOREYS, 0.01, 1)?;
    let acceleration = Record::new(sampling, response.acceleration().data() + noise.data())?;

    let mut columns = vec![("force", shaker.channel(0))];
    columns.extend(NAMES.iter().enumerate().map(|(at, name)| (*name, acceleration.channel(at))));
    let channels = Channels::new("force", Acceleration, &NAMES.join(","));
    let test = Measurement::from_columns(sampling, &columns, &channels)?;
    let modes = mechid::modes(&[test], &ModesSettings::default())?;

    let summary = modes.summary();
    for (mode, truth) in summary.modes.iter().zip(frame.modes()?) {
        let row = &mode.mode.row;
        let true_hz = truth.natural_frequency() / std::f64::consts::TAU;
        let [hz, hz_error, _] = row.natural_frequency_hz.cells();
        let [ratio, ratio_error, _] = row.damping_ratio.cells();
        println!("{hz} ± {hz_error} Hz (true {true_hz:.5}), damping ratio {ratio} ± {ratio_error}");
        let distance = (row.natural_frequency_hz.value - true_hz).abs();
        assert!(
            row.natural_frequency_hz.standard_error.is_some_and(|error| distance < 5.0 * error)
        );
    }
    assert_eq!(summary.modes.len(), STOREYS);
    println!("\n{modes}");
    Ok(())
}

/// Returns eight storeys of 40 kg on columns of 0.1 MN/m, with proportional damping.
fn frame() -> Result<SecondOrderSystem, Box<dyn Error>> {
    let stiffness = DMatrix::from_fn(STOREYS, STOREYS, |row, column| match row.abs_diff(column) {
        0 if row == STOREYS - 1 => 1.0e5,
        0 => 2.0e5,
        1 => -1.0e5,
        _ => 0.0,
    });
    let mass = DMatrix::from_diagonal_element(STOREYS, STOREYS, 40.0);
    let damping = &mass * 0.3 + &stiffness * 2.0e-4;
    Ok(SecondOrderSystem::new(mass, damping, stiffness)?)
}
