//! Every method with given parameters is a linear map of the measurement.

use mechid_force::{
    ForceModel, IdentifiedForce, Measurement, Noise, Start, Tuning, continuous, discretised,
    discretised_by_taylor, frequency_domain, kalman,
};
use mechid_model::{Discretisation, Response, ResponseQuantity, SecondOrderSystem};
use mechid_problems::random_stable;
use mechid_signal::{Extent, Record, Sampling};
use nalgebra::DMatrix;
use proptest::prelude::*;

const LEN: usize = 16;
const DOF: usize = 2;

type Method = fn(&SecondOrderSystem, &[f64]) -> IdentifiedForce;

fn record(values: &[f64]) -> Record {
    let sampling = Sampling::new(0.02, LEN).unwrap();
    Record::new(sampling, DMatrix::from_column_slice(LEN, DOF, values)).unwrap()
}

/// Returns a response with arbitrary displacement, velocity and acceleration, which need not be
/// derivatives of each other.
fn response(values: &[f64]) -> Response {
    let part = |i: usize| record(&values[i * LEN * DOF..][..LEN * DOF]);
    Response::new(part(0), part(1), part(2)).unwrap()
}

fn measured(values: &[f64]) -> Measurement {
    Measurement::from_record(ResponseQuantity::Velocity, record(&values[..LEN * DOF]))
}

fn discretised_by(s: &SecondOrderSystem, v: &[f64], how: Discretisation) -> IdentifiedForce {
    discretised(s, &response(v), how, Extent::Open).unwrap()
}

const METHODS: [(&str, Method); 7] = [
    ("continuous", |s, v| continuous(s, &response(v)).unwrap()),
    ("Euler", |s, v| discretised_by(s, v, Discretisation::Euler)),
    ("Taylor 4", |s, v| discretised_by_taylor(s, &response(v), 4, Extent::Open).unwrap()),
    ("exact held", |s, v| discretised_by(s, v, Discretisation::ZeroOrderHold)),
    ("exact linear", |s, v| discretised_by(s, v, Discretisation::FirstOrderHold)),
    ("frequency domain", |s, v| {
        let noise = Noise::PerChannel(vec![1.0, 2.0]);
        frequency_domain(s, &measured(v), &[1], &[1, 2, 5], &noise).unwrap()
    }),
    ("Kalman", |s, v| {
        let model = ForceModel { order: 2, corner_hz: 3.0, rms: vec![5.0] };
        let tuning = Tuning::Given { noise_std: vec![0.1, 0.1], model };
        kalman(s, &measured(v), &[1], Start::FromRest, &tuning).unwrap().force
    }),
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn sums_and_multiples_pass_through(
        first in prop::collection::vec(-1.0..1.0f64, 3 * LEN * DOF),
        second in prop::collection::vec(-1.0..1.0f64, 3 * LEN * DOF),
        weight in -100.0..100.0f64,
        seed in 0u64..50,
    ) {
        let system = random_stable(DOF, seed);
        let sum: Vec<f64> = first.iter().zip(&second).map(|(a, b)| a + weight * b).collect();
        for (name, method) in METHODS {
            let [a, b, both] = [&first, &second, &sum].map(|v| method(&system, v).record().data().clone());
            let expected = &a + &b * weight;
            let size = a.amax().max(weight.abs() * b.amax());
            // The tolerance allows for rounding errors of sums of a few dozen terms. The initial
            // state of the smoother depends on the size of the measurement, which changes the force
            // by less than a ten-thousandth of its standard error.
            let tolerance = if name == "Kalman" { 1e-3 } else { 1e-11 };
            prop_assert!((&both - &expected).amax() <= tolerance * size, "{name}");
        }
    }

    /// If M, C and K are doubled, the force for the same motion doubles.
    #[test]
    fn the_force_follows_the_machine(
        values in prop::collection::vec(-1.0..1.0f64, 3 * LEN * DOF),
        factor in 1e-3..1e3f64,
    ) {
        let system = random_stable(DOF, 3);
        let [m, c, k] = [system.mass(), system.damping(), system.stiffness()].map(|a| a * factor);
        let scaled = SecondOrderSystem::new(m, c, k).unwrap();
        for (name, method) in &METHODS[..6] {
            let (one, other) = (method(&system, &values), method(&scaled, &values));
            let (a, b) = (one.record().data() * factor, other.record().data());
            prop_assert!((&a - b).amax() <= 1e-10 * a.amax(), "{name}");
        }
    }
}
