//! The page of a record that is too long to keep in memory: it describes the whole record, and the
//! size of its file is limited.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use roxmltree::{Document, Node};
use serde_json::Value;

use super::{closed, mechid, page, parse, row, tagged, text};

const PERIOD: usize = 1000;

/// Number of periods, more than the 262 kept in memory.
const PERIODS: usize = 270;

const DT: f64 = 1e-3;

/// Number of lines of the force.
const LINES: usize = 40;

/// Returns force, displacement, velocity and acceleration of an oscillator in steady state, summed
/// term by term. Only the last eight periods are noisy and have a peak of the force.
fn channels() -> [Vec<f64>; 4] {
    let (m, c, k) = (25.0, 190.0, 142e3);
    let mut period = [const { Vec::new() }; 4];
    for at in 0..PERIOD {
        let mut sample = [0.5, 2e-6, 0.0, 0.0];
        for n in 1..=LINES {
            let (omega, phase) = (TAU * n as f64 / (PERIOD as f64 * DT), (n * n) as f64 / 12.7);
            let (re, im) = (k - m * omega * omega, c * omega);
            let angle = omega * at as f64 * DT + phase;
            let lag = im.atan2(re);
            sample[0] += angle.cos();
            sample[1] += (angle - lag).cos() / re.hypot(im);
            sample[2] -= omega * (angle - lag).sin() / re.hypot(im);
            sample[3] -= omega * omega * (angle - lag).cos() / re.hypot(im);
        }
        period.iter_mut().zip(sample).for_each(|(values, value)| values.push(value));
    }
    let mut random = 1_u64;
    let mut noise = |level: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        level * ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
    };
    let mut all = period.map(|values| values.repeat(PERIODS));
    let loud = PERIOD * (PERIODS - 8);
    for (values, level) in all.iter_mut().zip([1e-2, 1e-6, 1e-4, 1e-2]) {
        for (at, value) in values.iter_mut().enumerate() {
            *value += noise(if at < loud { level } else { 100.0 * level });
        }
    }
    all[0][PERIOD * PERIODS - 2] = 500.0;
    all
}

fn record(folder: &Path, all: &[Vec<f64>; 4]) {
    let mut lines = String::from("time,F,x,v,a\n");
    for at in 0..PERIOD * PERIODS {
        write!(lines, "{:.3}", at as f64 * DT).unwrap();
        all.iter().for_each(|values| write!(lines, ",{:.9e}", values[at]).unwrap());
        lines.push('\n');
    }
    fs::write(folder.join("long.csv"), lines).unwrap();
}

const CALL: [&str; 9] = [
    "report",
    "long.csv",
    "--force",
    "F",
    "--displacement",
    "x",
    "--output",
    "page.html",
    "--json",
];

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|x| x * x).sum::<f64>() / values.count() as f64).sqrt()
}

fn mean_period(values: &[f64]) -> Vec<f64> {
    let of = |k: usize| values.iter().skip(k).step_by(PERIOD).sum::<f64>() / PERIODS as f64;
    (0..PERIOD).map(of).collect()
}

/// Returns the cosine and sine amplitude of a line of a period.
fn line(period: &[f64], n: usize) -> (f64, f64) {
    let angle = |at: usize| TAU * (n * at % PERIOD) as f64 / PERIOD as f64;
    let sum = |of: fn(f64) -> f64| {
        let terms = period.iter().enumerate().map(|(at, value)| value * of(angle(at)));
        2.0 / PERIOD as f64 * terms.sum::<f64>()
    };
    (sum(f64::cos), -sum(f64::sin))
}

fn near(cell: &str, expected: f64, digits: i32) {
    let got: f64 = cell.trim_end_matches(" %").replace('−', "-").parse().unwrap();
    // The cell is rounded to `digits` digits, so its error is at most half a unit of the last
    // digit. The relative error is largest for a leading digit of 1.
    let within = 0.51 * 10f64.powi(1 - digits) * expected.abs();
    assert!((got - expected).abs() <= within, "{got} is not {expected}");
}

fn figure<'a>(document: &'a Document<'_>, id: &str) -> Node<'a, 'a> {
    let figures = tagged(document, "figure");
    *figures.iter().find(|figure| figure.attribute("id") == Some(id)).unwrap()
}

