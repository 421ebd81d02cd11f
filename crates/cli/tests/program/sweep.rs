//! The subcommand `mechid sweep` finds the best step of experiments and of records, and refuses
//! input that cannot be swept.

use std::fs;

use assert_cmd::Command;
use serde_json::Value;

/// Experiment with the dissertation's oscillator under a flat multisine; its response is the exact
/// response to the band-limited force.
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
    // NPI 1 puts the natural frequency, 22.3607 rad/s, on line 1, so a natural period has all 256
    // samples.
    let point = &report["points"][0];
    assert!((point["samples_per_cycle"].as_f64().unwrap() - 256.0).abs() < 1e-9);
    assert_eq!(point["parameters"][1]["name"], "k");
    assert_eq!(point["parameters"][1]["true_value"], 5000.0);

    for estimator in ["least-squares", "maximum-likelihood", "equation-of-motion"] {
        let arguments = format!("--npi 1:1:4 --unknown-mass --estimator {estimator}");
        let (done, report, error) = sweep(EXPERIMENT, &arguments);
        assert!(done, "{error}");
        // The data are exact, so the error is only rounding times the condition number of the
        // equations.
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
            && error.contains("at the first setting, 1"),
        "{error}"
    );
}

/// Writes a record in closed form: an oscillator in steady state, driven by a multisine of fifteen
/// lines with a period of 240 samples.
fn record(folder: &std::path::Path) {
    use mechid::signal::{Multisine, Phases, Sampling};
    let system = mechid::model::Sdof::new(10.0, 180.0, 5000.0).unwrap().system();
    let sampling = Sampling::from_rate_hz(100.0, 240).unwrap();
    let force = Multisine::flat(1..=15, 5.0, Phases::Schroeder).unwrap();
    let force = force.sample(sampling).unwrap().repeated(2).unwrap();
    let motion = mechid_problems::exact_harmonic_periodic(&system, &force).unwrap();
    let columns = [
        ("f".to_string(), force.channel(0)),
        ("x".to_string(), motion.displacement().channel(0)),
        ("v".to_string(), motion.velocity().channel(0)),
    ];
    let text = mechid::io::csv_text(force.sampling(), &columns);
    fs::write(folder.join("r.csv"), text).unwrap();
    fs::write(folder.join("a.json"), EXPERIMENT).unwrap();
}

#[test]
fn a_record_is_swept_by_taking_fewer_samples() {
    let place = tempfile::tempdir().unwrap();
    record(place.path());
    let columns = "sweep r.csv --force f --displacement x --velocity v --period 240";
    let known = format!("{columns} --reference a.json --estimator euler");
    let told = |arguments: &str| crate::mechid(place.path(), arguments);
    let report = |arguments: &str| -> Value {
        serde_json::from_str(&told(&format!("{arguments} --json"))).unwrap()
    };
    let euler = report(&format!("{known} --decimate 1:1:4 --plot s.svg"));
    assert!(errors(&euler).windows(2).all(|pair| pair[0] < pair[1]), "{euler}");
    assert_eq!((&euler["best_setting"], &euler["setting"]), (&1.0.into(), &"decimation".into()));
    let point = &euler["points"][2];
    assert!((point["step_s"].as_f64().unwrap() - 0.03).abs() < 1e-12);
    assert_eq!(point["parameters"][2]["true_value"], 5000.0);
    let [low, high] = [0, 1].map(|at| point["parameters"][2]["interval"][at].as_f64().unwrap());
    assert!(low < high);
    assert!(place.path().join("s.svg").exists());
    // The same settings are given as sampling rates; the text report names the best setting.
    let rates = report(&format!("{known} --rate-hz 100,50"));
    assert_eq!(errors(&rates), errors(&euler)[..2]);
    let best = told(&format!("{known} --rate-hz 50,100 --best"));
    assert!(best.contains("\nBest: rate 100 Hz\n") && best.contains("95 % interval"), "{best}");
    assert!(best.contains("\nerror ") && best.contains(" 5000 "), "{best}");
    // Spectra give the exact result if all lines are below half the sample rate.
    let spectra = format!("{columns} --reference a.json --estimator least-squares");
    for mass in ["", "--mass 10"] {
        let found = report(&format!("{spectra} --decimate 1,2,4 {mass}"));
        assert!(errors(&found).iter().all(|e| *e < 1e-8), "{found}");
    }
    // If the period is no multiple of the factor, the result of this setting states the failure.
    let uneven = report(&format!("{spectra} --decimate 1,7"));
    let reason = uneven["points"][1]["failure"].as_str().unwrap();
    assert_eq!(
        reason,
        "a period of 240 samples cannot be reduced to every 7th sample: the ratio must be a whole \
         number"
    );
    // Without a reference the report gives standard errors and says that they do not include bias.
    let own = told(&format!("{columns} --decimate 1,2"));
    assert!(own.contains("it does not include bias"), "{own}");
}

