//! Chooses the step of a scheme from its limit of stability, and from the errors of period and
//! damping at shorter steps.
//!
//! Prints, for each scheme, its limit of stability, the step with a period error of 1 %, and the
//! numerical damping at this step.
//!
//! `cargo run --package mechid --example 11_choose_the_step`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;

use mechid::integrate::{
    Accuracy, CentralDifference, Houbolt, IntegrateError, Newmark, RungeKutta4, Scheme,
    WilsonTheta, accuracy, critical_step,
};
use mechid::model::Sdof;

/// Accepted relative error of the period.
const ACCEPTED: f64 = 0.01;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // The machine has a natural frequency of 12 Hz and a damping ratio of 0.02.
    let period = 1.0 / 12.0;
    let machine = Sdof::from_modal(1.0, 0.02, std::f64::consts::TAU / period)?.system();
    let wilson = WilsonTheta::new(1.4)?;
    let schemes: [&dyn Scheme; 5] = [
        &Newmark::AVERAGE_ACCELERATION,
        &CentralDifference::default(),
        &Houbolt::default(),
        &wilson,
        &RungeKutta4::LINEAR,
    ];
    for scheme in schemes {
        let limit = match critical_step(scheme, &machine)? {
            Some(step) => format!("stable up to {:.2} ms", 1e3 * step),
            None => "stable at any step".into(),
        };
        let step = longest(scheme)?;
        let found = accuracy(scheme, 0.02, step)?;
        let added = found.numerical_damping_ratio.unwrap_or(f64::NAN);
        println!(
            "{}: {limit}; 1 % of the period at {:.2} ms ({:.0} steps a period), damping ratio {added:+.5}",
            scheme.name(),
            1e3 * step * period,
            1.0 / step,
        );
    }
    Ok(())
}

/// Returns the longest step, in periods, at which the error of the period is at most [`ACCEPTED`]:
/// it is found by halving the step, then by bisection.
fn longest(scheme: &dyn Scheme) -> Result<f64, IntegrateError> {
    let off = |found: Accuracy| found.period_elongation.map_or(f64::INFINITY, f64::abs);
    let good = |step: f64| Ok::<_, IntegrateError>(off(accuracy(scheme, 0.02, step)?) <= ACCEPTED);
    let mut low = 0.25;
    while !good(low)? {
        low /= 2.0;
    }
    let mut high = 2.0 * low;
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if good(middle)? { low = middle } else { high = middle }
    }
    Ok(low)
}
