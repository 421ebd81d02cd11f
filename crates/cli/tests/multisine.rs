//! The subcommand `multisine`.

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

fn json(arguments: &str) -> Value {
    let output = cargo_bin_cmd!("mechid")
        .arg("multisine")
        .args(arguments.split_whitespace())
        .arg("--json")
        .assert()
        .success();
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

/// Runs the program, which must fail with exit code 2 and a message with the given words.
fn refused(arguments: &str, words: &[&str]) {
    let output = cargo_bin_cmd!("mechid")
        .arg("multisine")
        .args(arguments.split_whitespace())
        .assert()
        .code(2);
    let message = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    for word in words {
        assert!(message.contains(word), "{arguments}: {message}");
    }
}

#[test]
fn the_record_is_the_sum_of_its_cosines() {
    let folder = tempfile::tempdir().unwrap();
    let (csv, svg) = (folder.path().join("force.csv"), folder.path().join("force.svg"));
    let report = json(&format!(
        "--samples 16 --rate 8 --lines 1:2:5 --amplitude 50 --phases schroeder-binary --periods 2 \
         --output {} --plot {}",
        csv.display(),
        svg.display()
    ));
    let list = |name: &str| -> Vec<f64> {
        let values = report["channels"][0][name].as_array().unwrap();
        values.iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let (lines, amplitudes, phases) = (list("lines"), list("amplitudes"), list("phases"));
    assert_eq!((lines.as_slice(), amplitudes.as_slice()), (&[1.0, 3.0, 5.0][..], &[50.0; 3][..]));
    let text = std::fs::read_to_string(csv).unwrap();
    let rows: Vec<&str> = text.lines().collect();
    assert_eq!((rows[0], rows.len()), ("time,force", 33));
    for row in &rows[1..] {
        let (t, force) = row.split_once(',').unwrap();
        let (t, force): (f64, f64) = (t.parse().unwrap(), force.parse().unwrap());
        let terms = lines.iter().zip(&amplitudes).zip(&phases);
        let expected: f64 =
            terms.map(|((n, a), p)| a * (std::f64::consts::PI * n * t + p).cos()).sum();
        assert!((force - expected).abs() < 1e-11, "{row}");
    }
    assert!(std::fs::read_to_string(svg).unwrap().starts_with("<svg"));
}

#[test]
fn measures_are_those_of_the_signal() {
    let report = json("--samples 64 --rate 64 --phases low-crest --rms 3 --starts 3");
    assert_eq!(report["line_spacing_hz"], 1.0);
    let channel = &report["channels"][0];
    let number = |name: &str| channel[name].as_f64().unwrap();
    assert!((number("rms") - 3.0).abs() < 1e-12);
    assert!((number("peak") / number("rms") - number("crest_factor")).abs() < 1e-12);
    assert!(number("crest_factor") < 1.45);
    assert!((number("spectral_flatness") - 1.0).abs() < 1e-12);
    assert_eq!(channel["persistent_excitation_order"], 62);
    assert!((number("effective_band_low_hz") - 1.0).abs() < 1e-12);
    assert!((number("effective_band_high_hz") - 31.0).abs() < 1e-12);
}

#[test]
fn several_inputs_have_columns_of_their_own() {
    let names = |arguments: &str| -> Vec<String> {
        let report = json(&format!("--samples 32 --rate 32 {arguments}"));
        let channels = report["channels"].as_array().unwrap();
        channels.iter().map(|c| c["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names("--inputs 2"), ["force_1", "force_2"]);
    let four = names("--inputs 2 --uncorrelated hadamard --phases random --peak 5");
    assert_eq!(four[2], "experiment_2_force_1");
    assert_eq!(four.len(), 4);
}

#[test]
fn impossible_requests_are_refused_with_their_numbers() {
    refused("--samples 0 --rate 50", &["sample"]);
    refused("--samples 16 --rate -5", &["-5"]);
    refused("--samples 16 --rate 5 --amplitude -1", &["amplitude", "-1"]);
    refused("--samples 16 --rate 5 --lines 8", &["8", "7"]);
    refused("--samples 2 --rate 5", &["line"]);
    refused("--samples 16 --rate 5 --amplitude 0", &["zero"]);
    refused("--samples 16 --rate 5 --inputs 3 --uncorrelated dft --slope nan", &["amplitude"]);
    refused("--samples 16 --rate 5 --inputs 3 --uncorrelated hadamard", &["order 3"]);
    refused("--samples 16 --rate 5 --inputs 8", &["8", "7"]);
    refused("--samples 99999999999 --rate 5", &["99999999999"]);
    refused("--samples 16 --rate 5 --rms 1 --peak 1", &["--peak"]);
    refused("--samples 16 --rate 5 --plot force.pdf", &[".svg"]);
    refused("--samples 16 --rate 5 --periods 0", &["--periods"]);
    refused("--samples 16 --rate 5 --inputs 0", &["--inputs"]);
}
