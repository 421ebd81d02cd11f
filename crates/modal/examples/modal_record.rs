//! Modes of a measured record: a text file with a header and columns separated by commas.
//!
//! `cargo run --release -p mechid-modal --example modal_record -- FILE RATE_HZ INPUTS LOW_HZ
//! HIGH_HZ [SHARE]` takes the first INPUTS columns as forces; with SHARE, the modes are identified
//! from this fraction of the record and predict the rest.
#![allow(clippy::print_stdout, reason = "an example prints its table")]

use std::error::Error;
use std::time::Instant;

use mechid_modal::{ModalSettings, identify_modes};
use mechid_signal::{Record, Sampling};
use mechid_spectra::LineData;
use nalgebra::DMatrix;

/// Prints the progress of the identification, with the time since the start.
struct Progress(Instant);

impl log::Log for Progress {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        println!("{:7.3} s  {}", self.0.elapsed().as_secs_f64(), record.args());
    }

    fn flush(&self) {}
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, rate, inputs, low, high] = arguments.get(..5).ok_or("five arguments")? else {
        return Err("five arguments".into());
    };
    let text = std::fs::read_to_string(file)?;
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|value| value.trim().parse()).collect())
        .collect::<Result<_, _>>()?;
    let (count, inputs): (usize, usize) = (rows[0].len(), inputs.parse()?);
    let band = [low.parse()?, high.parse()?];
    let share: f64 = arguments.get(5).map_or(Ok(1.0), |text| text.parse())?;
    let rate: f64 = rate.parse()?;
    let part = |from: usize, to: usize| -> Result<LineData, Box<dyn Error>> {
        let sampling = Sampling::from_rate_hz(rate, to - from)?;
        let record = |first: usize, last: usize| {
            let data = DMatrix::from_fn(to - from, last - first, |k, c| rows[from + k][first + c]);
            Record::new(sampling, data)
        };
        let (forces, motion) = (record(0, inputs)?, record(inputs, count)?);
        Ok(LineData::from_open_record(Some(&forces), &motion, band)?)
    };
    let split = (share * rows.len() as f64) as usize;
    let data = part(0, split)?;
    let start = Instant::now();
    if arguments.get(6).is_some() {
        log::set_boxed_logger(Box::new(Progress(start)))?;
        log::set_max_level(log::LevelFilter::Debug);
    }
    let estimate = identify_modes(&data, &ModalSettings::default())?;
    println!("{:.2} s, {} steps", start.elapsed().as_secs_f64(), estimate.iterations());
    for mode in estimate.modes() {
        let (f, z) = (mode.natural_frequency_hz, mode.damping_ratio);
        println!(
            "{:9.3} ± {:.3} Hz  ζ {:8.4} ± {:.4} %  not driven {:5.1} %  gain {:.0}{}",
            f.value,
            1.96 * f.standard_error,
            100.0 * z.value,
            196.0 * z.standard_error,
            100.0 * mode.unmeasured_ratio.unwrap_or(0.0),
            mode.gain,
            if mode.near_edge { "  near the edge" } else { "" },
        );
    }
    for dropped in estimate.dropped() {
        println!(
            "dropped {:9.3} Hz ζ {:.4}: {:?}",
            dropped.frequency_hz, dropped.damping_ratio, dropped.reason
        );
    }
    let summary = |what: &str, shares: &[f64]| {
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let least = shares.iter().copied().fold(1.0, f64::min);
        println!("{what}: {:.3} % on average, {:.3} % at least", 100.0 * mean, 100.0 * least);
    };
    summary("explained", &estimate.variance_explained());
    println!("residual powers {:?}", estimate.residual_powers().forces);
    if share < 1.0 {
        let rest = part(split, rows.len())?;
        let predicted = estimate.synthesis(&rest)?;
        let difference = rest.outputs() - predicted;
        let power = |matrix: &DMatrix<_>, k: usize| matrix.column(k).norm_squared();
        let shares: Vec<f64> = (0..rest.outputs().ncols())
            .map(|k| 1.0 - power(&difference, k) / power(rest.outputs(), k))
            .collect();
        summary("validated on the rest", &shares);
    }
    Ok(())
}
