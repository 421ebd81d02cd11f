//! Remarks of `mechid force` on a force, a period or a channel that contradicts the measured
//! motion, and tests of the noise level in the standard error of the force.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::{mechid, refused};

/// A rotor whose motion in both directions is so small that the noise is about 0.5 % of it.
const ROTOR: &str = r#"{"mass": [[25, 0], [0, 25]], "damping": [[14e3, -2.5e3], [-2.5e3, 18e3]],
    "stiffness": [[12e6, 5e6], [-8e6, 18e6]]}"#;

const BOTH: &str = "--displacement displacement_1,displacement_2";

/// Writes the response to independent multisines on these degrees of freedom, four periods of 512
/// samples.
fn motion(folder: &Path, forced: &[usize]) {
    let excitation = |dof: &usize| json!({"dof": dof, "lines": "5:60", "amplitude": 13, "phases": "random", "seed": dof});
    let experiment = json!({
        "system": serde_json::from_str::<Value>(ROTOR).unwrap(),
        "sampling": {"samples": 512, "rate_hz": 1024},
        "excitation": forced.iter().map(excitation).collect::<Vec<_>>(),
        "response": "periodic",
        "periods": 4,
        "noise": {"displacement": {"standard_deviation": 4e-8}, "seed": 9},
    });
    fs::write(folder.join("rotor.json"), experiment.to_string()).unwrap();
    mechid(folder, "simulate rotor.json --output run.csv --quiet");
}

/// Replaces one column of the record by a function of the row.
fn with_column(folder: &Path, name: &str, value: impl Fn(&[&str]) -> String) {
    let text = fs::read_to_string(folder.join("run.csv")).unwrap();
    let header = text.lines().next().unwrap();
    let at = header.split(',').position(|column| column == name).unwrap();
    let rows = text.lines().skip(1).map(|row| {
        let mut row: Vec<&str> = row.split(',').collect();
        let value = value(&row);
        row[at] = &value;
        row.join(",")
    });
    let rows: Vec<String> = rows.collect();
    fs::write(folder.join("run.csv"), format!("{header}\n{}\n", rows.join("\n"))).unwrap();
}

fn report(folder: &Path, arguments: &str) -> Value {
    let told = mechid(folder, &format!("force run.csv --system rotor.json {arguments} --json"));
    serde_json::from_str(&told).unwrap()
}

fn remarks(report: &Value) -> String {
    let remarks = report["remarks"].as_array().unwrap().iter();
    remarks.map(|remark| remark.as_str().unwrap()).collect::<Vec<_>>().join("\n")
}

fn unexplained(report: &Value) -> Vec<Option<f64>> {
    let channels = report["channels"].as_array().unwrap().iter();
    channels.map(|channel| channel["unexplained"].as_f64()).collect()
}

/// All ways to find one force from two channels; the last is an open record that is solved as a
/// whole.
const WAYS: [&str; 6] = [
    "--period 512 --lines 5:60",
    "--period 512",
    "--period 512 --method tikhonov",
    "--period 512 --method truncated-svd",
    "--method kalman",
    "--method tikhonov --start 1849",
];

fn ways() -> impl Iterator<Item = String> {
    WAYS.into_iter().map(|way| format!("{BOTH} --forced 1 {way}"))
}

#[test]
fn a_force_sought_in_too_few_places_is_told() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1, 2]);
    for way in ways() {
        let found = report(folder.path(), &way);
        let told = remarks(&found);
        for words in [
            "a force acts on a degree of freedom other than 1 (`forced`)",
            "the standard error of the force is not reliable",
        ] {
            assert!(told.contains(words), "{way}: {told}");
        }
        let most = unexplained(&found).into_iter().map(Option::unwrap).fold(0.0, f64::max);
        assert!(most > 0.3 && most < 1.1, "{way}: {most}");
        assert_eq!(found["channels"][1]["column"], "displacement_2");
        assert!(told.contains("channel 2 (displacement_2"), "{way}: {told}");
    }
    let text =
        mechid(folder.path(), &format!("force run.csv --system rotor.json {BOTH} --forced 1"));
    assert!(text.contains("  channel 2 (displacement_2) unexplained: "), "{text}");
}

#[test]
fn a_force_that_explains_the_motion_is_not_doubted() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1]);
    for way in ways() {
        let found = report(folder.path(), &way);
        let told = remarks(&found);
        assert!(!told.contains("the identified force leaves"), "{way}: {told}");
        for share in unexplained(&found) {
            assert!(share.unwrap() < 0.03, "{way}: {share:?}");
        }
    }
    // With as many forces as channels the fit is exact, so it cannot show a contradiction.
    let found = report(folder.path(), &format!("{BOTH} --period 512 --lines 5:60"));
    assert_eq!(unexplained(&found), [None, None]);
    assert_eq!(found["channels"][0]["channel"], 1);
}

#[test]
fn sensors_that_are_dead_or_exchanged_are_told() {
    for way in WAYS {
        let folder = tempfile::tempdir().unwrap();
        motion(folder.path(), &[1]);
        let swapped = "--displacement displacement_2,displacement_1 --forced 1";
        let told = remarks(&report(folder.path(), &format!("{swapped} {way}")));
        assert!(told.contains("two sensors are interchanged"), "{way}: {told}");
        for level in ["0", "3.3e-4"] {
            with_column(folder.path(), "displacement_2", |_| level.into());
            let arguments = format!("{BOTH} --forced 1 {way}");
            if way.contains("lines") {
                let call = format!("force run.csv --system rotor.json {arguments}");
                let message = refused(folder.path(), &call);
                assert!(message.contains("channel 2") && message.contains("dead"), "{message}");
                continue;
            }
            let found = report(folder.path(), &arguments);
            let share = unexplained(&found)[1].unwrap();
            assert!(share > 0.8, "{way}, {level}: {share}");
            let told = remarks(&found);
            assert!(told.contains("channel 2 (displacement_2"), "{way}, {level}: {told}");
        }
    }
}

