//! Identifies an uncertain machine from a noisy test, and reconstructs an unknown force with its
//! confidence band.
//!
//! Prints the force with its standard error, and how many samples lie within two standard errors.
//!
//! `cargo run --package mechid --example 04_a_force_with_its_band`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use mechid::model::Sdof;
use mechid::signal::{Multisine, Phases, Record, Sampling, lines, noise};
use mechid::{Channels, Displacement, Identify, MaximumLikelihood, Measurement, Reconstruct};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let machine = Sdof::from_modal(25.0, 0.05, 75.0)?.system();
    let period = Sampling::from_rate_hz(128.0, 256)?;
    let measured = |force: &Record, seed: u64| -> Result<Record, Box<dyn std::error::Error>> {
        let response = mechid::exact_periodic(&machine, force)?;
        let noise = noise::white(force.sampling(), 1, 2e-6, seed)?;
        Ok(Record::new(force.sampling(), response.displacement().data() + noise.data())?)
    };

    // The test has eight periods under a known force.
    let known = Multisine::flat(lines::band(period, 2.0, 30.0), 2.0, Phases::Schroeder)?;
    let known = known.sample(period)?.repeated(8)?;
    let x = measured(&known, 1)?;
    let test = Measurement::from_records(&known, &[(Displacement, &x)])?.period(256)?;
    let found = mechid::identify(&[test], &Identify::spectra(MaximumLikelihood))?;

    // In operation, another force acts, which is not measured.
    let truth = Multisine::flat([6, 11, 23], 5.0, Phases::Random { seed: 3 })?.sample(period)?;
    let x = measured(&truth, 2)?;
    let columns = [("x", x.channel(0))];
    let channels = Channels::from_responses(Displacement, "x");
    let run = Measurement::from_columns(period, &columns, &channels)?.period(256)?;
    let how = Reconstruct { lines: Some("6,11,23".parse()?), ..Reconstruct::auto() };
    let force = mechid::reconstruct(&run, &found.machine()?, &how)?;

    println!("{force}");
    let (value, error) = (force.force().record(), force.force().standard_error().unwrap());
    let inside = (0..period.len())
        .filter(|k| {
            let apart = value.channel(0)[*k] - truth.channel(0)[*k];
            apart.abs() < 2.0 * error.channel(0)[*k]
        })
        .count();
    println!("{inside} of {} samples lie within two standard errors of the truth", period.len());
    assert!(inside * 10 > period.len() * 8);
    Ok(())
}
