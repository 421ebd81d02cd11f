//! Modes from responses alone, judged by exact discretisations of known structures.

use std::f64::consts::TAU;

use mechid_modal::ambient::{
    AmbientError, AmbientEstimate, AmbientSettings, Uncertainty, identify_ambient,
};
use mechid_modal::indicators::mac;
use mechid_signal::Record;
use nalgebra::{Complex, DMatrix, dmatrix};

use crate::ambient_generator::{Quantity, Structure};

/// Four modes, two of them 3 % apart, at four sensors, under three white forces.
fn tower() -> Structure {
    let shapes = dmatrix![
        0.3, 0.4, -0.8, 0.9;
        0.6, 0.9, -0.6, -0.6;
        0.8, -0.6, 0.5, -0.5;
        1.0, -0.9, 0.9, 0.8
    ];
    Structure {
        frequencies_hz: vec![1.1, 3.2, 3.3, 6.0],
        dampings: vec![0.015, 0.01, 0.012, 0.01],
        shapes: shapes.map(Complex::from),
        forces: dmatrix![
            1.0, 0.2, -0.4;
            0.5, 3.0, 1.0;
            -1.0, 1.0, 3.0;
            6.0, -2.0, 5.0
        ],
    }
}

fn identified(record: &Record, settings: AmbientSettings) -> AmbientEstimate {
    identify_ambient(record, &settings).unwrap_or_else(|error| panic!("{error}"))
}

fn is_right(estimate: &AmbientEstimate, truth: &Structure) -> usize {
    let close = |r: usize| {
        estimate.modes.iter().any(|mode| {
            let ratio = mode.natural_frequency_hz.value / truth.frequencies_hz[r] - 1.0;
            let shape = truth.shapes.column(r).into_owned();
            ratio.abs() < 0.5 * truth.dampings[r] && mac(mode.shape.shape(), &shape) > 0.95
        })
    };
    (0..truth.frequencies_hz.len()).filter(|r| close(*r)).count()
}

#[test]
fn all_modes_of_each_quantity_are_found_and_no_other() {
    let truth = tower();
    for (index, quantity) in
        [Quantity::Displacement, Quantity::Velocity, Quantity::Acceleration].into_iter().enumerate()
    {
        let seed = 40 + index as u64;
        let record = match quantity {
            Quantity::Acceleration => truth.accelerations(20.0, 12_000, 0.05, seed),
            quantity => truth.record(quantity, 25.0, 15_000, 0.05, seed),
        };
        let estimate = identified(&record, AmbientSettings::default());
        let frequencies: Vec<_> =
            estimate.modes.iter().map(|mode| mode.natural_frequency_hz.value).collect();
        assert_eq!(estimate.modes.len(), 4, "{frequencies:?} {:?}", estimate.dropped);
        assert_eq!(is_right(&estimate, &truth), 4, "{frequencies:?}");
        assert!(estimate.harmonics.is_empty(), "{:?}", estimate.harmonics);
    }
}
