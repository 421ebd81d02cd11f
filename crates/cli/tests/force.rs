//! Tests of the subcommand `force`: a record is simulated, the machine is identified, and the force
//! is reconstructed.

use std::path::{Path, PathBuf};

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

/// Runs the program in a folder; returns the report, or the message of a failure with exit code 2.
fn mechid(folder: &Path, arguments: &str) -> Result<Vec<u8>, String> {
    let output = cargo_bin_cmd!("mechid")
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    match output.status.code() {
        Some(0) => Ok(output.stdout),
        code => {
            assert_eq!(code, Some(2), "{arguments}");
            Err(String::from_utf8_lossy(&output.stderr).into_owned())
        }
    }
}

fn report(folder: &Path, arguments: &str) -> Value {
    serde_json::from_slice(&mechid(folder, &format!("{arguments} --json")).unwrap()).unwrap()
}

/// Makes a folder with a record of the example machine and the machine identified from it.
fn experiment() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.json");
    std::fs::copy(example, folder.path().join("experiment.json")).unwrap();
    mechid(folder.path(), "simulate experiment.json --output run.csv").unwrap();
    let identified = mechid(
        folder.path(),
        "identify run.csv --force force --displacement displacement --period 256 --json",
    );
    std::fs::write(folder.path().join("machine.json"), identified.unwrap()).unwrap();
    folder
}

fn column(path: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut rows = text.lines().map(|row| row.split(','));
    let at = rows.next().unwrap().position(|header| header == name).unwrap();
    rows.map(|mut row| row.nth(at).unwrap().parse().unwrap()).collect()
}

fn error(found: &[f64], truth: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let difference = square(&mut found.iter().zip(truth).map(|(a, b)| a - b));
    (difference / square(&mut truth[..found.len()].iter().copied())).sqrt()
}

#[test]
fn the_force_of_the_record_comes_back() {
    let folder = experiment();
    let folder = folder.path();
    let truth = column(&folder.join("run.csv"), "force");
    let found = report(
        folder,
        "force run.csv --system machine.json --displacement displacement --period 256 --lines 4:60 \
         --output force.csv --spectrum lines.csv --plot force.svg",
    );
    assert_eq!(found["method"], "dynamic stiffness, line by line");
    assert_eq!(
        (found["periods"].as_u64(), found["machine_uncertainty"].as_bool()),
        (Some(2), Some(true))
    );
    let force = column(&folder.join("force.csv"), "force");
    assert_eq!(force.len(), 256);
    let seen = error(&force, &truth[..256]);
    let stated = column(&folder.join("force.csv"), "standard_error");
    let stated = (stated.iter().map(|e| e * e).sum::<f64>() / 256.0).sqrt();
    let size = (truth.iter().map(|f| f * f).sum::<f64>() / truth.len() as f64).sqrt();
    // The displacement has 1 % noise, which weighs more at the lines far above the resonance. The
    // actual error agrees with the stated one up to the scatter of one draw.
    assert!(seen < 3.0 * stated / size, "seen {seen:.3}, stated {:.3}", stated / size);
    // The spectrum has only the lines 4 to 60, which are 0.5 Hz apart.
    let amplitude = column(&folder.join("lines.csv"), "amplitude");
    let frequency = column(&folder.join("lines.csv"), "frequency_hz");
    assert_eq!((frequency.len(), frequency[0], frequency[56]), (57, 2.0, 30.0));
    assert!((amplitude[6] - 2.0).abs() < 0.2, "{}", amplitude[6]);
    let drawing = std::fs::read_to_string(folder.join("force.svg")).unwrap();
    assert!(drawing.starts_with("<svg") && drawing.contains("Frequency"));
}

#[test]
fn the_method_follows_the_record_and_says_why() {
    let folder = experiment();
    let folder = folder.path();
    let truth = column(&folder.join("run.csv"), "force");
    let displacement = "--displacement displacement";
    let all = "--displacement displacement --velocity velocity --acceleration acceleration";
    let period = format!("{displacement} --period 256");
    let short = format!("{displacement} --period 128 --method shrinkage");
    let open = format!("{displacement} --method kalman");
    for (arguments, method, largest) in [
        (all, "equation of motion, sample by sample", 0.3),
        (&period, "mean of the force given the measurement (shrinkage)", 0.6),
        (displacement, "augmented Kalman filter and smoother, tuned by likelihood", 0.9),
        (&open, "augmented Kalman filter and smoother, tuned by likelihood", 0.9),
        (&short, "mean of the force given the measurement (shrinkage)", f64::INFINITY),
    ] {
        let arguments = format!("force run.csv --system machine.json {arguments} --output f.csv");
        let found = report(folder, &arguments);
        assert_eq!(found["method"], method, "{arguments}");
        assert!(!found["why"].as_str().unwrap().is_empty());
        let seen = error(&column(&folder.join("f.csv"), "force"), &truth);
        assert!(seen < largest, "{arguments}: {seen:.3}");
    }
    let told = mechid(folder, &format!("force run.csv --system machine.json {period}")).unwrap();
    let told = String::from_utf8(told).unwrap();
    for words in [
        "because: the record has whole periods, but the lines with force are not given",
        "standard error (N)",
    ] {
        assert!(told.contains(words), "{told}");
    }
}

