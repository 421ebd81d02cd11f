//! Reconstructs the force from a noisy response with three methods: line by line if the lines of
//! the force are known, by shrinkage if they are not known, and by a Kalman smoother, which needs
//! no periodic force.
//!
//! Prints the true and the stated error of each method, in per cent of the force.
//!
//! `cargo run --package mechid --example 07_force_through_noise`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::force::{
    Filter, ForceUnknowns, IdentifiedForce, Measurement, Noise, Start, Tuning, frequency_domain,
    kalman, regularised, relative_error,
};
use mechid::model::{ResponseQuantity, Sdof};
use mechid::signal::noise::{self, NoiseLevel};
use mechid::signal::{Multisine, Phases, Record, Sampling};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let machine = Sdof::from_modal(25.0, 0.05, std::f64::consts::TAU * 12.0)?.system();
    let sampling = Sampling::new(1.0 / 256.0, 256)?;
    let lines = [3, 7, 11, 18, 25];
    let truth = Multisine::flat(lines, 20.0, Phases::Schroeder)?.sample(sampling)?;
    let motion = mechid::exact_periodic(&machine, &truth)?;
    let noisy = noise::add_white(motion.displacement(), NoiseLevel::FractionOfRms(0.01), 5)?;
    let measured = Measurement::from_record(ResponseQuantity::Displacement, noisy);

    let (all, unknown) = ((1..128).collect::<Vec<_>>(), Noise::Unknown);
    // On all lines, the factor ω²m amplifies the noise at high frequencies.
    let naive = frequency_domain(&machine, &measured, &[0], &all, &unknown)?;
    show("every line, as it stands", &naive, &truth)?;
    let known = frequency_domain(&machine, &measured, &[0], &lines, &Noise::OutsideLines)?;
    show("the five lines that are driven", &known, &truth)?;
    let shrunk = regularised(
        &machine,
        &measured,
        &[0],
        &ForceUnknowns::EveryLine,
        Filter::Shrinkage,
        &unknown,
    )?;
    show("shrinkage, lines not known", &shrunk.force, &truth)?;
    let smoothed = kalman(&machine, &measured, &[0], Start::InMotion, &Tuning::Likelihood)?;
    show("Kalman smoother, no period", &smoothed.force, &truth)
}

fn show(name: &str, found: &IdentifiedForce, truth: &Record) -> Result<(), Box<dyn Error>> {
    let error = 100.0 * relative_error(found.record(), truth)?;
    let size = |record: &Record| record.column(0).norm() / (record.len() as f64).sqrt();
    let claimed = found.standard_error().map(|e| 100.0 * size(e) / size(truth));
    let claimed = claimed.map_or("none stated".into(), |claimed| format!("{claimed:.1} % stated"));
    println!("{name}: {error:.1} % off, {claimed}");
    Ok(())
}
