//! Headers, axes and formats from public questions and bug reports; the codes F1, F2 … number the
//! cases. Reference: the example record, whose mass in SI units is known.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::{mechid, refused};

const G: f64 = 9.80665;
const LBF: f64 = 4.448_221_615_260_5;
const INCH: f64 = 0.0254;

/// Returns time, force, displacement and acceleration of the example.
fn columns() -> [Vec<f64>; 4] {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let text = fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|field| field.parse().unwrap()).collect())
        .collect();
    [0, 1, 2, 4].map(|at| rows.iter().map(|row| row[at]).collect())
}

/// Writes a file with the lines `above` and, below these, the columns. The values are in SI units;
/// the values of a column are divided by its factor.
fn table(file: &Path, above: &[&str], columns: &[(&[f64], f64)], separator: &str) {
    let mut text: String = above.iter().map(|line| format!("{line}\n")).collect();
    for row in 0..columns[0].0.len() {
        let fields: Vec<String> =
            columns.iter().map(|(values, si)| format!("{}", values[row] / si)).collect();
        text += &(fields.join(separator) + "\n");
    }
    fs::write(file, text).unwrap();
}

fn json(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&mechid(folder, &format!("{arguments} --json"))).unwrap()
}

/// Returns the mass, and true if a check asks about a unit.
fn mass(report: &Value) -> (f64, bool) {
    let asks = report["checks"].as_array().unwrap().iter().any(|check| check["subject"] == "unit");
    (
        report["parameters"][0]["estimate"]["value"]
            .as_f64()
            .or(report["parameters"][0]["value"].as_f64())
            .unwrap(),
        asks,
    )
}

/// The lines above the numbers, the unit of the force, the response and its unit, the unit of time,
/// and the delimiter.
type Case<'a> = (&'a [&'a str], f64, &'a [f64], f64, f64, &'a str);

/// Cases F1, F2, F7, F31, F34, F39: units in a header, and times written as clock readings, are
/// used.
#[test]
fn units_that_stand_in_a_header_are_used() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let [t, f, x, a] = columns();
    let lvm = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\nChannels\t2\t\t\n\
               Y_Unit_Label\tN\tg\t\nX0\t0\t0\t\nDelta_X\t0.0078125\t0.0078125\t\n***End_of_Header***\t\t";
    let meta = ["Serial,1234,5", "Range,10,100", "time,force,acc", "s,N,g"];
    let cases: [Case<'_>; 13] = [
        (&["time,force_N,accel_g"], 1.0, &a, G, 1.0, ","),
        (&["time,Force (lbs),x [m]"], LBF, &x, 1.0, 1.0, ","),
        (&["time,{lbf} Force,x [m]"], LBF, &x, 1.0, 1.0, ","),
        (&["time,Force [N],Acc (G)"], 1.0, &a, G, 1.0, ","),
        (&["time,Force [N],Acceleration (g) - X"], 1.0, &a, G, 1.0, ","),
        (&["time,[kN] Force,x [m]"], 1e3, &x, 1.0, 1.0, ","),
        (&["time,Force [N],Disp (in.)"], 1.0, &x, INCH, 1.0, ","),
        (&["time,Force [N],disp_um"], 1.0, &x, 1e-6, 1.0, ","),
        (&["# time [s],force [N],acc [g]"], 1.0, &a, G, 1.0, ","),
        (&["Time (msec),force,x"], 1.0, &x, 1.0, 1e-3, ","),
        (&["Zeit [s],Kraft [kN],Weg [mm]"], 1e3, &x, 1e-3, 1.0, ","),
        (&[lvm, "X_Value\tForce\tAcc\tComment"], 1.0, &a, G, 1.0, "\t"),
        (&meta, 1.0, &a, G, 1.0, ","),
    ];
    let plain = |response: &[f64]| {
        table(&home.join("si.csv"), &["time,f,y"], &[(&t, 1.0), (&f, 1.0), (response, 1.0)], ",");
        let option = response_option(response == x);
        mass(&json(home, &format!("identify si.csv --force f {option} y --period 256"))).0
    };
    for (above, force, values, unit, second, separator) in cases {
        table(&home.join("a.txt"), above, &[(&t, second), (&f, force), (values, unit)], separator);
        let option = response_option(values == x);
        let time = if above[0].contains("Zeit") { " --time 1" } else { "" };
        let line = format!("identify a.txt{time} --force 2 {option} 3 --period 256");
        let (found, asks) = mass(&json(home, &line));
        let expected = plain(values);
        assert!(
            (found / expected - 1.0).abs() < 1e-6 && !asks,
            "{above:?}: {found} for {expected}, {asks}"
        );
    }
}

fn response_option(is_displacement: bool) -> &'static str {
    if is_displacement { "--displacement" } else { "--acceleration" }
}

