//! Steel subframe with two shakers (DaISy 96-013), a public record that is stored beside the
//! project.

use std::path::Path;

use mechid_modal::{ModalSettings, identify_modes};
use mechid_signal::{Record, Sampling};
use mechid_spectra::LineData;
use nalgebra::DMatrix;

#[allow(clippy::print_stderr, reason = "a skipped test says so")]
/// Forces and accelerations of a part of the record; `None`, with a message, if the file is
/// missing.
fn record(from: f64, to: f64) -> Option<LineData> {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/subframe/subframe.csv");
    let Ok(text) = std::fs::read_to_string(file) else {
        eprintln!("skipped: the subframe is not beside the project");
        return None;
    };
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|field| field.trim().parse().unwrap()).collect())
        .collect();
    let part = |share: f64| (share * rows.len() as f64) as usize;
    let rows = &rows[part(from)..part(to)];
    let sampling = Sampling::from_rate_hz(1024.0, rows.len()).unwrap();
    let columns = |first: usize, count: usize| {
        let data = DMatrix::from_fn(rows.len(), count, |k, column| rows[k][first + column]);
        Record::new(sampling, data).unwrap()
    };
    let (forces, motion) = (columns(0, 2), columns(2, 14));
    Some(LineData::from_open_record(Some(&forces), &motion, [10.0, 500.0]).unwrap())
}

#[test]
fn modes_of_a_part_predict_the_rest() {
    let Some(first) = record(0.0, 0.6) else { return };
    let rest = record(0.6, 1.0).unwrap();
    let estimate = identify_modes(&first, &ModalSettings::default()).unwrap();
    let explained = estimate.variance_explained();
    assert!(explained.iter().sum::<f64>() / 14.0 > 0.997, "{explained:?}");
    let difference = rest.outputs() - estimate.synthesis(&rest).unwrap();
    for output in 0..14 {
        let share =
            difference.column(output).norm_squared() / rest.outputs().column(output).norm_squared();
        assert!(share < 0.01, "output {output}: {share}");
    }
    // Known modes of this structure.
    for known in [62.2, 119.0, 154.7, 156.5] {
        let is_known = |mode: &mechid_modal::IdentifiedMode| {
            (mode.natural_frequency_hz.value - known).abs() < 0.15
        };
        assert!(estimate.modes().iter().any(is_known), "{known} Hz");
    }
}