#[test]
fn numbers_and_pictures_are_those_of_all_samples() {
    let folder = tempfile::tempdir().unwrap();
    let all = channels();
    record(folder.path(), &all);
    let more = ["--period", "1000", "--lines", "1:40", "--reconstruct-force"];
    let told = mechid(folder.path(), &[&CALL[..], &more].concat());
    let page = page(folder.path());
    assert!(page.len() < 600_000, "{} bytes", page.len());
    let page = closed(&page);
    let document = parse(&page);

    for (name, values) in ["F", "x"].into_iter().zip(&all) {
        let cells = row(&document, "Channels over the window", name);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let peak = values.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        let level = rms(values.iter().copied());
        for (cell, expected) in cells[3..6].iter().zip([mean, level, peak]) {
            near(cell, expected, 4);
        }
        near(&cells[6], peak / level, 3);
        let period = mean_period(values);
        let apart = rms(values.iter().zip(period.iter().cycle()).map(|(x, m)| x - m));
        let varying = rms(period.iter().map(|x| x - mean));
        near(&cells[7], 100.0 * apart / varying, 3);
    }

    // The expected values are computed here from the mean period of all samples and from the
    // definition of the Fourier coefficients.
    let told: Value = serde_json::from_str(&told).unwrap();
    let value = |at: usize| told["parameters"][at]["value"].as_f64().unwrap();
    let [m, c, k] = [0, 1, 2].map(value);
    let [force, motion] = [0, 1].map(|at| mean_period(&all[at]));
    let (mut measured, mut found) = (0.0, 0.0);
    for n in 1..=LINES {
        let (re, im) = line(&force, n);
        measured += 0.5 * (re * re + im * im);
        let omega = TAU * n as f64 / (PERIOD as f64 * DT);
        let stiffness = (k - m * omega * omega).hypot(c * omega);
        let (re, im) = line(&motion, n);
        found += 0.5 * stiffness * stiffness * (re * re + im * im);
    }
    let cells = row(&document, "Computed and measured force", "F");
    // The peak of the force adds 2 N to the mean period, but is not in the part kept in memory.
    near(&cells[1], measured.sqrt(), 4);
    near(&cells[2], found.sqrt(), 4);
    // The peak of the force is the second last of the drawn samples.
    let force = figure(&document, "figure-force");
    let curve = force.descendants().find(|node| node.attribute("class") == Some("curve")).unwrap();
    let path = curve.descendants().find_map(|node| node.attribute("d")).unwrap();
    let points: Vec<(f64, f64)> = path
        .split(['M', 'L'])
        .filter_map(|point| point.split_once(' '))
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect();
    let top = points.iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let end = points.last().unwrap();
    assert!(end.0 - top.0 < 0.2, "{top:?} is not at the end, {end:?}");
    assert!(points.iter().filter(|point| point.1 < 0.5 * (top.1 + end.1)).count() < 4);

    let of_held = row(&document, "Residual of the response, samples 1 to 262000", "x");
    near(&of_held[2], rms(without_mean(&all[1][..262_000]).into_iter()), 4);
    assert_eq!(row(&document, "The record", "Samples used")[1], "1 to 270000");
}

fn without_mean(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| x - mean).collect()
}

#[test]
fn an_open_record_says_which_samples_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let all = channels();
    record(folder.path(), &all);
    let more =
        ["--velocity", "v", "--acceleration", "a", "--domain", "time", "--reconstruct-force"];
    mechid(folder.path(), &[&CALL[..], &more].concat());
    let page = page(folder.path());
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    let page = closed(&page);
    let document = parse(&page);
    let captions: Vec<String> = tagged(&document, "figcaption").into_iter().map(text).collect();
    for (id, part) in [
        ("force", "history of the window, and line amplitudes of samples 1 to 262144 taken as"),
        ("fit", "for the measured force over samples 1 to 262144; below"),
        ("residual-spectrum", "of the residual, samples 1 to 262144: the spectrum of pure noise"),
        ("correlations", "with the force, samples 1 to 262144; for pure noise, 95 %"),
        ("reconstructed-force", "their difference, samples 1 to 262144."),
    ] {
        let caption =
            text(figure(&document, &format!("figure-{id}")).last_element_child().unwrap());
        assert!(caption.contains(part), "{caption}");
    }
    assert!(captions.iter().any(|c| c.contains("segments of 32768 samples")), "{captions:?}");
    let excited = row(&document, "Quality of the excitation, samples 1 to 262144", "F");
    // The crest factor of the part in memory does not include the peak of the force.
    let held = &all[0][..262_144];
    let peak = held.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
    near(&excited[1], peak / rms(held.iter().copied()), 3);
    // The levels of the whole window include the peak.
    let cells = row(&document, "Channels over the window", "F");
    near(&cells[6], 500.0 / rms(all[0].iter().copied()), 3);
}

#[test]
fn what_is_wrong_near_the_end_leaves_no_page() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), &channels());
    let whole = fs::read_to_string(folder.path().join("long.csv")).unwrap();
    let mut lines: Vec<&str> = whole.lines().collect();
    lines[269_500] = "269.499,1,NaN,0,0";
    fs::write(folder.path().join("long.csv"), lines.join("\n")).unwrap();
    let call = [&CALL[..], &["--period", "1000"]].concat();
    let output =
        Command::cargo_bin("mechid").unwrap().current_dir(folder.path()).args(call).output();
    let output = output.unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), message.lines().count()), (Some(2), 1), "{message}");
    assert!(message.contains("long.csv, line 269501") && message.contains('x'), "{message}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "something was written");
}
