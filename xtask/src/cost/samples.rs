//! Records of many samples: simulation, reading, identification.

use std::fs;
use std::path::Path;

use mechid::estimate::{EquationOfMotion, Unknowns};
use mechid::integrate::{AllowUnstable, Newmark, integrate};
use mechid::io::{ReadOptions, RecordFile, TimeAxis, csv_text};
use mechid::model::{InitialState, KyxSign, Response};
use mechid::signal::{Record, Sampling};
use mechid_problems::dissertation_bearing;
use nalgebra::DMatrix;

use super::measure::{Growth, shortest};

/// Number of rows that the reader of a text file buffers.
const BUFFERED_ROWS: usize = 1 << 18;

pub fn measured(seconds: f64) -> Result<Vec<Growth>, String> {
    let [mut step, mut read, mut solve] =
        ["stepping", "reading a text of 4 columns", "least squares"].map(Growth::new);
    let path = std::env::temp_dir().join(format!("mechid-cost-{}.csv", std::process::id()));
    for samples in [1_000, 10_000, 100_000, 1_000_000, 3_000_000] {
        let (force, response) = stepped(samples)?;
        let system = dissertation_bearing(KyxSign::Minus).system();
        let (rest, scheme) = (InitialState::rest(2), AllowUnstable(&Newmark::AVERAGE_ACCELERATION));
        step.push(
            samples,
            shortest(seconds, || integrate(&scheme, &system, &force, &rest).is_ok()),
        );
        solve.push(samples, least_squares(&force, &response, seconds)?);
        read.push(samples, reading(&path, &force, &response, seconds)?);
    }
    fs::remove_file(&path).map_err(|e| e.to_string())?;
    Ok(vec![step, read, solve])
}

/// Returns the response of the bearing of the dissertation to two forces with many frequencies.
fn stepped(samples: usize) -> Result<(Record, Response), String> {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let sampling = Sampling::new(1e-3, samples).map_err(|e| e.to_string())?;
    let data = DMatrix::from_fn(samples, 2, |k, c| {
        let t = 1e-3 * k as f64;
        (90.0 * t * (1.0 + 0.1 * (7.0 * t).sin()) + c as f64).sin()
    });
    let force = Record::new(sampling, data).map_err(|e| e.to_string())?;
    let scheme = AllowUnstable(&Newmark::AVERAGE_ACCELERATION);
    let response = integrate(&scheme, &system, &force, &InitialState::rest(2));
    Ok((force, response.map_err(|e| e.to_string())?))
}

fn least_squares(force: &Record, response: &Response, seconds: f64) -> Result<f64, String> {
    let [a, v, x] = [response.acceleration(), response.velocity(), response.displacement()]
        .map(|record| record.data().as_view());
    let solve = || {
        let mut rows = EquationOfMotion::new(2);
        rows.push_rows(a, v, x, force.data().as_view())?;
        rows.solve(&Unknowns::unknown_mass(2)?)
    };
    solve().map_err(|e| e.to_string())?;
    Ok(shortest(seconds, || solve().is_ok()))
}

fn reading(path: &Path, force: &Record, response: &Response, seconds: f64) -> Result<f64, String> {
    let x = response.displacement();
    let columns: [(String, &[f64]); 3] = [
        ("force".into(), force.channel(0)),
        ("x".into(), x.channel(0)),
        ("y".into(), x.channel(1)),
    ];
    fs::write(path, csv_text(force.sampling(), &columns)).map_err(|e| e.to_string())?;
    let read = || {
        let file = RecordFile::open(path, &ReadOptions::default(), BUFFERED_ROWS)?;
        file.survey(&TimeAxis::Column("time"), &["force", "x", "y"])
    };
    read().map_err(|e| e.to_string())?;
    Ok(shortest(seconds, || read().is_ok()))
}
