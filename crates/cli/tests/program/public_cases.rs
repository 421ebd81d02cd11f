//! Layouts, forces and delays from public questions and bug reports; the codes F4, F24 … number the
//! cases. References: closed forms, and the record of the example.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mechid::model::{Response, ResponseQuantity, Sdof};
use mechid::signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, Matrix2};
use serde_json::Value;

use super::{mechid, refused};

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples");

fn json(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&mechid(folder, &format!("{arguments} --json"))).unwrap()
}

/// Returns value and standard error of a parameter by its index.
fn parameter(report: &Value, at: usize) -> [f64; 2] {
    ["value", "standard_error"].map(|part| report["parameters"][at][part].as_f64().unwrap())
}

/// A dataset 58 with even spacing. The fields are its type, first abscissa, spacing, type and label
/// of the ordinate, node and direction of response and reference, and real numbers or pairs.
struct Function<'a> {
    kind: u32,
    first: f64,
    step: f64,
    ordinate: (u32, &'a str),
    response: (u32, i32),
    reference: (u32, i32),
    values: Vec<f64>,
}

impl Function<'_> {
    fn text(&self) -> String {
        let is_response = self.kind == 4;
        let (kind, per) = if is_response { (6, 2) } else { (4, 1) };
        let denominator = if is_response { 13 } else { 0 };
        let mut text = format!("    -1\n    58\n{}", "NONE\n".repeat(5));
        let (to, of) = (self.response, self.reference);
        let _ = writeln!(
            text,
            "{:5}{:10}{:5}{:10} NONE      {:10}{:4} NONE      {:10}{:4}",
            self.kind, 0, 1, 0, to.0, to.1, of.0, of.1
        );
        let count = self.values.len() / per;
        let _ = writeln!(
            text,
            "{kind:10}{count:10}{:10}{:13.5e}{:13.5e}{:13.5e}",
            1, self.first, self.step, 0.0
        );
        for (code, label) in [
            (if is_response { 18 } else { 17 }, "NONE"),
            self.ordinate,
            (denominator, "N"),
            (0, "NONE"),
        ] {
            let _ = writeln!(text, "{code:10}{:5}{:5}{:5} {:<20} {label:<20}", 0, 0, 0, "NONE");
        }
        for row in self.values.chunks(4) {
            row.iter().for_each(|value| {
                let _ = write!(text, "{value:20.11e}");
            });
            text.push('\n');
        }
        text + "    -1\n"
    }
}

fn write(file: &Path, functions: &[Function<'_>]) {
    fs::write(file, functions.iter().map(Function::text).collect::<String>()).unwrap();
}

/// Returns the numbers of a column of the example, counted from 0.
fn example_column(at: usize) -> Vec<f64> {
    let text = fs::read_to_string(format!("{EXAMPLES}/machine.csv")).unwrap();
    text.lines().skip(1).map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

/// A channel of the example at a node, in the direction +Z.
fn channel(node: u32, ordinate: (u32, &str), values: Vec<f64>) -> Function<'_> {
    Function {
        kind: 1,
        first: 0.0,
        step: 1.0 / 128.0,
        ordinate,
        response: (node, 3),
        reference: (0, 0),
        values,
    }
}

/// Case F4: labels of functions in a universal file without dataset 164 are read as units.
#[test]
fn labels_of_functions_of_time_are_units() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let mass = |label: &str, per_si: f64| {
        let response = example_column(4).iter().map(|a| a * per_si).collect();
        write(
            &home.join("a.unv"),
            &[channel(1, (13, "N"), example_column(1)), channel(2, (12, label), response)],
        );
        let line = "identify a.unv --force 1+Z --acceleration 2+Z --period 256";
        parameter(&json(home, line), 0)[0]
    };
    let expected = mass("m/s^2", 1.0);
    for (label, per_si) in [("g", 1.0 / 9.80665), ("mm/s^2", 1e3), ("in/s**2", 1.0 / 0.0254)] {
        assert!((mass(label, per_si) / expected - 1.0).abs() < 1e-6, "{label}");
    }
}

