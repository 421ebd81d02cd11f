//! `mechid bearing` over speeds and loads, and from tables of frequency responses.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mechid::bearing::{Conditions, ShortBearing};
use mechid::model::OilFilm;
use mechid::signal::Sampling;
use mechid_problems::rig::{BearingRig, RigTest, Shakers};
use nalgebra::Matrix2;
use serde_json::{Value, json};

use super::{mechid, refused};

const PERIOD: usize = 256;

/// Returns the rig with a short bearing, and its coefficients kxx … cyy.
fn rig(rotation_hz: f64, load: f64) -> (BearingRig, [f64; 8]) {
    let conditions = Conditions {
        diameter: 0.1,
        length: 0.03,
        clearance: 100e-6,
        viscosity: 0.02,
        omega: TAU * rotation_hz,
    };
    let bearing = ShortBearing::new(conditions.length_over_diameter().unwrap()).unwrap();
    let found = bearing.equilibrium(conditions.sommerfeld_number(load).unwrap()).unwrap();
    let film = conditions.film(found.coefficients(), load).unwrap();
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = film;
    let k = Matrix2::new(kxx, kxy, kyx, kyy);
    let c = Matrix2::new(cxx, cxy, cyx, cyy);
    let rig = BearingRig { rotation_hz, ..BearingRig::new([k, c, Matrix2::zeros()]) };
    (rig, [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy])
}

/// Writes the record of a test in direction x as `name-x.csv` and that of a test in direction y as
/// `name-y.csv`, each with this number of periods.
fn write(folder: &Path, rig: &BearingRig, periods: usize, name: &str) {
    let sampling = Sampling::from_rate_hz(1024.0, PERIOD).unwrap();
    let lines: Vec<usize> = (6..=50).step_by(2).collect();
    for (seed, shakers, direction) in [(1, Shakers::X, "x"), (2, Shakers::Y, "y")] {
        let period = rig.period(sampling, &lines, 20.0, shakers, seed).unwrap();
        let RigTest { force, acceleration, displacement } =
            rig.measured(&period, periods, seed).unwrap();
        let mut text = String::from("time,fx,fy,ax,ay,dx,dy\n");
        for (row, time) in force.sampling().times().enumerate() {
            let _ = write!(text, "{time}");
            for record in [&force, &acceleration, &displacement] {
                let [x, y] = [0, 1].map(|channel| record.channel(channel)[row]);
                let _ = write!(text, ",{x:e},{y:e}");
            }
            text.push('\n');
        }
        fs::write(folder.join(format!("{name}-{direction}.csv")), text).unwrap();
    }
}

