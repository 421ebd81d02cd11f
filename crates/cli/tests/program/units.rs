//! Columns whose header states units other than SI units.

use std::fs;
use std::path::Path;

use mechid::io::{Table, TimeAxis};
use serde_json::Value;

use super::{mechid, refused};

const NAMES: [&str; 4] = ["force", "displacement", "velocity", "acceleration"];

/// Writes the example record in SI units, and a copy with other names and units.
fn records(names: [&str; 4], per_si: [f64; 4], row_of_units: Option<&str>) -> tempfile::TempDir {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let record = Table::read(&source).unwrap();
    let record = record.record(&TimeAxis::Column("time"), &NAMES).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (file, names, factors, units) in
        [("si.csv", NAMES, [1.0; 4], None), ("other.csv", names, per_si, row_of_units)]
    {
        let mut text = format!("time,{}\n", names.join(","));
        text += &units.map_or(String::new(), |units| format!("s,{units}\n"));
        for (k, t) in record.sampling().times().enumerate() {
            text += &format!("{t:?}");
            for (c, factor) in factors.iter().enumerate() {
                text += &format!(",{:?}", record.data()[(k, c)] * factor);
            }
            text.push('\n');
        }
        fs::write(folder.path().join(file), text).unwrap();
    }
    folder
}

fn json(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&mechid(folder, &format!("{arguments} --json"))).unwrap()
}

/// Checks that two reports agree: numbers to rounding, and texts except names and notes.
fn alike(path: &str, a: &Value, b: &Value) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in a.iter().filter(|(key, _)| {
                !["file", "remarks", "covariance", "channels", "response_names", "force_names"]
                    .contains(&key.as_str())
            }) {
                alike(&format!("{path}.{key}"), value, &b[key]);
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{path}");
            a.iter().zip(b).for_each(|(a, b)| alike(&format!("{path}[]"), a, b));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= 1e-7 * a.abs().max(b.abs()), "{path}: {a} {b}");
        }
        (Value::String(a), Value::String(b)) if a.chars().any(|c| c.is_ascii_digit()) => {
            assert_eq!(a.split_whitespace().count(), b.split_whitespace().count(), "{path}");
        }
        _ => assert_eq!(a, b, "{path}"),
    }
}

#[test]
fn the_machine_is_the_same_in_any_units() {
    let cases: [([&str; 4], [f64; 4], Option<&str>); 2] = [
        (["Force [kN]", "x (mm)", "v / mm/s", "a [g]"], [1e-3, 1e3, 1e3, 1.0 / 9.80665], None),
        (
            NAMES,
            [1.0 / 4.448_221_615_260_5, 1e6 / 25.4, 1.0 / 0.0254, 1e3],
            Some("lbf,mil,in/s,mm/s^2"),
        ),
    ];
    for (names, per_si, units) in cases {
        let folder = records(names, per_si, units);
        let folder = folder.path();
        let rest = "--period 256 --force 2 --displacement 3";
        for arguments in [
            format!("identify RECORD {rest} --method maximum-likelihood"),
            format!("identify RECORD {rest} --domain time --velocity 4 --acceleration 5"),
            format!("frf RECORD {rest}"),
            format!("sweep RECORD {rest} --decimate 1,2 --estimator least-squares"),
        ] {
            let [si, other] = ["si.csv", "other.csv"]
                .map(|file| json(folder, &arguments.replace("RECORD", file)));
            alike(&arguments, &si, &other);
            let notes = |report: &Value| {
                let remarks = report["remarks"].as_array().unwrap();
                remarks.iter().filter(|r| r.as_str().unwrap().contains("converted")).count()
            };
            assert_eq!((notes(&si), notes(&other)), (0, 1), "{arguments}");
        }
        let told = mechid(folder, &format!("identify other.csv {rest}"));
        assert!(told.contains("note: other.csv: converted to SI units: 2 "), "{told}");
        let machine = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.json");
        let machine = machine.display();
        let [si, other] = ["si.csv", "other.csv"].map(|file| {
            json(folder, &format!("force {file} --system {machine} --displacement 3 --period 256"))
        });
        alike("force", &si["forces"], &other["forces"]);
        assert!(other["remarks"].to_string().contains("converted"), "{other}");
    }
}

/// Writes the example record with another name and unit of its time column.
fn timed(folder: &Path, name: &str, time: &str, per_second: f64) {
    let machine = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let text = fs::read_to_string(machine).unwrap();
    let rows = text.lines().skip(1).map(|row| {
        let (t, rest) = row.split_once(',').unwrap();
        format!("{:?},{rest}\n", per_second * t.parse::<f64>().unwrap())
    });
    let header = text.lines().next().unwrap().replace("time,", &format!("{time},"));
    fs::write(folder.join(name), format!("{header}\n{}", rows.collect::<String>())).unwrap();
}

