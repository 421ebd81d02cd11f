//! Complete paths: from a description or a closed-form response to a file, from the file to the
//! machine, and back.
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::{Value, json};

fn mechid(folder: &Path, arguments: &str) -> Value {
    let output = Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .arg("--json")
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn parameter(report: &Value, name: &str) -> (f64, f64) {
    let rows = report["parameters"].as_array().unwrap();
    let row = rows.iter().find(|row| row["name"] == name).unwrap();
    (row["value"].as_f64().unwrap(), row["standard_error"].as_f64().unwrap_or(0.0))
}

fn assert_close(report: &Value, name: &str, truth: f64, tolerance: f64) {
    let (value, _) = parameter(report, name);
    assert!((value - truth).abs() <= tolerance, "{name} = {value}, truth {truth}");
}

/// One oscillator under the force Σ A cos(nω0 t + n²); its steady-state displacement is summed term
/// by term.
struct Oscillator {
    m: f64,
    c: f64,
    k: f64,
}

impl Oscillator {
    fn displacement(&self, amplitude: f64, lines: &[u32], omega0: f64, t: f64) -> f64 {
        let term = |&n: &u32| {
            let (omega, phase) = (f64::from(n) * omega0, f64::from(n * n));
            let (re, im) = (self.k - self.m * omega * omega, self.c * omega);
            amplitude / re.hypot(im) * (omega * t + phase - im.atan2(re)).cos()
        };
        lines.iter().map(term).sum()
    }
}

fn force(amplitude: f64, lines: &[u32], omega0: f64, t: f64) -> f64 {
    lines.iter().map(|&n| amplitude * (f64::from(n) * omega0 * t + f64::from(n * n)).cos()).sum()
}

/// A record in closed form, summed term by term in the test, gives the parameters of its
/// oscillator.
#[test]
fn a_closed_form_record_gives_its_oscillator() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Oscillator { m: 2.0, c: 3.0, k: 800.0 };
    let lines: Vec<u32> = (1..=31).step_by(2).collect();
    let (dt, omega0) = (1.0 / 64.0, TAU / 2.0);
    // The record has an offset of the sensor and a run-in before the window, as on a real rig.
    let mut text = String::from("\"clock\";\"F\";\"x\";\n");
    for k in -10..128 {
        let t = f64::from(k) * dt;
        let (f, x) = (force(5.0, &lines, omega0, t), truth.displacement(5.0, &lines, omega0, t));
        writeln!(text, "{};{:.17e};{x:.17e};", t + 1.0, f + 0.25).unwrap();
    }
    fs::write(folder.path().join("rig.csv"), text).unwrap();
    let common = "identify rig.csv --time clock --force F --displacement x --start 11 --period 128";
    let report = mechid(folder.path(), &format!("{common} --lines odd"));
    // The error is rounding of 17 digits and of the transform (1e-16 each), times the condition
    // number (about 1e2).
    for (name, value) in [("m", truth.m), ("c", truth.c), ("k", truth.k)] {
        assert_close(&report, name, value, 1e-10 * value);
    }
    assert!(report["fit"]["nrmse"].as_f64().unwrap() < 1e-11);
    assert_eq!(report["lines"]["count"], 32);
    let mode = &report["modes"][0];
    let hz = mode["natural_frequency_hz"]["value"].as_f64().unwrap();
    assert!((hz - 20.0 / TAU).abs() < 1e-10);
    // With a known mass there are two parameters, and the report says so.
    let report = mechid(folder.path(), &format!("{common} --mass 2 --band-hz 1:6"));
    assert_eq!(report["parameters"][0]["known"], true);
    assert_eq!(report["fit"]["unknowns"], 2);
    // Other commands can read the identified machine.
    let path = folder.path().join("found.json");
    fs::write(&path, report.to_string()).unwrap();
    let found = mechid::io::read_system(&path).unwrap();
    assert_eq!((found.mass()[0], found.stiffness()[0]), (2.0, parameter(&report, "k").0));
    assert_close(&report, "k", truth.k, 1e-10 * truth.k);
}

