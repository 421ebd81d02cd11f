//! Modes from responses alone, compared with exact discretisations of known structures.

use std::f64::consts::TAU;

use mechid_modal::PartsComparison;
use mechid_modal::ambient::harmonics::harmonics;
use mechid_modal::ambient::{
    AmbientError, AmbientEstimate, AmbientMode, AmbientSettings, DropReason, Uncertainty,
    identify_ambient,
};
use mechid_modal::indicators::mac;
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, dmatrix};

use crate::ambient_generator::{Noise, Quantity, Structure, moving_mean};

/// Returns a structure with four modes, four sensors and three white forces; two of the modes are 3
/// % apart.
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

/// All modes of a record with little noise must be found. In such a record, the lines between zero
/// frequency and the modes have as much weight as the resonances. So the model must be right at
/// these lines, too, where the leakage is larger than the noise and the spectrum of an acceleration
/// falls to zero.
#[test]
fn good_accelerometers_lose_no_mode() {
    let frame = Structure {
        frequencies_hz: vec![6.2, 17.0],
        dampings: vec![0.02, 0.012],
        shapes: dmatrix![0.5, 1.0; 1.0, -0.6].map(Complex::from),
        forces: dmatrix![1.0, 0.5; 1.0, -0.6],
    };
    // In the records of the tower, a random peak is significant in the first fit, which describes
    // the leakage only approximately. The fit with the transient must reject this peak.
    for (truth, rate_hz, len, seeds) in
        [(frame, 64.0, 2048, [20, 21, 22]), (tower(), 20.0, 6000, [1001, 1002, 1006])]
    {
        for seed in seeds {
            let record = truth.accelerations(rate_hz, len, 0.002, seed);
            let estimate = identified(&record, AmbientSettings::default());
            let found: Vec<_> =
                estimate.modes.iter().map(|mode| mode.natural_frequency_hz.value).collect();
            let number = truth.frequencies_hz.len();
            assert_eq!((found.len(), is_right(&estimate, &truth)), (number, number), "{found:?}");
            let misfit = estimate.misfit.unwrap();
            assert!(misfit.p_value > 0.001, "{misfit:?}");
        }
    }
}

/// Returns a structure with three modes and one sensor.
fn mast() -> Structure {
    Structure {
        frequencies_hz: vec![2.0, 4.7, 8.1],
        dampings: vec![0.02, 0.01, 0.01],
        shapes: dmatrix![1.0, 0.8, -0.9].map(Complex::from),
        forces: dmatrix![1.0, 0.3; 2.0, -2.0; -3.0, 6.0],
    }
}

/// Reference: the true frequencies and damping ratios in twelve records. At least 61 of 72
/// intervals of 95 % must contain the true value; 61 is four standard deviations below the expected
/// number. The example `examples/ambient_study` is a longer study.
#[test]
fn intervals_hold_the_truth() {
    let truth = mast();
    let (mut covered, mut all) = (0, 0);
    for seed in 0..12 {
        let record = truth.record(Quantity::Velocity, 30.0, 6000, 0.05, 700 + seed);
        let settings = AmbientSettings { modes: Some(3), ..AmbientSettings::default() };
        let estimate = identified(&record, settings);
        for (r, mode) in estimate.modes.iter().enumerate() {
            let exact = [truth.frequencies_hz[r], truth.dampings[r]];
            for (value, exact) in [mode.natural_frequency_hz, mode.damping_ratio].iter().zip(exact)
            {
                let [low, high] = value.interval().unwrap();
                covered += usize::from(low < exact && exact < high);
                all += 1;
            }
        }
    }
    assert_eq!(all, 72);
    assert!(covered >= 61, "{covered} of {all}");
}

/// A record is filtered by a moving mean over twelve samples. It is then the response to filtered
/// forces, whose spectrum has four zeros in the band. The misfit of the model must become
/// significant, because the model has a flat spectrum of the forces.
#[test]
fn forces_whose_spectrum_is_not_flat_are_seen() {
    let record = mast().record(Quantity::Velocity, 30.0, 6000, 0.05, 60);
    let misfit = |record: &Record| identified(record, AmbientSettings::default()).misfit.unwrap();
    let right = misfit(&record);
    assert!(right.p_value > 0.01 && right.error_scale() < 1.2, "{right:?}");
    let filtered = moving_mean(&record, 12);
    let wrong = misfit(&filtered);
    assert!(wrong.p_value < 1e-9 && wrong.error_scale() > 1.5, "{wrong:?}");
}

