//! Records too long to be held say what they say when they are held.

use std::fs;

use mechid::model::Sdof;
use mechid::signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use mechid_problems::exact_harmonic_periodic;
use serde_json::Value;

use super::mechid;
use super::records::matlab;

const PERIOD: usize = 1000;

/// More than are held of a text; 262 periods are.
const PERIODS: usize = 270;

/// The record of an oscillator as text, of which only the beginning is held, and as a MATLAB file,
/// which is read at once. The noise of the last 8 periods is large.
fn records() -> tempfile::TempDir {
    let sampling = Sampling::new(1e-3, PERIOD).unwrap();
    let force = Multisine::flat(1..=40, 2.0, Phases::Schroeder).unwrap();
    let force = force.sample(sampling).unwrap();
    let system = Sdof::new(25.0, 190.0, 142e3).unwrap().system();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    let noisy = |clean: &Record, seed: u64| {
        let noise = |periods: usize, share: f64| {
            let record = clean.repeated(periods).unwrap();
            noise::add_white(&record, NoiseLevel::FractionOfRms(share), seed).unwrap()
        };
        let (quiet, loud) = (noise(PERIODS - 8, 0.01), noise(8, 1.0));
        [quiet.channel(0), loud.channel(0)].concat()
    };
    let channels = [&force, motion.displacement(), motion.velocity(), motion.acceleration()];
    let channels: Vec<Vec<f64>> = (1..).zip(channels).map(|(seed, c)| noisy(c, seed)).collect();
    let whole = sampling.with_len(PERIODS * PERIOD).unwrap();
    let times: Vec<f64> = whole.times().collect();
    let names = ["f", "x", "v", "a"].map(String::from).into_iter();
    let columns: Vec<(String, &[f64])> = names.zip(channels.iter().map(Vec::as_slice)).collect();
    let folder = tempfile::tempdir().unwrap();
    let text = mechid::io::csv_text(whole, &columns);
    fs::write(folder.path().join("rec.csv"), text).unwrap();
    let mut all = vec![("time".to_owned(), &times[..])];
    all.extend(columns);
    fs::write(folder.path().join("rec.mat"), matlab(&all, false)).unwrap();
    folder
}

#[test]
fn a_long_text_gives_what_the_record_in_memory_gives() {
    let folder = records();
    let run = |file: &str, arguments: &str| -> Value {
        let (command, rest) = arguments.split_once(' ').unwrap();
        let call = format!("{command} {file} --force f --displacement x {rest} --json");
        let told = mechid(folder.path(), &call).replace(file, "rec");
        serde_json::from_str(&told).unwrap()
    };
    let both = |arguments: &str| {
        let text = run("rec.csv", arguments);
        assert_eq!(text, run("rec.mat", arguments), "{arguments}");
        text
    };
    let samples = (PERIOD * PERIODS) as u64;

    let report = both("identify --period 1000 --method maximum-likelihood --detrend mean");
    assert_eq!(report["window"]["periods"], PERIODS);
    assert_eq!(report["window"]["last_sample"], samples);
    let remarks = report["remarks"].as_array().unwrap();
    let part = "checks of single samples looked at samples 1 to 262000 of rec only";
    assert!(remarks.iter().any(|r| r == part), "{remarks:?}");
    // What is not held counts all the same: 8 periods of a hundred times the noise, of 270.
    let beginning = both("identify --period 1000 --periods 262 --method maximum-likelihood");
    let error = |report: &Value| report["parameters"][2]["standard_error"].as_f64().unwrap();
    assert!(error(&report) > 10.0 * error(&beginning), "{report}");

    both("identify --period 1000 --periods 265 --start 301 --method instrumental");
    for (more, equations) in [
        ("--velocity v --acceleration a", samples),
        ("--velocity v --between-samples linear", samples - 1),
    ] {
        let report = both(&format!("identify --domain time {more}"));
        assert_eq!(report["fit"]["equations"], equations, "{more}");
    }
    let report = both("frf --segment 1024 --lines 1:40");
    assert_eq!(report["last_sample"], samples);
}
