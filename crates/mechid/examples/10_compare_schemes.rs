//! Compares the natural frequency of one machine in the simulations of five time-stepping schemes
//! with the exact response.
//!
//! Prints the natural frequency and the damping ratio of each simulation.
//!
//! `cargo run --package mechid --example 10_compare_schemes`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::integrate::{
    CentralDifference, Houbolt, Newmark, RungeKutta4, Scheme, WilsonTheta, integrate_periodic,
};
use mechid::model::{Response, ResponseQuantity, Sdof, SecondOrderSystem};
use mechid::signal::{Multisine, Phases, Record, Sampling};
use mechid::spectra::FrequencyData;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // The sampling rate is ten samples per natural period.
    let machine = Sdof::from_modal(10.0, 0.05, 10.0)?.system();
    let sampling = Sampling::new(std::f64::consts::TAU / 100.0, 512)?;
    let force = Multisine::flat(20..=90, 1.0, Phases::Schroeder)?.sample(sampling)?;
    println!("true natural frequency: 10 rad/s, damping ratio 0.05");

    show("exact", &force, &mechid::exact_periodic(&machine, &force)?)?;
    let wilson = WilsonTheta::new(1.4)?;
    let schemes: [&dyn Scheme; 5] = [
        &Newmark::AVERAGE_ACCELERATION,
        &CentralDifference::default(),
        &Houbolt::default(),
        &wilson,
        &RungeKutta4::LINEAR,
    ];
    for scheme in schemes {
        show(&scheme.name(), &force, &integrate_periodic(scheme, &machine, &force)?)?;
    }
    Ok(())
}

/// Identifies the machine from the displacement and prints its natural frequency.
fn show(name: &str, force: &Record, response: &Response) -> Result<(), Box<dyn Error>> {
    let lines = 20..=90;
    let motion = response.displacement();
    let data = FrequencyData::from_records(force, motion, ResponseQuantity::Displacement, lines)?;
    let system: SecondOrderSystem = equation_error(&data, &Unknowns::unknown_mass(1)?)?.system()?;
    let mode = &system.modes()?[0];
    let (omega, ratio) = (mode.natural_frequency(), mode.damping_ratio());
    println!("{name:<60} {omega:8.4} rad/s   {ratio:.5}");
    Ok(())
}
