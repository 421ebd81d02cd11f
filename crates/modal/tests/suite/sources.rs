//! Data other than a record with forces: tables, free decays and roving hammers. Other tests check
//! properties of all kinds of data.

use std::f64::consts::TAU;

use mechid_modal::{DrivingPoint, ModalEstimate, ModalSettings, identify_modes};
use mechid_signal::Record;
use mechid_spectra::LineData;
use nalgebra::DMatrix;

use crate::generator::{Case, pair, roving};

/// Compares frequency and damping with the truth, in standard errors, and returns the largest
/// deviation.
fn largest_deviation(case: &Case, estimate: &ModalEstimate) -> f64 {
    let modes = case.in_band();
    assert_eq!(estimate.modes().len(), modes.len(), "{:?}", estimate.dropped());
    let deviation = |(mode, truth): (&mechid_modal::IdentifiedMode, &usize)| {
        let (f, z) = (mode.natural_frequency_hz, mode.damping_ratio);
        let f = (f.value - case.frequency_hz[*truth]).abs() / f.standard_error;
        f.max((z.value - case.damping[*truth]).abs() / z.standard_error)
    };
    estimate.modes().iter().zip(&modes).map(deviation).fold(0.0, f64::max)
}

// Each record gives twelve errors. By chance, one of them exceeds 4.5 standard errors once in
// 12,000 records.
const BOUND: f64 = 4.5;

#[test]
fn table_of_frequency_responses() {
    let case = pair(8);
    let data = case.table(3, 1500);
    let estimate = identify_modes(&data, &ModalSettings::default()).unwrap();
    let deviation = largest_deviation(&case, &estimate);
    assert!(deviation < BOUND, "{deviation}");
    // The synthesised response has no noise, and its error is far below the noise of 2 %.
    let omega = data.omega()[700];
    let (model, truth) = (estimate.response(omega), case.response(omega, &case.participation));
    assert!((&model - &truth).norm() < 0.01 * truth.norm());
}

#[test]
fn free_decay_without_forces() {
    let case = Case { samples: 2048, ..pair(8) };
    let estimate = identify_modes(&case.decay(5), &ModalSettings::default()).unwrap();
    let deviation = largest_deviation(&case, &estimate);
    assert!(deviation < BOUND, "{deviation}");
    assert!(estimate.modes().iter().all(|mode| mode.driven_share.is_none()));
}

/// The modes outside the band are much stronger than the noise in the band. They must not bias the
/// modes in the band.
#[test]
fn free_decays_in_a_band_have_residual_terms() {
    let pair = pair(4);
    let case = Case { samples: 4096, noise: 0.002, band_hz: [70.0, 160.0], ..pair };
    for seed in 0..4 {
        let data = case.decay(seed).followed_by(&case.decay(10 + seed)).unwrap();
        let estimate = identify_modes(&data, &ModalSettings::default()).unwrap();
        let deviation = largest_deviation(&case, &estimate);
        assert!(deviation < BOUND, "{seed}: {deviation}");
    }
}

#[test]
fn one_accelerometer_and_a_roving_hammer_give_shapes_and_masses() {
    let case = roving(5);
    let estimate = identify_modes(&case.lines(1), &ModalSettings::default()).unwrap();
    let deviation = largest_deviation(&case, &estimate);
    assert!(deviation < BOUND, "{deviation}");
    let point = DrivingPoint::new(0, 0);
    for (index, (mode, truth)) in estimate.modes().iter().zip(&case.participation).enumerate() {
        let largest = truth.iter().copied().fold(0.0, f64::max);
        for (value, truth) in mode.shape_at_inputs().iter().zip(truth) {
            assert!((value - truth / largest).norm() < 0.02, "{value} {}", truth / largest);
        }
        // The accelerometer is at the point of input 0; its shape is 1 there, so the mass is 1/ψ².
        let mass = estimate.modal_mass(index, point, 2).unwrap();
        let error = mass.value - 1.0 / (truth[0] * truth[0]);
        assert!(error.abs() < 3.5 * mass.standard_error, "{mass:?} {error}");
        assert!(mass.standard_error < 0.02 * mass.value, "{mass:?}");
    }
    let outside = DrivingPoint::new(1, 0);
    assert!(estimate.modal_mass(0, outside, 2).is_none());
}

/// Reference: the delays of the generator. Shapes and participations do not contain the delays. If
/// the records have no delays, no delay is found.
#[test]
fn delays_between_forces_and_responses_are_part_of_the_model() {
    for (seed, delays) in [(1, vec![-0.5]), (2, vec![0.0, 0.3, 0.7]), (3, Vec::new())] {
        let case = Case { delays, ..pair(8) };
        let estimate = identify_modes(&case.lines(seed), &ModalSettings::default()).unwrap();
        let deviation = largest_deviation(&case, &estimate);
        assert!(deviation < BOUND, "{seed}: {deviation}");
        let found = estimate.delays();
        assert_eq!(found.len(), if case.delays.is_empty() { 0 } else { 8 }, "{seed}");
        for (output, delay) in found.iter().enumerate() {
            let error = delay.seconds * case.rate_hz - case.delay(output);
            let spread = delay.standard_error * case.rate_hz;
            assert!(error.abs() < 4.5 * spread && spread < 0.01, "{seed} {output}: {delay:?}");
        }
        // The synthesis of another record contains the delays.
        let other = case.lines(seed + 10);
        let left = other.outputs() - estimate.synthesis(&other).unwrap();
        let share = left.norm_squared() / other.outputs().norm_squared();
        assert!(share < 1.5 * case.noise * case.noise, "{seed}: {share}");
    }
}

