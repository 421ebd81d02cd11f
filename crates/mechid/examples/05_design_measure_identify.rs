//! Designs a multisine of low crest factor, simulates eight measured periods, and identifies the
//! machine with confidence intervals.
//!
//! Prints the crest factor before and after the search. For each of two estimators, prints the
//! parameters and the natural frequency with their intervals.
//!
//! `cargo run --package mechid --example 05_design_measure_identify`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::{equation_error, output_error};
use mechid::model::{ResponseQuantity, Sdof};
use mechid::signal::noise::{self, NoiseLevel};
use mechid::signal::{CrestSearch, Multisine, Phases, Sampling, Spectrum, measures};
use mechid::spectra::{Lines, Pooling, RepeatedPeriods};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // The expected frequency is about 20 Hz: the lines from 5 to 40 Hz are 0.5 Hz apart, the
    // sampling rate is 256 Hz, and the period lasts 2 s.
    let sampling = Sampling::new(1.0 / 256.0, 512)?;
    let schroeder = Multisine::flat(10..=80, 2.0, Phases::Schroeder)?;
    let designed = CrestSearch { starts: 2, seed: 1 }.minimise(&schroeder)?;
    let (before, after) = (schroeder.crest_factor()?, designed.crest_factor()?);
    println!("crest factor {before:.2} with Schroeder's phases, {after:.2} after a search");
    let force = designed.sample(sampling)?;
    let band = measures::effective_band(&Spectrum::from_record(&force), 0, 20.0)?;
    println!("the force covers {} to {} Hz", band.low_hz, band.high_hz);

    // The experiment has eight periods of the steady state, with noise of 5 % on the displacement.
    let truth = Sdof::from_modal(40.0, 0.03, std::f64::consts::TAU * 20.0)?.system();
    let steady = mechid::exact_periodic(&truth, &force)?;
    let level = NoiseLevel::FractionOfRms(0.05);
    let displacement = noise::add_white(&steady.displacement().repeated(8)?, level, 7)?;
    let force = force.repeated(8)?;

    let lines = Lines::new(sampling, 10..=80)?;
    let periods =
        RepeatedPeriods::new(&lines, &force, &displacement, ResponseQuantity::Displacement)?;
    let unknowns = Unknowns::unknown_mass(1)?;
    let simple = equation_error(&periods.mean()?, &unknowns)?;
    let likely = output_error(&periods.mean_with_noise(Pooling::PerLine)?, &unknowns)?.estimate;
    for (name, found) in [("least squares", simple), ("maximum likelihood", likely)] {
        println!("{name}");
        for estimated in found.parameters() {
            let [low, high] = estimated.interval(0.95)?;
            println!("  {estimated}, 95 % between {low:.6e} and {high:.6e}");
        }
        let mode = &found.modes()?[0];
        let [low, high] = mode.natural_frequency_hz.interval(0.95)?;
        println!("  natural frequency between {low:.4} and {high:.4} Hz; the truth is 20 Hz");
    }
    Ok(())
}
