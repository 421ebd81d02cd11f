//! If only accelerations are measured, the force is identified above a lowest frequency, and the
//! result states this frequency.

use mechid_force::{
    Filter, ForceUnknowns, Measurement, Noise, Start, Tuning, kalman, regularised, within_band,
};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

use crate::study::accelerations::{found, row};

#[test]
fn the_force_is_found_in_the_band_that_they_show() {
    // The band begins at the frequency at which the noise is as large as the force. The lines near
    // this frequency, a few of 307, cause an error of 10 %, and a larger error if stiff springs or
    // distant masses amplify the noise.
    for (dof, hz, level, most) in
        [(1, 1.0, 0.01, 0.1), (1, 40.0, 0.01, 0.35), (2, 40.0, 0.001, 0.2), (3, 1.0, 0.05, 0.5)]
    {
        let all: Vec<_> = (1..=4).map(|seed| found(dof, hz, level, seed)).collect();
        for one in &all {
            let what = format!("{dof} masses, {hz} Hz, {level}");
            assert!(one.error < most * one.size, "{what}: {:.3}", one.error / one.size);
            assert!((100.0..400.0).contains(&one.size), "{what}: {:.0} N", one.size);
            assert!(one.band_hz[0] > 0.0 && one.band_hz[0] < 30.0, "{what}: {:?}", one.band_hz);
        }
        // The four records have some hundred independent errors each.
        let held = all.iter().map(|one| one.held).sum::<f64>() / 4.0;
        assert!((0.88..0.995).contains(&held), "{dof} masses, {hz} Hz, {level}: {held:.3}");
    }
}

/// The stiffer the springs, the less a slow force accelerates the mass.
#[test]
fn stiff_springs_hide_more_of_a_slow_force() {
    let lowest = |hz: f64| found(1, hz, 0.01, 1).band_hz[0];
    assert!(lowest(40.0) > 2.0 * lowest(1.0), "{} {}", lowest(40.0), lowest(1.0));
}

/// Returns a whole period of 200 samples at 100 Hz; the force drives lines 3, 20 and 31.
fn period(system: &SecondOrderSystem) -> (Record, [Measurement; 2]) {
    let sampling = Sampling::new(0.01, 200).unwrap();
    let drive = Multisine::flat([3, 20, 31], 90.0, Phases::Schroeder).unwrap();
    let truth = drive.sample(sampling).unwrap();
    let response = exact_harmonic_periodic(system, &truth).unwrap();
    let noisy =
        |record: &Record| noise::add_white(record, NoiseLevel::FractionOfRms(0.01), 4).unwrap();
    let of = |quantity| Measurement::from_record(quantity, noisy(response.quantity(quantity)));
    let measured = [ResponseQuantity::Acceleration, ResponseQuantity::Displacement].map(of);
    (truth, measured)
}

#[test]
fn a_displacement_shows_a_force_at_all_frequencies() {
    for hz in [1.0, 20.0] {
        let system = row(1, hz);
        let (_, [accelerations, displacements]) = period(&system);
        let both = |measured: &Measurement| {
            let lines = ForceUnknowns::EveryLine;
            let filter = Filter::Shrinkage;
            let period =
                regularised(&system, measured, &[0], &lines, filter, &Noise::Unknown).unwrap();
            let open = kalman(&system, measured, &[0], Start::InMotion, &Tuning::Likelihood);
            [period.force.band_hz(), open.unwrap().force.band_hz()]
        };
        assert_eq!(both(&displacements), [None, None]);
        for band in both(&accelerations) {
            let [low, high] = band.expect("a constant force accelerates nothing");
            assert!(low > 0.0 && low < 10.0 && high == 50.0, "{low} {high}");
        }
    }
}

/// A constant force accelerates a free mass, so the accelerations show this force.
#[test]
fn without_a_spring_accelerations_show_a_constant_force() {
    let zero = DMatrix::zeros(1, 1);
    let system =
        SecondOrderSystem::new(DMatrix::from_element(1, 1, 20.0), zero.clone(), zero).unwrap();
    let sampling = Sampling::new(0.01, 400).unwrap();
    let force = Record::from_fn(sampling, |t| 300.0 + 50.0 * (7.0 * t).sin()).unwrap();
    let exact = Record::new(sampling, force.data() / 20.0).unwrap();
    let noisy = noise::add_white(&exact, NoiseLevel::FractionOfRms(0.01), 2).unwrap();
    let measured = Measurement::from_record(ResponseQuantity::Acceleration, noisy);
    let found = kalman(&system, &measured, &[0], Start::InMotion, &Tuning::Likelihood).unwrap();
    assert_eq!((found.seen_from_hz, found.force.band_hz()), (Some(0.0), None));
    let error = mechid_force::relative_error(found.force.record(), &force).unwrap();
    assert!(error < 0.01, "{error:.4}");
}

#[test]
fn a_band_that_is_asked_for_is_the_one_returned() {
    let system = row(1, 20.0);
    let (truth, [_, displacements]) = period(&system);
    let band_hz = [5.0, 12.0];
    let banded = displacements.in_band(band_hz).unwrap();
    // Only the line at 10 Hz is in the band; the lines at 1.5 and 15.5 Hz are not.
    let expected = within_band(&truth, band_hz, Extent::WholePeriod).unwrap();
    let filter = Filter::Shrinkage;
    let found =
        regularised(&system, &banded, &[0], &ForceUnknowns::EveryLine, filter, &Noise::Unknown)
            .unwrap()
            .force;
    assert_eq!(found.band_hz(), Some(band_hz));
    assert!(mechid_force::relative_error(found.record(), &expected).unwrap() < 0.05);
    let lines = [3, 20, 31];
    let at_lines =
        mechid_force::frequency_domain(&system, &banded, &[0], &lines, &Noise::OutsideLines)
            .unwrap();
    assert!(mechid_force::relative_error(at_lines.record(), &expected).unwrap() < 0.05);
    let [all, one] = [at_lines.spectrum().line(3, 0), at_lines.spectrum().line(20, 0)];
    assert!(all.norm() < 1e-9 && (one.norm() - 90.0).abs() < 5.0, "{all} {one}");
}

#[test]
fn bands_that_are_none_or_hold_no_line_are_refused_with_their_numbers() {
    let system = row(1, 20.0);
    let (_, [_, displacements]) = period(&system);
    for band in [[5.0, 5.0], [-1.0, 3.0], [1.0, f64::INFINITY], [f64::NAN, 2.0]] {
        assert!(displacements.clone().in_band(band).is_err(), "{band:?}");
    }
    let between = displacements.in_band([10.1, 10.4]).unwrap();
    let refused = regularised(
        &system,
        &between,
        &[0],
        &ForceUnknowns::EveryLine,
        Filter::Shrinkage,
        &Noise::Unknown,
    );
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("10.1 and 10.4 Hz") && message.contains("0.5"), "{message}");
}