/// A universal file states which channel is a force, and at which point, so the user need not name
/// channels. A force and the response at its point have the same name.
#[test]
fn channels_of_a_universal_file_need_no_names() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let text = fs::read_to_string(format!("{EXAMPLES}/machine.csv")).unwrap();
    // The force acts at one of two points; both points have the same acceleration.
    let record = |file: &str, point: u32, responses: u32| {
        let response = |node| channel(node, (12, "m/s^2"), example_column(4));
        let force = channel(point, (13, "N"), example_column(1));
        let mut channels: Vec<_> = (1..=responses).map(response).chain([force]).collect();
        if file.starts_with("turned") {
            channels.reverse();
        }
        write(&home.join(file), &channels);
    };
    record("alone.unv", 1, 1);
    record("one.unv", 1, 2);
    record("two.unv", 2, 2);
    record("turned.unv", 1, 2);
    let same = |unnamed: &str, named: &str| {
        let [unnamed, named] = [unnamed, named].map(|line| json(home, line));
        assert_eq!(unnamed, named);
        unnamed
    };
    same("modes one.unv", "modes one.unv --force 1+Z --acceleration 1+Z,2+Z");
    same("frf one.unv --period 256", "frf one.unv --force 3 --acceleration 1,2 --period 256");
    same(
        "identify alone.unv --period 256",
        "identify alone.unv --force 1+Z --acceleration 1+Z --period 256",
    );
    // The channels of further records are found by the names in the first record, in any order.
    same("modes one.unv turned.unv", "modes one.unv turned.unv --force 1+Z --acceleration 1+Z,2+Z");
    // With a roving hammer, the file of each record states the point of the force.
    let roving = json(home, "modes one.unv two.unv");
    assert_eq!(roving["inputs"], serde_json::json!(["1+Z", "2+Z"]));
    // If two forces and two responses have no stated points, they can be paired in two ways, so the
    // user must name the columns.
    let rows: Vec<Vec<&str>> = text.lines().map(|row| row.split(',').collect()).collect();
    let write_table = |file: &str, header: &str, columns: &[usize]| {
        let row = |row: &Vec<&str>| columns.iter().map(|at| row[*at]).collect::<Vec<_>>().join(",");
        let rows: Vec<String> = rows[1..].iter().map(row).collect();
        fs::write(home.join(file), format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    };
    write_table("one.csv", "time,f1 [N],x1 [m]", &[0, 1, 2]);
    same(
        "identify one.csv --period 256",
        "identify one.csv --force f1 --displacement x1 --period 256",
    );
    write_table("two.csv", "time,f1 [N],f2 [N],x1 [m],x2 [m]", &[0, 1, 1, 2, 2]);
    let message = refused(home, "identify two.csv --period 256");
    assert!(message.contains("--force"), "{message}");
    // A column without a unit may be a force, and responses of two kinds may belong to two tests,
    // so the channels must be named.
    write_table("plain.csv", "time,force,x1 [m]", &[0, 1, 2]);
    write_table("kinds.csv", "time,f1 [N],x1 [m],a1 [m/s^2]", &[0, 1, 2, 4]);
    for file in ["plain.csv", "kinds.csv"] {
        let message = refused(home, &format!("frf {file} --period 256"));
        assert!(message.contains("--force"), "{message}");
    }
}

/// If the responses are a displacement and an acceleration, the entries of a shape have two units,
/// so no modal mass is reported.
#[test]
fn responses_of_several_kinds_give_no_modal_mass() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let modes = |responses: &str, points: &str| {
        let record = format!("{EXAMPLES}/machine.csv");
        let line = format!("modes {record} --force force {responses} --force-at 1");
        json(home, &format!("{line} --response-at {points}"))
    };
    let one = modes("--acceleration acceleration", "1");
    assert!((one["modes"][0]["modal_mass"].as_f64().unwrap() / 25.0 - 1.0).abs() < 0.01, "{one}");
    let two = modes("--displacement displacement --acceleration acceleration", "1,1");
    assert!(two["modes"][0]["modal_mass"].is_null(), "{two}");
    assert!(two["notes"].to_string().contains("different quantities"), "{}", two["notes"]);
}

/// Masses of a machine with two points, in kg; its damping is `C` and its stiffness is `K`.
const M: [f64; 2] = [4.0, 3.0];
const C: Matrix2<f64> = Matrix2::new(25.0, -8.0, -8.0, 18.0);
const K: Matrix2<f64> = Matrix2::new(9e4, -5e4, -5e4, 7e4);

