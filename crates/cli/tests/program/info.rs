//! The subcommand `mechid info`. Reference: closed forms of the signals in the files.

use std::f64::consts::{SQRT_2, TAU};
use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

use super::mechid;

/// Makes a folder with a record at 100 Hz: six periods of 2 sin(2π·k/50) + 0.5 sin(2π·3k/50) + 1,
/// and a decaying oscillation of 7 Hz.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("t,force,ring\n");
    for k in 0..300 {
        let turn = TAU * f64::from(k) / 50.0;
        let force = 2.0 * turn.sin() + 0.5 * (3.0 * turn).sin() + 1.0;
        let t = f64::from(k) / 100.0;
        writeln!(text, "{t},{force},{}", (-4.0 * t).exp() * (TAU * 7.0 * t).sin()).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text.replace("t,force", "clock,force")).unwrap();
    fs::write(folder.path().join("timed.csv"), text).unwrap();
    folder
}

fn info(folder: &tempfile::TempDir, arguments: &str) -> Value {
    serde_json::from_str(&mechid(folder.path(), &format!("info {arguments} --json"))).unwrap()
}

fn close(value: &Value, truth: f64, tolerance: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - truth).abs() < tolerance, "{value}, truth {truth}");
}

#[test]
fn levels_lines_and_period_are_those_of_the_signal() {
    let folder = folder();
    let report = info(&folder, "timed.csv --columns force,ring");
    assert_eq!(report["format"], "text, fields between commas");
    close(&report["sampling"]["rate_hz"], 100.0, 1e-9);
    close(&report["sampling"]["duration_s"], 3.0, 1e-9);
    let force = &report["channels"][0];
    close(&force["mean"], 1.0, 1e-14);
    close(&force["rms"], f64::sqrt(1.0 + 2.0 + 0.125), 1e-13);
    let crest = force["peak"].as_f64().unwrap() / force["rms"].as_f64().unwrap();
    close(&force["crest_factor"], crest, 1e-14);
    assert_eq!(force["period"]["samples"], 50);
    close(&force["period"]["seconds"], 0.5, 1e-12);
    close(&force["period"]["mismatch"], 0.0, 1e-12);
    // The report has all lines of the signal; they are exact, because the window has whole periods.
    let peaks = force["spectrum_peaks"].as_array().unwrap();
    assert_eq!(peaks.len(), 2);
    for (peak, (hz, amplitude)) in peaks.iter().zip([(2.0, 2.0), (6.0, 0.5)]) {
        close(&peak["frequency_hz"], hz, 1e-10);
        close(&peak["amplitude"], amplitude, 1e-12);
    }
    let ring = &report["channels"][1];
    assert!(ring["period"].is_null());
    close(&ring["spectrum_peaks"][0]["frequency_hz"], 7.0, 0.34);
}

#[test]
fn without_a_time_axis_frequencies_are_per_sample() {
    let folder = folder();
    let report = info(&folder, "a.csv --columns force");
    assert!(report["sampling"].is_null());
    let force = &report["channels"][0];
    assert!(force["period"]["seconds"].is_null());
    assert_eq!(force["period"]["samples"], 50);
    assert!(force["spectrum_peaks"][0]["frequency_hz"].is_null());
    close(&force["spectrum_peaks"][0]["cycles_per_sample"], 0.02, 1e-15);
    let text = mechid(folder.path(), "info a.csv");
    assert!(text.contains("no time axis: give --time or --sample-rate"), "{text}");
    assert!(text.contains("strongest lines, cycles/sample"), "{text}");
}