/// One shaker is enough to identify two equal masses on three springs. Reference: these masses move
/// as two oscillators, in phase and in opposition.
#[test]
fn two_degrees_of_freedom_with_one_shaker() {
    let folder = tempfile::tempdir().unwrap();
    let together = Oscillator { m: 1.5, c: 0.8, k: 300.0 };
    let opposed = Oscillator { m: 1.5, c: 1.4, k: 700.0 };
    let lines: Vec<u32> = (2..=40).collect();
    let (dt, omega0) = (1.0 / 50.0, TAU / 5.12);
    let mut text = String::from("t,f,x,y\n");
    for k in 0..256 {
        let t = f64::from(k) * dt;
        let half = |o: &Oscillator| 0.5 * o.displacement(3.0, &lines, omega0, t);
        let (p, q) = (half(&together), half(&opposed));
        let f = force(3.0, &lines, omega0, t);
        writeln!(text, "{t:.17e},{f:.17e},{:.17e},{:.17e}", p + q, p - q).unwrap();
    }
    fs::write(folder.path().join("two.csv"), text).unwrap();
    let arguments = "identify two.csv --force f,0 --displacement x,y --mass 1.5,1.5";
    let report = mechid(folder.path(), arguments);
    for (name, value) in [
        ("c11", 1.1),
        ("c12", -0.3),
        ("c21", -0.3),
        ("c22", 1.1),
        ("k11", 500.0),
        ("k12", -200.0),
        ("k21", -200.0),
        ("k22", 500.0),
    ] {
        // The error is rounding times a condition number of about 1e3, relative to the largest
        // stiffness or damping.
        let scale = if name.starts_with('k') { 500.0 } else { 1.1 };
        assert_close(&report, name, value, 1e-9 * scale);
    }
    // If no force acts on a mass and the mass is unknown, its equation of motion has no scale and
    // may be added to the equation of the other mass. The report then has the modes but not the
    // matrices.
    let report = mechid(folder.path(), "identify two.csv --force f,0 --displacement x,y");
    assert!(
        report.get("system").is_none() && report["unscaled"]["equations"] == json!([1, 2]),
        "{report}"
    );
    for (mode, oscillator) in report["modes"].as_array().unwrap().iter().zip([together, opposed]) {
        let omega = (oscillator.k / oscillator.m).sqrt();
        let ratio = oscillator.c / (2.0 * oscillator.m * omega);
        for (name, truth) in [("natural_frequency_hz", omega / TAU), ("damping_ratio", ratio)] {
            let value = mode[name]["value"].as_f64().unwrap();
            assert!((value - truth).abs() <= 1e-8 * truth, "{name} = {value}, truth {truth}");
        }
    }
}

/// A bearing test: C and K are not symmetric, and two shakers use interleaved lines.
const BEARING: &str = r#"{
    "system": {
        "mass": [[14.8, 0], [0, 14.8]],
        "damping": [[900, 150], [-120, 700]],
        "stiffness": [[120000, 45000], [-30000, 90000]]
    },
    "sampling": { "samples": 512, "rate_hz": 256 },
    "excitation": [
        { "dof": 1, "lines": "3:2:99", "amplitude": 20 },
        { "dof": 2, "lines": "4:2:100", "amplitude": 20, "phases": "random", "seed": 4 }
    ]
}"#;

