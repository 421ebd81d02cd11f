//! Identifies a machine from a file in four statements, then uses the result: predicts a second
//! measurement and reconstructs the force.
//!
//! Prints the identified parameters and modes with their intervals and checks, the warnings that
//! follow from them (none for this record), the percentage of the second response that the machine
//! predicts, and the force with its standard error.
//!
//! `cargo run --package mechid --example 01_identify_a_record`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use mechid::{
    Channels, Displacement, Identify, MaximumLikelihood, Measurement, Reconstruct, Window,
};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");

    // The identification, from the first of the two periods in the file.
    let channels = Channels::new("force", Displacement, "displacement");
    let period = Window { start: 1, period: Some(256), periods: Some(1) };
    let test = Measurement::open(file, &channels)?.window(period)?;
    let identified = mechid::identify(&[test], &Identify::spectra(MaximumLikelihood))?;

    println!("{identified}");
    for warning in identified.doubts() {
        println!("warning: {warning}");
    }

    // The second period was not fitted, so that it can validate the identified machine.
    let period = Window { start: 257, period: Some(256), periods: None };
    let other = Measurement::open(file, &channels)?.window(period)?;
    for channel in &identified.validate(&other)?.channels {
        println!("{} predicted: {:.2} %", channel.quantity, channel.fit_percent);
        assert!(channel.fit_percent > 99.0);
    }

    let force = mechid::reconstruct(&other, &identified.machine()?, &Reconstruct::auto())?;
    println!("\n{force}");
    Ok(())
}
