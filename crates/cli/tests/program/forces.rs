//! The force computed from a long text file equals the force computed from the same record in
//! memory.

use std::fs;
use std::ops::Range;
use std::path::Path;

use mechid::force::{MotionNoise, discretised, discretised_with_noise, with_uncertain_system};
use mechid::io::{Table, TimeAxis, csv_text};
use mechid::model::{Discretisation, Parameter, Response, SecondOrderSystem, UncertainSystem};
use mechid::signal::{Extent, Record, Sampling};
use nalgebra::dmatrix;
use serde_json::Value;

use super::records::matlab;
use super::{mechid, refused};

const PERIOD: usize = 1000;

/// Number of samples in the record: larger than the number that the program keeps in memory from a
/// text file, and not a multiple of the chunk read at a time or of the period.
const SAMPLES: usize = 270_123;

/// Number of samples per piece in the search for the strongest line.
const PIECE: usize = 1 << 18;

const RATE_HZ: f64 = 1024.0;

/// Parameters m, c and k of the machine, in SI units.
const MACHINE: [f64; 3] = [25.0, 190.0, 142e3];
const ERRORS: [f64; 3] = [0.1, 2.0, 300.0];

const ALL: &str = "--displacement x --velocity v --acceleration a";

/// Name of the column whose standard error includes only the uncertainty of the machine.
const OF_MACHINE: &str = "standard_error_of_machine";

/// Sample at which the second part of the force begins.
const BURST: usize = 250_000;

/// The force: 3 N at 20 Hz throughout, and 100 N at 32 Hz near the end.
fn force(k: usize) -> f64 {
    let turn = |hz: f64| (std::f64::consts::TAU * hz * k as f64 / RATE_HZ).cos();
    3.0 * turn(20.0) + if k < BURST { 0.0 } else { 100.0 * turn(32.0) }
}

/// Writes the exact motion under `force` as a text file and as a MATLAB file, and the description
/// of the machine; returns x, v and a.
fn motion(folder: &Path) -> [Vec<f64>; 3] {
    let wave = |amplitude: f64, samples: f64| -> Vec<f64> {
        let turn = |k: usize| (std::f64::consts::TAU * k as f64 / samples).sin();
        (0..SAMPLES).map(|k| amplitude * turn(k)).collect()
    };
    let (x, v) = (wave(1e-4, 250.0), wave(2e-3, 125.0));
    let [m, c, kx] = MACHINE;
    let a: Vec<f64> = (0..SAMPLES).map(|k| (force(k) - c * v[k] - kx * x[k]) / m).collect();
    let sampling = Sampling::from_rate_hz(RATE_HZ, SAMPLES).unwrap();
    let named = ["x", "v", "a"].map(String::from).into_iter().zip([&x[..], &v[..], &a[..]]);
    let mut columns: Vec<(String, &[f64])> = named.collect();
    fs::write(folder.join("rec.csv"), csv_text(sampling, &columns)).unwrap();
    let times: Vec<f64> = sampling.times().collect();
    columns.insert(0, ("time".to_owned(), &times));
    fs::write(folder.join("rec.mat"), matlab(&columns, false)).unwrap();
    let [vm, vc, vk] = ERRORS.map(|error| error * error);
    let machine = format!(
        r#"{{"system": {{"mass": {m}, "damping": {c}, "stiffness": {kx}}}, "covariance":
        {{"parameters": ["m", "c", "k"], "matrix": [[{vm}, 0, 0], [0, {vc}, 0], [0, 0, {vk}]],
        "degrees_of_freedom": 100}}}}"#
    );
    fs::write(folder.join("machine.json"), machine).unwrap();
    [x, v, a]
}