/// Returns the accelerance of the machine with the matrices `M`, `C` and `K` at 0.25 … 50 Hz, from
/// the inverse of the dynamic stiffness; `signs` are the signs of the two directions.
fn accelerance(response: usize, reference: usize, signs: [f64; 2]) -> Function<'static> {
    let values = (1..=200).flat_map(|line| {
        let omega = TAU * 0.25 * f64::from(line);
        let mass = Matrix2::from_diagonal(&M.into());
        let stiffness = (K - mass * omega.powi(2)).map(Complex::from);
        let dynamic = stiffness + C.map(|c| Complex::new(0.0, omega * c));
        let receptance = dynamic.lu().solve(&Matrix2::identity()).unwrap();
        let h = -omega.powi(2) * receptance[(response, reference)];
        let h = h * signs[response] * signs[reference];
        [h.re, h.im]
    });
    let place = |at: usize| (at as u32 + 1, if signs[at] < 0.0 { -3 } else { 3 });
    Function {
        kind: 4,
        first: 0.25,
        step: 0.25,
        ordinate: (12, "m/s^2"),
        response: place(response),
        reference: place(reference),
        values: values.collect(),
    }
}

/// Cases F24, F38: a row of the response matrix is enough by reciprocity, and a negative direction
/// changes the sign.
#[test]
fn a_row_is_a_column_by_reciprocity_and_a_direction_is_a_sign() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let exact = |report: &Value| {
        for (name, truth) in [("m11", M[0]), ("m22", M[1])] {
            let all = report["parameters"].as_array().unwrap();
            let mass = all.iter().find(|one| one["name"] == name).unwrap();
            let value = mass["value"].as_f64().unwrap();
            assert!((value / truth - 1.0).abs() < 1e-5, "{value} {truth}: {report}");
        }
    };
    write(&home.join("row.unv"), &[0, 1].map(|at| accelerance(0, at, [1.0; 2])));
    let message = refused(home, "identify row.unv --frf-table");
    assert!(message.contains("no response at 2+Z to a force at 2+Z"), "{message}");
    assert!(message.contains("by reciprocity") && message.contains("--structure symmetric"));
    let report = json(home, "identify row.unv --frf-table --structure symmetric");
    exact(&report);
    assert!(report["remarks"].to_string().contains("By reciprocity"), "{report}");
    // First both points have the direction −Z, then only the second point.
    for signs in [[-1.0, -1.0], [1.0, -1.0]] {
        let all = [(0, 0), (0, 1), (1, 0), (1, 1)];
        write(&home.join("neg.unv"), &all.map(|(i, j)| accelerance(i, j, signs)));
        exact(&json(home, "identify neg.unv --frf-table --structure diagonal-mass"));
    }
}

/// Returns time, force and displacement of an oscillator (3 kg, 8 Hz, 5 % damping) that starts from
/// rest. The displacement is exact if the force is linear between samples.
fn driven(count: usize, rate: f64, force: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let sampling = Sampling::from_rate_hz(rate, count).unwrap();
    let force: Vec<f64> = sampling.times().map(force).collect();
    let record = Record::new(sampling, DMatrix::from_column_slice(count, 1, &force)).unwrap();
    let omega = TAU * 8.0;
    let machine = Sdof::new(3.0, 0.1 * omega * 3.0, 3.0 * omega * omega).unwrap();
    let response: Response = machine.linear_force_response(&record, 0.0, 0.0).unwrap();
    let x = response.quantity(ResponseQuantity::Displacement).channel(0).to_vec();
    (sampling.times().collect(), force, x)
}

fn write_table(file: &Path, header: &str, columns: &[&[f64]]) {
    let mut text = format!("{header}\n");
    for row in 0..columns[0].len() {
        let fields: Vec<String> = columns.iter().map(|column| column[row].to_string()).collect();
        text += &(fields.join(",") + "\n");
    }
    fs::write(file, text).unwrap();
}

/// Case F28: if the force excites too few lines for the unknowns, the message states the number of
/// excited lines and names `--lines all`.
#[test]
fn a_force_that_drives_few_lines_is_named() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let (t, f, x) = driven(6000, 100.0, |t| if (5.0..30.0).contains(&t) { 30.0 } else { 0.0 });
    write_table(&home.join("step.csv"), "time,f,x", &[&t, &f, &x]);
    let (t, f, x) = driven(1000, 100.0, |t| 30.0 * (TAU * 5.0 * t).sin());
    write_table(&home.join("sine.csv"), "time,f,x", &[&t, &f, &x]);
    let line = "identify sine.csv --force f --displacement x --period 100";
    let message = refused(home, line);
    assert!(message.contains("2 equations do not determine 3 unknowns"), "{message}");
    assert!(
        message.contains("the forces excite only 1 of 49 lines") && message.contains("--lines all")
    );
    let output = json(home, "identify step.csv --force f --displacement x --lines all");
    let [mass, _] = parameter(&output, 0);
    assert!((mass / 3.0 - 1.0).abs() < 0.01, "{mass}");
}

