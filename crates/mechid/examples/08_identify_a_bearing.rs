//! Identifies the eight coefficients of an oil film from two shakers on interleaved lines and two
//! noisy displacements.
//!
//! Prints the coefficients and the modes with their standard errors, and the skew part of the
//! stiffness.
//!
//! `cargo run --package mechid --example 08_identify_a_bearing`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::output_error;
use mechid::model::{JournalBearing, KyxSign, OilFilm, ResponseQuantity};
use mechid::signal::noise::{self, NoiseLevel};
use mechid::signal::{Multisine, Phases, Record, Sampling, lines};
use mechid::spectra::{Lines, Pooling, RepeatedPeriods};
use nalgebra::DMatrix;

const MASS: f64 = 14.8;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let film = OilFilm {
        kxx: 4.0e7,
        kxy: 1.2e7,
        kyx: -2.0e7,
        kyy: 6.0e7,
        cxx: 2.0e4,
        cxy: 3.0e3,
        cyx: 3.0e3,
        cyy: 2.6e4,
    };
    let machine = JournalBearing::new(MASS, film, KyxSign::Plus)?.system();

    // Lines 10 to 300, which are 2 Hz apart, are assigned in turn to the shakers in x and y.
    let sampling = Sampling::new(1.0 / 2048.0, 1024)?;
    let used: Vec<usize> = (10..=300).collect();
    let shakers = lines::interleaved(&used, 2)?
        .into_iter()
        .map(|own| Multisine::flat(own, 20.0, Phases::Schroeder)?.sample(sampling))
        .collect::<Result<Vec<_>, _>>()?;
    let force = Record::from_channels(sampling, &[shakers[0].channel(0), shakers[1].channel(0)])?;
    let steady = mechid::exact_periodic(&machine, &force)?.displacement().repeated(10)?;
    let displacement = noise::add_white(&steady, NoiseLevel::SnrDb(30.0), 11)?;

    // The mass is known by weighing; the other parameters are estimated.
    let periods = RepeatedPeriods::new(
        &Lines::new(sampling, used)?,
        &force.repeated(10)?,
        &displacement,
        ResponseQuantity::Displacement,
    )?;
    let unknowns = Unknowns::known_mass(&DMatrix::from_diagonal_element(2, 2, MASS))?;
    let found = output_error(&periods.mean_with_noise(Pooling::PerLine)?, &unknowns)?.estimate;
    print!("{found}");
    for (number, mode) in (1..).zip(found.modes()?) {
        let (hz, ratio) = (mode.natural_frequency_hz, mode.damping_ratio);
        println!(
            "mode {number}: {:.2} ± {:.2} Hz, damping ratio {:.4} ± {:.4}",
            hz.value, hz.standard_error, ratio.value, ratio.standard_error
        );
    }
    // This cross-coupling can cause a whirl.
    let whirl = 0.5 * (found.parameter("k12")?.value - found.parameter("k21")?.value);
    println!("skew part of the stiffness: {whirl:.3e} N/m, true 1.6e7 N/m");
    Ok(())
}
