//! The Silverbox, a public benchmark stored next to the project, analysed with the program as a
//! user would.
//!
//! Wigren & Schoukens, "Three free data sets for development and benchmarking in nonlinear system
//! identification", ECC 2013.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::mechid;

/// Index, counted from 1, of the first sample in steady state, for each of the six realisations.
const STARTS: [usize; 6] = [9030, 17722, 26414, 35106, 43798, 52490];

/// Returns the path of a file of the benchmark; if it is missing, prints a note and returns `None`.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn file(name: &str) -> Option<PathBuf> {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/silverbox").join(name);
    if !path.exists() {
        eprintln!("skipped: {name} of the Silverbox is missing in ../shared/data/silverbox");
        return None;
    }
    Some(path.canonicalize().unwrap())
}

/// Returns the arguments to read a file of the benchmark.
fn record(path: &Path) -> String {
    let path = path.display();
    format!("{path} --sample-rate 610.3515625 --force V1 --displacement V2 --detrend mean")
}

fn identified(folder: &Path, arguments: &str) -> Value {
    let told = mechid(folder, &format!("identify {arguments} --json"));
    fs::write(folder.join("machine.json"), &told).unwrap();
    serde_json::from_str(&told).unwrap()
}

fn assert_small_amplitude_frequency(told: &Value) {
    let hz = told["modes"][0]["natural_frequency_hz"]["value"].as_f64().unwrap();
    assert!((hz - 68.3).abs() <= 0.1, "{hz} Hz");
}

#[test]
fn the_schroeder_record_is_explained() {
    let Some(path) = file("Schroeder80mV.csv") else { return };
    let folder = tempfile::tempdir().unwrap();
    let window = format!("{} --start 13657 --period 1024 --periods 8 --lines 1:335", record(&path));
    // The commands state the weighting. With automatic weights, which follow the residual force, a
    // model with springs as the only nonlinear terms does not explain 1.5 % of the response.
    for (terms, most) in [
        ("--nonlinear k2:x1^2,k3:x1^3 --weighting white-force", 0.0070),
        ("--nonlinear k2:x1^2,k3:x1^3,c2:|v1|v1 --weighting response --search phase", 0.0025),
    ] {
        let told = identified(folder.path(), &format!("{window} {terms}"));
        let left = told["fit"]["unexplained_motion"].as_f64().unwrap();
        assert!(left <= most, "{terms} leaves {left}");
        assert_small_amplitude_frequency(&told);
        // The kind of distortion is found without a model, from the lines without force.
        let kind = told["nonlinear"]["distortion"]["text"].as_str().unwrap();
        assert!(kind.contains("cubic stiffness"), "{kind}");
    }
    // The picture shows the measured restoring force, the spring force, the damping force and the
    // residual force.
    let drawn = format!("identify {window} --nonlinear k2:x1^2,k3:x1^3 --quiet --plot drawn.svg");
    mechid(folder.path(), &drawn);
    let svg = fs::read_to_string(folder.path().join("drawn.svg")).unwrap();
    for panel in ["Measured restoring force", "Spring force", "Damping force", "Residual force"] {
        assert!(svg.contains(panel), "{panel}");
    }
}

/// Returns the RMSE in mV of a realisation in its steady state.
fn rmse(folder: &Path, path: &Path, start: usize) -> f64 {
    let window = format!("{} --start {start} --period 8192 --periods 1", record(path));
    let told = mechid(folder, &format!("predict machine.json {window} --json"));
    let told: Value = serde_json::from_str(&told).unwrap();
    1e3 * told["channels"][0]["rmse"].as_f64().unwrap()
}

#[test]
fn four_windows_of_a_file_predict_the_other_two() {
    let Some(path) = file("SNLS80mV_estimation.csv") else { return };
    let folder = tempfile::tempdir().unwrap();
    let more = STARTS[1..4].iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let four = format!(
        "{} --start {} --more-starts {more} --period 8192 --periods 1",
        record(&path),
        STARTS[0]
    );
    // Terms that are selected by means of held-out realisations give the same fit as the same terms
    // given by `--nonlinear`.
    let candidates = "--candidates k2:x1^2,k3:x1^3,k5:x1^5,k4:x1^4 --criterion held-out";
    let chosen = identified(folder.path(), &format!("{four} {candidates}"));
    let steps = chosen["nonlinear"]["selection"]["steps"].as_array().unwrap();
    let added: Vec<&str> = steps.iter().filter_map(|step| step["added"].as_str()).collect();
    assert_eq!(added[..2], ["k3", "k2"], "{added:?}");
    let windows = chosen["records"].as_array().unwrap();
    assert_eq!(windows.len(), 4);
    assert_eq!(windows[3]["first_sample"], STARTS[3]);

    for (terms, parameters, most) in [
        ("--nonlinear k2:x1^2,k3:x1^3", 5, 0.33),
        ("--nonlinear k2:x1^2,k3:x1^3,c3:v1^3/(1+(v1/20)^2),f:x1^0 --search laws,phase", 10, 0.22),
    ] {
        let told = identified(folder.path(), &format!("{four} {terms}"));
        assert_eq!(told["fit"]["unknowns"], parameters);
        assert_small_amplitude_frequency(&told);
        for start in &STARTS[4..] {
            let rmse = rmse(folder.path(), &path, *start);
            assert!(rmse <= most, "{terms}: {rmse} mV from sample {start} on");
        }
    }
}
