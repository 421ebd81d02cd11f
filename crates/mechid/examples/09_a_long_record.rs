//! Identifies a machine from a record that does not fit into memory: it is read in chunks,
//! repeatedly.
//!
//! Prints the number of periods and the stiffness.
//!
//! `cargo run --package mechid --example 09_a_long_record`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use mechid::analysis::measurement::IN_MEMORY_SAMPLES;
use mechid::io::CsvFile;
use mechid::model::Sdof;
use mechid::signal::{Multisine, Phases, Sampling, lines};
use mechid::{Channels, Displacement, Identify, LeastSquares, Measurement};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The record has three hundred thousand samples: a repeated period of a multisine and its exact
    // response.
    let period = Sampling::from_rate_hz(128.0, 1024)?;
    let periods = 300;
    let machine = Sdof::from_modal(25.0, 0.05, 75.0)?.system();
    let force = Multisine::flat(lines::band(period, 4.0, 30.0), 2.0, Phases::Schroeder)?;
    let force = force.sample(period)?;
    let response = mechid::exact_periodic(&machine, &force)?;
    let path = std::env::temp_dir().join(format!("mechid-long-{}.csv", std::process::id()));
    let whole = period.with_len(period.len() * periods)?;
    assert!(whole.len() > IN_MEMORY_SAMPLES);
    let mut file = CsvFile::begin(&path, whole, &["force", "x"])?;
    for _ in 0..periods {
        file.append(&[force.channel(0), response.displacement().channel(0)])?;
    }
    mechid::io::write_all(vec![file.finish()?], &[])?;

    let channels = Channels::new("force", Displacement, "x");
    let test = Measurement::open(&path, &channels)?.period(period.len())?;
    let found = mechid::identify(&[test], &Identify::spectra(LeastSquares))?;
    std::fs::remove_file(&path)?;

    let stiffness = found.estimate().parameter("k")?;
    println!("{} periods, k = {:.3} N/m", found.summary().window.periods, stiffness.value);
    assert_eq!(found.summary().window.periods, periods);
    assert!((stiffness.value / (25.0 * 75.0 * 75.0) - 1.0).abs() < 1e-9);
    Ok(())
}
