//! Identifies the example record step by step: the table, the spectral lines, the mean of the
//! periods, least squares on the equation of motion.
//!
//! Prints mass, damping and stiffness, the natural frequency and the damping ratio.
//!
//! `cargo run --package mechid --example 12_step_by_step`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::io::{Table, TimeAxis};
use mechid::model::ResponseQuantity;
use mechid::spectra::{Lines, RepeatedPeriods};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // The record is part of the repository; replace it by the path of your own record.
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
    let table = Table::read(file)?;
    let time = TimeAxis::Column("time");
    let force = table.record(&time, &["force"])?;
    let displacement = table.record(&time, &["displacement"])?;

    // The record has two periods of 256 samples; the excitation is on lines 4 to 60.
    let period = force.sampling().with_len(256)?;
    let lines = Lines::new(period, 4..=60)?;
    let periods =
        RepeatedPeriods::new(&lines, &force, &displacement, ResponseQuantity::Displacement)?;
    let found = equation_error(&periods.mean()?, &Unknowns::unknown_mass(1)?)?;
    print!("{found}");

    let mode = &found.system()?.modes()?[0];
    let frequency_hz = mode.natural_frequency() / std::f64::consts::TAU;
    println!("{frequency_hz:.3} Hz, damping ratio {:.4}", mode.damping_ratio());
    Ok(())
}