/// The noise of the sensors falls over the band in a way that a few polynomials cannot describe.
/// The mean error of the first damping ratio must be consistent with its standard error.
#[test]
fn coloured_noise_does_not_bias_the_damping_of_a_long_record() {
    let truth = tower();
    let errors: Vec<f64> = (0..4)
        .map(|seed| {
            let record = truth.accelerations(20.0, 60_000, 0.3, 1000 + seed);
            let mode = &identified(&record, AmbientSettings::default()).modes[0];
            let standard_error = mode.damping_ratio.standard_error().unwrap();
            (mode.damping_ratio.value - truth.dampings[0]) / standard_error
        })
        .collect();
    // Each error is in standard errors, so the sum of four errors has a standard deviation of 2.
    assert!(errors.iter().sum::<f64>().abs() < 6.0, "{errors:?}");
}

/// The noise of two records falls steeply with frequency. A few polynomials of the noise do not
/// describe it as well as the same polynomials with an additional, false mode whose damping ratio
/// is 15 %. Only the four true modes must be found.
#[test]
fn noise_that_falls_steeply_is_no_mode() {
    let noise = Noise { level: 0.1, pole: 0.9 };
    for seed in [1021, 1065] {
        let record = tower().accelerations(20.0, 6000, noise, seed);
        let estimate = identified(&record, AmbientSettings::default());
        let modes = estimate.modes.iter();
        let modes: Vec<_> =
            modes.map(|m| (m.natural_frequency_hz.value, m.damping_ratio.value)).collect();
        assert_eq!(modes.len(), 4, "{modes:?}");
        assert_eq!(is_right(&estimate, &tower()), 4, "{modes:?}");
    }
}

/// In two records, the likelihood has a larger maximum for a wrong measured quantity (displacement,
/// velocity or acceleration) than for the right quantity. In two other records, the likelihood of
/// independent lines has a false maximum, because the state of a mode differs much between the two
/// ends of the record. The wrong maxima are at damping ratios of at most a tenth of the true
/// values; the estimates must be near the true values.
#[test]
fn no_resonance_becomes_a_sinusoid() {
    let truth = tower();
    let rising = Noise { level: 0.1, pole: -0.5 };
    let velocities =
        [1029, 1079].map(|seed| truth.record(Quantity::Velocity, 25.0, 7500, 0.05, seed));
    let accelerations = [1099, 1170].map(|seed| truth.accelerations(20.0, 6000, rising, seed));
    for (index, record) in velocities.iter().chain(&accelerations).enumerate() {
        let estimate = identified(record, AmbientSettings::default());
        assert_eq!(estimate.modes.len(), 4, "{index}");
        for (mode, exact) in estimate.modes.iter().zip(&truth.dampings) {
            let ratio = mode.damping_ratio.value / exact;
            let error = mode.damping_ratio.standard_error().unwrap() / mode.damping_ratio.value;
            assert!(ratio.ln().abs() < 4.0 * error, "{index}: {ratio} ± {error}");
        }
    }
}

fn half(record: &Record, part: usize) -> Record {
    let len = record.len() / 2;
    record.window(part * len, len).unwrap()
}

fn halves(record: &Record, estimate: &AmbientEstimate) -> PartsComparison {
    PartsComparison::of_ambient(estimate, [&half(record, 0), &half(record, 1)]).unwrap()
}

#[test]
fn halves_of_an_unchanged_structure_agree() {
    let truth = tower();
    for seed in 0..3 {
        let record = truth.record(Quantity::Velocity, 25.0, 15_000, 0.05, 60 + seed);
        let estimate = identified(&record, AmbientSettings::default());
        let halves = halves(&record, &estimate);
        assert_eq!(halves.error_scales, [Some(1.0); 4], "{seed}: {}", halves.p_value());
    }
}

