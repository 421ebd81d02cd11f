//! `mechid identify --machine`: machines of named elements, from records and tables.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mechid::ResponseQuantity;
use mechid::signal::{NoiseLevel, Sampling, noise};
use mechid_problems::HammerTest;
use nalgebra::{Complex, dmatrix};
use serde_json::{Value, json};

use super::{mechid, refused};

/// Makes a folder with a simulated noisy record of three masses in a row; all of them are measured.
fn simulated() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let experiment = json!({
        "system": {
            "mass": [[2.0, 0, 0], [0, 1.5, 0], [0, 0, 1.2]],
            "damping": [[10.0, -4, 0], [-4, 7, -3], [0, -3, 3]],
            "stiffness": [[50000.0, -20000, 0], [-20000, 45000, -25000], [0, -25000, 25000]]
        },
        "sampling": {"samples": 512, "rate_hz": 128},
        "excitation": [{"dof": 1, "lines": "4:200", "amplitude": 1, "phases": "random", "seed": 1}],
        "periods": 6,
        "scheme": {"name": "exact"},
        "response": "periodic",
        "noise": {"displacement": {"fraction_of_rms": 0.01}, "seed": 3}
    });
    write(folder.path(), "rig.json", &experiment);
    mechid(folder.path(), "simulate rig.json --output rig.csv");
    write(folder.path(), "three.json", &three());
    folder
}

/// Describes the simulated machine by elements, with two sensors and with unknown springs and
/// dampers.
fn three() -> Value {
    let link = |name: &str, ends: Value| {
        let mut link =
            json!({"name": name, "k": {"start": 3e4, "min": 0}, "c": {"start": 4, "min": 0}});
        let field = if ends.is_array() { "between" } else { "at" };
        link[field] = ends;
        link
    };
    json!({
        "dofs": ["x1", "x2", "x3"],
        "elements": [
            {"name": "m1", "at": "x1", "m": 2.0},
            {"name": "m2", "at": "x2", "m": 1.5},
            {"name": "m3", "at": "x3", "m": 1.2},
            link("s1", json!("x1")),
            link("s2", json!(["x1", "x2"])),
            link("s3", json!(["x2", "x3"]))
        ],
        "sensors": [
            {"name": "displacement_1", "at": "x1", "quantity": "displacement"},
            {"name": "displacement_3", "at": "x3", "quantity": "displacement"}
        ],
        "inputs": [{"kind": "force", "name": "force_1", "at": "x1"}]
    })
}

fn write(folder: &Path, name: &str, value: &Value) {
    fs::write(folder.join(name), value.to_string()).unwrap();
}

fn identified(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&mechid(folder, &format!("identify {arguments} --json"))).unwrap()
}

/// Returns value and standard error of an unknown.
fn unknown(report: &Value, name: &str) -> [f64; 2] {
    let rows = report["parameters"].as_array().unwrap();
    let row = rows.iter().find(|row| row["name"] == name).unwrap();
    ["value", "standard_error"].map(|field| row[field].as_f64().unwrap())
}

/// Reference: the springs and dampers behind the matrices of the simulation.
const TRUTH: [(&str, f64); 6] =
    [("s1.k", 3e4), ("s1.c", 6.0), ("s2.k", 2e4), ("s2.c", 4.0), ("s3.k", 2.5e4), ("s3.c", 3.0)];

fn is_true(report: &Value) {
    for (name, truth) in TRUTH {
        let [value, error] = unknown(report, name);
        assert!((value - truth).abs() < 4.5 * error, "{name}: {value} ± {error}, {truth}");
        assert!(error < 0.05 * truth, "{name}: {value} ± {error}");
    }
}

#[test]
fn two_sensors_find_springs_and_dampers_and_other_commands_read_the_result() {
    let folder = simulated();
    let at = folder.path();
    let periodic = identified(at, "rig.csv --machine three.json --period 512");
    is_true(&periodic);
    assert_eq!(periodic["tests"][0]["kind"], "periods");
    assert!(periodic["misfit_p_value"].as_f64().unwrap() > 1e-4);
    let open = identified(at, "rig.csv --machine three.json --band-hz 1:50 --starts 1");
    is_true(&open);
    assert_eq!(open["tests"][0]["kind"], "open");
    write(at, "found.json", &periodic);
    // The saved settings contain all six elements of the machine.
    assert_eq!(periodic["analysis"]["machine"]["elements"].as_array().unwrap().len(), 6);
    let modes: Value = serde_json::from_str(&mechid(at, "modes found.json --json")).unwrap();
    let error = modes["modes"][0]["natural_frequency_hz"]["standard_error"].as_f64().unwrap();
    assert!(error > 0.0 && error < 1e-2, "{error}");
    let force = mechid(
        at,
        "force rig.csv --system found.json --displacement displacement_1,0,displacement_3 \
         --forced 1 --period 512 --lines 4:200",
    );
    assert!(force.contains("standard error (N)"), "{force}");
    let all = "--displacement displacement_1,displacement_2,displacement_3";
    let predicted =
        mechid(at, &format!("predict found.json rig.csv --force force_1,0,0 {all} --period 512"));
    assert!(predicted.contains("displacement_2"), "{predicted}");
}

