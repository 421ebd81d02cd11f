//! Study of the search for the maximum of the likelihood: 200 seeded machines of 1 to 10
//! degrees of freedom with 0.01 to 2 % of noise.
//!
//! ```sh
//! cargo run --release -p mechid-estimate --example search_study
//! ```
//!
//! Two numbers after the name select the machines of the series from the first number to the
//! second. Without numbers, the search for 10 and 20 masses is timed, too.

#![allow(clippy::print_stdout, reason = "the table is the result")]

use std::collections::BTreeMap;
use std::time::Instant;

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{output_error, output_error_near};
use mechid_model::ResponseQuantity;
use mechid_problems::machines::{Support, Test, chain, repeated, series, steady_test};
use mechid_signal::{NoiseLevel, noise};
use mechid_spectra::{FrequencyData, Lines, Pooling, RepeatedPeriods};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const PERIODS: usize = 4;
/// Number of lines of each timed search; [`TIMED_NOISE`] is the ratio of noise to response.
const TIMED_LINES: usize = 500;
const TIMED_NOISE: f64 = 0.01;

#[derive(Default)]
struct Tally {
    machines: usize,
    global: usize,
    failed: usize,
    seconds: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let whole = std::env::args().len() == 1;
    let mut bounds = std::env::args().skip(1).map(|a| a.parse());
    let (from, to) = (bounds.next().unwrap_or(Ok(0))?, bounds.next().unwrap_or(Ok(200))?);
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    for index in from..to {
        let test = series(index)?;
        let level = 10f64.powf(ChaCha8Rng::seed_from_u64(index).random_range(-4.0..-1.7));
        let measured = match index / 50 % 2 {
            0 => ResponseQuantity::Displacement,
            _ => ResponseQuantity::Acceleration,
        };
        let data = measure(&test, measured, level, index)?;
        let unknowns = match test.mass_known {
            true => Unknowns::known_mass(test.system.mass())?,
            false => Unknowns::unknown_mass(test.system.dof())?,
        };
        let start = Instant::now();
        let found = output_error(&data, &unknowns);
        let seconds = start.elapsed().as_secs_f64();
        // The reference search starts from the true machine.
        let best = output_error_near(&data, &unknowns, Some(&test.system))?;
        let tally = tallies.entry(test.name).or_default();
        tally.machines += 1;
        tally.seconds += seconds;
        let told = match &found {
            Ok(found) => {
                let global = found.misfit_ratio <= best.misfit_ratio * (1.0 + 1e-6);
                tally.global += usize::from(global);
                format!(
                    "{} misfit {:.4}, {} of {} searches, {} steps, condition {:.1e}",
                    if global { "global" } else { "LOCAL" },
                    found.misfit_ratio,
                    found.agreeing,
                    found.searches,
                    found.steps,
                    found.estimate.condition(),
                )
            }
            Err(error) => {
                tally.failed += 1;
                format!("FAILED {error}")
            }
        };
        println!(
            "{index}: {}, {} dof, {measured}, noise {:.3} %: {told}, {seconds:.2} s; best {:.4}",
            test.name,
            test.system.dof(),
            level * 100.0,
            best.misfit_ratio
        );
    }
    println!(
        "| Machine | Machines | Global minimum | Failed | Seconds each |\n|---|---|---|---|---|"
    );
    for (name, t) in tallies {
        let each = t.seconds / t.machines as f64;
        println!("| {name} | {} | {} | {} | {each:.2} |", t.machines, t.global, t.failed);
    }
    if whole {
        time()?;
    }
    Ok(())
}

/// Measures and prints the time of the search for the parameters of large machines.
fn time() -> Result<(), Box<dyn std::error::Error>> {
    println!("\n| Held chain, masses | Unknowns | Searches | Seconds |\n|---|---|---|---|");
    for dof in [10, 20] {
        let system = chain(dof, Support::Fixed, 0.02, 1);
        let test = steady_test("held chain", system, false, TIMED_LINES, 1)?;
        let data = measure(&test, ResponseQuantity::Displacement, TIMED_NOISE, 1)?;
        let start = Instant::now();
        let fit = output_error(&data, &Unknowns::unknown_mass(dof)?)?;
        let seconds = start.elapsed().as_secs_f64();
        println!("| {dof} | {} | {} | {seconds:.1} |", 3 * dof * dof, fit.searches);
    }
    Ok(())
}

/// Returns repeated periods of a test, with white noise on the response.
fn measure(
    test: &Test,
    measured: ResponseQuantity,
    level: f64,
    seed: u64,
) -> Result<FrequencyData, Box<dyn std::error::Error>> {
    let exact = match measured {
        ResponseQuantity::Acceleration => &test.acceleration,
        _ => &test.displacement,
    };
    let level = NoiseLevel::FractionOfRms(level);
    let response = noise::add_white(&repeated(exact, PERIODS)?, level, seed)?;
    let lines = Lines::new(test.force.sampling(), test.lines.iter().copied())?;
    let force = repeated(&test.force, PERIODS)?;
    let periods = RepeatedPeriods::new(&lines, &force, &response, measured)?;
    Ok(periods.mean_with_noise(Pooling::AllLines)?)
}
