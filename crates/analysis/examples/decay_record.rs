//! Example record of the book's free decay: a frame that is pulled and released after a quarter of
//! a second.
//!
//! ```text
//! cargo run -p mechid-analysis --example decay_record > examples/decay.csv
//! ```

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling, noise};
use nalgebra::{Complex, DMatrix, dmatrix};

/// Instant of the release, in s.
const RELEASE: f64 = 0.25;

#[allow(clippy::print_stdout, reason = "the record is what the example is for")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sampling = Sampling::from_rate_hz(512.0, 1536)?;
    let pole = |hz: f64, zeta: f64| TAU * hz * Complex::new(-zeta, (1.0 - zeta * zeta).sqrt());
    let poles = [pole(8.2, 0.008), pole(21.5, 0.012), pole(47.0, 0.006)];
    // Displacements of the modes at the release, in m, modes × channels.
    let pulled = dmatrix![
        -3.0e-3, -1.9e-3, -0.7e-3;
        -3.0e-4, 2.1e-4, 2.8e-4;
        -4.0e-5, 5.0e-5, -6.0e-5
    ];
    let acceleration = |t: f64, channel: usize| -> f64 {
        let mode = |(at, pole): (usize, &Complex<f64>)| {
            // The frame is at rest at the release: ẋ = 0 determines the imaginary part of A in x =
            // Re(A e^{λt}).
            let amplitude = pulled[(at, channel)] * Complex::new(1.0, pole.re / pole.im);
            (amplitude * pole * pole * (pole * t).exp()).re
        };
        if t < 0.0 { 0.0 } else { poles.iter().enumerate().map(mode).sum() }
    };
    let times: Vec<f64> = sampling.times().collect();
    let clean = DMatrix::from_fn(times.len(), 3, |k, c| acceleration(times[k] - RELEASE, c));
    let level = noise::white(sampling, 3, 0.05, 1)?;
    let record = Record::new(sampling, clean + level.data())?;
    println!("time,a1 [m/s^2],a2 [m/s^2],a3 [m/s^2]");
    for (k, time) in times.iter().enumerate() {
        let [a1, a2, a3] = [0, 1, 2].map(|c| record.channel(c)[k]);
        println!("{time:.9},{a1:.4},{a2:.4},{a3:.4}");
    }
    Ok(())
}
