//! Score test of a delay, on correct data and on late outputs; the reference is the phase e^(−iωτ).

use mechid_estimate::likelihood::machine::{MachineEstimate, identify_machine};
use mechid_estimate::likelihood::{DelayScore, Settings};
use mechid_model::elements::FreeCoefficient;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::chain;
use super::open;

/// Returns `data` without its stated noise and with every output delayed by its entry of `delays`,
/// in s.
fn late(data: &LineData, delays: [f64; 2]) -> LineData {
    let omega = data.omega();
    let turned = |row: usize, output: usize| {
        data.outputs()[(row, output)] * Complex::cis(-omega[row] * delays[output])
    };
    let outputs = DMatrix::from_fn(data.len(), 2, turned);
    let (_, kind) = data.records()[0];
    LineData::new(omega.to_vec(), data.inputs().clone(), outputs, kind).unwrap()
}

/// Identifies the chain from delayed outputs. A prior of 1 % on the first spring contributes a part
/// of the information.
fn of_prior(seed: u64, delays: [f64; 2]) -> MachineEstimate {
    let data = late(&chain::data(&chain::STIFFNESSES, seed), delays);
    let machine = chain::machine_with_prior(0.5);
    let settings = Settings::default();
    identify_machine(&data, &machine, &chain::instruments(), &settings).unwrap()
}

fn of_chain(seed: u64, delays: [f64; 2]) -> MachineEstimate {
    let data = late(&chain::data(&chain::STIFFNESSES, seed), delays);
    let (machine, instruments) = (chain::machine(), chain::instruments());
    identify_machine(&data, &machine, &instruments, &Settings::default()).unwrap()
}

fn of_open_record(seed: u64, delays: [f64; 2]) -> MachineEstimate {
    let data = late(&open::data(&open::rig(), seed, &[0, 1]), delays);
    let (machine, instruments) = (open::machine(), open::instruments(&["x1", "x2"]));
    identify_machine(&data, &machine, &instruments, &Settings::default()).unwrap()
}

/// The score test of a delay, with a level of 5 %, rejects at most 3 of 10 records without a delay.
/// The probability of more than 3 is 0.001.
#[test]
fn no_delay_is_found_in_right_data() {
    for test in [of_chain, of_prior, of_open_record] {
        let scores: Vec<DelayScore> =
            (0..10).into_par_iter().map(|seed| test(seed, [0.0; 2]).delay.unwrap()).collect();
        let found = scores.iter().filter(|score| score.p_value < 0.05).count();
        assert!(found <= 3, "{found} {scores:?}");
    }
}

/// The score test finds a delay of all sensors or of one sensor. The test predicts how far the
/// delay shifts the parameters: with this correction, the parameters agree with the true values.
/// Intervals that include the shift contain the truth.
#[test]
fn a_delay_of_all_sensors_or_of_one_is_found() {
    const DELAY: f64 = 1e-4;
    let of_open_truth = open::TRUTH.map(|(name, value)| (name.to_owned(), value)).to_vec();
    for seed in 0..1 {
        for (test, truth) in
            [(of_chain as fn(_, _) -> _, chain::truth()), (of_open_record, of_open_truth.clone())]
        {
            for (delays, output) in [([DELAY; 2], None), ([0.0, DELAY], Some(1))] {
                let estimate: MachineEstimate = test(seed, delays);
                let score = estimate.delay.clone().unwrap();
                assert!(score.p_value < 1e-6, "{score:?}");
                assert_eq!(score.output, output, "{score:?}");
                assert!((score.delay / DELAY - 1.0).abs() < 0.3, "{score:?}");
                let wider = estimate.clone().with_parameter_errors(&score.changes).likelihood;
                let pairs = estimate.likelihood.parameters.iter().zip(&wider.parameters);
                for ((narrow, wide), change) in pairs.zip(&score.changes) {
                    let (_, truth) = truth.iter().find(|(name, _)| *name == narrow.name).unwrap();
                    let error = narrow.standard_error.unwrap();
                    let corrected = narrow.value + change - truth;
                    let message = format!("{narrow:?} {change} {truth}");
                    assert!(corrected.abs() < 5.0 * error + 0.3 * change.abs(), "{message}");
                    let ratio = wide.standard_error.unwrap() / error.hypot(*change);
                    assert!((ratio - 1.0).abs() < 1e-12, "{message}");
                    let away = (narrow.value - truth).abs();
                    assert!(away < 3.0 * wide.standard_error.unwrap(), "{message}");
                }
            }
        }
    }
}

/// The delay of a sensor is not tested if this delay is a parameter of the fit.
#[test]
fn a_delay_that_is_a_parameter_is_not_tested() {
    let data = late(&open::data(&open::rig(), 0, &[0, 1]), [0.0, 1e-4]);
    let mut instruments = open::instruments(&["x1", "x2"]);
    instruments.sensors[1].delay = FreeCoefficient::from_start(0.0).into();
    let found = identify_machine(&data, &open::machine(), &instruments, &Settings::default());
    let score = found.unwrap().delay.unwrap();
    assert!(score.output == Some(0) && score.p_value > 1e-3, "{score:?}");
}
