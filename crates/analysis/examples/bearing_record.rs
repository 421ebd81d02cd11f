//! The example records of the book's bearing test: `rig` is the test with the film, `dry` is the
//! baseline test without it.
//!
//! ```text
//! cargo run -p mechid-analysis --example bearing_record -- rig > examples/bearing-rig.csv
//! ```

use mechid_bearing::{Bore, Conditions, FiniteBearing};
use mechid_model::OilFilm;
use mechid_problems::rig::{BearingRig, Shakers};
use mechid_signal::Sampling;
use nalgebra::Matrix2;

/// Number of samples in a period, and number of periods.
const LENGTH: [usize; 2] = [256, 4];

fn rig() -> Result<BearingRig, Box<dyn std::error::Error>> {
    let omega = std::f64::consts::TAU * 50.0;
    let conditions =
        Conditions { diameter: 0.1, length: 0.05, clearance: 100e-6, viscosity: 0.02, omega };
    let load = 2500.0;
    let bore = Bore::two_axial_grooves(20_f64.to_radians())?;
    let bearing = FiniteBearing::new(bore, conditions.length_over_diameter()?)?;
    let found = bearing.equilibrium(conditions.sommerfeld_number(load)?)?;
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } =
        conditions.film(found.coefficients(), load)?;
    let film = [
        Matrix2::new(kxx, kxy, kyx, kyy),
        Matrix2::new(cxx, cxy, cyx, cyy),
        Matrix2::identity() * 2.0,
    ];
    let stinger = Matrix2::new(4e6, 2e5, 2e5, 3e6);
    Ok(BearingRig {
        baseline: [stinger, Matrix2::new(1e3, 0.0, 0.0, 800.0), Matrix2::identity() * 0.5],
        crosstalk: 0.002,
        run_out: vec![1.5e-6, 6e-7, 2e-7],
        ..BearingRig::new(film)
    })
}

#[allow(clippy::print_stdout, reason = "the record is what the example is for")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let is_dry = std::env::args().nth(1).is_some_and(|which| which == "dry");
    let (rig, seed) = if is_dry { (rig()?.dry(), 2) } else { (rig()?, 1) };
    let sampling = Sampling::from_rate_hz(1024.0, LENGTH[0])?;
    // The lines are from 20 to 252 Hz in steps of 4 Hz; the shakers excite alternate lines.
    let lines: Vec<usize> = (5..=63).collect();
    let amplitude = if is_dry { 4.0 } else { 14.0 };
    let period = rig.period(sampling, &lines, amplitude, Shakers::Interleaved, seed)?;
    let test = rig.measured(&period, LENGTH[1], seed)?;
    println!("time,fx [N],fy [N],ax [m/s^2],ay [m/s^2],dx [um],dy [um]");
    for (k, time) in test.force.sampling().times().enumerate() {
        let two = |record: &mechid_signal::Record, scale: f64, digits: usize| {
            let [x, y] = [0, 1].map(|channel| record.channel(channel)[k] * scale);
            format!("{x:.digits$},{y:.digits$}")
        };
        let (force, acceleration) = (two(&test.force, 1.0, 3), two(&test.acceleration, 1.0, 4));
        println!("{time:.10},{force},{acceleration},{}", two(&test.displacement, 1e6, 4));
    }
    Ok(())
}
