//! Hammer tests with a roving hammer: names and pictures.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::mechid;

/// Arguments for hits on the first and on the second of two masses, with the accelerations of both
/// masses.
const ROVING: &str = "hammer-1.csv hammer-2.csv --force force --struck 1,2 --acceleration a1,a2 --hits \
                      --band-hz 5:45";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for file in ["hammer-1.csv", "hammer-2.csv"] {
        fs::copy(examples.join(file), folder.path().join(file)).unwrap();
    }
    folder
}

#[test]
fn channels_keep_their_names_and_the_picture_has_the_coherence() {
    let place = folder();
    let folder = place.path();
    let found = mechid(folder, &format!("identify {ROVING} --plot fit.svg --json"));
    let picture = fs::read_to_string(folder.join("fit.svg")).unwrap();
    for words in ["a1 / force at a1", "a1 / force at a2", "a2 / force at a2", "Coherence"] {
        assert!(picture.contains(&format!(">{words}<")), "no {words}");
    }
    fs::write(folder.join("found.json"), found).unwrap();
    let modes = mechid(folder, "modes found.json --plot modes.svg");
    for row in ["\n1 a1 ", "\n1 a2 ", "\n2 a1 ", "\n2 a2 "] {
        assert!(modes.contains(row), "{modes}");
    }
    let picture = fs::read_to_string(folder.join("modes.svg")).unwrap();
    assert!(picture.contains(">x at a2 / force at a1<"));
}

/// Averaged frequency responses of a roving hammer satisfy reciprocity at the second mode to 10 %.
/// The windows of the hits end before the response has decayed, which causes an error of some per
/// cent.
#[test]
fn frequency_responses_are_averaged_over_the_hits_at_every_place() {
    let place = folder();
    let call = format!("frf {ROVING} --exponential-percent 1 --json").replace("5:45", "25:45");
    let told: Value = serde_json::from_str(&mechid(place.path(), &call)).unwrap();
    assert_eq!(told["force_names"], serde_json::json!(["force at a1", "force at a2"]));
    let largest = |at: usize| {
        let values = told["responses"][at]["magnitude"].as_array().unwrap();
        values.iter().map(|value| value.as_f64().unwrap()).fold(0.0, f64::max)
    };
    let pairs = told["responses"].as_array().unwrap();
    assert_eq!(pairs.len(), 4);
    assert!((largest(1) / largest(2) - 1.0).abs() < 0.1, "{} {}", largest(1), largest(2));
}