/// In the second half of the record, the frequency of the highest mode is 1 % lower, which is half
/// the width of its resonance; the other modes do not change. Only the intervals of the highest
/// mode must become wider.
#[test]
fn a_mode_that_changes_has_wider_intervals() {
    let truth = tower();
    let mut softer = truth.clone();
    softer.frequencies_hz[3] *= 0.99;
    let part = |structure: &Structure, index| {
        let record = structure.record(Quantity::Velocity, 25.0, 15_000, 0.05, 70);
        half(&record, index).into_data()
    };
    let (before, after) = (part(&truth, 0), part(&softer, 1));
    let len = before.nrows();
    let data = DMatrix::from_fn(2 * len, 4, |row, column| {
        if row < len { before[(row, column)] } else { after[(row - len, column)] }
    });
    let record = Record::new(Sampling::from_rate_hz(25.0, 2 * len).unwrap(), data).unwrap();
    let estimate = identified(&record, AmbientSettings::default());
    let halves = halves(&record, &estimate);
    let ([one, two], _) = halves.largest_difference().unwrap();
    for (mode, hz) in [(one, truth.frequencies_hz[3]), (two, softer.frequencies_hz[3])] {
        let frequency = mode.natural_frequency_hz;
        assert!((frequency.value - hz).abs() < 4.0 * frequency.standard_error, "{frequency:?}");
    }
    let scales: Vec<f64> = halves.error_scales.iter().map(|scale| scale.unwrap()).collect();
    assert!(scales[3] > 4.0 && scales[..3] == [1.0; 3], "{scales:?}");
    let narrow = estimate.modes[3].natural_frequency_hz;
    let error = estimate.modes[3].shape.standard_errors().max();
    let wide = &estimate.with_error_scales(&scales).modes[3];
    let scaled = wide.shape.standard_errors().max();
    assert!((scaled / error / scales[3] - 1.0).abs() < 1e-12, "{error} {scaled}");
    let wide = wide.natural_frequency_hz;
    let ratio = wide.standard_error().unwrap() / narrow.standard_error().unwrap();
    assert!((ratio / scales[3] - 1.0).abs() < 1e-12, "{ratio}");
    let [low, high] = wide.interval().unwrap();
    assert!(low < softer.frequencies_hz[3] && truth.frequencies_hz[3] < high, "{low} {high}");
}

fn with_sinusoid(record: &Record, frequency_hz: f64, amplitude: f64) -> Record {
    let sampling = record.sampling();
    let data = DMatrix::from_fn(record.len(), record.channels(), |t, channel| {
        let phase = TAU * frequency_hz * sampling.time(t) + channel as f64;
        record.data()[(t, channel)] + amplitude * phase.cos()
    });
    Record::new(sampling, data).unwrap()
}

#[test]
fn a_harmonic_is_named_and_left_out_on_request() {
    let truth = tower();
    let record = truth.accelerations(20.0, 8000, 0.05, 3);
    let rms = (record.data().norm_squared() / record.data().len() as f64).sqrt();
    let (frequency_hz, amplitude) = (4.1803, 0.7 * rms);
    let disturbed = with_sinusoid(&record, frequency_hz, amplitude);
    let without = AmbientSettings { exclude_harmonics: true, ..AmbientSettings::default() };
    let estimate = identified(&disturbed, without);
    let [harmonic] = estimate.harmonics[..] else { panic!("{:?}", estimate.harmonics) };
    assert!((harmonic.frequency_hz - frequency_hz).abs() < 1e-4, "{harmonic:?}");
    assert!((harmonic.amplitude / amplitude - 1.0).abs() < 0.1, "{harmonic:?}");
    assert!(harmonic.p_value < 1e-5 && harmonic.kurtosis < -1.0, "{harmonic:?}");
    assert_eq!((estimate.modes.len(), is_right(&estimate, &truth)), (4, 4));
    // If the frequency of the harmonic is stated, its removal must hardly change the damping
    // ratios: they are those of the record without the harmonic, to 0.3 standard errors.
    let stated = AmbientSettings { without_hz: vec![frequency_hz], ..AmbientSettings::default() };
    let again = identified(&disturbed, stated);
    let undisturbed = identified(&record, AmbientSettings::default());
    assert!(undisturbed.harmonics.is_empty());
    for (mode, other) in undisturbed.modes.iter().zip(&again.modes) {
        let error = mode.damping_ratio.standard_error().unwrap();
        let gap = (mode.damping_ratio.value - other.damping_ratio.value).abs();
        assert!(gap < 0.3 * error, "{gap} {error}");
    }
    // With the default settings the harmonic is not excluded: it is reported, and a mode at its
    // frequency has a note.
    let estimate = identified(&disturbed, AmbientSettings::default());
    assert_eq!(estimate.harmonics.len(), 1);
    let at = |f: f64| (f - frequency_hz).abs() < 0.02;
    for mode in estimate.modes.iter().filter(|mode| at(mode.natural_frequency_hz.value)) {
        assert_eq!(mode.harmonic, Some(0));
    }
}

/// A resonance must not be reported as a harmonic if the record lasts at least 15 decay times of
/// each mode. The significance level of the harmonic test allows one false harmonic in a thousand
/// records.
#[test]
fn resonances_are_not_taken_for_harmonics() {
    let truth = mast();
    let mut false_alarms = 0;
    for seed in 0..40 {
        // The record lasts ζωT = 18 to 37 decay times of the modes.
        let record = truth.record(Quantity::Velocity, 30.0, 2200, 0.05, 90 + seed);
        false_alarms += harmonics(&record, [0.5, 12.0]).unwrap().len();
    }
    assert!(false_alarms <= 1, "{false_alarms}");
}

