//! Identifies a machine from a file, with intervals and checks, and reconstructs the force, in four
//! statements.
//!
//! Prints the identified parameters and modes with their intervals and checks, the percentage of
//! the response of a second window that is predicted, and the force with its standard error.
//!
//! `cargo run --package mechid --example 01_identify_a_record`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use mechid::{
    Channels, Displacement, Identify, MaximumLikelihood, Measurement, Reconstruct, Window,
};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
    let channels = Channels::new("force", Displacement, "displacement");
    // The second of the two periods is used for validation.
    let other = Measurement::open(rig, &channels)?.window(Window {
        start: 257,
        period: Some(256),
        periods: None,
    })?;

    let test = Measurement::open(rig, &channels)?.window(Window {
        start: 1,
        period: Some(256),
        periods: Some(1),
    })?;
    let found = mechid::identify(&[test], &Identify::spectra(MaximumLikelihood))?;
    let fit = found.validate(&other)?;
    let force = mechid::reconstruct(&other, &found.machine()?, &Reconstruct::auto())?;

    println!("{found}");
    for channel in &fit.channels {
        println!("{} predicted: {:.2} %", channel.quantity, channel.fit_percent);
        assert!(channel.fit_percent > 99.0);
    }
    println!("\n{force}");
    for doubt in found.doubts() {
        println!("doubt: {doubt}");
    }
    Ok(())
}