/// Frequency responses of `mechid frf` give the same result as the record.
#[test]
fn a_table_of_frequency_responses_gives_the_same() {
    let folder = simulated();
    let at = folder.path();
    let columns = "--force force_1 --displacement displacement_1,displacement_2,displacement_3";
    mechid(at, &format!("frf rig.csv {columns} --period 512 --output frf.csv"));
    let mut machine = three();
    for (sensor, name) in machine["sensors"].as_array_mut().unwrap().iter_mut().zip(["1", "3"]) {
        sensor["name"] = json!(name);
    }
    machine["inputs"][0]["name"] = json!("1");
    write(at, "table.json", &machine);
    let report = identified(at, "frf.csv --frf-table --machine table.json");
    assert_eq!(report["tests"][0]["kind"], "responses");
    is_true(&report);
}

/// The response of a rigid rotor with a trial weight at several speeds gives the coefficients of
/// its bearing. The response is known in closed form.
#[test]
fn unbalance_over_the_speed_gives_a_bearing() {
    let folder = tempfile::tempdir().unwrap();
    let (mass, stiffness, damping) = (10.0, [1.2e6, 8e5], [900.0, 700.0]);
    let (trial, residual) = (Complex::new(1e-4, 0.0), Complex::new(3e-5, -2e-5));
    let mut text = String::from(
        "speed_rpm,u_real,u_imaginary,x_amplitude [um],x_phase_deg,x_standard_error [um],\
         y_real,y_imaginary,y_standard_error\n",
    );
    for (run, weight) in [Complex::default(), trial].into_iter().enumerate() {
        for step in 0..12 {
            let rpm = 1200.0 + 200.0 * f64::from(step);
            let omega = rpm * TAU / 60.0;
            let unbalance = (weight + residual) * omega * omega;
            let motion = |at: usize, force: Complex<f64>| {
                force / Complex::new(stiffness[at] - mass * omega * omega, omega * damping[at])
            };
            // The errors are at most two standard errors and vary without a pattern.
            let error = |at: usize| {
                let phase = f64::from(step * 7 + 3) * (1.3 + at as f64) + run as f64;
                Complex::from_polar(1e-7, phase)
            };
            let x = motion(0, unbalance) + error(0);
            let y = motion(1, unbalance * Complex::new(0.0, -1.0)) + error(1);
            let (amplitude, phase) = (x.norm() * 1e6, x.arg().to_degrees());
            writeln!(
                text,
                "{rpm},{},{},{amplitude},{phase},0.1,{},{},1e-7",
                weight.re, weight.im, y.re, y.im
            )
            .unwrap();
        }
    }
    fs::write(folder.path().join("runs.csv"), text).unwrap();
    let machine = json!({
        "dofs": ["x", "y"],
        "elements": [
            {"name": "disc", "dofs": ["x", "y"], "mass": "disc.csv"},
            {"name": "film", "at": ["x", "y"], "kxx": {"start": 1e6}, "kyy": {"start": 1e6},
             "cxx": {"start": 500}, "cyy": {"start": 500}},
            {"name": "rest", "kind": "unbalance", "at": ["x", "y"],
             "real": {"start": 0}, "imaginary": {"start": 0}}
        ],
        "sensors": [
            {"at": "x", "quantity": "displacement"},
            {"at": "y", "quantity": "displacement"}
        ],
        "inputs": [{"kind": "unbalance", "name": "u", "at": ["x", "y"]}],
        "speed": "synchronous",
        "candidates": {"sensors": [{"at": "x", "quantity": "velocity"}]}
    });
    fs::write(folder.path().join("disc.csv"), "10,0\n0,10\n").unwrap();
    write(folder.path(), "rotor.json", &machine);
    let report = identified(folder.path(), "runs.csv --machine rotor.json --speed-table");
    for (name, truth) in [
        ("film.kxx", stiffness[0]),
        ("film.kyy", stiffness[1]),
        ("film.cxx", damping[0]),
        ("film.cyy", damping[1]),
        ("rest.real", residual.re),
        ("rest.imaginary", residual.im),
    ] {
        let [value, error] = unknown(&report, name);
        assert!((value - truth).abs() < 4.0 * error, "{name}: {value} ± {error}, {truth}");
        assert!(error < 0.05 * truth.abs(), "{name}: {value} ± {error}");
    }
    assert_eq!(report["candidates"][0]["name"], "x");
    let message = refused(folder.path(), "identify runs.csv --machine rotor.json");
    assert!(message.contains("give a table over the speed (--speed-table)"), "{message}");
}