/// Runs `force` on the text file and on the MATLAB file, which must give the same report and
/// output. Returns the report and the output; `error` is the name of the column with the standard
/// error.
fn both(folder: &Path, arguments: &str, error: &str) -> (Value, Record) {
    let run = |file: &str| -> (Value, Record) {
        let call = format!("force {file} --system machine.json {arguments} --output f.csv --json");
        let told = mechid(folder, &call).replace(file, "rec");
        let written = Table::read(folder.join("f.csv")).unwrap();
        let columns = ["force", error];
        let written = written.record(&TimeAxis::Column("time"), &columns).unwrap();
        (serde_json::from_str(&told).unwrap(), written)
    };
    let (text, matlab) = (run("rec.csv"), run("rec.mat"));
    assert_eq!(text.0, matlab.0, "{arguments}");
    assert!(text.1 == matlab.1, "{arguments}: other rows");
    text
}

/// Checks that a column agrees with `truth` at every sample, to the tolerance.
fn close(found: &Record, column: usize, truth: &dyn Fn(usize) -> f64, tolerance: f64) {
    for (k, value) in found.channel(column).iter().enumerate() {
        let error = (value - truth(k)).abs();
        assert!(error <= tolerance, "column {column}, sample {k}: {value}, off by {error:.1e}");
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    (values.map(|value| value * value).sum::<f64>() / SAMPLES as f64).sqrt()
}

#[test]
fn sample_by_sample_a_long_text_gives_the_force_in_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let [x, v, a] = motion(folder.path());
    let (report, written) = both(folder.path(), ALL, OF_MACHINE);
    assert_eq!(written.len(), SAMPLES);
    close(&written, 0, &force, 1e-11);
    let [m, c, k] = ERRORS;
    let error = |at: usize| (m * a[at]).hypot(c * v[at]).hypot(k * x[at]);
    close(&written, 1, &error, 1e-11);

    assert_eq!((&report["samples"], &report["periods"]), (&SAMPLES.into(), &Value::Null));
    assert_eq!(report["method"], "equation of motion, sample by sample");
    let told = |field: &str, truth: f64| {
        let value = report["forces"][0][field].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 1e-11, "{field}: {value}, truth {truth}");
    };
    told("rms", rms((0..SAMPLES).map(force)));
    told("standard_error", rms((0..SAMPLES).map(error)));
    told("peak", (0..SAMPLES).map(|k| force(k).abs()).fold(0.0, f64::max));
    // The spectrum is averaged over two pieces of the record: the first piece begins at the first
    // sample, the second ends at the last sample. The pieces contain different parts of the burst.
    // Both frequencies of the force are spectral lines of each piece.
    told("strongest_hz", 32.0);
    let part = |piece: Range<usize>| 100.0 * (piece.end - BURST) as f64 / PIECE as f64;
    let parts = [part(0..PIECE), part(SAMPLES - PIECE..SAMPLES)];
    let amplitude = (0.5 * (parts[0] * parts[0] + parts[1] * parts[1])).sqrt();
    let value = report["forces"][0]["strongest_amplitude"].as_f64().unwrap();
    assert!((value / amplitude - 1.0).abs() < 1e-3, "{value}, truth {amplitude}");
    let remark = format!(
        "the strongest line is that of the mean power spectrum of 2 pieces of {PIECE} samples each"
    );
    assert_eq!(report["remarks"][0], remark);

    // If a spectrum is written, the record is kept in memory, with the same result.
    let all = format!("{ALL} --spectrum lines.csv");
    let (held, rows) = both(folder.path(), &all, OF_MACHINE);
    for column in 0..2 {
        close(&rows, column, &|k| written.channel(column)[k], 1e-12);
    }
    for field in ["rms", "peak", "standard_error", "strongest_hz", "strongest_amplitude"] {
        told(field, held["forces"][0][field].as_f64().unwrap());
    }
    assert_eq!(report["remarks"], held["remarks"]);
}