#[test]
fn a_simulated_bearing_is_read_back_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bearing.json"), BEARING).unwrap();
    let simulated = mechid(folder.path(), "simulate bearing.json --output bearing.csv");
    let common = "identify bearing.csv --force force_1,force_2 --plot frf.png";
    for motion in ["displacement", "velocity", "acceleration"] {
        let columns = format!("{motion}_1,{motion}_2");
        let report = mechid(folder.path(), &format!("{common} --{motion} {columns}"));
        for (name, value) in [("m11", 14.8), ("c12", 150.0), ("k12", 45000.0), ("k21", -30000.0)] {
            // The error is rounding times a condition number of about 1e3, relative to the largest
            // entry of each matrix.
            assert_close(&report, name, value, 1e-9 * value.abs().max(10.0));
        }
        for (found, true_mode) in
            report["modes"].as_array().unwrap().iter().zip(simulated["modes"].as_array().unwrap())
        {
            let (found, truth) =
                (&found["natural_frequency_hz"]["value"], &true_mode["natural_frequency_hz"]);
            assert!((found.as_f64().unwrap() - truth.as_f64().unwrap()).abs() < 1e-8);
        }
    }
    assert!(fs::read(folder.path().join("frf.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn noise_stays_inside_the_standard_errors() {
    let folder = tempfile::tempdir().unwrap();
    let description = r#"{
        "system": { "mass": 25, "natural_frequency_hz": 12, "damping_ratio": 0.05 },
        "sampling": { "samples": 256, "rate_hz": 128 },
        "excitation": [{ "lines": "4:60", "amplitude": 2 }],
        "periods": 10,
        "noise": { "displacement": { "fraction_of_rms": 0.05 }, "seed": 7 }
    }"#;
    fs::write(folder.path().join("s.json"), description).unwrap();
    mechid(folder.path(), "simulate s.json --output s.csv");
    let common = "identify s.csv --force force --displacement displacement --period 256";
    let omega = TAU * 12.0;
    let truth = [("m", 25.0), ("c", 2.0 * 0.05 * omega * 25.0), ("k", 25.0 * omega * omega)];
    let unbiased = mechid(folder.path(), &format!("{common} --method maximum-likelihood"));
    for (name, value) in truth {
        let (found, error) = parameter(&unbiased, name);
        // The test uses one seed only; four standard errors are exceeded once in 16,000 draws.
        assert!((found - value).abs() < 4.0 * error, "{name} = {found} ± {error}, truth {value}");
        assert!(error < 0.02 * value, "{name} ± {error}");
    }
    // The report distinguishes a bad fit from a good one.
    let report = mechid(folder.path(), &format!("{common} --periods 1 --band-hz 2:30"));
    assert!(report["fit"]["unexplained_motion"].as_f64().unwrap() > 0.02);
}

/// The response that a time-stepping scheme simulates differs from the exact response only by the
/// error of this scheme.
#[test]
fn every_scheme_simulates_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    for (scheme, name, conventions) in [
        (r#""exact""#, "exact", 0),
        (r#""newmark""#, "Newmark", 0),
        (r#""central-difference", "start": "rest""#, "central difference", 2),
        (r#""houbolt""#, "Houbolt", 2),
        (r#""wilson-theta", "theta": 1.4"#, "Wilson", 1),
        (r#""generalised-alpha""#, "generalised-α (ρ∞ = 0.8)", 3),
        (r#""hht-alpha", "rho_infinity": 0.9, "acceleration": "carried""#, "HHT-α", 3),
        (r#""wbz-alpha", "rho_infinity": 0.9"#, "WBZ-α", 3),
        (r#""bathe", "load": "exact""#, "Bathe (ρ∞ = 0, γ = 0.5)", 2),
        (r#""rho-infinity-bathe", "rho_infinity": 0.5, "load": "exact""#, "Bathe (ρ∞ = 0.5", 2),
        (r#""matrix-exponential", "load": "linear""#, "matrix exponential", 2),
        (r#""runge-kutta-4", "load": "linear""#, "Runge", 1),
        (r#""runge-kutta-4", "load": "band-limited""#, "Runge", 1),
        (r#""runge-kutta-4", "load": "spline""#, "Runge", 1),
    ] {
        let description = format!(
            r#"{{
                "system": {{ "mass": 2, "damping": 6, "stiffness": 800 }},
                "sampling": {{ "samples": 2048, "rate_hz": 1024 }},
                "excitation": [{{ "lines": "1:16", "amplitude": 1 }}],
                "scheme": {{ "name": {scheme} }}
            }}"#
        );
        fs::write(folder.path().join("s.json"), description).unwrap();
        let simulated = mechid(folder.path(), "simulate s.json --output s.csv");
        assert!(simulated["scheme"].as_str().unwrap().starts_with(name), "{simulated}");
        assert!(simulated["conventions"].as_array().unwrap().len() >= conventions, "{simulated}");
        let arguments = "identify s.csv --force force --displacement displacement";
        let report = mechid(folder.path(), arguments);
        let hz = report["modes"][0]["natural_frequency_hz"]["value"].as_f64().unwrap();
        // With 320 steps per period the error of second-order schemes is about (ωΔt)²/12 to
        // (ωΔt)²/2, which is at most 2e-4.
        assert!((hz / (20.0 / TAU) - 1.0).abs() < 3e-4, "{name}: {hz} Hz");
    }
}

/// A fit in the time domain finds the parameters of a machine from its exact response to a force
/// that is constant, or linear, between samples.
#[test]
fn the_time_domain_gives_the_machine_whose_force_is_held_or_linear() {
    use mechid::model::{InitialState, Sdof};
    let folder = tempfile::tempdir().unwrap();
    let machine = Sdof::new(2.0, 6.0, 800.0).unwrap();
    let sampling = mechid::signal::Sampling::new(0.01, 300).unwrap();
    let wave: Vec<f64> = sampling.times().map(|t| 4.0 * (30.0 * t * t).sin() + 1.0).collect();
    let force = mechid::signal::Record::from_channel(sampling, wave).unwrap();
    let rest = InitialState::rest(1);
    for (between, response) in [
        ("held", mechid_problems::exact_zoh(&machine.system(), &force, &rest).unwrap()),
        ("linear", mechid_problems::exact_foh(&machine.system(), &force, &rest).unwrap()),
    ] {
        let columns = [
            ("f".to_string(), force.channel(0)),
            ("x".to_string(), response.displacement().channel(0)),
            ("v".to_string(), response.velocity().channel(0)),
        ];
        let text = mechid::io::csv_text(sampling, &columns);
        fs::write(folder.path().join("t.csv"), text).unwrap();
        let common = "identify t.csv --force f --displacement x --velocity v --domain time";
        let report = mechid(folder.path(), &format!("{common} --between-samples {between}"));
        for (name, value) in [("m", 2.0), ("c", 6.0), ("k", 800.0)] {
            // The error is rounding times the condition number of the transition over one step.
            assert_close(&report, name, value, 1e-8 * value);
        }
        // Euler's rule on the same record gives c with a relative error of more than 0.1, half of
        // ωΔt = 0.2.
        let euler = mechid(folder.path(), &format!("{common} --between-samples euler"));
        assert!((parameter(&euler, "c").0 / 6.0 - 1.0).abs() > 0.1);
    }
}

/// Ordinary least squares over the 168 odd lines of the multisine gives the mode of the Silverbox,
/// a measured benchmark.
#[test]
fn the_silverbox_comes_out() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let file = "../shared/data/silverbox/Schroeder80mV.csv";
    if !root.join(file).exists() {
        eprintln!("skipped: the silverbox record is not at {file}");
        return;
    }
    let arguments = format!(
        "identify {file} --sample-rate 610.3515625 --force V1 --displacement V2 --start 10585 \
         --period 1024 --periods 1 --lines 1:2:335 --detrend mean"
    );
    let report = mechid(&root, &arguments);
    let value = |name: &str| report["modes"][0][name]["value"].as_f64().unwrap();
    assert_eq!(report["lines"]["count"], 168);
    assert!((value("natural_frequency_hz") - 72.38).abs() < 0.05, "{report}");
    assert!((value("damping_ratio") - 0.0471).abs() < 0.0005, "{report}");
    let remarks = report["remarks"].to_string();
    assert!(remarks.contains("is not explained by"), "{remarks}");
}