#[test]
fn a_sine_has_its_crest_factor_and_its_window() {
    let folder = tempfile::tempdir().unwrap();
    let sine = |k: u32| (TAU * f64::from(k) / 8.0).sin();
    let text: String = (0..64).map(|k| format!("{}\n", 3.0 * sine(k))).collect();
    fs::write(folder.path().join("sine.csv"), text).unwrap();
    let report = info(&folder, "sine.csv --sample-rate 8 --start 9 --period 16 --periods 2");
    assert_eq!(report["window"]["first_sample"], 9);
    assert_eq!(report["window"]["last_sample"], 40);
    close(&report["channels"][0]["crest_factor"], SQRT_2, 1e-12);
    close(&report["channels"][0]["spectrum_peaks"][0]["frequency_hz"], 1.0, 1e-14);
}

#[test]
fn what_cannot_be_shown_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../io/tests/data/");
    let report = info(&folder, &format!("{data}plain.mat"));
    assert_eq!(report["format"], "MATLAB level 5");
    assert_eq!(report["scalars"][0]["name"], "fs");
    assert_eq!(report["scalars"][0]["value"], 4.0);
    let left_out = report["left_out"].as_array().unwrap();
    assert!(left_out.iter().any(|l| l.as_str().unwrap().contains("\"short\" has 3 samples")));
    assert!(left_out.iter().any(|l| l.as_str().unwrap().contains("\"note\": it holds text")));
    let text = mechid(folder.path(), &format!("info {data}printed.unv"));
    for part in [
        "universal file, 6 columns, 8 samples",
        "4 Hz, a step of 0.25 s, 2 s long",
        "12+Z (rig 4, acceleration)",
        "units: code 1 SI: Meter (newton)",
        "it holds a frequency response function",
    ] {
        assert!(text.contains(part), "\"{part}\" is missing in\n{text}");
    }
    // An uneven time column is reported, unless it is inspected as a channel.
    fs::write(folder.path().join("b.csv"), "time,x\n0,1\n1,2\n3,1\n").unwrap();
    let text = mechid(folder.path(), "info b.csv");
    assert!(text.contains("left out: time axis: b.csv: the time steps are not uniform"), "{text}");
    super::refused(folder.path(), "info b.csv --time time");
}

#[test]
fn a_table_below_other_lines_and_in_utf16_is_the_same_table() {
    let folder = folder();
    let text = fs::read_to_string(folder.path().join("timed.csv")).unwrap();
    let told = mechid(folder.path(), "info timed.csv");
    fs::write(folder.path().join("above.csv"), format!("Analyser 7\n\nRate 100\n{text}")).unwrap();
    let above = mechid(folder.path(), "info above.csv --skip-lines 3");
    assert_eq!(above, told.replace("timed.csv", "above.csv"));
    let text = format!("\u{feff}{text}");
    let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(folder.path().join("wide.csv"), wide).unwrap();
    let wide = mechid(folder.path(), "info wide.csv");
    let told = told.replace(
        "timed.csv: text, fields between commas",
        "wide.csv: text, fields between commas, in UTF-16",
    );
    assert_eq!(wide, told);
}

/// The time column is a ramp: its spectrum has many lines, but no vibration. `info` reports its
/// mean and its extreme values, and its spectrum only if the column is requested.
#[test]
fn the_time_column_has_no_spectrum_unless_asked_for() {
    let folder = folder();
    let report = info(&folder, "timed.csv");
    let time = &report["channels"][0];
    assert_eq!((&time["name"], &time["spectrum_peaks"]), (&"t".into(), &Value::Array(vec![])));
    assert!(time["period"].is_null());
    close(&time["maximum"], 2.99, 1e-12);
    let text = mechid(folder.path(), "info timed.csv");
    let rows = |text: &str, column: &str| text.lines().filter(|l| l.starts_with(column)).count();
    assert_eq!((rows(&text, "1 t"), rows(&text, "2 force")), (1, 2), "{text}");
    let asked = mechid(folder.path(), "info timed.csv --columns t,force");
    assert_eq!((rows(&asked, "1 t"), rows(&asked, "2 force")), (2, 2), "{asked}");
    // A time column with another name is treated like any other column.
    let text = mechid(folder.path(), "info a.csv");
    assert_eq!(rows(&text, "1 clock"), 2, "{text}");
    assert_eq!(rows(&mechid(folder.path(), "info a.csv --time clock"), "1 clock"), 1);
}

