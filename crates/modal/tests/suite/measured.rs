//! Measured records: a steel subframe with two shakers, the response of a cantilever, and the arm
//! of a CD player under control. The data are public; they are stored in a folder beside the
//! project.

use std::f64::consts::TAU;
use std::path::Path;

use mechid_modal::{IdentifiedMode, ModalSettings, PartsComparison, identify_modes};
use mechid_signal::{Record, Sampling};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

/// Returns the rows of a data file in `../shared/data`, a folder outside the project. If the file
/// is missing, the function prints a message and returns `None`.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn rows(file: &str) -> Option<Vec<Vec<f64>>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(text) = std::fs::read_to_string(folder.join(file)) else {
        eprintln!("skipped: {file} is missing in ../shared/data");
        return None;
    };
    let numbers = |row: &str| row.split(',').map(|field| field.trim().parse().unwrap()).collect();
    Some(text.lines().skip(1).map(numbers).collect())
}

/// Returns the spectral lines of a part of a record. The first `forces` columns of the record are
/// forces, the other columns are responses.
fn part(
    rows: &[Vec<f64>],
    [from, to]: [f64; 2],
    rate_hz: f64,
    forces: usize,
    band_hz: [f64; 2],
) -> LineData {
    let at = |share: f64| (share * rows.len() as f64) as usize;
    let rows = &rows[at(from)..at(to)];
    let sampling = Sampling::from_rate_hz(rate_hz, rows.len()).unwrap();
    let columns = |first: usize, count: usize| {
        let data = DMatrix::from_fn(rows.len(), count, |k, column| rows[k][first + column]);
        Record::new(sampling, data).unwrap()
    };
    let (inputs, outputs) = (columns(0, forces), columns(forces, rows[0].len() - forces));
    LineData::from_open_record(Some(&inputs), &outputs, band_hz).unwrap()
}

fn subframe(share: [f64; 2]) -> Option<LineData> {
    Some(part(&rows("subframe/subframe.csv")?, share, 1024.0, 2, [10.0, 500.0]))
}

fn cd_arm(share: [f64; 2]) -> Option<LineData> {
    Some(part(&rows("cd-arm/cd_arm.csv")?, share, 1.0, 2, [4e-4, 0.18]))
}

/// Returns the share of each output's power that an estimate predicts.
fn predicted(estimate: &mechid_modal::ModalEstimate, data: &LineData) -> Vec<f64> {
    let difference = data.outputs() - estimate.synthesis(data).unwrap();
    let pairs = difference.column_iter().zip(data.outputs().column_iter());
    pairs.map(|(left, all)| 1.0 - left.norm_squared() / all.norm_squared()).collect()
}

#[test]
fn modes_of_a_part_predict_the_rest() {
    let Some(first) = subframe([0.0, 0.6]) else { return };
    let rest = subframe([0.6, 1.0]).unwrap();
    let estimate = identify_modes(&first, &ModalSettings::default()).unwrap();
    let explained = estimate.variance_explained();
    assert!(explained.iter().sum::<f64>() / 14.0 > 0.997, "{explained:?}");
    for (output, share) in predicted(&estimate, &rest).into_iter().enumerate() {
        assert!(share > 0.99, "output {output}: {share}");
    }
    // Known natural frequencies of this structure, in Hz.
    for known in [62.2, 119.0, 154.7, 156.5] {
        let is_known =
            |mode: &IdentifiedMode| (mode.natural_frequency_hz.value - known).abs() < 0.15;
        assert!(estimate.modes().iter().any(is_known), "{known} Hz");
    }
}

/// Reference: 212.0925 Hz. The toolbox that contains the measured response prints this natural
/// frequency for its own fit of one degree of freedom. Neighbouring lines are 0.3125 Hz apart.
#[test]
fn a_cantilever_has_one_mode_near_its_printed_frequency() {
    let Some(rows) = rows("beam-frf/beam_frf.csv") else { return };
    let rows: Vec<_> = rows.into_iter().filter(|row| (180.0..240.0).contains(&row[0])).collect();
    let omega = rows.iter().map(|row| TAU * row[0]).collect();
    let response = DMatrix::from_fn(rows.len(), 1, |k, _| Complex::new(rows[k][1], rows[k][2]));
    let unit = DMatrix::from_element(rows.len(), 1, Complex::from(1.0));
    let data = LineData::new(omega, unit, response, Transient::None).unwrap();
    let estimate = identify_modes(&data, &ModalSettings::default()).unwrap();
    let [mode] = estimate.modes() else { panic!("{:?}", estimate.modes()) };
    assert!((mode.natural_frequency_hz.value - 212.0925).abs() < 0.05, "{mode:?}");
    assert!((0.0005..0.0015).contains(&mode.damping_ratio.value), "{mode:?}");
    assert!(estimate.variance_explained()[0] > 0.99);
}

/// The arm is in a closed loop, so a sum of modes driven by the inputs is a wrong model. The fit
/// must explain more than 90 % of the response power in the part of the record to which it was
/// fitted, but predict less than 50 % in the other part. The modes of the two halves of the record
/// must not agree.
#[test]
fn modes_of_a_controlled_arm_do_not_predict_the_rest() {
    let Some(whole) = cd_arm([0.0, 1.0]) else { return };
    let settings = ModalSettings::default();
    let [first, rest] = [[0.0, 0.6], [0.6, 1.0]].map(|share| cd_arm(share).unwrap());
    let estimate = identify_modes(&first, &settings).unwrap();
    assert!(estimate.variance_explained().iter().all(|share| *share > 0.9));
    assert!(predicted(&estimate, &rest).iter().all(|share| *share < 0.5));
    let estimate = identify_modes(&whole, &settings).unwrap();
    let [first, second] = [[0.0, 0.5], [0.5, 1.0]].map(|share| cd_arm(share).unwrap());
    let agrees = PartsComparison::new(&estimate, [&first, &second], &settings)
        .is_ok_and(|compared| compared.error_scales.iter().all(|scale| *scale == Some(1.0)));
    assert!(!agrees);
}
