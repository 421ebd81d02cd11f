//! Columns that say to be in other units than those of the SI.

use std::fs;
use std::path::Path;

use mechid::io::{Table, TimeAxis};
use serde_json::Value;

use super::{mechid, refused};

const NAMES: [&str; 4] = ["force", "displacement", "velocity", "acceleration"];

/// The example's record in SI units, and with other names and numbers.
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

/// Every number alike to rounding, every text the same but for what `names` and notes say.
fn alike(path: &str, a: &Value, b: &Value) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in a
                .iter()
                .filter(|(key, _)| !["file", "remarks", "covariance"].contains(&key.as_str()))
            {
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