/// The mean over whole periods of a sine is zero up to rounding, and is reported as zero. An offset
/// of 1e-12 times the amplitude of the sine is reported unchanged.
#[test]
fn a_mean_of_zero_is_told_as_zero() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("t,sine,offset\n");
    for k in 0..300 {
        let sine = 1e3 * (TAU * f64::from(k) / 50.0).sin();
        writeln!(text, "{k},{sine:?},{:?}", sine + 1e-9).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let report = info(&folder, "a.csv --columns sine,offset");
    assert_eq!(report["channels"][0]["mean"], 0.0);
    close(&report["channels"][1]["mean"], 1e-9, 1e-11);
}

/// A record of one period does not show that it repeats. If `--period` states the period, the
/// spectral lines are exact; they do not spread to neighbouring lines as under a window.
#[test]
fn a_period_that_is_given_has_exact_lines() {
    let folder = tempfile::tempdir().unwrap();
    let force = |k: u32, line: u32, phase: f64| (TAU * f64::from(k * line) / 64.0 + phase).cos();
    let rows: String = (0..64)
        .map(|k| format!("{}\n", force(k, 3, 0.0) + 5.0 * force(k, 4, 2.0) + force(k, 5, 1.0)))
        .collect();
    fs::write(folder.path().join("one.csv"), format!("f\n{rows}")).unwrap();
    for window in ["--period 64", "--start 1 --period 64 --periods 1"] {
        let report = info(&folder, &format!("one.csv --sample-rate 64 {window}"));
        let peaks = report["channels"][0]["spectrum_peaks"].as_array().unwrap();
        assert_eq!(peaks.len(), 1, "{peaks:?}");
        close(&peaks[0]["frequency_hz"], 4.0, 1e-12);
        close(&peaks[0]["amplitude"], 5.0, 1e-12);
    }
}

#[test]
fn a_channel_that_is_cut_off_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("time,whole,cut\n");
    for k in 0..400 {
        let t = f64::from(k) / 100.0;
        let x = (TAU * 1.3 * t).sin() + 0.4 * (TAU * 3.1 * t).sin();
        writeln!(text, "{t},{x},{}", x.max(-0.8)).unwrap();
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let report = info(&folder, "a.csv --columns whole,cut");
    let [whole, cut] = [0, 1].map(|at| &report["channels"][at]["clipping"]);
    assert!(whole.is_null());
    close(&cut["level"], -0.8, 1e-15);
    assert!(cut["samples"].as_u64().unwrap() > 10, "{cut}");
    let text = mechid(folder.path(), "info a.csv");
    assert_eq!(text.matches(" is clipped at ").count(), 1, "{text}");
    assert!(text.contains("\ncolumn 3 cut is clipped at -0.80000: "), "{text}");
}

/// If the last line of a file has no line break, its last number may be cut short, so a remark
/// names the line.
#[test]
fn a_last_line_that_nothing_ends_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text, told) in [
        ("whole.csv", "t,x\n0,1.25\n1,2.5\n2,3.75\n", None),
        ("cut.csv", "t,x\n0,1.25\n1,2.5\n2,3", Some("the last line, 4, has no line break")),
        ("words.txt", "# rig\n0 1.25\n1 2.5\n2 3.7", Some("the last line, 4, has no line break")),
        ("crlf.csv", "t,x\r\n0,1.25\r\n1,2.5\r\n2,3.75\r\n", None),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
        let said = mechid(folder.path(), &format!("info {name}"));
        assert_eq!(said.matches("has no line break").count(), usize::from(told.is_some()));
        assert!(said.contains(told.unwrap_or("3 samples")), "{said}");
    }
}
