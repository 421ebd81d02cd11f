//! The subcommand `mechid modes` on known machines and on results of `mechid identify`.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

fn mechid(directory: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::cargo_bin("mechid").unwrap();
    command.current_dir(directory).args(arguments).output().unwrap()
}

fn json(directory: &Path, arguments: &[&str]) -> Value {
    let output = mechid(directory, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

const STEFFEN_RADE: &str = r#"{"system": {
    "mass": [[4.54, 0], [0, 4.54]],
    "damping": [[87.559, -35.0236], [-35.0236, 52.5354]],
    "stiffness": [[2626.77, -875.59], [-875.59, 2626.77]]}}"#;

#[test]
fn a_known_machine_has_its_published_modes() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("machine.json"), STEFFEN_RADE).unwrap();
    let report = json(place.path(), &["modes", "machine.json", "--json"]);
    for (mode, (frequency, ratio)) in [(3.1157, 0.1869), (3.9384, 0.4275)].iter().enumerate() {
        let mode = &report["modes"][mode];
        assert!((mode["damped_frequency_hz"]["value"].as_f64().unwrap() - frequency).abs() < 1e-4);
        assert!((mode["damping_ratio"]["value"].as_f64().unwrap() - ratio).abs() < 1e-4);
        assert!(mode["damping_ratio"]["standard_error"].is_null());
        assert_eq!(mode["shape"].as_array().unwrap().len(), 2);
    }
    let text = mechid(place.path(), &["modes", "machine.json"]).stdout;
    let text = String::from_utf8(text).unwrap();
    assert!(text.starts_with("machine.json: 2 degrees of freedom, 2 modes\n"), "{text}");
    assert!(text.contains("1 damped frequency") && text.contains("2 direction 2"), "{text}");
}

/// The standard errors of the modes agree with a calculation by hand for one degree of freedom in
/// which only k has a variance.
#[test]
fn standard_errors_follow_from_the_covariance() {
    let place = tempfile::tempdir().unwrap();
    let text = r#"{"system": {"mass": 2, "damping": 0.4, "stiffness": 800},
        "covariance": {"parameters": ["k"], "matrix": [[64.0]], "degrees_of_freedom": 50}}"#;
    std::fs::write(place.path().join("found.json"), text).unwrap();
    let report = json(place.path(), &["modes", "found.json", "--json"]);
    let mode = &report["modes"][0];
    // At ωn = 20 rad/s the relation dωn/ωn = dk/2k turns ±8 N/m of 800 N/m into ±0.5 %.
    let error = mode["natural_frequency_hz"]["standard_error"].as_f64().unwrap();
    assert!((error - 0.005 * 20.0 / std::f64::consts::TAU).abs() < 1e-12);
    // The damping ratio ζ = c/(2√(km)) has the same relative error as the natural frequency.
    let error = mode["damping_ratio"]["standard_error"].as_f64().unwrap();
    assert!((error - 0.005 * 0.4 / (2.0 * 1600f64.sqrt())).abs() < 1e-14);
    let text = String::from_utf8(mechid(place.path(), &["modes", "found.json"]).stdout).unwrap();
    assert!(text.contains("1 degree of freedom, 1 mode\n"), "{text}");
}

#[test]
fn what_identify_found_is_read_back_with_its_uncertainty() {
    let place = tempfile::tempdir().unwrap();
    let mut table = String::from("time,force,displacement\n");
    // The record is the response of 10 ẍ + 180 ẋ + 5000 x = F to five cosines of 50 N, rounded to a
    // micrometre.
    for sample in 0..64 {
        let (t, mut force, mut x) = (sample as f64 * 0.02, 0.0, 0.0);
        for n in [1.0, 3.0, 5.0, 7.0, 9.0] {
            let w = n * std::f64::consts::TAU / 1.28;
            let (re, im) = (5000.0 - 10.0 * w * w, 180.0 * w);
            let (c, s) = ((w * t + n * n).cos(), (w * t + n * n).sin());
            force += 50.0 * c;
            x += 50.0 * (re * c + im * s) / (re * re + im * im);
        }
        table += &format!("{t:.2},{force:.9},{x:.6}\n");
    }
    std::fs::write(place.path().join("record.csv"), table).unwrap();
    let arguments =
        ["identify", "record.csv", "--force", "force", "--displacement", "displacement"];
    let found = mechid(place.path(), &[&arguments[..], &["--json"]].concat());
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    std::fs::write(place.path().join("found.json"), &found.stdout).unwrap();
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    let modal = json(place.path(), &["modes", "found.json", "--json"]);
    for quantity in ["natural_frequency_hz", "damping_ratio"] {
        for part in ["value", "standard_error"] {
            let [a, b] = [&found, &modal].map(|r| r["modes"][0][quantity][part].as_f64().unwrap());
            // `modes` computes the same sums as `identify`, from a file that has seventeen digits.
            assert!((a / b - 1.0).abs() < 1e-9, "{quantity} {part}: {a} {b}");
        }
    }
    let hz = modal["modes"][0]["natural_frequency_hz"]["value"].as_f64().unwrap();
    assert!((hz - 500f64.sqrt() / std::f64::consts::TAU).abs() < 0.01, "{hz}");
}

#[test]
fn what_is_no_machine_is_refused_with_exit_code_2() {
    let place = tempfile::tempdir().unwrap();
    let odd = r#"{"system": {"mass": 2, "damping": 0.4, "stiffness": 800},
        "covariance": {"parameters": ["k12"], "matrix": [[1.0]], "degrees_of_freedom": 5}}"#;
    std::fs::write(place.path().join("odd.json"), odd).unwrap();
    std::fs::write(place.path().join("empty.json"), "{}").unwrap();
    for (file, message) in [
        ("odd.json", "the covariance names \"k12\"; the parameters of this machine are m, c, k"),
        ("empty.json", "system"),
        ("absent.json", "cannot read absent.json"),
    ] {
        let output = mechid(place.path(), &["modes", file]);
        assert_eq!(output.status.code(), Some(2));
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains(message), "{told}");
    }
}