#[test]
fn settings_belong_to_what_is_swept() {
    let place = tempfile::tempdir().unwrap();
    record(place.path());
    let columns = "sweep r.csv --force f --displacement x";
    for (arguments, part) in [
        (
            format!("{columns} --velocity v --npi 1,2"),
            "--npi applies only to a described experiment",
        ),
        (format!("{columns} --velocity v --rate-hz 30"), "cannot be reduced to 30 Hz"),
        (format!("{columns} --velocity v --decimate 2.5"), "got 2.5"),
        (format!("{columns} --decimate 1,2"), "needs the velocity"),
        (format!("{columns} --velocity v"), "--npi"),
        (format!("{columns} --decimate 1 --rate-hz 50"), "cannot be used with"),
        ("sweep a.json --npi 1 --force f".to_owned(), "--force belongs to a record"),
    ] {
        let message = crate::refused(place.path(), &arguments);
        assert!(message.contains(part), "{arguments}: {message}");
    }
    // The experiment of a description is simulated at other sample rates.
    let told = |arguments: &str| -> Value {
        serde_json::from_str(&crate::mechid(place.path(), arguments)).unwrap()
    };
    let rates = told("sweep a.json --rate-hz 8,16 --estimator euler --json");
    assert_eq!(rates["points"][1]["step_s"], 0.0625);
    let thinned = told("sweep a.json --decimate 0.0625,0.125 --estimator euler --json");
    assert_eq!(errors(&thinned), [errors(&rates)[1], errors(&rates)[0]]);
}

#[test]
fn a_machine_of_many_parameters_fits_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = r#"{
        "system": { "mass": [[10, 0], [0, 12]], "damping": [[180, -20], [-20, 160]],
                    "stiffness": [[5000, -900], [-900, 7000]] },
        "sampling": { "samples": 256, "rate_hz": 64 },
        "excitation": [{ "lines": "1:2:99", "amplitude": 5, "phases": "schroeder" },
                       { "dof": 2, "lines": "2:2:100", "amplitude": 5, "phases": "schroeder" }]
    }"#;
    fs::write(folder.path().join("a.json"), experiment).unwrap();
    let text = super::mechid(
        folder.path(),
        "sweep a.json --npi 2:2:6 --estimator least-squares --unknown-mass",
    );
    let blocks: Vec<&str> = text.split("\n\n").filter(|block| block.starts_with("NPI ")).collect();
    assert_eq!(blocks.len(), 4, "{text}");
    for row in blocks.iter().flat_map(|block| block.lines()) {
        assert!(row.chars().count() <= 100, "{row}");
    }
    for name in ["m11", "m22", "c12", "c21", "k11", "k21", "k22"] {
        assert_eq!(text.matches(&format!("{name} (")).count(), 1, "{name}\n{text}");
    }
    // Each block of parameters has a row for each setting and one with the true values.
    assert!(blocks[1..].iter().all(|b| b.lines().count() == 5 && b.contains("\ntrue ")), "{text}");
}
