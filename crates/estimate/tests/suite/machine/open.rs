//! Two masses under two random forces, recorded for less than a period.

use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::LineData;
use nalgebra::dmatrix;

pub const TRUTH: [(&str, f64); 4] =
    [("s1.k", 1.6e5), ("s1.c", 22.0), ("s2.k", 0.9e5), ("s2.c", 8.0)];

pub fn rig() -> RandomTest {
    let mass = dmatrix![10.0, 0.0; 0.0, 8.0];
    let damping = dmatrix![30.0, -8.0; -8.0, 8.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -0.9e5, 0.9e5];
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    let sampling = Sampling::new(0.002, 2048).unwrap();
    RandomTest { system, sampling, quantity: ResponseQuantity::Acceleration, force: 100.0 }
}

/// Returns spectra of the forces and of these channels of the response, which have 1 % noise.
pub fn data(rig: &RandomTest, seed: u64, channels: &[usize]) -> LineData {
    let [force, response] = rig.measure(seed).unwrap();
    let columns = response.data().select_columns(channels);
    let response = Record::new(response.sampling(), columns).unwrap();
    let level = NoiseLevel::FractionOfRms(0.01);
    let response = noise::add_white(&response, level, seed + 100_000).unwrap();
    LineData::from_open_record(Some(&force), &response, [3.0, 120.0]).unwrap()
}

pub fn machine() -> Machine {
    let free = |start: f64| FreeCoefficient::from_start(start).at_least(0.0);
    Machine::new(["x1", "x2"])
        .with("m1", Element::mass("x1", 10.0))
        .with("m2", Element::mass("x2", 8.0))
        .with("s1", Element::spring_damper(["x1", "support"], free(1.4e5), free(10.0)))
        .with("s2", Element::spring_damper(["x1", "x2"], free(1.1e5), free(10.0)))
}

pub fn instruments(sensors: &[&str]) -> Instruments {
    Instruments {
        sensors: sensors
            .iter()
            .map(|dof| Sensor::new(dof, ResponseQuantity::Acceleration))
            .collect(),
        inputs: vec![Input::force("x1"), Input::force("x2")],
        ..Instruments::default()
    }
}