/// Case F29: an acceleration of the ground that is given as a force is refused; the message names
/// the option `--machine`.
#[test]
fn the_motion_of_a_support_is_no_force() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("a.csv"), "t,ag [m/s^2],a [m/s^2]\n0,1,2\n1,2,3\n2,1,1\n").unwrap();
    let message = refused(home.path(), "identify a.csv --force ag --acceleration a");
    assert!(
        message.contains("a unit of acceleration; --force takes columns of force"),
        "{message}"
    );
    assert!(message.contains("named elements (--machine)"), "{message}");
}

/// Case F31: a time column is read correctly with every usual spelling of its name and unit.
#[test]
fn spellings_of_time_are_read_or_named() {
    let home = tempfile::tempdir().unwrap();
    let clock = |row: i32| format!("09:26:{:06.3}", 3.5 + 0.25 * f64::from(row));
    for (name, at) in [
        ("TIME(S)", (|row| format!("{}", 0.25 * f64::from(row))) as fn(i32) -> String),
        ("Time [milliseconds]", |row| format!("{}", 250.0 * f64::from(row))),
        ("time_usec", |row| format!("{}", 250_000.0 * f64::from(row))),
        ("Time (h)", |row| format!("{:.12}", 0.25 / 3600.0 * f64::from(row))),
    ] {
        let rows: String = (0..40).map(|row| format!("{},{}\n", at(row), row % 7)).collect();
        fs::write(home.path().join("a.csv"), format!("{name},x\n{rows}")).unwrap();
        let told = mechid(home.path(), "info a.csv");
        assert!(told.contains("4 Hz, a step of 0.25 s"), "{name}: {told}");
    }
    let rows: String = (0..40).map(|row| format!("{},{}\n", clock(row), row % 7)).collect();
    fs::write(home.path().join("a.csv"), format!("Time [hh:mm:ss],x\n{rows}")).unwrap();
    let told = mechid(home.path(), "info a.csv");
    assert!(told.contains("4 Hz, a step of 0.25 s"), "{told}");
}

/// Case F39: the message names the lines to skip even if the first rows have several fields.
#[test]
fn the_table_below_many_lines_is_found() {
    let home = tempfile::tempdir().unwrap();
    let mut text: String = (0..300).map(|at| format!("meta {at}: value {at}\n")).collect();
    text += "time,force,acc\n";
    (0..50).for_each(|row| text += &format!("{},{},{}\n", 0.01 * f64::from(row), row % 5, row % 7));
    fs::write(home.path().join("a.csv"), text).unwrap();
    let message = refused(home.path(), "info a.csv");
    assert!(message.contains("line 301, with 3 fields") && message.contains("`skip_lines` 300"));
    assert!(mechid(home.path(), "info a.csv --skip-lines 300").contains("3 columns, 50 samples"));
}

/// In the time domain the message states the delay even if it is far beyond the usual search range.
#[test]
fn a_delay_of_fifty_samples_is_named_in_the_time_domain() {
    let home = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(format!("{EXAMPLES}/machine.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|row| row.split(',').collect()).collect();
    let mut late = String::from("time,force,x,v,a\n");
    for (now, before) in rows[50..].iter().zip(&rows) {
        late += &format!("{},{},{},{},{}\n", now[0], now[1], before[2], before[3], before[4]);
    }
    fs::write(home.path().join("a.csv"), late).unwrap();
    for motions in [
        "--displacement x --velocity v --acceleration a",
        "--displacement x --derivatives spectral",
    ] {
        let line = format!("identify a.csv --force force {motions} --domain time --json");
        let output = assert_cmd::Command::cargo_bin("mechid")
            .unwrap()
            .current_dir(home.path())
            .args(line.split_whitespace())
            .output()
            .unwrap();
        let told = [output.stdout, output.stderr].concat();
        let told = String::from_utf8_lossy(&told).into_owned();
        assert!(told.contains("50 samples") && told.contains("late"), "{motions}: {told}");
    }
}