/// A bearing is driven in y, and only its displacement in x is measured; the cross-coupled
/// coefficients give the force.
#[test]
fn one_sensor_finds_the_force_in_the_other_direction() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let experiment = r#"{
        "system": { "mass": [[14.8, 0], [0, 14.8]], "damping": [[20, 10], [10, 30]],
                    "stiffness": [[40, 50], [-20, 60]] },
        "sampling": { "samples": 256, "rate_hz": 7.5 },
        "excitation": [{ "dof": 2, "lines": "1:20", "amplitude": 100, "phases": "schroeder" }],
        "scheme": { "name": "exact" }, "response": "periodic", "periods": 2
    }"#;
    std::fs::write(folder.join("rotor.json"), experiment).unwrap();
    mechid(folder, "simulate rotor.json --output run.csv").unwrap();
    let arguments = "force run.csv --system rotor.json --displacement displacement_1,0 --forced 2 \
                     --period 256 --lines 1:20 --output f.csv --plot f.png";
    let found = report(folder, arguments);
    assert_eq!(found["machine_uncertainty"], false);
    assert_eq!(
        (&found["forces"][0]["sought"], &found["forces"][1]["sought"]),
        (&false.into(), &true.into())
    );
    let truth = column(&folder.join("run.csv"), "force_2");
    let seen = error(&column(&folder.join("f.csv"), "force_2"), &truth);
    assert!(seen < 1e-9, "{seen:.1e}");
    let picture = std::fs::read(folder.join("f.png")).unwrap();
    assert_eq!(&picture[1..4], b"PNG");
    // One sensor cannot distinguish two forces.
    let both = arguments.replace("--forced 2", "");
    assert!(mechid(folder, &both).unwrap_err().contains("name fewer forced degrees of freedom"));
}

#[test]
fn bad_requests_say_what_to_change() {
    let folder = experiment();
    let folder = folder.path();
    let displacement = "--displacement displacement";
    for (arguments, words) in [
        ("", "the response is missing"),
        ("--displacement displacement,velocity", "the system has 1 degree of freedom"),
        ("--displacement displacement --forced 2", "degree of freedom 2 (counted from 1)"),
        ("--displacement displacement --method continuous", "velocity and acceleration"),
        ("--displacement displacement --method frequency-domain", "--period"),
        ("--displacement displacement --period 256 --method kalman", "open record"),
        ("--velocity velocity --period 256 --lines 200", "line"),
        ("--displacement displacement --period 256 --noise 0", "must be positive"),
        ("--displacement displacement --method tikhonov", "at most 512 are possible"),
    ] {
        let arguments = format!("force run.csv --system machine.json {arguments}");
        let long = arguments.contains("tikhonov");
        if long {
            // The method accepts at most 512 samples, which are two periods, so three periods are
            // refused.
            let experiment = std::fs::read_to_string(folder.join("experiment.json")).unwrap();
            let three = experiment.replace("\"periods\": 2", "\"periods\": 3");
            std::fs::write(folder.join("experiment.json"), three).unwrap();
            mechid(folder, "simulate experiment.json --output run.csv").unwrap();
        }
        let message = mechid(folder, &arguments).unwrap_err();
        assert!(message.contains(words), "{arguments}: {message}");
    }
    let missing = format!("force run.csv --system nowhere.json {displacement}");
    assert!(mechid(folder, &missing).unwrap_err().contains("nowhere.json"));
}

#[test]
fn the_noise_of_a_channel_has_the_unit_of_its_motion() {
    let folder = experiment();
    let common = "force run.csv --system machine.json --period 256 --method shrinkage";
    for (motion, unit) in [("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s²")] {
        let found = report(folder.path(), &format!("{common} --{motion} {motion}"));
        let chosen = found["chosen"].as_array().unwrap();
        let noise = chosen.iter().find(|c| c["name"] == "noise of channel 1").unwrap();
        assert_eq!(noise["unit"], unit);
    }
}