/// Cases F1, F7, F32: if the unit of a column is uncertain, a check asks about it. If a sensitivity
/// or a factor is stated, no check asks.
#[test]
fn units_that_are_not_sure_are_asked_about() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let [t, f, x, _] = columns();
    let days: Vec<f64> = t.iter().map(|t| 45_000.5 + t / 86_400.0).collect();
    for (header, time, force, response, part) in [
        ("time,Force [N],Disp [um pk-pk]", &t, 1.0, 1e-6, "um pk-pk"),
        ("time,Force [mV],x", &t, 1.0, 1.0, "mV"),
        ("time,Force [N],LVDT (mm/V)", &t, 1.0, 1.0, "mm/V"),
        ("time,force,x", &days, 1.0, 1.0, "in days"),
    ] {
        table(&home.join("a.csv"), &[header], &[(time, 1.0), (&f, force), (&x, response)], ",");
        let report = json(home, "identify a.csv --force 2 --displacement 3 --period 256");
        let (found, asks) = mass(&report);
        assert!(asks, "{header}: {found}");
        let text = report["checks"].to_string();
        assert!(text.contains(part), "{header}: {text}");
        // The subcommand `info` also asks about the unit.
        let text = mechid(home, "info a.csv");
        assert!(text.contains(part), "{header}: {text}");
    }
    // With a stated sensitivity or factor, no check asks about the unit.
    let above = ["time,Force [mV; 11.2 mV/N],x"];
    table(&home.join("a.csv"), &above, &[(&t, 1.0), (&f, 1.0 / 11.2), (&x, 1.0)], ",");
    let line = "identify a.csv --force 2 --displacement 3 --period 256";
    let (stated, asks) = mass(&json(home, line));
    table(
        &home.join("a.csv"),
        &["time,Force [mV],x"],
        &[(&t, 1.0), (&f, 1.0 / 11.2), (&x, 1.0)],
        ",",
    );
    let (scaled, still) = mass(&json(home, &format!("{line} --scale 2={}", 1.0 / 11.2)));
    table(&home.join("a.csv"), &["time,f,x"], &[(&t, 1.0), (&f, 1.0), (&x, 1.0)], ",");
    let (expected, _) = mass(&json(home, line));
    assert!(!asks && !still);
    assert!((stated / expected - 1.0).abs() < 1e-6 && (scaled / expected - 1.0).abs() < 1e-6);
}

/// Cases F5, F38: the axes, units and directions that a table of frequency responses states are
/// used.
#[test]
fn axes_and_units_of_response_tables_are_used() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let (m, c, k) = (5.0, 33.9, 63_956.0);
    let hz: Vec<f64> = (1..=160).map(|line| 0.25 * f64::from(line)).collect();
    let omega: Vec<f64> = hz.iter().map(|hz| std::f64::consts::TAU * hz).collect();
    // The accelerance is −ω² / (k + i ω c − ω² m).
    let parts: Vec<[f64; 2]> = omega
        .iter()
        .map(|w| {
            let (re, im) = (k - w * w * m, w * c);
            let scale = -w * w / (re * re + im * im);
            [scale * re, -scale * im]
        })
        .collect();
    let [re, im] = [0, 1].map(|part| parts.iter().map(|h| h[part]).collect::<Vec<f64>>());
    let rows: [(&[&str], &[f64], f64, f64); 6] = [
        (&["frequency (rad/s),real,imaginary"], &omega, 1.0, 1.0),
        (&["omega_rad_s,real,imaginary"], &omega, 1.0, 1.0),
        (&["freq [kHz],real,imaginary"], &hz, 1e3, 1.0),
        (&["frequency_hz,real [g/N],imaginary [g/N]"], &hz, 1.0, G),
        (&["frequency_hz,real,imaginary", "Hz,g/N,g/N"], &hz, 1.0, G),
        (&["rpm,real,imaginary"], &hz, 1.0 / 60.0, 1.0),
    ];
    for (above, axis, unit, response) in rows {
        let columns = [(axis, unit), (re.as_slice(), response), (im.as_slice(), response)];
        table(&home.join("h.csv"), above, &columns, ",");
        let (found, _) = mass(&json(home, "identify h.csv --frf-table --quantity acceleration"));
        assert!((found / m - 1.0).abs() < 1e-3, "{above:?}: {found}");
    }
    // Orders cannot be converted to frequencies without the speed.
    table(
        &home.join("h.csv"),
        &["order,real,imaginary"],
        &[(&hz, 1.0), (&re, 1.0), (&im, 1.0)],
        ",",
    );
    let message = refused(home, "identify h.csv --frf-table --quantity acceleration");
    assert!(message.contains("speed of rotation"), "{message}");
}

/// Case F37: a pulse that begins with the record does not determine the machine, because the
/// transient has the same spectrum as the response to the pulse.
#[test]
fn a_pulse_at_the_beginning_does_not_determine_the_machine() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let (m, c, k) = (5.0_f64, 33.9_f64, 63_956.0_f64);
    let (decay, omega) = (0.5 * c / m, (k / m - (0.5 * c / m).powi(2)).sqrt());
    let t: Vec<f64> = (0..1024).map(|sample| f64::from(sample) / 512.0).collect();
    let f: Vec<f64> = (0..1024).map(|sample| if sample == 0 { 100.0 } else { 0.0 }).collect();
    let x: Vec<f64> = t.iter().map(|t| 1e-3 * (-decay * t).exp() * (omega * t).sin()).collect();
    let clipped: Vec<f64> = x.iter().map(|x| x.clamp(-4e-4, 4e-4)).collect();
    for (name, response) in [("a", &x), ("clipped", &clipped)] {
        let file = format!("{name}.csv");
        let columns = [&t, &f, response].map(|channel| (channel.as_slice(), 1.0));
        table(&home.join(&file), &["time,f,x"], &columns, ",");
        let message = refused(home, &format!("identify {file} --force f --displacement x"));
        assert!(message.contains("singular within rounding errors"), "{name}: {message}");
    }
}
