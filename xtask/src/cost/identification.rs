//! Time to identify every entry of M, C and K of a chain from its displacements, with a force on
//! each mass.

use mechid::estimate::frequency_domain::output_error;
use mechid::estimate::{EquationOfMotion, Unknowns};
use mechid::model::ResponseQuantity;
use mechid::signal::{NoiseLevel, noise};
use mechid::spectra::{FrequencyData, Lines, Pooling, RepeatedPeriods};
use mechid_problems::machines::{Support, chain, repeated, steady_test};
use nalgebra::DMatrix;

use super::measure::{Growth, shortest};

/// Number of samples for least squares.
const ROWS: usize = 2048;
/// Number of lines for maximum likelihood; `PERIODS` is the number of periods.
const LINES: usize = 500;
const PERIODS: usize = 4;

pub fn measured(seconds: f64) -> Result<Vec<Growth>, String> {
    let mut least_squares = Growth::new("least squares, 2,048 samples");
    for n in [2, 5, 10, 20, 50] {
        least_squares.push(n, least_squares_time(n, seconds)?);
    }
    let mut likelihood = Growth::new("maximum likelihood, 500 lines");
    for n in [2, 5, 10, 20] {
        likelihood.push(n, likelihood_time(n, seconds).map_err(|e| e.to_string())?);
    }
    Ok(vec![least_squares, likelihood])
}

/// Returns numbers between −½ and ½, the same in every run.
fn scattered(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut seed = 1_u64;
    DMatrix::from_fn(rows, columns, |_, _| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    })
}

fn least_squares_time(n: usize, seconds: f64) -> Result<f64, String> {
    let motions = scattered(ROWS, 3 * n);
    let truth = DMatrix::from_fn(3 * n, n, |i, j| if i % n == j { 2.0 } else { 0.1 });
    let force = &motions * truth + scattered(ROWS, n) * 0.01;
    let solve = || {
        let mut rows = EquationOfMotion::new(n);
        let [a, v, x] = [0, 1, 2].map(|kind| motions.columns(kind * n, n));
        rows.push_rows(a, v, x, force.as_view())?;
        rows.solve(&Unknowns::unknown_mass(n)?)
    };
    solve().map_err(|e| e.to_string())?;
    Ok(shortest(seconds, || solve().is_ok()))
}

fn likelihood_time(n: usize, seconds: f64) -> Result<f64, Box<dyn std::error::Error>> {
    let test = steady_test("held chain", chain(n, Support::Fixed, 0.02, 1), false, LINES, 1)?;
    let response = repeated(&test.displacement, PERIODS)?;
    let response = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), 1)?;
    let lines = Lines::new(test.force.sampling(), test.lines.iter().copied())?;
    let force = repeated(&test.force, PERIODS)?;
    let quantity = ResponseQuantity::Displacement;
    let data: FrequencyData = RepeatedPeriods::new(&lines, &force, &response, quantity)?
        .mean_with_noise(Pooling::AllLines)?;
    let unknowns = Unknowns::unknown_mass(n)?;
    output_error(&data, &unknowns)?;
    Ok(shortest(seconds, || output_error(&data, &unknowns).is_ok()))
}
