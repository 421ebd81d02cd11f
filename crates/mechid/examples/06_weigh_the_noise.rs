//! Compares least squares, instrumental variables and weighted estimates for a displacement whose
//! noise is strongest at low frequencies.
//!
//! Prints the parameters of each estimator and their distance from the truth, in standard errors.
//!
//! `cargo run --package mechid --example 06_weigh_the_noise`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::frequency_domain::{equation_error, instrumental_variables, output_error};
use mechid::estimate::{Estimate, Unknowns};
use mechid::model::{ResponseQuantity, Sdof};
use mechid::signal::noise::{self, Colour, NoiseLevel};
use mechid::signal::{Multisine, Phases, Sampling};
use mechid::spectra::{Lines, Pooling, RepeatedPeriods};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let truth = Sdof::new(10.0, 60.0, 4.0e4)?.system(); // 10 Hz
    let sampling = Sampling::new(1.0 / 128.0, 512)?;
    let force = Multisine::flat(4..=120, 5.0, Phases::Schroeder)?.sample(sampling)?;

    // The record has sixteen periods, with noise that decreases above 2 Hz.
    let steady = mechid::exact_periodic(&truth, &force)?.displacement().repeated(16)?;
    let (level, slow) = (NoiseLevel::FractionOfRms(0.3), Colour::LowPass { corner_hz: 2.0 });
    let displacement = noise::add(&steady, level, slow, 3)?;
    let force = force.repeated(16)?;

    let lines = Lines::new(sampling, 4..=120)?;
    let periods =
        RepeatedPeriods::new(&lines, &force, &displacement, ResponseQuantity::Displacement)?;
    let unknowns = Unknowns::unknown_mass(1)?;
    show("least squares", &equation_error(&periods.mean()?, &unknowns)?)?;
    let (first, second) = periods.halves()?;
    show("instruments", &instrumental_variables(&first, &second, &unknowns)?)?;
    // Without weights the noise is assumed white; the weights come from the scatter of the periods.
    show("likelihood, white noise", &output_error(&periods.mean()?, &unknowns)?.estimate)?;
    let weighted = output_error(&periods.mean_with_noise(Pooling::Neighbours(2))?, &unknowns)?;
    show("likelihood, weighted", &weighted.estimate)?;
    println!(
        "power of the weighted residual over what its noise explains: {:.2}",
        weighted.misfit_ratio
    );
    Ok(())
}

/// Prints each parameter with its deviation from the true value, in standard errors.
fn show(name: &str, found: &Estimate) -> Result<(), Box<dyn Error>> {
    println!("{name}");
    for (parameter, truth) in [("m", 10.0), ("c", 60.0), ("k", 4.0e4)] {
        let estimated = found.parameter(parameter)?;
        let away = (estimated.value - truth) / estimated.standard_error;
        println!("  {estimated}, {away:+.1} standard errors from {truth}");
    }
    Ok(())
}
