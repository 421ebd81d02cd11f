//! The subcommand `mechid modes` on records with forces, with more modes or more points than
//! sensors.

use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::Complex;
use serde_json::Value;

use super::{mechid, refused};

fn examples() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for file in ["decay.csv", "hammer-1.csv", "hammer-2.csv", "machine.json"] {
        std::fs::copy(examples.join(file), folder.path().join(file)).unwrap();
    }
    folder
}

fn modes(folder: &Path, arguments: &str) -> Value {
    let text = mechid(folder, &format!("modes {arguments} --json"));
    serde_json::from_str(&text).unwrap()
}

/// Checks that a report has the two modes of the machine of the examples: 12 Hz with 1 % damping
/// and 31 Hz with 1.5 % damping. The examples are its response in closed form.
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

/// Reference: reciprocity. One accelerometer and several struck points give the same shape as
/// several accelerometers and one struck point.
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
        "hammer-1.csv --force force --force-at 1 --acceleration a1,a2 --response-at 1,2 --hits \
         --band-hz 2:100",
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
        let sign = entry(row, "mass_normalised_shape_at_forces", 0).signum()
            * entry(column, "mass_normalised_shape", 0).signum();
        for point in 0..2 {
            let [struck, sensed] = [
                &row["mass_normalised_shape_at_forces"][point],
                &column["mass_normalised_shape"][point],
            ];
            let real = |entry: &Value, field: &str| entry[field][0].as_f64().unwrap();
            let error = real(struck, "standard_error").hypot(real(sensed, "standard_error"));
            let difference = real(struck, "value") - sign * real(sensed, "value");
            assert!(difference.abs() < 4.0 * error, "mode {number}: {struck} {sensed}");
            assert!(error < 0.01 * real(sensed, "value").abs(), "mode {number}: {sensed}");
        }
    }
}

/// Real shapes and reciprocity can be imposed on the modes of the examples, because their machine
/// has proportional damping and is reciprocal. Each of the two records has hits on one point only.
#[test]
fn known_properties_are_imposed() {
    let folder = examples();
    let arguments = "hammer-1.csv hammer-2.csv --force force --force-at 1,2 --acceleration a1,a2 \
                     --response-at 1,2 --hits --band-hz 2:100";
    let free = modes(folder.path(), arguments);
    let imposed = modes(folder.path(), &format!("{arguments} --real-shapes --reciprocal"));
    are_those_of_the_machine(&imposed);
    let checks = imposed["checks"].as_array().unwrap();
    for code in ["real_shapes", "reciprocity"] {
        let of_code: Vec<&Value> = checks.iter().filter(|check| check["code"] == code).collect();
        assert!(of_code.len() == 1 && of_code[0]["passed"] == true, "{of_code:?}");
    }
    let error = |report: &Value, mode: usize| {
        report["modes"][mode]["modal_mass_standard_error"].as_f64().unwrap()
    };
    for mode in 0..2 {
        assert!(error(&imposed, mode) < error(&free, mode), "{mode}");
        // All entries of a real shape have the same phase or opposite phases.
        let shape = &imposed["modes"][mode]["shape"];
        let part = |entry: usize| {
            let value = &shape[entry]["value"];
            value[1].as_f64().unwrap() / value[0].as_f64().unwrap()
        };
        assert!((part(0) - part(1)).abs() < 1e-9, "{shape}");
    }
    let settings = imposed["analysis"]["properties"].clone();
    assert_eq!(settings, serde_json::json!({ "real_shapes": true, "reciprocal": true }));
}

#[test]
fn what_means_nothing_is_refused() {
    let folder = examples();
    for (arguments, told) in [
        ("machine.json --hits", "--hits: it does not apply to a machine"),
        (
            "hammer-1.csv --acceleration a1 --force-at 1",
            "--force-at: it does not apply to a free decay",
        ),
        ("hammer-1.csv --force force --acceleration a1 --band-hz 300:400", "no spectral line"),
        (
            "hammer-1.csv --force force --acceleration a1,a2 --reciprocal",
            "--reciprocal: it needs responses of one quantity, and at least two driving points",
        ),
        (
            "decay.csv --displacement displacement --real-shapes",
            "it does not apply to a free decay",
        ),
        (
            "hammer-1.csv --force force --force-at 1,2 --acceleration a1",
            "2 places for 1 force column",
        ),
    ] {
        let message = refused(folder.path(), &format!("modes {arguments}"));
        assert!(message.contains(told), "{arguments}: {message}");
    }
}

