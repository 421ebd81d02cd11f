//! Identifies a machine in one experiment, then reconstructs an unknown force from another
//! response.
//!
//! Prints the amplitude of the reconstructed force and its relative error.
//!
//! `cargo run --package mechid --example 03_find_the_force`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::model::{ResponseQuantity, Sdof};
use mechid::signal::{Multisine, Phases, Sampling};
use mechid::spectra::FrequencyData;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let machine = Sdof::new(10.0, 180.0, 5000.0)?.system();
    let sampling = Sampling::new(0.01, 512)?;

    // The experiment has a known multisine.
    let excitation = Multisine::flat(1..=120, 5.0, Phases::Schroeder)?.sample(sampling)?;
    let response = mechid::exact_periodic(&machine, &excitation)?;
    let motion = response.displacement();
    let data =
        FrequencyData::from_records(&excitation, motion, ResponseQuantity::Displacement, 1..=120)?;
    let identified = equation_error(&data, &Unknowns::unknown_mass(1)?)?.system()?;

    // In operation, an unmeasured unbalance acts on line 40.
    let unbalance = Multisine::flat([40], 30.0, Phases::Zero)?.sample(sampling)?;
    let at_work = mechid::exact_periodic(&machine, &unbalance)?;
    let found = mechid::force::continuous(&identified, &at_work)?;
    let error = mechid::force::relative_error(found.record(), &unbalance)?;
    let peak = found.record().column(0).amax();
    println!("a force of {peak:.3} N found where 30 N acted; relative error {error:.1e}");
    Ok(())
}
