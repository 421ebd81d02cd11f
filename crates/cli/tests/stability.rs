//! The subcommand `stability`.

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

fn json(arguments: &[&str]) -> Value {
    let output =
        cargo_bin_cmd!("mechid").arg("stability").args(arguments).arg("--json").assert().success();
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

/// Runs the program, which must fail with exit code 2 and a message with the given words.
fn refused(arguments: &[&str], words: &str) {
    let output = cargo_bin_cmd!("mechid").arg("stability").args(arguments).assert().code(2);
    let message = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    assert!(message.contains(words), "{arguments:?}: {message}");
}

#[test]
fn anchors_and_limits_are_in_the_json() {
    let report = json(&["--step", "0.1"]);
    let schemes = report["schemes"].as_array().unwrap();
    let elongation = |k: usize| schemes[k]["chart"][0]["period_elongation"].as_f64().unwrap();
    // Published period elongations at ten steps per period, in per cent with four decimals.
    for (k, percent) in
        [3.2075, 1.6002, -1.6934, 12.3206, 6.1462, 3.3828, 1.6179, 0.1122].iter().enumerate()
    {
        assert!((100.0 * elongation(k) - percent).abs() < 0.51e-4, "{}", schemes[k]["name"]);
    }
    let pi = std::f64::consts::PI;
    let limits = [None, Some(3f64.sqrt()), Some(1.0), None, None, None, None, Some(2f64.sqrt())];
    for (scheme, limit) in schemes.iter().zip(limits) {
        let found = scheme["stability_limit"].as_f64();
        match (found, limit) {
            (None, None) => {}
            (Some(found), Some(limit)) => assert!((found * pi / limit - 1.0).abs() < 1e-8),
            other => panic!("{}: {other:?}", scheme["name"]),
        }
    }
}

/// A scheme that is chosen by ρ∞ has the spectral radius ρ∞ at very large steps.
#[test]
fn schemes_of_a_radius_have_it() {
    let of = |rho: &str| {
        let report = json(&["--step", "0.05,1e7", "--rho-infinity", rho]);
        let schemes = report["schemes"].as_array().unwrap().clone();
        let with_rho = schemes.into_iter().filter(|scheme| {
            let name = scheme["name"].as_str().unwrap();
            name.contains("ρ∞ =") && !name.contains("ρ∞ = 0,")
        });
        with_rho.collect::<Vec<_>>()
    };
    for (rho, count) in [("0.8", 4), ("0.5", 4), ("0.3", 3)] {
        let schemes = of(rho);
        assert_eq!(schemes.len(), count, "{rho}: {schemes:?}");
        for scheme in schemes {
            let radius = |k: usize| scheme["chart"][k]["spectral_radius"].as_f64().unwrap();
            let expected: f64 = rho.parse().unwrap();
            // A double eigenvalue is accurate to only half of the digits.
            assert!((radius(1) - expected).abs() < 1e-4, "{}: {}", scheme["name"], radius(1));
            assert!(radius(0) > 0.99, "{}: {}", scheme["name"], radius(0));
            assert_eq!(scheme["stability_limit"], Value::Null, "{}", scheme["name"]);
        }
    }
}

#[test]
fn a_machine_gets_its_largest_steps() {
    let folder = tempfile::tempdir().unwrap();
    let (file, plot) = (folder.path().join("machine.json"), folder.path().join("charts.svg"));
    // With ω = √500 rad/s central difference is stable up to the step 2/ω.
    std::fs::write(
        &file,
        r#"{ "system": { "mass": 10, "damping": 180, "stiffness": 5000 },
             "sampling": { "samples": 64, "rate_hz": 10 },
             "excitation": [{ "lines": "all", "amplitude": 1 }] }"#,
    )
    .unwrap();
    let report = json(&[file.to_str().unwrap(), "--plot", plot.to_str().unwrap()]);
    let machine = &report["schemes"][2]["machine"];
    let critical = machine["critical_step_s"].as_f64().unwrap();
    assert!((critical - 2.0 / 500f64.sqrt()).abs() < 1e-8);
    assert_eq!(machine["step_s"].as_f64(), Some(0.1));
    assert!(machine["spectral_radius"].as_f64().unwrap() > 1.0);
    let drawn = std::fs::read_to_string(plot).unwrap();
    for words in ["Houbolt", "Period elongation", "Amplitude decay", "Spectral radius"] {
        assert!(drawn.contains(words), "{words}");
    }
}

#[test]
fn text_holds_every_table() {
    let output = cargo_bin_cmd!("mechid").args(["stability", "--theta", "1.3"]).assert().success();
    let text = String::from_utf8_lossy(&output.get_output().stdout).into_owned();
    for words in ["Spectral radius", "Amplitude decay", "Wilson θ = 1.3", "largest stable Δt/T"] {
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn impossible_requests_are_refused() {
    refused(&["--damping", "1.0"], "less than 1");
    refused(&["--damping", "-0.1"], "damping");
    refused(&["--step", "0"], "time step");
    refused(&["--theta", "0.9"], "θ must lie between 1 and inf");
    refused(&["--gamma", "-1"], "γ must lie between 0 and 1");
}