/// Writes a record of 4 s at 256 Hz: the exact response of a machine (20 Hz, 2 % damping) to two
/// random forces. `gain` scales the second force, and `fault` changes the channels.
fn two_shakers(folder: &Path, name: &str, gain: f64, fault: impl Fn([f64; 4]) -> [f64; 4]) {
    let (omega, zeta, dt) = (TAU * 20.0, 0.02, 1.0 / 256.0);
    let pole = Complex::new(-zeta * omega, omega * (1.0f64 - zeta * zeta).sqrt());
    let step = (pole * dt).exp();
    let mut seed = 12_345_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let (mut state, mut text) = (Complex::new(0.0, 0.0), String::from("f1,f2,a1,a2\n"));
    for _ in 0..1024 {
        let forces = [random(), random()];
        state = state * step + (step - 1.0) / pole * (forces[0] + gain * forces[1]);
        let noise = [1e-6 * random(), 1e-6 * random()];
        let row = fault([forces[0], forces[1], state.im + noise[0], 0.5 * state.im + noise[1]]);
        text += &row.map(|value| format!("{value:e}")).join(",");
        text.push('\n');
    }
    std::fs::write(folder.join(name), text).unwrap();
}

const SHAKERS: &str = "--force f1,f2 --displacement a1,a2 --sample-rate 256 --band-hz 5:60";

#[test]
fn faults_of_a_test_are_told_in_a_line_each() {
    let folder = examples();
    let path = folder.path();
    two_shakers(path, "dead.csv", 0.6, |[f1, f2, a1, _]| [f1, f2, a1, 0.25]);
    two_shakers(path, "off.csv", 0.6, |[f1, _, a1, a2]| [f1, 0.0, a1, a2]);
    two_shakers(path, "one.csv", 0.6, |[f1, _, a1, a2]| [f1, 2.0 * f1, a1, a2]);
    for (file, told) in [
        ("dead.csv", "a2: constant or zero in the band; the sensor may be dead"),
        ("off.csv", "force f2: constant or zero in the band; the shaker may be off"),
        ("one.csv", "force f2 is a multiple of f1 in the band"),
    ] {
        let message = refused(path, &format!("modes {file} {SHAKERS}"));
        assert!(message.contains(told) && message.trim_end().lines().count() == 1, "{message}");
    }
    // The second shaker is off, but its channel has noise.
    two_shakers(path, "noise.csv", 0.0, |[f1, f2, a1, a2]| [f1, 1e-3 * f2, a1, a2]);
    let text = mechid(path, &format!("modes noise.csv {SHAKERS}"));
    let warnings = text.lines().filter(|line| line.contains("f2 drives no mode")).count();
    assert_eq!(warnings, 1, "{text}");
    let silence = refused(
        path,
        "modes dead.csv --force f1,f2 --displacement a1 --sample-rate 256 --band-hz 90:120",
    );
    assert!(
        silence.contains("no mode from 90") && silence.trim_end().lines().count() == 1,
        "{silence}"
    );
}

/// A requested mode that is only noise is reported as noise. If the struck points were not stated,
/// the report says so.
#[test]
fn what_was_asked_for_may_be_noise() {
    let folder = examples();
    let notes = |arguments: &str| -> Vec<String> {
        let report = modes(folder.path(), arguments);
        let notes = report["notes"].as_array().unwrap().iter();
        notes.map(|note| note.as_str().unwrap().to_owned()).collect()
    };
    let is_one_point = |arguments: &str| -> Option<bool> {
        let report = modes(folder.path(), arguments);
        let mut checks = report["checks"].as_array().unwrap().iter();
        let check = checks.find(|check| check["code"] == "one_point")?;
        check["passed"].as_bool()
    };
    let record = "hammer-1.csv --force force --acceleration a1,a2 --hits --band-hz 2:100";
    let is_noise = |note: &&String| note.contains("is not significant, and may be noise");
    assert_eq!(notes(record).iter().filter(is_noise).count(), 0);
    assert_eq!(notes(&format!("{record} --modes 4")).iter().filter(is_noise).count(), 2);
    let both = "hammer-1.csv hammer-2.csv --force force --acceleration a1 --hits --band-hz 2:100";
    assert_eq!(is_one_point(both), Some(false));
    assert_eq!(is_one_point(&format!("{both} --force-at 1,2")), None);
    assert_eq!(is_one_point(record), None);
}

