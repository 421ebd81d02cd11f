//! Records that no machine produces, and records with faults: each gives a warning or is refused.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mechid::signal::{Sampling, noise};
use serde_json::Value;

use super::{mechid, refused};

const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");

/// Writes time, force and displacement of the example, changed row by row.
fn changed(file: &Path, rows: usize, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) {
    let example = fs::read_to_string(EXAMPLE).unwrap();
    let mut text = String::from("time,force,x\n");
    for (at, line) in example.lines().skip(1).take(rows).enumerate() {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let [time, force, x] = change(at, [fields[0], fields[1], fields[2]]);
        let _ = writeln!(text, "{time:?},{force:?},{x:?}");
    }
    fs::write(file, text).unwrap();
}

/// Returns the sentences of the warnings of a fit, with their subjects.
fn warnings(folder: &Path, arguments: &str) -> String {
    let report: Value =
        serde_json::from_str(&mechid(folder, &format!("{arguments} --json"))).unwrap();
    let checks = report["checks"].as_array().unwrap().iter();
    let bad = checks.filter(|check| check["verdict"] != "good");
    bad.map(|check| format!("{}: {}\n", check["subject"], check["text"])).collect()
}

#[test]
fn white_noise_as_response_is_no_result() {
    let home = tempfile::tempdir().unwrap();
    let white = noise::white(Sampling::new(1.0, 512).unwrap(), 1, 1e-4, 7).unwrap();
    let file = home.path().join("a.csv");
    changed(&file, 512, |at, [time, force, _]| [time, force, white.channel(0)[at]]);
    let line = "identify a.csv --force force --displacement x";
    for way in ["", "--domain time --derivatives spectral"] {
        let message = refused(home.path(), &format!("{line} {way}"));
        assert!(message.contains("do not determine the machine"), "{way}: {message}");
    }
    // With a stated period the fit has a result; warnings say that the single periods of the
    // response differ from each other and that the parameters are meaningless.
    let found = warnings(home.path(), &format!("{line} --period 256"));
    assert!(found.contains("single periods of the response differ"), "{found}");
    assert!(found.contains("the parameters are meaningless"), "{found}");
}

#[test]
fn a_response_that_drops_out_for_ten_samples_is_named() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("a.csv");
    let is_lost = |at: usize| (200..210).contains(&at);
    changed(&file, 512, |at, [time, force, x]| [time, force, if is_lost(at) { 0.0 } else { x }]);
    let found = warnings(home.path(), "identify a.csv --force force --displacement x --period 256");
    assert!(found.contains("x is 0 from sample 201 on, for 10 samples"), "{found}");
}

#[test]
fn time_in_nanoseconds_is_named() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("a.csv");
    changed(&file, 512, |_, [time, force, x]| [1e9 * time, force, x]);
    let found = warnings(home.path(), "identify a.csv --force force --displacement x --period 256");
    assert!(found.contains("in ns the rate would be 128 Hz"), "{found}");
}

#[test]
fn checks_of_seven_samples_are_said_to_be_weak() {
    let home = tempfile::tempdir().unwrap();
    changed(&home.path().join("a.csv"), 7, |_, row| row);
    let line = "identify a.csv --force force --displacement x --domain time";
    let told = mechid(home.path(), &format!("{line} --derivatives spectral"));
    assert!(told.contains("even a wrong model may pass the checks"), "{told}");
}