/// If the shaft in the description of the example rotor is too soft by 1 %, a note names the
/// stiffness of the shaft, and the intervals of the bearing coefficients include the effect of this
/// error.
#[test]
fn a_wrong_part_of_a_rotor_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/rotor");
    for file in ["mass.mtx", "stiffness.mtx", "gyroscopic.mtx", "runs.csv"] {
        fs::copy(format!("{example}/{file}"), folder.path().join(file)).unwrap();
    }
    let text = fs::read_to_string(format!("{example}/rotor.json")).unwrap();
    let mut machine: Value = serde_json::from_str(&text).unwrap();
    let mut report = |factor: f64| {
        machine["elements"][0]["stiffness_factor"] = json!(factor);
        write(folder.path(), "rotor.json", &machine);
        identified(folder.path(), "runs.csv --machine rotor.json --speed-table")
    };
    let named = |report: &Value| -> Option<Value> {
        let notes = report["notes"].as_array().unwrap();
        notes.iter().find(|note| note["kind"] == "doubtful_known").cloned()
    };
    let [right, soft] = [1.0, 0.99].map(&mut report);
    assert!(named(&right).is_none(), "{}", right["notes"]);
    let note = named(&soft).unwrap();
    assert_eq!(note["parameter"], "shaft.stiffness");
    let [value, error] = ["value", "standard_error"].map(|part| note[part].as_f64().unwrap());
    assert!((value - 1.0).abs() < 3.0 * error && error < 0.002, "{note}");
    let misfit = [0, 1].map(|at| note["misfit"][at].as_f64().unwrap());
    assert!(misfit[0] > 1.3 && misfit[1] < 1.1, "{note}");
    let name = "B.kxx";
    let ([true_value, _], [wrong_value, wrong_error]) =
        (unknown(&right, name), unknown(&soft, name));
    assert!((wrong_value - true_value).abs() < 1.96 * wrong_error, "{wrong_value} ± {wrong_error}");
}

#[test]
fn bad_descriptions_are_told_by_name() {
    let folder = simulated();
    let at = folder.path();
    let message = |change: &dyn Fn(&mut Value)| {
        let mut machine = three();
        change(&mut machine);
        write(at, "bad.json", &machine);
        let message = refused(at, "identify rig.csv --machine bad.json --period 512");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        message
    };
    let told = message(&|m| m["elements"][4]["between"] = json!(["x1", "x9"]));
    assert!(told.contains("element \"s2\" is at \"x9\", which is none of"), "{told}");
    let told = message(&|m| m["elements"][3]["k"] = json!({"start": 2, "min": 3, "max": 1}));
    assert!(told.contains("the bounds of \"s1.k\" contradict each other"), "{told}");
    let told = message(&|m| m["sensors"][0]["at"] = json!("nowhere"));
    assert!(told.contains("sensor \"displacement_1\" is at \"nowhere\""), "{told}");
    let told = message(&|m| m["elements"][2] = m["elements"][1].clone());
    assert!(told.contains("the element \"m2\" appears twice"), "{told}");
    let told = message(&|m| drop(m["elements"].as_array_mut().unwrap().remove(2)));
    assert!(told.contains("degree of freedom \"x3\" has no mass (it belongs to \"s3\")"), "{told}");
    let told = message(&|m| m["dofs"] = json!(["x1", "x2", "x3", "x4"]));
    assert!(told.contains("no element is connected to degree of freedom \"x4\""), "{told}");
    let told = message(&|m| m["elements"][3]["k"] = json!({"begin": 2}));
    assert!(told.contains("elements[3].k.begin: unknown field `begin`"), "{told}");
    let told = message(&|m| {
        m["elements"] = json!([
            {"name": "body", "dofs": ["x1", "x2", "x3"],
             "mass": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "stiffness": "lost.mtx"}
        ]);
    });
    assert!(told.contains("lost.mtx"), "{told}");
    // If the data do not determine an unknown at all, the command fails; if they determine only the
    // sum of several unknowns, it succeeds.
    let told = message(&|m| {
        for at in 3..6 {
            (m["elements"][at]["k"], m["elements"][at]["c"]) = (json!(3e4), json!(4));
        }
        let nothing = json!({"name": "none", "dofs": ["x1"], "stiffness": [[0]],
            "stiffness_factor": {"start": 1}});
        m["elements"].as_array_mut().unwrap().push(nothing);
    });
    assert!(told.contains("the data do not determine none.stiffness: add a sensor"), "{told}");
    let mut machine = three();
    let beside = json!({"name": "beside", "at": "x1", "k": {"start": 1e3}});
    machine["elements"].as_array_mut().unwrap().push(beside);
    write(at, "beside.json", &machine);
    let text = mechid(at, "identify rig.csv --machine beside.json --period 512");
    let told =
        "the data do not determine s1.k and beside separately, but only their sum s1.k + beside";
    assert!(text.contains(told), "{text}");
    let message = refused(at, "identify rig.csv --machine three.json --mass 3");
    assert!(message.contains("cannot be used with"), "{message}");
}