#[test]
fn number_and_frequencies_can_be_stated() {
    let data = pair(8).lines(2);
    let all = identify_modes(&data, &ModalSettings::default()).unwrap();
    let four = ModalSettings { modes: Some(4), ..ModalSettings::default() };
    let four = identify_modes(&data, &four).unwrap();
    assert_eq!(four.modes().len(), 4);
    // The two modes that are not requested remain in the model, so that they do not bias the four
    // requested modes.
    for mode in four.modes() {
        let is_same = |other: &mechid_modal::IdentifiedMode| {
            let difference = mode.damping_ratio.value - other.damping_ratio.value;
            difference.abs() < 0.1 * mode.damping_ratio.standard_error
        };
        assert!(all.modes().iter().any(is_same), "{mode:?}");
    }
    let near = ModalSettings { near_hz: vec![87.2, 304.0], ..ModalSettings::default() };
    let modes = identify_modes(&data, &near).unwrap();
    let hz: Vec<f64> = modes.modes().iter().map(|mode| mode.natural_frequency_hz.value).collect();
    assert_eq!(hz.len(), 2);
    assert!((hz[0] - 87.0).abs() < 0.01 && (hz[1] - 305.0).abs() < 0.02, "{hz:?}");
}

/// The record contains mains hum that the forces do not cause. The hum must not be reported as a
/// mode. If the model did not contain the hum, the standard error of the mode next to it would be
/// fifty times as large.
#[test]
fn hum_is_no_mode_and_does_not_widen_the_errors_of_modes() {
    let case = pair(8);
    let (force, motion) = case.record(2);
    let hum = |row: usize| (TAU * 85.3 * motion.sampling().time(row)).sin();
    let level = motion.data().column(0).variance().sqrt();
    let data = DMatrix::from_fn(motion.len(), 8, |row, column| {
        motion.data()[(row, column)] + 0.5 * level * hum(row)
    });
    let with_hum = Record::new(motion.sampling(), data).unwrap();
    let estimates = [&motion, &with_hum].map(|motion| {
        let data = LineData::from_open_record(Some(&force), motion, case.band_hz).unwrap();
        identify_modes(&data, &ModalSettings::default()).unwrap()
    });
    assert!(largest_deviation(&case, &estimates[1]) < BOUND);
    let [clean, hum] = estimates.map(|estimate| estimate.modes()[1].natural_frequency_hz);
    assert!((hum.standard_error / clean.standard_error - 1.0).abs() < 0.3, "{hum:?} {clean:?}");
}

#[test]
fn the_rest_of_a_record_is_predicted() {
    let case = pair(8);
    let estimate = identify_modes(&case.lines(8), &ModalSettings::default()).unwrap();
    let other = case.lines(9);
    let difference = other.outputs() - estimate.synthesis(&other).unwrap();
    for output in 0..8 {
        let share = difference.column(output).norm_squared()
            / other.outputs().column(output).norm_squared();
        // The noise of 2 % has 4e-4 of the power of the output over all frequencies. The fraction
        // in the band is larger, because the noise is coloured.
        assert!(share < 1.5e-3, "output {output}: {share}");
    }
}

#[test]
fn data_without_noise_gives_the_truth() {
    let case = Case { noise: 0.0, ..pair(8) };
    let estimate = identify_modes(&case.table(1, 800), &ModalSettings::default()).unwrap();
    assert_eq!(estimate.modes().len(), case.frequency_hz.len());
    for (mode, pole) in estimate.modes().iter().zip(case.poles()) {
        assert!((mode.pole - pole).norm() < 1e-6 * pole.norm(), "{} {pole}", mode.pole);
    }
}

/// Exact responses of six modes do not determine more modes; a fit of more modes removes the
/// additional ones.
#[test]
fn modes_that_the_data_do_not_determine_are_removed() {
    for (noise, count) in [(0.0, 9), (1e-12, 12)] {
        let case = Case { noise, ..pair(2) };
        let settings = ModalSettings { modes: Some(count), ..ModalSettings::default() };
        let estimate = identify_modes(&case.table(1, 400), &settings);
        let estimate = estimate.unwrap_or_else(|error| panic!("{noise} {count}: {error}"));
        for (truth, hz) in case.in_band().iter().map(|mode| (mode, case.frequency_hz[*mode])) {
            let found = estimate
                .modes()
                .iter()
                .any(|mode| (mode.natural_frequency_hz.value / hz - 1.0).abs() < 1e-6);
            assert!(found, "{truth}: {:?}", estimate.modes());
        }
    }
}