/// The command refuses options, and additional files, that do not apply to the given kind of data
/// (machine, free decay, ambient record).
#[test]
fn what_does_not_apply_is_refused() {
    let folder = examples();
    let path = folder.path();
    let both = "modes decay.csv decay.csv --acceleration a1,a2,a3";
    let same = refused(path, both);
    assert!(same.trim_end().lines().count() == 1, "{same}");
    for (command, named) in [
        ("modes machine.json decay.csv", "further files"),
        ("modes decay.csv --acceleration a1,a2,a3 --ambient --near-hz 20", "near-hz"),
        ("modes decay.csv --acceleration a1,a2,a3 --ambient --hits", "hits"),
        ("modes decay.csv --acceleration a1,a2,a3 --ambient --validate-percent 20", "validate"),
    ] {
        let message = refused(path, command);
        assert!(message.contains(named) && message.contains("does not apply"), "{message}");
    }
    let outside =
        refused(path, "modes hammer-1.csv --force force --acceleration a1,a2 --near-hz 900");
    assert!(outside.contains("900 Hz is not between"), "{outside}");
}

/// A table of frequency responses gives the modes of the machine of the examples. The responses are
/// averages over hits with an exponential window.
#[test]
fn a_table_gives_the_modes_of_the_record() {
    let folder = examples();
    let path = folder.path();
    for table in ["table.csv", "table.unv"] {
        mechid(
            path,
            &format!(
                "frf hammer-1.csv --force force,0 --acceleration a1,a2 --hits --band-hz 2:100 \
                 --exponential-percent 5 --output {table} --quiet"
            ),
        );
        let report = modes(path, table);
        let found = report["modes"].as_array().unwrap();
        assert_eq!(found.len(), 2, "{report}");
        for (mode, [hz, ratio]) in found.iter().zip([[12.0, 0.01], [31.0, 0.015]]) {
            for (quantity, truth) in [("natural_frequency_hz", hz), ("damping_ratio", ratio)] {
                let [value, error] =
                    ["value", "standard_error"].map(|part| mode[quantity][part].as_f64().unwrap());
                assert!(
                    (value - truth).abs() < 4.0 * error,
                    "{quantity}: {value} ± {error}, {truth}"
                );
                assert!(error < 0.5 * truth, "{quantity}: {value} ± {error}");
            }
        }
        assert!(report["records"][0]["frequencies"].as_u64().unwrap() > 10, "{report}");
    }
    let text = std::fs::read_to_string(path.join("hammer-1.csv")).unwrap();
    let header = text.lines().next().unwrap();
    let without_units = header.split(',').map(|name| name.split(' ').next().unwrap());
    let without_units = without_units.collect::<Vec<_>>().join(",");
    std::fs::write(path.join("plain.csv"), text.replacen(header, &without_units, 1)).unwrap();
    let message = refused(path, "modes plain.csv");
    assert!(message.trim_end().lines().count() == 1, "{message}");
    assert!(
        refused(path, "modes table.csv --hits").contains("--hits: it does not apply to a table")
    );
    let message = refused(path, "modes plain.csv --ambient");
    assert!(message.contains("name the columns of a record"), "{message}");
}

/// Shapes of a free decay have the points of the sensors as names of their entries, in results and
/// in comparisons, although no force is measured. Reference: the same shapes without stated points.
#[test]
fn results_without_forces_are_compared_at_the_points_of_their_sensors() {
    let folder = examples();
    let path = folder.path();
    let columns = "decay.csv --acceleration a1,a2,a3";
    let plain = modes(path, columns);
    let modes_of = |order: [usize; 3], signs: [f64; 3]| -> Vec<Value> {
        let mode = |mode: &Value| {
            let entry = |at: usize| {
                let value = &mode["shape"][order[at]]["value"];
                let part = |k: usize| signs[at] * value[k].as_f64().unwrap();
                serde_json::json!({ "value": [part(0), part(1)] })
            };
            let hz = mode["natural_frequency_hz"]["value"].clone();
            let shape: Vec<Value> = (0..3).map(entry).collect();
            serde_json::json!({ "natural_frequency_hz": { "value": hz }, "shape": shape })
        };
        plain["modes"].as_array().unwrap().iter().map(mode).collect()
    };
    let names = ["9+X", "7-Z", "8+Y"];
    let model = modes_of([2, 0, 1], [1.0, -1.0, 1.0]);
    let model = serde_json::json!({ "modes": model, "response_names": names });
    std::fs::write(path.join("model.json"), model.to_string()).unwrap();
    let at = "--response-at 7+Z,8+Y,9+X";
    let same = |report: &Value| {
        let pairs = report["pairs"].as_array().unwrap();
        assert_eq!(
            (pairs.len(), &report["points"]),
            (3, &serde_json::json!(["7+Z", "8+Y", "9+X"]))
        );
        assert!(pairs.iter().all(|pair| pair["mac"].as_f64().unwrap() > 0.999), "{report}");
    };
    same(&modes(path, &format!("{columns} {at} --compare model.json")));
    std::fs::write(path.join("decay.json"), modes(path, &format!("{columns} {at}")).to_string())
        .unwrap();
    same(&modes(path, "decay.json --compare model.json"));
    let message = refused(path, &format!("modes {columns} --response-at 1,2"));
    assert!(message.contains("--response-at: 2 places for 3 responses"), "{message}");
    let ambient = format!("modes {columns} --ambient");
    let message = refused(path, &format!("{ambient} --response-at 1,2"));
    assert!(message.contains("--response-at: 2 places for 3 responses"), "{message}");
    let compared = modes(path, &format!("{columns} --ambient {at} --compare model.json"));
    assert_eq!(compared["points"], serde_json::json!(["7+Z", "8+Y", "9+X"]), "{compared}");
}