fn json_of(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

const CHANNELS: &str = "--force fx,fy --acceleration ax,ay --displacement dx,dy --period 256";

/// The table can be passed to `ross.BearingElement`: the column `speed` is its argument
/// `frequency`, and the columns kxx … myy are its keyword arguments.
#[test]
fn a_campaign_is_one_table_over_speed_and_load() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let points = [(70.0, 1500.0), (35.0, 1500.0), (35.0, 800.0)];
    let mut described = Vec::new();
    for (at, (rotation_hz, load)) in points.into_iter().enumerate() {
        write(folder, &rig(rotation_hz, load).0, 8, &format!("p{at}"));
        let tests = [format!("p{at}-x.csv"), format!("p{at}-y.csv")];
        described.push(json!({ "tests": tests, "rotation_hz": rotation_hz, "load": load }));
    }
    // The campaign uses the settings that the report of one test states.
    let one =
        format!("bearing p0-x.csv p0-y.csv {CHANNELS} --stator-mass 20 --clearance 1e-4 --json");
    let settings = json_of(&mechid(folder, &one))["analysis"].clone();
    let campaign = json!({
        "channels": { "force": ["fx", "fy"], "acceleration": ["ax", "ay"], "displacement": ["dx", "dy"] },
        "window": { "period": PERIOD },
        "settings": settings,
        "points": described,
    });
    fs::write(folder.join("campaign.json"), campaign.to_string()).unwrap();
    let run = "bearing campaign.json --campaign --output table.csv --plot speeds.svg --json";
    let report = json_of(&mechid(folder, run));
    assert_eq!(report["rows"].as_array().unwrap().len(), 3);

    let table = fs::read_to_string(folder.join("table.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let names =
        ["kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy", "mxx", "mxy", "myx", "myy"];
    assert_eq!(rows[0][..2], ["speed", "load"]);
    assert_eq!(rows[0][2..14], names);
    let errors = names.map(|name| format!("{name}_standard_error"));
    assert_eq!(rows[0][14..26], errors);
    let threshold = ["whirl_frequency_ratio", "critical_mass"];
    let threshold = threshold.map(|name| [name.to_owned(), format!("{name}_standard_error")]);
    assert_eq!(rows[0][26..], threshold.concat());
    // The rows are sorted by speed, then by load.
    let order = [(35.0, 800.0), (35.0, 1500.0), (70.0, 1500.0)];
    assert_eq!(rows.len(), 1 + order.len());
    for (row, (rotation_hz, load)) in rows[1..].iter().zip(order) {
        let row: Vec<f64> = row.iter().map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(row[..2], [TAU * rotation_hz, load]);
        let truth = rig(rotation_hz, load).1;
        for (at, exact) in truth.into_iter().enumerate() {
            let (value, error) = (row[2 + at], row[14 + at]);
            assert!((value - exact).abs() < 5.0 * error, "{}: {value}, {exact}", names[at]);
            let largest = truth[at / 4 * 4..at / 4 * 4 + 4].iter().map(|x| x.abs());
            assert!(error < 0.02 * largest.fold(0.0, f64::max), "{}: {error}", names[at]);
        }
    }
    let drawn = fs::read_to_string(folder.join("speeds.svg")).unwrap();
    let drawing = roxmltree::Document::parse(&drawn).unwrap();
    let texts: Vec<&str> = drawing.descendants().filter_map(|node| node.text()).collect();
    for word in ["kxy", "cyy", "Rotation"] {
        assert!(texts.iter().any(|text| text.contains(word)), "{word} is not drawn");
    }
}

#[test]
fn tables_of_frequency_responses_are_a_bearing_test() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let (rig, truth) = rig(35.0, 1500.0);
    write(folder, &rig, 32, "r");
    for (direction, force) in [("x", "fx,0"), ("y", "0,fy")] {
        for (quantity, columns) in [("displacement", "dx,dy"), ("acceleration", "ax,ay")] {
            mechid(
                folder,
                &format!(
                    "frf r-{direction}.csv --force {force} --{quantity} {columns} --period 256 \
                     --output {quantity}-{direction}.csv"
                ),
            );
        }
    }
    let x = "displacement-x.csv acceleration-x.csv";
    let tables = format!("bearing {x} displacement-y.csv acceleration-y.csv --frf-table");
    let how = "--stator-mass 20 --rotation-hz 35 --coefficients eight --json";
    let found =
        json_of(&mechid(folder, &format!("{tables} {how} --output table.csv --plot h.svg")));
    let rows = found["coefficients"].as_array().unwrap();
    assert_eq!(rows.len(), 8);
    for (row, exact) in rows.iter().zip(truth) {
        let [value, error] = ["value", "standard_error"].map(|name| row[name].as_f64().unwrap());
        assert!(
            (value - exact).abs() < 5.0 * error && error < 0.05 * truth[1].max(truth[4]),
            "{row}"
        );
    }
    assert_eq!(found["amplitude"], Value::Null);
    let table = fs::read_to_string(folder.join("table.csv")).unwrap();
    assert!(table.lines().nth(1).unwrap().starts_with(&format!("{:?},,", TAU * 35.0)), "{table}");
    let below = json_of(&mechid(folder, &format!("{tables} {how} --band-hz 20:100")));
    assert!(below["lines"].as_u64().unwrap() < found["lines"].as_u64().unwrap());

    // A campaign description with these tables gives the same coefficients as the command with the
    // tables.
    let files = ["displacement-x", "acceleration-x", "displacement-y", "acceleration-y"];
    let campaign = json!({
        "frf_table": true,
        "settings": found["analysis"],
        "points": [{ "tests": files.map(|name| format!("{name}.csv")) }],
    });
    fs::write(folder.join("campaign.json"), campaign.to_string()).unwrap();
    let report = json_of(&mechid(folder, "bearing campaign.json --campaign --json"));
    assert_eq!(report["rows"][0]["coefficients"], found["coefficients"]);

    let told = refused(folder, &format!("bearing {x} displacement-y.csv --frf-table {how}"));
    assert!(told.contains("--frf-table: a test needs two tables"), "{told}");
    let told = refused(
        folder,
        &format!("bearing displacement-x.csv acceleration-y.csv --frf-table {how}"),
    );
    assert!(told.contains("need the same frequencies and forces"), "{told}");
    let told = refused(folder, &format!("{tables} {how} --force fx,fy"));
    assert!(told.contains("cannot be used with"), "{told}");
}