/// The cross stiffness k21 is 5 % too large. A remark appears only if this error exceeds the stated
/// uncertainty of the machine.
#[test]
fn what_the_machine_is_known_to_is_expected() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1]);
    let mut system: Value = serde_json::from_str(ROTOR).unwrap();
    system["stiffness"][1][0] = json!(-8.4e6);
    for (error, doubted) in [(4e3, true), (4e5, false)] {
        let machine = json!({
            "system": system,
            "covariance": {"parameters": ["k21"], "matrix": [[error * error]], "degrees_of_freedom": 99},
        });
        fs::write(folder.path().join("rotor.json"), machine.to_string()).unwrap();
        for way in ways() {
            // Several periods show the noise; an open record shows it only in the residual.
            let noise = if way.contains("period") { "" } else { "--noise 4e-8,4e-8" };
            let found = report(folder.path(), &format!("{way} {noise}"));
            let told = remarks(&found);
            if doubted && way.contains("kalman") {
                // With a wrong machine, a force that is not band-limited can explain both channels
                // by its values between the samples. A note says that the machine may be wrong, and
                // the interval contains the true force.
                assert!(told.contains("hardly determines the force"), "{way}, {found}");
                assert!(told.contains("another machine"), "{way}, {found}");
                let force = &found["forces"][0];
                let [rms, error] =
                    ["rms", "standard_error"].map(|name| force[name].as_f64().unwrap());
                let acted = 13.0 * (56.0_f64 / 2.0).sqrt();
                assert!(
                    (rms - acted).abs() < 1.5 * error,
                    "{way}: {rms} N ± {error} N for {acted} N"
                );
                continue;
            }
            assert_eq!(told.contains("the identified force leaves"), doubted, "{way}, {found}");
        }
    }
}

#[test]
fn noise_is_that_of_the_record_before_periods_are_averaged() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1, 2]);
    // The standard error is the same whether the noise is stated or estimated from the lines
    // without force.
    let lines = format!("{BOTH} --period 512 --lines 5:60");
    let error = |arguments: &str| {
        let found = report(folder.path(), arguments);
        found["forces"][0]["standard_error"].as_f64().unwrap()
    };
    let (found, stated) = (error(&lines), error(&format!("{lines} --noise 4e-8,4e-8")));
    // The noise level, estimated from 195 lines of two channels, has a standard error of 4 %.
    assert!((found / stated - 1.0).abs() < 0.16, "{found}, stated {stated}");
    // The noise level that the method shrinkage reports is that of the record, not of the mean over
    // the periods; `--noise` states the same level.
    let found = report(folder.path(), &format!("{BOTH} --period 512"));
    let chosen = found["chosen"].as_array().unwrap().iter();
    let levels = chosen.filter(|c| c["name"].as_str().unwrap().starts_with("noise of channel"));
    for level in levels.map(|level| level["value"].as_f64().unwrap()) {
        assert!((2.5e-8..6.5e-8).contains(&level), "{level}");
    }
    // The level is given in the unit of its column.
    let text = fs::read_to_string(folder.path().join("run.csv")).unwrap();
    let named = text.replacen("displacement_1,displacement_2", "x [um],displacement_2", 1);
    fs::write(folder.path().join("run.csv"), named).unwrap();
    with_column(folder.path(), "x [um]", |row| {
        format!("{:e}", 1e6 * row[3].parse::<f64>().unwrap())
    });
    let lines = "--displacement 4,displacement_2 --period 512 --lines 5:60 --noise 0.04,4e-8";
    let converted = error(lines);
    assert!((converted / stated - 1.0).abs() < 1e-9, "{converted}, in m {stated}");
}

#[test]
fn periods_that_are_not_alike_are_told() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1, 2]);
    let told =
        |period: usize| remarks(&report(folder.path(), &format!("{BOTH} --period {period}")));
    assert!(!told(512).contains("another period"), "{}", told(512));
    for period in [500, 511] {
        let told = told(period);
        let words = format!("the periods of {period} samples differ from their mean by");
        assert!(told.contains(&words) && told.contains("another period"), "{told}");
    }
}

#[test]
fn a_column_that_is_not_the_rate_of_another_is_told() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path(), &[1, 2]);
    let all = format!(
        "{BOTH} --velocity velocity_1,velocity_2 --acceleration acceleration_1,acceleration_2"
    );
    let held = format!("{all} --spectrum lines.csv");
    let told = |arguments: &str| remarks(&report(folder.path(), arguments));
    assert!(!told(&all).contains("the rate of"), "{}", told(&all));
    let thousand = |row: &[&str]| format!("{:e}", 1e3 * row[6].parse::<f64>().unwrap());
    with_column(folder.path(), "velocity_2", thousand);
    let backwards = |row: &[&str]| format!("{:e}", -row[7].parse::<f64>().unwrap());
    with_column(folder.path(), "acceleration_1", backwards);
    for arguments in [&all, &held] {
        let told = told(arguments);
        assert!(told.contains("velocity_2 is 10") || told.contains("velocity_2 is 9"), "{told}");
        assert!(told.contains("times the rate of displacement_2"), "{told}");
        assert!(told.contains("acceleration_1 is -"), "{told}");
        assert!(!told.contains("velocity_1 is"), "{told}");
    }
}
