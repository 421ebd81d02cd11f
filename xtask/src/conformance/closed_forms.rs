//! Modes and motions that have a closed form.

use std::f64::consts::{PI, TAU};

use mechid::integrate::{MatrixExponential, Scheme, integrate};
use mechid::model::{InitialState, Sdof, SecondOrderSystem};
use mechid::signal::{Record, Sampling};
use nalgebra::DMatrix;

use super::{Judge, Row};

/// Number of masses of the chain.
const MASSES: usize = 60;

/// Compares the natural frequencies of a chain of equal masses and springs with the closed form;
/// one end is fixed, the other end is free.
pub(super) fn chain() -> Result<Judge, String> {
    let (mass, stiffness) = (2.0, 5000.0);
    let springs = DMatrix::from_fn(MASSES, MASSES, |i, j| match i.abs_diff(j) {
        0 if i == MASSES - 1 => stiffness,
        0 => 2.0 * stiffness,
        1 => -stiffness,
        _ => 0.0,
    });
    let masses = DMatrix::identity(MASSES, MASSES) * mass;
    let damping = DMatrix::zeros(MASSES, MASSES);
    let words = |e: &dyn std::fmt::Display| e.to_string();
    let system = SecondOrderSystem::new(masses, damping, springs).map_err(|e| words(&e))?;
    let mut ours: Vec<f64> = system
        .modes()
        .map_err(|e| words(&e))?
        .iter()
        .map(|mode| mode.natural_frequency() / TAU)
        .collect();
    ours.sort_by(f64::total_cmp);
    let expected = |j: usize| {
        let angle = (2 * j + 1) as f64 * PI / (2.0 * (2 * MASSES + 1) as f64);
        2.0 * (stiffness / mass).sqrt() * angle.sin() / TAU
    };
    let rows = ours.iter().enumerate().map(|(j, ours)| {
        let quantity = format!("chain of {MASSES} masses: natural frequency {}, Hz", j + 1);
        Row::by_formula(quantity, expected(j), *ours, 1e-11 * expected(MASSES - 1))
    });
    Ok(Judge {
        name: "Chain of equal masses",
        source: "ωⱼ = 2 √(k/m) sin((2j − 1) π / (2 (2n + 1))); R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979",
        tolerance: "10⁻¹¹ of the highest frequency: rounding of the eigenvalues",
        test: "xtask/tests/conformance.rs",
        rows: rows.collect(),
    })
}

/// Compares the displacement of a damped oscillator with the closed form. The oscillator starts at
/// rest, and the force grows in proportion to time.
pub(super) fn transient() -> Result<Judge, String> {
    let (mass, damping, stiffness, rate) = (10.0, 40.0, 9000.0, 300.0);
    let sampling = Sampling::new(0.025, 61).map_err(|e| e.to_string())?;
    let force =
        Record::from_channels(sampling, &[sampling.times().map(|t| rate * t).collect::<Vec<_>>()])
            .map_err(|e| e.to_string())?;
    let system = Sdof::new(mass, damping, stiffness).map_err(|e| e.to_string())?.system();
    let scheme: &dyn Scheme = &MatrixExponential::LINEAR;
    let motion =
        integrate(scheme, &system, &force, &InitialState::rest(1)).map_err(|e| e.to_string())?;
    let natural = f64::sqrt(stiffness / mass);
    let ratio = damping / (2.0 * f64::sqrt(stiffness * mass));
    let damped = natural * (1.0 - ratio * ratio).sqrt();
    let expected = |t: f64| {
        let lag = 2.0 * ratio / natural;
        let decay = (-ratio * natural * t).exp();
        let (sin, cos) = (damped * t).sin_cos();
        rate / stiffness
            * (t - lag + decay * (lag * cos + (2.0 * ratio * ratio - 1.0) / damped * sin))
    };
    let largest = expected(1.5);
    let rows = sampling.times().enumerate().skip(1).map(|(k, t)| {
        let quantity = format!("oscillator under a ramp: displacement at {t:.3} s, m");
        Row::by_formula(quantity, expected(t), motion.displacement().channel(0)[k], 1e-12 * largest)
    });
    Ok(Judge {
        name: "Oscillator under a ramp",
        source: "Duhamel's integral of a ramp; A. K. Chopra, Dynamics of Structures, chapter 4",
        tolerance: "10⁻¹² of the largest displacement: rounding of 60 exact steps",
        test: "xtask/tests/conformance.rs",
        rows: rows.collect(),
    })
}