/// Reads the acceleration in the direction of motion of the shake table from the file of a logger.
/// The header of the columns in this file begins with `PacketCounter`.
fn logged(file: &Path) -> Option<Vec<f64>> {
    let text = fs::read_to_string(file).ok()?;
    let rows = text.lines().skip_while(|line| !line.starts_with("PacketCounter")).skip(2);
    let along = |row: &str| row.split(',').nth(5)?.trim().parse::<f64>().ok();
    let values: Vec<f64> = rows.map_while(along).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    Some(values.iter().map(|value| value - mean).collect())
}

/// A model of one storey under an earthquake, measured by two wireless loggers at 120 Hz.
/// Reference: the highest peak in the spectrum of the storey is at 21.98 Hz.
#[test]
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn two_loggers_on_a_shake_table() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/shake-table");
    let [ground, top] =
        ["ground", "top"].map(|place| logged(&data.join(format!("stiff1_elcentro1_{place}.csv"))));
    let Some((ground, top)) = ground.zip(top) else {
        eprintln!("skipped: there is no {}", data.display());
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("ground,top\n");
    for (ground, top) in ground.iter().zip(&top) {
        writeln!(text, "{ground},{top}").unwrap();
    }
    fs::write(folder.path().join("quake.csv"), text).unwrap();
    let machine = json!({
        "dofs": ["top"],
        "elements": [
            {"name": "m", "at": "top", "m": 1},
            {"name": "frame", "at": "top", "k": {"start": 1.5e4, "min": 1e3, "max": 1e5},
             "c": {"start": 5, "min": 0}}
        ],
        "sensors": [{"at": "top", "quantity": "acceleration",
            "delay": {"start": 0, "min": -0.05, "max": 0.05}}],
        "inputs": [{"kind": "support", "name": "ground", "quantity": "acceleration"}]
    });
    write(folder.path(), "storey.json", &machine);
    for band in ["10:35", "18:26"] {
        let report = identified(
            folder.path(),
            &format!("quake.csv --machine storey.json --sample-rate 120 --band-hz {band}"),
        );
        let hz = report["modes"][0]["natural_frequency_hz"]["value"].as_f64().unwrap();
        assert!((hz - 21.98).abs() < 0.1, "{hz}");
        let [delay, error] = unknown(&report, "top.delay");
        // If parts of the data disagree, the report multiplies the standard error from noise by
        // `error_scale`; the division gives the standard error from noise.
        let of_noise = error / report["error_scale"].as_f64().unwrap();
        assert!((delay - 0.015).abs() < 3e-4 && of_noise < 1e-4, "{delay} ± {error}");
        // The model has only one storey, but other parts of the structure also move, so the
        // residual is not white.
        let checks = report["checks"].as_array().unwrap();
        let is_told = |check: &Value| check["subject"] == "whiteness" && check["verdict"] != "good";
        assert!(checks.iter().any(is_told), "{checks:?}");
    }
}

