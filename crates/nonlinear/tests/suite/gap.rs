//! Stops with clearance; the search starts from a given clearance, or from the clearance of a
//! least-squares fit.

use mechid_estimate::Unknowns;
use mechid_model::{ResponseQuantity, Terms};
use mechid_nonlinear::{
    EquationErrorOptions, ShapeConstants, SteadyExperiments, SteppedRecord, best_output_error,
    equation_error,
};
use mechid_signal::{Extent, NoiseLevel, Record, Sampling, noise};
use mechid_spectra::Lines;
use rayon::prelude::*;

use crate::stepped::{random_phases, steady_after};
use crate::study::runs;

const PERIODS: usize = 4;
const STIFFNESS: f64 = 5053.24;

/// Returns force and response of an oscillator of 2 kg and 8 Hz between two stops with a clearance
/// of 5 mm: four periods with 1 % of noise on both records.
fn measure(amplitude: f64, seed: u64) -> [Record; 2] {
    let sampling = Sampling::new(1.0 / 256.0, 512).unwrap();
    let lines = random_phases(4..60, amplitude, seed);
    let (force, response) = steady_after(3, sampling, &[lines], |x, v, f| {
        let beyond = (x[0].abs() - 0.005).max(0.0).copysign(x[0]);
        [(f[0] - 4.0 * v[0] - STIFFNESS * x[0] - 3000.0 * beyond) / 2.0]
    });
    let level = NoiseLevel::FractionOfRms(0.01);
    let with = |record: &Record, seed| {
        noise::add_white(&record.repeated(PERIODS).unwrap(), level, seed).unwrap()
    };
    [with(&force, 2 * seed), with(&response, 2 * seed + 1)]
}

/// Returns the error of the estimated clearance divided by the standard error, or the reason why
/// the fit failed.
fn search(amplitude: f64, clearance: f64, seed: u64) -> Result<f64, String> {
    let [force, response] = measure(amplitude, seed);
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let sampling = Sampling::new(1.0 / 256.0, 512).unwrap();
    let lines = Lines::new(sampling, 1..=60).unwrap();
    let mut data = SteadyExperiments::new(&lines, 1, ResponseQuantity::Displacement);
    data.push(&force, &response).unwrap();
    let terms: Terms = format!("kg: gap(x1, {clearance})").parse().unwrap();
    let start = |laws: bool| {
        let shape = ShapeConstants { laws, ..ShapeConstants::default() };
        let options = EquationErrorOptions { shape, ..EquationErrorOptions::default() };
        equation_error(&data, &unknowns, &terms, &options)
    };
    let starts: Vec<_> = [false, true].into_iter().filter_map(|laws| start(laws).ok()).collect();
    let record = SteppedRecord { force, response, extent: Extent::WholePeriod, periods: PERIODS };
    let fit = best_output_error(&[record], ResponseQuantity::Displacement, &starts);
    let fit = fit.map_err(|error| error.to_string())?.estimate;
    let found = fit.parameter("kg.a").unwrap().estimate;
    Ok((found.value - 0.005) / found.standard_error)
}

#[test]
#[allow(clippy::print_stderr, reason = "the study by hand is read")]
fn a_clearance_is_found() {
    for (amplitude, clearance) in [(12.0, 0.005), (6.0, 0.008)] {
        let found: Vec<_> =
            (0..runs(3)).into_par_iter().map(|seed| search(amplitude, clearance, seed)).collect();
        let is_wrong = |found: &&Result<f64, String>| !found.as_ref().is_ok_and(|z| z.abs() < 4.0);
        let wrong: Vec<_> = found.iter().filter(is_wrong).collect();
        eprintln!("{amplitude} N, from {clearance} m: {} of {}", wrong.len(), found.len());
        assert!(wrong.is_empty(), "{amplitude} N, from {clearance} m: {wrong:?}");
    }
}