/// The standard error of each force sample combines the stated noise of the response and the
/// standard errors of the machine. Reference: the same combination, computed here for each sample.
#[test]
fn sample_by_sample_the_noise_stated_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let [x, v, a] = motion(folder.path());
    let noise = [1e-6, 2e-5, 5e-3];
    let [m, c, k] = MACHINE;
    let of_noise = (m * noise[2]).hypot(c * noise[1]).hypot(k * noise[0]);
    let [em, ec, ek] = ERRORS;
    let error = |at: usize| (em * a[at]).hypot(ec * v[at]).hypot(ek * x[at]).hypot(of_noise);
    let stated = format!("{ALL} --noise 1e-6,2e-5,5e-3");
    let (report, written) = both(folder.path(), &stated, "standard_error");
    close(&written, 1, &error, 1e-11);
    assert_eq!(report["noise_uncertainty"], true);
    let (report, _) = both(folder.path(), ALL, OF_MACHINE);
    assert_eq!(report["noise_uncertainty"], false);
    // Noise and motion are averaged over 270 periods.
    let periods = SAMPLES / PERIOD;
    let (_, written) =
        both(folder.path(), &format!("{stated} --period {PERIOD}"), "standard_error");
    let mean = |of: &[f64], at: usize| {
        (0..periods).map(|p| of[p * PERIOD + at]).sum::<f64>() / periods as f64
    };
    let error = |at: usize| {
        let machine = (em * mean(&a, at)).hypot(ec * mean(&v, at)).hypot(ek * mean(&x, at));
        machine.hypot(of_noise / (periods as f64).sqrt())
    };
    close(&written, 1, &error, 1e-11);
    // A single level for three columns, or a negative level, must be refused.
    for (levels, words) in [
        ("1e-6", "--noise gives 1 level, but the response has 3 columns"),
        ("1e-6,-1,1", "must be positive"),
    ] {
        let call = format!("force rec.csv --system machine.json {ALL} --noise {levels}");
        let message = refused(folder.path(), &call);
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn from_sample_to_sample_stretches_join_without_a_seam() {
    let folder = tempfile::tempdir().unwrap();
    let [x, v, _] = motion(folder.path());
    let method = "--displacement x --velocity v --method discretised";
    let (_, machine_alone) = both(folder.path(), method, OF_MACHINE);
    let noisy = format!("{method} --noise 1e-6,2e-5");
    let (_, with_noise) = both(folder.path(), &noisy, "standard_error");
    let sampling = machine_alone.sampling();
    let channel = |values: Vec<f64>| Record::from_channel(sampling, values).unwrap();
    let response = Response::new(channel(x), channel(v), channel(vec![0.0; SAMPLES])).unwrap();
    let [m, c, k] = MACHINE;
    let system = SecondOrderSystem::new(dmatrix![m], dmatrix![c], dmatrix![k]).unwrap();
    let [vm, vc, vk] = ERRORS.map(|error| error * error);
    let covariance = dmatrix![vm, 0.0, 0.0; 0.0, vc, 0.0; 0.0, 0.0, vk];
    let machine = UncertainSystem::new(system, Parameter::all(1).collect(), covariance).unwrap();
    let (linear, ends) = (Discretisation::FirstOrderHold, Extent::Open);
    let noise = MotionNoise::new(vec![1e-6], vec![2e-5], vec![]).unwrap();
    let alone =
        with_uncertain_system(&machine, |system| discretised(system, &response, linear, ends));
    let noisy = with_uncertain_system(&machine, |system| {
        discretised_with_noise(system, &response, linear, ends, &noise)
    });
    for (written, at_once) in [(machine_alone, alone.unwrap()), (with_noise, noisy.unwrap())] {
        let columns = [at_once.record(), at_once.standard_error().unwrap()];
        for (column, truth) in columns.into_iter().enumerate() {
            let truth = truth.channel(0);
            let size = rms(truth.iter().copied());
            assert!(size > 1e-3);
            close(&written, column, &|k| truth[k], 1e-11 * size);
        }
    }
}

#[test]
fn periods_and_windows_of_a_long_text_are_those_of_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let [x, ..] = motion(folder.path());
    let lines = "--displacement x --lines 1:40";
    let whole = format!("{lines} --period {PERIOD} --start 101");
    let (report, found) = both(folder.path(), &whole, "standard_error");
    let periods = (SAMPLES - 100) / PERIOD;
    assert_eq!((&report["periods"], report["samples"].as_u64()), (&periods.into(), Some(1000)));
    let mean = |k: usize| (0..periods).map(|p| x[100 + p * PERIOD + k]).sum::<f64>();
    let mean: Vec<f64> = (0..PERIOD).map(|k| mean(k) / periods as f64).collect();
    let sampling = Sampling::from_rate_hz(RATE_HZ, PERIOD).unwrap();
    let text = csv_text(sampling, &[("x".to_owned(), &mean[..])]);
    fs::write(folder.path().join("mean.csv"), text).unwrap();
    let call = format!("force mean.csv --system machine.json {lines} --output mean-f.csv --quiet");
    mechid(folder.path(), &call);
    let expected = Table::read(folder.path().join("mean-f.csv")).unwrap();
    let columns = ["force", "standard_error"];
    let expected = expected.record(&TimeAxis::Column("time"), &columns).unwrap();
    for column in 0..2 {
        let truth = expected.channel(column);
        let size = truth.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        close(&found, column, &|k| truth[k], 1e-11 * size);
    }
    // The method tikhonov needs the whole open record in memory.
    let (report, _) =
        both(folder.path(), "--displacement x --start 270001 --method tikhonov", "standard_error");
    assert_eq!(report["samples"], 123);
}

