//! Modes of two parts of a record, for a structure that does not change and for a structure that
//! changes.

use mechid_modal::{ModalSettings, PartsComparison, identify_modes};
use mechid_signal::Record;
use mechid_spectra::LineData;
use nalgebra::DMatrix;

use crate::generator::{Case, pair};

/// Forces and accelerations of a record.
type Test = (Record, Record);

fn half(record: &Record, part: usize) -> Record {
    let len = record.len() / 2;
    record.window(part * len, len).unwrap()
}

fn lines((forces, motion): &Test, band_hz: [f64; 2]) -> LineData {
    LineData::from_open_record(Some(forces), motion, band_hz).unwrap()
}

fn compared(test: &Test, band_hz: [f64; 2]) -> PartsComparison {
    let settings = ModalSettings::default();
    let whole = identify_modes(&lines(test, band_hz), &settings).unwrap();
    let [first, second] =
        [0, 1].map(|part| lines(&(half(&test.0, part), half(&test.1, part)), band_hz));
    PartsComparison::new(&whole, [&first, &second], &settings).unwrap()
}

#[test]
fn parts_of_an_unchanged_structure_agree() {
    let case = Case { unmeasured: 0.05, ..pair(8) };
    for seed in 0..3 {
        let compared = compared(&case.record(seed), case.band_hz);
        assert_eq!(compared.pairs.len(), 6, "{seed}");
        assert!(!compared.differ(), "{seed}: {}", compared.p_value());
        assert!(compared.error_scales.iter().all(|scale| *scale == Some(1.0)), "{seed}");
    }
}

/// The frequency of the second mode is 0.2 % lower in the second half of the record; the other
/// modes do not change. Only the intervals of the second mode must become wider.
#[test]
fn a_mode_that_changes_has_wider_intervals() {
    let case = pair(8);
    let mut softer = case.clone();
    softer.frequency_hz[1] *= 0.998;
    let join = |before: &Record, after: &Record| {
        let (first, second) = (half(before, 0), half(after, 1));
        let data = DMatrix::from_fn(before.len(), before.channels(), |row, column| {
            let at = row % first.len();
            if row < first.len() { first.channel(column)[at] } else { second.channel(column)[at] }
        });
        Record::new(before.sampling(), data).unwrap()
    };
    let (before, after) = (case.record(3), softer.record(3));
    let test = (join(&before.0, &after.0), join(&before.1, &after.1));
    let settings = ModalSettings { near_hz: vec![52.0, 87.0, 210.0], ..ModalSettings::default() };
    let whole = identify_modes(&lines(&test, case.band_hz), &settings).unwrap();
    let [first, second] =
        [0, 1].map(|part| lines(&(half(&test.0, part), half(&test.1, part)), case.band_hz));
    let compared = PartsComparison::new(&whole, [&first, &second], &settings).unwrap();
    let ([one, two], _) = compared.largest_difference().unwrap();
    for (mode, hz) in [(one, case.frequency_hz[1]), (two, softer.frequency_hz[1])] {
        let frequency = mode.natural_frequency_hz;
        assert!((frequency.value - hz).abs() < 4.0 * frequency.standard_error, "{frequency:?}");
    }
    let scales: Vec<f64> = compared.error_scales.iter().map(|scale| scale.unwrap()).collect();
    assert!(scales[1] > 5.0 && scales[0] == 1.0 && scales[2] == 1.0, "{scales:?}");
    let narrow = whole.modes()[1].clone();
    let wide = whole.with_error_scales(&scales).unwrap();
    let [error, scaled] =
        [&narrow, &wide.modes()[1]].map(|mode| mode.natural_frequency_hz.standard_error);
    assert!((scaled / error / scales[1] - 1.0).abs() < 1e-12, "{error} {scaled}");
    // The frequency from the whole record is between the frequencies of the two halves. Only the
    // wider interval contains the mean of these two frequencies.
    let mean = 0.5 * (case.frequency_hz[1] + softer.frequency_hz[1]);
    let off = (narrow.natural_frequency_hz.value - mean).abs();
    assert!(off < 2.0 * scaled, "{off} {error} {scaled}");
}