#[test]
fn a_short_record_gives_values_without_intervals() {
    let record = mast().record(Quantity::Displacement, 30.0, 1050, 0.02, 5);
    let settings = AmbientSettings { modes: Some(3), ..AmbientSettings::default() };
    let estimate = identified(&record, settings);
    let slow = estimate.modes[0].damping_ratio;
    assert_eq!(slow.interval(), None);
    let Uncertainty::RecordTooShort { decay_times, needed } = slow.uncertainty else {
        panic!("{slow:?}")
    };
    assert!((decay_times / (slow.value * 2.0 * TAU * 35.0) - 1.0).abs() < 0.05, "{decay_times}");
    assert_eq!(needed, 15.0);
}

#[test]
fn a_stated_number_of_modes_is_kept() {
    let record = tower().record(Quantity::Displacement, 25.0, 10_000, 0.05, 9);
    let settings = AmbientSettings { modes: Some(2), ..AmbientSettings::default() };
    let estimate = identified(&record, settings);
    assert_eq!(estimate.modes.len(), 2);
    let reached = |reason: &DropReason| matches!(reason, DropReason::NumberReached { number: 2 });
    assert!(estimate.dropped.iter().any(|dropped| reached(&dropped.reason)));
    // The two modes that are not reported remain in the model of the spectrum, so that they do not
    // bias the two reported modes.
    let all = identified(&record, AmbientSettings::default());
    for mode in &estimate.modes {
        let is_same = |other: &AmbientMode| {
            (mode.damping_ratio.value / other.damping_ratio.value - 1.0).abs() < 3e-3
        };
        assert!(all.modes.iter().any(is_same), "{:?}", mode.damping_ratio);
    }
}

#[test]
fn unusable_records_are_refused_with_their_numbers() {
    let good = mast().record(Quantity::Velocity, 30.0, 3000, 0.05, 1);
    let changed = |change: &dyn Fn(usize, f64) -> f64| {
        let second: Vec<f64> =
            good.channel(0).iter().enumerate().map(|(t, x)| change(t, *x)).collect();
        Record::from_channels(good.sampling(), &[good.channel(0).to_vec(), second]).unwrap()
    };
    let refused = |record: &Record, settings: &AmbientSettings| {
        identify_ambient(record, settings).unwrap_err()
    };
    let default = AmbientSettings::default();
    let error = refused(&changed(&|_, _| 3.5), &default);
    assert_eq!(error, AmbientError::ConstantChannel { channel: 1, samples: 3000, value: 3.5 });
    let error = refused(&changed(&|t, _| 1e-12 * (t % 7) as f64), &default);
    assert!(matches!(error, AmbientError::DeadChannel { channel: 1, .. }), "{error}");
    let error = refused(&changed(&|_, x| -2.0 * x), &default);
    assert!(matches!(error, AmbientError::CopiedChannel { first: 0, second: 1, .. }), "{error}");
    let short = good.window(0, 15).unwrap();
    let error = refused(&short, &default);
    assert!(matches!(error, AmbientError::TooFewLines { needed: 12, .. }), "{error}");
    let error = refused(&good.window(0, 90).unwrap(), &default);
    assert!(matches!(error, AmbientError::TooShort { samples: 90, .. }), "{error}");
    for band_hz in [[5.0, 4.0], [0.0, 16.0], [f64::NAN, 3.0]] {
        let settings = AmbientSettings { band_hz: Some(band_hz), ..default.clone() };
        assert!(matches!(refused(&good, &settings), AmbientError::Band { .. }));
    }
    let none = AmbientSettings { modes: Some(0), ..default.clone() };
    assert_eq!(refused(&good, &none), AmbientError::NoModesAsked);
}

/// A record of white noise must be refused, because no mode is significant.
#[test]
fn noise_alone_has_no_mode() {
    let sampling = Sampling::from_rate_hz(30.0, 3000).unwrap();
    let quiet = Record::new(sampling, DMatrix::zeros(3000, 2)).unwrap();
    for seed in 0..3 {
        let level = mechid_signal::NoiseLevel::StandardDeviation(1.0);
        let record = mechid_signal::noise::add_white(&quiet, level, seed).unwrap();
        let error = identify_ambient(&record, &AmbientSettings::default());
        assert!(matches!(error, Err(AmbientError::NoMode { .. })), "{error:?}");
    }
}