#[test]
fn nothing_is_left_of_a_file_begun_when_the_end_of_the_record_is_bad() {
    let folder = tempfile::tempdir().unwrap();
    motion(folder.path());
    let path = folder.path().join("rec.csv");
    let mut lines: Vec<String> =
        fs::read_to_string(&path).unwrap().lines().map(String::from).collect();
    fs::remove_file(folder.path().join("rec.mat")).unwrap();
    let call = "force rec.csv --system machine.json --displacement x --velocity v --acceleration a \
                --output f.csv";
    for (bad, words) in
        [("0,0,NaN", "rec.csv, line 269501"), ("1e305,0,0", "sample 269500 of channel 1 is inf")]
    {
        let time = lines[269_500].split(',').next().unwrap().to_owned();
        lines[269_500] = format!("{time},{bad}");
        fs::write(&path, lines.join("\n")).unwrap();
        let message = refused(folder.path(), call);
        assert!(message.contains(words), "{message}");
        let left = fs::read_dir(folder.path()).unwrap();
        let mut left: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["machine.json", "rec.csv"]);
    }
}

/// Line 3 of a period of 64 samples is line 12 of a window of four periods. If `--period` is not
/// given, a note says that the given lines contain only a part of the motion.
#[test]
fn lines_of_another_period_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let wave = |k: u32| 1e-3 * (std::f64::consts::TAU * 3.0 * f64::from(k) / 64.0).sin();
    let rows: String = (0..256).map(|k| format!("{}\n", wave(k))).collect();
    fs::write(folder.path().join("x.csv"), format!("x\n{rows}")).unwrap();
    let machine = r#"{"system": {"mass": 25, "damping": 190, "stiffness": 142e3}}"#;
    fs::write(folder.path().join("machine.json"), machine).unwrap();
    let notes = |window: &str| {
        let call = "force x.csv --sample-rate 64 --system machine.json --displacement x --lines 3";
        let told = mechid(folder.path(), &format!("{call} {window}"));
        told.lines().filter(|line| line.contains("the given lines contain only")).count()
    };
    assert_eq!(notes(""), 1);
    assert_eq!(notes("--method shrinkage"), 1);
    assert_eq!(notes("--period 64"), 0);
}
