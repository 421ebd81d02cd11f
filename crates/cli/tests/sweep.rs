//! `mechid sweep`: the best step is found, and what cannot be swept is refused.

use std::fs;

use assert_cmd::Command;
use serde_json::Value;

/// The dissertation's oscillator under a flat multisine; the response is the exact one of the
/// band-limited force.
const EXPERIMENT: &str = r#"{
    "system": { "mass": 10, "damping": 180, "stiffness": 5000 },
    "sampling": { "samples": 256, "rate_hz": 1 },
    "excitation": [{ "lines": "all", "amplitude": 5, "phases": "schroeder" }]
}"#;

fn sweep(experiment: &str, arguments: &str) -> (bool, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.json"), experiment).unwrap();
    let output = Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder.path())
        .args(["sweep", "a.json", "--json"])
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let report = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.success(), report, String::from_utf8(output.stderr).unwrap())
}

fn errors(report: &Value) -> Vec<f64> {
    report["points"].as_array().unwrap().iter().map(|p| p["error"].as_f64().unwrap()).collect()
}

#[test]
fn euler_is_best_at_the_finest_step_and_spectra_at_any() {
    let (done, report, _) = sweep(EXPERIMENT, "--npi 4:-1:1 --estimator euler");
    assert!(!done && report == Value::Null);

    let (done, report, error) = sweep(EXPERIMENT, "--npi 1:1:4 --estimator euler --plot a.svg");
    assert!(done, "{error}");
    assert_eq!(report["best_npi"], 1.0);
    let found = errors(&report);
    assert_eq!(found.len(), 4);
    assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "{found:?}");
    // ωn = 22.3607 rad/s: a cycle of 256 samples at NPI 1.
    let point = &report["points"][0];
    assert!((point["samples_per_cycle"].as_f64().unwrap() - 256.0).abs() < 1e-9);
    assert_eq!(point["parameters"][1]["name"], "k");
    assert_eq!(point["parameters"][1]["true_value"], 5000.0);

    for estimator in ["least-squares", "maximum-likelihood", "equation-of-motion"] {
        let arguments = format!("--npi 1:1:4 --unknown-mass --estimator {estimator}");
        let (done, report, error) = sweep(EXPERIMENT, &arguments);
        assert!(done, "{error}");
        // Exact data: only rounding, amplified by the condition of the equations, is left.
        assert!(errors(&report).iter().all(|e| *e < 1e-8), "{estimator}: {report}");
    }
}

#[test]
fn a_sweep_that_finds_nothing_says_why() {
    let silent = EXPERIMENT.replace("\"amplitude\": 5", "\"amplitude\": 0");
    let (done, _, error) = sweep(&silent, "--npi 1,2 --estimator euler");
    assert!(
        !done
            && error.contains("no setting gave an estimate")
            && error.contains("at the first one, 1"),
        "{error}"
    );
}
