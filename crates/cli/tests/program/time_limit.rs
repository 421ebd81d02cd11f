//! The option `--time-limit`. A limit of 0 s ends every search before its first step, whatever the
//! speed of the computer.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::{mechid, refused};

fn examples() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples"))
}

const MACHINE: &str = "machine.csv --force force --displacement displacement";

#[test]
fn an_identification_that_ends_early_says_so() {
    let text = mechid(examples(), &format!("identify {MACHINE} --time-limit 0"));
    assert!(text.contains("the time limit of 0 s ended the work early"), "{text}");
    assert!(text.contains("--time-limit"), "{text}");
    let json = mechid(examples(), &format!("identify {MACHINE} --time-limit 0 --json"));
    let report: Value = serde_json::from_str(&json).unwrap();
    let checks = report["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["finding"]["kind"] == "time_limit");
    let check = check.unwrap_or_else(|| panic!("{checks:?}"));
    assert_eq!((&check["verdict"], &check["subject"]), (&"bad".into(), &"search".into()));
    assert_eq!(check["finding"]["seconds"], 0.0);
    let whole = mechid(examples(), &format!("identify {MACHINE} --json"));
    let long = mechid(examples(), &format!("identify {MACHINE} --time-limit 1e6 --json"));
    assert_eq!(whole, long);
}

#[test]
fn modes_and_pages_have_a_limit() {
    let hammer = "hammer-1.csv --force force --acceleration a1,a2";
    let json = mechid(examples(), &format!("modes {hammer} --time-limit 0 --json"));
    let report: Value = serde_json::from_str(&json).unwrap();
    let checks = report["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["code"] == "time_limit");
    let check = check.unwrap_or_else(|| panic!("{checks:?}"));
    assert_eq!((&check["passed"], &check["value"]), (&false.into(), &0.0.into()));
    let home = tempfile::tempdir().unwrap();
    let page = home.path().join("page.html");
    let report = format!("report {MACHINE} --time-limit 0 --output {} --quiet", page.display());
    mechid(examples(), &report);
    assert!(fs::read_to_string(page).unwrap().contains("ended the work early"));
}

#[test]
fn a_limit_without_a_result_is_a_failure() {
    let decay = "modes decay.csv --acceleration a1,a2,a3 --time-limit 0";
    let message = refused(examples(), decay);
    assert!(message.contains("the time limit of 0 s ended the work before"), "{message}");
    assert!(message.contains("--time-limit"), "{message}");
    for wrong in ["-1", "inf", "soon"] {
        let message = refused(examples(), &format!("identify {MACHINE} --time-limit={wrong}"));
        assert!(message.contains("--time-limit"), "{message}");
    }
}

#[test]
fn every_record_of_a_fleet_has_the_limit() {
    let home = tempfile::tempdir().unwrap();
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    fs::copy(examples().join("machine.csv"), home.path().join("a.csv")).unwrap();
    let fleet = "fleet a.csv --analysis analysis.json --output results --json";
    let report = |more: &str| -> Value {
        serde_json::from_str(&mechid(home.path(), &format!("{fleet} {more}"))).unwrap()
    };
    let whole = report("");
    let limited = report("--time-limit 0");
    assert_eq!((&whole["failed"], &limited["failed"]), (&0.into(), &0.into()), "{limited}");
    // The time limit is a setting of the analysis, so a run with another limit computes the record
    // again.
    assert_eq!(limited["computed_records"], 1);
}