/// A fit near a stated frequency finds only the mode near this frequency. The frequency of the mode
/// agrees with a fit of all modes of the same decay.
#[test]
fn a_decay_is_searched_from_a_stated_frequency() {
    let folder = examples();
    let columns = "decay.csv --acceleration a1,a2,a3";
    let all = modes(folder.path(), columns);
    let number = |mode: &Value, part: &str| mode["natural_frequency_hz"][part].as_f64().unwrap();
    let second = &all["modes"][1];
    let hz = number(second, "value");
    let near = modes(folder.path(), &format!("{columns} --near-hz {:.2}", 1.005 * hz));
    let found = near["modes"].as_array().unwrap();
    assert_eq!(found.len(), 1, "{near}");
    let error = number(second, "standard_error").hypot(number(&found[0], "standard_error"));
    assert!((number(&found[0], "value") - hz).abs() < 4.0 * error, "{near}");
}

/// The modes of two records of the same machine are paired, and do not differ significantly. The
/// shapes and frequency responses that the command writes can be read again.
#[test]
fn two_results_are_compared() {
    let folder = examples();
    let path = folder.path();
    let columns = "--force force --acceleration a1,a2 --response-at 1,2 --hits --band-hz 2:100";
    let saved = mechid(path, &format!("modes hammer-1.csv {columns} --json"));
    std::fs::write(path.join("first.json"), saved).unwrap();
    let comparison = modes(path, &format!("hammer-2.csv {columns} --compare first.json"));
    let pairs = comparison["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 2, "{comparison}");
    for pair in pairs {
        assert!(pair["mac"].as_f64().unwrap() > 0.9999, "{pair}");
        let p = pair["natural_frequency_hz"]["p_value"].as_f64().unwrap();
        assert!(p > 1e-3, "{pair}");
    }
    mechid(path, "modes first.json --compare first.json");
    mechid(
        path,
        &format!(
            "modes hammer-1.csv {columns} --shapes shapes.unv --synthesis frf.unv --diagrams --quiet"
        ),
    );
    let with_model = modes(path, "first.json --compare shapes.unv");
    assert_eq!(with_model["pairs"].as_array().unwrap().len(), 2, "{with_model}");
    let again = modes(path, "frf.unv");
    assert_eq!(again["modes"].as_array().unwrap().len(), 2, "{again}");
}

/// The example is a part of a longer test and begins in motion, so a prediction from rest differs
/// from the record, and a note says that the prediction begins at rest. The force in the record
/// explains both responses.
#[test]
fn a_result_predicts_responses_and_finds_the_force() {
    let folder = examples();
    let folder = folder.path();
    let report =
        modes(folder, "hammer-1.csv --force force --acceleration a1,a2 --hits --band-hz 2:100");
    std::fs::write(folder.join("modes.json"), report.to_string()).unwrap();
    let predicted =
        mechid(folder, "predict modes.json hammer-1.csv --force force --acceleration a1,a2");
    assert!(predicted.contains("the prediction begins at rest"), "{predicted}");
    let settled = mechid(
        folder,
        "predict modes.json hammer-1.csv --force force --acceleration a1,a2 --settle 200 --json",
    );
    let settled: Value = serde_json::from_str(&settled).unwrap();
    for channel in settled["channels"].as_array().unwrap() {
        assert!(channel["nrmse"].as_f64().unwrap() < 0.05, "{settled}");
    }
    let force = "force hammer-1.csv --system modes.json --acceleration a1,a2";
    let message = refused(folder, force);
    assert!(message.contains("--at-rest"), "{message}");
    let text = mechid(folder, &format!("{force} --at-rest --json"));
    let found: Value = serde_json::from_str(&text).unwrap();
    for channel in found["channels"].as_array().unwrap() {
        assert!(channel["unexplained"].as_f64().unwrap() < 0.01, "{text}");
    }
}
