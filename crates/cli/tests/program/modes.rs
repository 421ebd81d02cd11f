//! `mechid modes` on records with forces: more modes than sensors, more points than sensors.

use std::path::Path;

use serde_json::Value;

use super::{mechid, refused};

fn examples() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for file in ["hammer-1.csv", "hammer-2.csv", "machine.json"] {
        std::fs::copy(examples.join(file), folder.path().join(file)).unwrap();
    }
    folder
}

fn modes(folder: &Path, arguments: &str) -> Value {
    let text = mechid(folder, &format!("modes {arguments} --json"));
    serde_json::from_str(&text).unwrap()
}

/// Judge: the machine behind the examples, whose response is known in closed form: 12 Hz and 1 %, 31 Hz
/// and 1.5 %.
fn are_those_of_the_machine(report: &Value) {
    let found = report["modes"].as_array().unwrap();
    assert_eq!(found.len(), 2, "{report}");
    for (mode, [hz, ratio]) in found.iter().zip([[12.0, 0.01], [31.0, 0.015]]) {
        for (quantity, truth) in [("natural_frequency_hz", hz), ("damping_ratio", ratio)] {
            let [value, error] =
                ["value", "standard_error"].map(|part| mode[quantity][part].as_f64().unwrap());
            assert!((value - truth).abs() < 5.0 * error, "{quantity}: {value} ± {error}, {truth}");
            assert!(error < 1e-3 * truth, "{quantity}: {value} ± {error}");
        }
    }
}

#[test]
fn one_accelerometer_shows_both_modes() {
    let folder = examples();
    let report =
        modes(folder.path(), "hammer-1.csv --force force --acceleration a1 --hits --band-hz 2:100");
    are_those_of_the_machine(&report);
}

/// Judge: reciprocity. The row of one accelerometer over the struck points is the column of two
/// accelerometers under one of them.
#[test]
fn a_hammer_that_roves_gives_the_shapes() {
    let folder = examples();
    let roving = modes(
        folder.path(),
        "hammer-1.csv hammer-2.csv --force force --force-at 1,2 --acceleration a1 --response-at 1 \
         --hits --band-hz 2:100",
    );
    are_those_of_the_machine(&roving);
    let column = modes(
        folder.path(),
        "hammer-1.csv --force force --acceleration a1,a2 --hits --band-hz 2:100",
    );
    are_those_of_the_machine(&column);
    let entry =
        |mode: &Value, field: &str, at: usize| mode[field][at]["value"][0].as_f64().unwrap();
    for number in 0..2 {
        let (row, column) = (&roving["modes"][number], &column["modes"][number]);
        let [a, b] = [(row, "participation"), (column, "shape")]
            .map(|(mode, field)| entry(mode, field, 0) / entry(mode, field, 1));
        assert!((a / b - 1.0).abs() < 0.01, "mode {number}: {a} {b}");
        assert!(row["modal_mass"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn what_means_nothing_is_refused() {
    let folder = examples();
    for (arguments, told) in [
        ("machine.json --hits", "--hits: it means nothing to a machine"),
        (
            "hammer-1.csv --acceleration a1 --force-at 1",
            "--force-at: it means nothing to a free decay",
        ),
        ("hammer-1.csv --force force --acceleration a1 --band-hz 300:400", "no spectral line"),
        (
            "hammer-1.csv --force force --force-at 1,2 --acceleration a1",
            "2 places for 1 force column",
        ),
    ] {
        let message = refused(folder.path(), &format!("modes {arguments}"));
        assert!(message.contains(told), "{arguments}: {message}");
    }
}