/// Good hits of a hammer are fitted as open records. Bad hits are excluded, and the report and the
/// page name these hits. Reference: the matrices of the generator; the unknown factors of damping
/// and stiffness must be 1.
#[test]
fn hits_of_a_hammer_and_the_page() {
    let rig = HammerTest {
        frequencies_hz: vec![11.0, 27.0],
        damping_ratios: vec![0.02, 0.015],
        shapes: dmatrix![0.5, 0.6; 0.7, -0.4],
        sampling: Sampling::new(1.0 / 256.0, 6144).unwrap(),
        quantity: ResponseQuantity::Acceleration,
        hits: 6,
        peak: 200.0,
        duration: 0.015,
        force_noise: 0.02,
    };
    let test = rig.measure(0, 1, 4).unwrap();
    let level = NoiseLevel::FractionOfRms(0.01);
    let response = noise::add_white(&test.response, level, 5).unwrap();
    let mut text = String::from("hammer,a2\n");
    for (f, a) in test.force.channel(0).iter().zip(response.channel(1)) {
        writeln!(text, "{f},{a}").unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("hits.csv"), text).unwrap();
    let system = rig.system().unwrap();
    let rows = |m: &nalgebra::DMatrix<f64>| json!([[m[(0, 0)], m[(0, 1)]], [m[(1, 0)], m[(1, 1)]]]);
    let start = json!({"start": 1.3, "min": 0});
    let machine = json!({
        "dofs": ["x1", "x2"],
        "elements": [{"name": "frame", "dofs": ["x1", "x2"], "mass": rows(system.mass()),
            "damping": rows(system.damping()), "stiffness": rows(system.stiffness()),
            "damping_factor": start, "stiffness_factor": start}],
        "sensors": [{"name": "a2", "at": "x2", "quantity": "acceleration"}],
        "inputs": [{"kind": "force", "name": "hammer", "at": "x1"}]
    });
    write(at, "frame.json", &machine);
    let fit = "hits.csv --machine frame.json --hits --sample-rate 256";
    let report = identified(at, fit);
    for name in ["frame.damping", "frame.stiffness"] {
        let [value, error] = unknown(&report, name);
        assert!((value - 1.0).abs() < 4.5 * error && error < 1e-2, "{name}: {value} ± {error}");
    }
    let used = |hits: &Value| hits.as_array().unwrap().iter().filter(|h| h["used"] == true).count();
    assert_eq!((report["hits"].as_array().unwrap().len(), used(&report["hits"])), (6, 5));
    assert_eq!(report["tests"][0]["kind"], "hit");
    assert_eq!(report["force_noise"][0]["source"], "between_hits");
    let stated = identified(at, &format!("{fit} --force-noise 0.02"));
    assert_eq!(stated["force_noise"][0]["levels_n"], json!([0.02]));
    let message = refused(at, &format!("identify {fit} --force-noise 1,2"));
    assert!(message.contains("one for each of 1 forces, not 2"), "{message}");
    let text = mechid(at, &format!("report {fit} --output page.html"));
    assert!(text.contains("5 of 6 hits on degree of freedom 1 used"), "{text}");
    let page = fs::read_to_string(at.join("page.html")).unwrap();
    let [value, _] = unknown(&report, "frame.stiffness");
    for part in ["left out", "frame.stiffness", &format!("{value:.4}"), "mechid report hits.csv"] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let message = refused(at, &format!("identify {fit} --period 512"));
    assert!(message.contains("hits has no periods: leave --period out"), "{message}");
    let message = refused(at, "report hits.csv --frf-table --output page.html");
    assert!(message.contains("--frf-table needs --machine in a report"), "{message}");
}

/// A saved analysis with elements gives a row for every record of a fleet.
#[test]
fn fleets_identify_machines_of_elements() {
    let folder = simulated();
    let at = folder.path();
    let settings = &identified(at, "rig.csv --machine three.json --period 512")["analysis"];
    let window = json!({"start": 1, "period": 512});
    write(at, "analysis.json", &json!({"window": window, "elements": settings}));
    let report = mechid(at, "fleet rig.csv --analysis analysis.json --output results --json");
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!((&report["computed_records"], &report["failed"]), (&json!(1), &json!(0)));
    let trends = mechid(at, "trends results");
    assert!(trends.contains("s2.k"), "{trends}");
    let both = json!({"elements": settings, "channels": {"force": ["force_1"]}});
    write(at, "both.json", &both);
    let message = refused(at, "fleet rig.csv --analysis both.json --output more");
    assert!(message.contains("states its columns and settings itself"), "{message}");
}
