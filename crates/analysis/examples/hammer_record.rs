//! The example records of the book's hammer test: hits on mass 1 or on mass 2.
//!
//! ```text
//! cargo run -p mechid-analysis --example hammer_record -- 1 > examples/hammer-1.csv
//! ```

use mechid_model::ResponseQuantity;
use mechid_problems::HammerTest;
use mechid_signal::{NoiseLevel, Sampling, noise};
use nalgebra::dmatrix;

#[allow(clippy::print_stdout, reason = "the record is what the example is for")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let point: usize = std::env::args().nth(1).ok_or("which mass?")?.parse()?;
    let rig = HammerTest {
        frequencies_hz: vec![12.0, 31.0],
        damping_ratios: vec![0.01, 0.015],
        shapes: dmatrix![0.3, -0.2; 0.25, 0.35],
        sampling: Sampling::from_rate_hz(512.0, 2560)?,
        quantity: ResponseQuantity::Acceleration,
        hits: 5,
        peak: 150.0,
        duration: 0.02,
        force_noise: 0.005,
    };
    let record = rig.measure(point - 1, 2, 10 + point as u64)?;
    let level = NoiseLevel::StandardDeviation(0.02);
    let response = noise::add_white(&record.response, level, 20 + point as u64)?;
    println!("time,force [N],a1 [m/s^2],a2 [m/s^2]");
    for (k, time) in rig.sampling.times().enumerate() {
        let [force, a1, a2] =
            [record.force.channel(0), response.channel(0), response.channel(1)].map(|x| x[k]);
        println!("{time:.9},{force:.4},{a1:.4},{a2:.4}");
    }
    Ok(())
}