/// A time column in milliseconds without a unit is taken as seconds; a note states the sampling
/// rate for milliseconds. At 128 Hz the samples are 7.8125 ms apart, and 512 samples last 4 s.
#[test]
fn milliseconds_that_do_not_say_so_are_asked_about() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    timed(folder, "bare.csv", "t", 1e3);
    timed(folder, "said.csv", "t_ms", 1e3);
    timed(folder, "si.csv", "t", 1.0);
    let machine = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.json");
    let roles = "--force force --displacement displacement --period 256";
    let calls = [
        "info RECORD".to_owned(),
        format!("identify RECORD {roles}"),
        format!("frf RECORD {roles}"),
        format!("sweep RECORD {roles} --decimate 1 --estimator least-squares --velocity velocity"),
        format!(
            "force RECORD --system {} --displacement displacement --period 256",
            machine.display()
        ),
        format!("report RECORD {roles} --output page.html"),
    ];
    let asked = "the time in column 1 \"t\" has no unit and is taken as seconds: the sampling rate is \
                 0.128 Hz and the duration 4000 s; in ms the rate would be 128 Hz: state the unit \
                 (--unit) or --sample-rate";
    for call in calls {
        let told = |file: &str| mechid(folder, &call.replace("RECORD", file));
        assert!(told("bare.csv").contains(asked), "{call}: {}", told("bare.csv"));
        let rate = told("bare.csv --sample-rate 128");
        let contradicted = "bare.csv: --sample-rate 128 Hz is used; column 1 \"t\" says 0.128 Hz";
        assert!(rate.contains(contradicted), "{call}: {rate}");
        assert!(!told("si.csv --sample-rate 128").contains("is used"), "{call}");
        for told in [told("said.csv"), told("si.csv"), rate] {
            assert!(!told.contains("has no unit"), "{call}: {told}");
        }
    }
    let page = || fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(!page().contains("has no unit"));
    mechid(folder, &format!("report bare.csv {roles} --output page.html"));
    assert!(page().contains("has no unit"));
}

/// A time column without unit gives a question only if the time steps or the duration would be
/// unusually long in seconds; a time column with a unit gives no question.
#[test]
fn slow_records_with_a_unit_and_fast_ones_without_are_not_doubted() {
    let folder = tempfile::tempdir().unwrap();
    for (header, step, rows, doubted) in [
        ("t,x", 0.4, 100, false),
        ("t,x", 0.6, 100, true),
        ("time,x", 0.1, 9990, false),
        ("time,x", 0.1, 10_010, true),
        ("time,x", 0.04, 30_000, false),
        ("time_s,x", 0.6, 100, false),
        ("Time [min],x", 0.6, 100, false),
        ("t,x\ns,mm", 0.6, 100, false),
    ] {
        let rows = (0..rows).map(|k| format!("{:?},{}\n", f64::from(k) * step, k % 7));
        let text = format!("{header}\n{}", rows.collect::<String>());
        fs::write(folder.path().join("a.csv"), text).unwrap();
        let told = mechid(folder.path(), "info a.csv");
        assert_eq!(told.contains("has no unit"), doubted, "{header} {step}: {told}");
    }
}

#[test]
fn a_column_of_another_quantity_is_refused() {
    let folder = records(["F [N]", "x [g]", "v", "a"], [1.0; 4], None);
    let told = refused(folder.path(), "identify other.csv --force 2 --displacement 3");
    assert_eq!(
        told,
        "error: other.csv: column 3 \"x [g]\" is in g, a unit of acceleration; --displacement takes \
         columns of displacement\n"
    );
    let told = refused(folder.path(), "frf other.csv --force 3 --velocity 4");
    assert!(told.contains("is in g, a unit of acceleration; --force takes"), "{told}");
}

/// A time column with an unknown unit, or with a factor in its name, causes a question, which
/// states the factor if there is one.
#[test]
fn a_time_column_with_a_factor_or_an_unknown_unit_is_asked_about() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let roles = "--time 1 --force force --displacement displacement --period 256";
    for (name, factor) in [("Time [0.1 s]", Some(0.1)), ("Time [samples]", None)] {
        timed(folder, "a.csv", name, 1.0);
        let report = json(folder, &format!("identify a.csv {roles}"));
        let checks = report["checks"].as_array().unwrap();
        let finding = checks.iter().find(|check| check["subject"] == "unit").unwrap();
        assert_eq!(finding["finding"]["factor"].as_f64(), factor, "{finding}");
    }
}

/// If the name of a force column has the unit psi, the report has one warning, and the parameters
/// are those of the same record with SI units in its column names.
#[test]
fn a_unit_of_another_quantity_in_a_name_gives_a_warning() {
    let names = ["\"Force, psi\"", "x_mm", "velocity", "acceleration"];
    let folder = records(names, [1.0, 1e3, 1.0, 1.0], None);
    let how = "--force 2 --displacement 3 --period 256";
    let (si, other) = (
        json(folder.path(), &format!("identify si.csv {how}")),
        json(folder.path(), &format!("identify other.csv {how}")),
    );
    alike("parameters", &si["parameters"], &other["parameters"]);
    let warnings = other["checks"].as_array().unwrap().iter();
    let warnings: Vec<&str> = warnings
        .filter(|check| check["subject"] == "unit" && check["verdict"] == "doubtful")
        .map(|check| check["text"].as_str().unwrap())
        .collect();
    let [warning] = warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.contains("\"psi\"") && warning.contains("converted to N"), "{warning}");
}
