//! Records that are too long to keep in memory give the same results as records in memory.

use std::fs;

use mechid::estimate::derivatives::SavitzkyGolay;
use mechid::estimate::time_domain::{TimeDomain, equation_of_motion};
use mechid::estimate::{Unknowns, fit_percent, fitted_start, predict};
use mechid::io::{Table, TimeAxis};
use mechid::model::{Discretisation, ResponseQuantity, Sdof};
use mechid::signal::{
    Extent, Interpolation, Multisine, NoiseLevel, Phases, Record, Sampling, noise,
};
use mechid_problems::exact_harmonic_periodic;
use serde_json::Value;

use super::records::matlab;
use super::{mechid, refused};

const PERIOD: usize = 1000;

/// Number of periods; only the first 262 periods of a text are kept in memory.
const PERIODS: usize = 270;

/// Writes the record of an oscillator as text and as a MATLAB file. Only the beginning of the text
/// is kept in memory; the MATLAB file is read as a whole. The noise of the last 8 periods is large.
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
    let part = "rec: the checks that look at single samples cover only samples 1 to 262000";
    assert!(remarks.iter().any(|r| r == part), "{remarks:?}");
    // The part of the record that is not kept in memory affects the result, too: 8 of 270 periods
    // have a hundred times the noise.
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

/// A sweep reads the record once for all settings, in sections whose length is no multiple of the
/// decimation factors. For a factor n, the result is that of a separate file with every nth row.
#[test]
fn a_sweep_of_a_long_text_takes_every_nth_row() {
    let folder = records();
    let run = |arguments: &str| -> Value {
        serde_json::from_str(&mechid(folder.path(), &format!("{arguments} --json"))).unwrap()
    };
    let text = fs::read_to_string(folder.path().join("rec.csv")).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let thin = |factor: usize| {
        let rows: Vec<&str> = rows.lines().step_by(factor).collect();
        fs::write(folder.path().join("thin.csv"), [header, &rows.join("\n")].join("\n")).unwrap();
    };
    let sweep = |options: &str| {
        let of = |file: &str| {
            let report = run(&format!("sweep {file} --force f --displacement x {options}"));
            report.to_string().replace(file, "rec")
        };
        let report = of("rec.csv");
        assert_eq!(report, of("rec.mat"), "{options}");
        serde_json::from_str::<Value>(&report).unwrap()
    };
    for (swept, identified, factor) in [
        ("--velocity v --decimate 3,7", "--velocity v --domain time", 7),
        (
            "--velocity v --acceleration a --estimator equation-of-motion --decimate 1,3",
            "--velocity v --acceleration a --domain time",
            3,
        ),
        (
            "--period 1000 --estimator least-squares --decimate 1,5",
            "--period 200 --lines 1:40 --method least-squares",
            5,
        ),
    ] {
        let report = sweep(swept);
        let point = report["points"].as_array().unwrap();
        let point = point.iter().find(|p| p["setting"] == f64::from(factor)).unwrap();
        thin(factor as usize);
        let own = run(&format!("identify thin.csv --force f --displacement x {identified}"));
        for own in own["parameters"].as_array().unwrap() {
            let swept = point["parameters"].as_array().unwrap();
            let swept = swept.iter().find(|p| p["name"] == own["name"]).unwrap();
            for number in ["value", "standard_error"] {
                let (a, b) = (swept[number].as_f64().unwrap(), own[number].as_f64().unwrap());
                assert!((a / b - 1.0).abs() < 1e-9, "{swept} {own}");
            }
        }
    }
}

/// A fit in the time domain that reads the record in sections gives the same result as a fit with
/// all samples in memory.
#[test]
fn stretches_of_a_long_text_meet_as_in_one_record() {
    let folder = records();
    let table = Table::read(folder.path().join("rec.csv")).unwrap();
    let [f, x, v] =
        ["f", "x", "v"].map(|name| table.record(&TimeAxis::Column("time"), &[name]).unwrap());
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let steps = |how, extent| TimeDomain::new(how, extent);
    let smooth = SavitzkyGolay::new(10, 4).unwrap().motion(&x).unwrap();
    let [own_x, own_v] = [smooth.displacement(), smooth.velocity()];
    let refined = steps(Discretisation::Euler, Extent::Open);
    let refined = refined.fit_refined([&x, &v, &f], &unknowns, 8, Interpolation::Linear);
    let whole = steps(Discretisation::FirstOrderHold, Extent::WholePeriod);
    let closed = whole.fit(own_x, own_v, &f, &unknowns);
    for (options, judge) in [
        (
            "--velocity v --extent period --plot p.svg",
            whole.fit(&x, &v, &f, &unknowns).unwrap().into_estimate(),
        ),
        (
            "--velocity v --between-samples euler --refine 8:linear",
            refined.unwrap().into_estimate(),
        ),
        ("--derivatives savitzky-golay:21:4", equation_of_motion(&smooth, &f, &unknowns).unwrap()),
        (
            "--derivatives savitzky-golay:21:4 --extent period --between-samples linear",
            closed.unwrap().into_estimate(),
        ),
    ] {
        let options = format!("--force f --displacement x --domain time {options} --json");
        let told = mechid(folder.path(), &format!("identify rec.csv {options}"));
        let report: Value = serde_json::from_str(&told).unwrap();
        assert!(report["remarks"].to_string().contains("samples 1 to 262144"), "{options}");
        for (found, p) in report["parameters"].as_array().unwrap().iter().zip(judge.parameters()) {
            for (what, judge) in [("value", p.value), ("standard_error", p.standard_error)] {
                let found = found[what].as_f64().unwrap();
                assert!((found / judge - 1.0).abs() < 1e-9, "{options}: {what} {found} {judge}");
            }
        }
        let checks = report["checks"].as_array().unwrap().iter();
        let seam = checks.filter(|check| check["subject"] == "periodicity").collect::<Vec<_>>();
        assert_eq!(seam.len(), usize::from(options.contains("period")), "{options}");
        if options.contains("--plot") {
            let bend = |k: usize| {
                let at = |k: usize| x.channel(0)[k % x.len()];
                at(k + x.len() - 1) - 2.0 * at(k) + at(k + 1)
            };
            let usual = (1..262_143).map(|k| bend(k).powi(2)).sum::<f64>() / 262_142.0;
            let judge = bend(0).abs().max(bend(x.len() - 1).abs()) / usual.sqrt();
            let found = seam[0]["value"].as_f64().unwrap();
            assert!((found / judge - 1.0).abs() < 1e-6, "{found} {judge}");
            let picture = fs::read_to_string(folder.path().join("p.svg")).unwrap();
            assert!(picture.contains("</svg>"));
        }
    }
}

/// A fit by prediction that reads the record in sections gives the same result as with all samples
/// in memory.
#[test]
fn a_long_text_is_predicted_as_one_record() {
    let folder = records();
    let table = Table::read(folder.path().join("rec.csv")).unwrap();
    let [f, x, v] =
        ["f", "x", "v"].map(|name| table.record(&TimeAxis::Column("time"), &[name]).unwrap());
    let told = mechid(
        folder.path(),
        "identify rec.csv --force f --displacement x --velocity v --domain time --periods 1 \
         --period 1000 --validate rec.csv:501 --json",
    );
    let report: Value = serde_json::from_str(&told).unwrap();
    let [start, samples] = [500, x.len() - 500];
    assert_eq!(report["validation"]["last_sample"], x.len());
    let part = |record: &Record| record.window(start, samples).unwrap();
    let [f, x, v] = [part(&f), part(&x), part(&v)];
    let number = |at: usize| report["parameters"][at]["value"].as_f64().unwrap();
    let system = Sdof::new(number(0), number(1), number(2)).unwrap().system();
    let hold = Discretisation::FirstOrderHold;
    let measured = [(ResponseQuantity::Displacement, &x), (ResponseQuantity::Velocity, &v)];
    let start = fitted_start(&system, &f, hold, &measured).unwrap();
    let judge = predict(&system, &f, hold, Extent::Open, &start).unwrap();
    for (at, (record, predicted)) in
        [(&x, judge.displacement()), (&v, judge.velocity())].into_iter().enumerate()
    {
        let judge = fit_percent(record, predicted).unwrap()[0];
        let found = report["validation"]["channels"][at]["fit_percent"].as_f64().unwrap();
        assert!((found - judge).abs() < 1e-9 * judge.abs(), "{found} {judge}");
        assert!(found > 20.0 && found < 99.9, "{found}");
    }
}

/// Number of samples; only the first 262,144 samples of a text are kept in memory.
const SPIKED: usize = 270_000;

/// Returns a record as lines of text and as columns: the time, a column that alternates between 3
/// and 1 with one sample of 80 near the end, and a sine with eight samples per cycle.
fn spiked() -> (Vec<String>, Vec<(String, Vec<f64>)>) {
    let mut square: Vec<f64> = (0..SPIKED).map(|k| if k % 2 == 0 { 3.0 } else { 1.0 }).collect();
    square[SPIKED - 2] = 80.0;
    let sine = (0..SPIKED).map(|k| (k as f64 * std::f64::consts::FRAC_PI_4).sin()).collect();
    let times = (0..SPIKED).map(|k| k as f64 / 64.0).collect();
    let named = |name: &str, values| (name.to_owned(), values);
    let columns = vec![named("time", times), named("square", square), named("sine", sine)];
    let rows = (0..SPIKED)
        .map(|k| format!("{},{},{:?}", columns[0].1[k], columns[1].1[k], columns[2].1[k]));
    let lines = std::iter::once("time,square,sine".to_owned()).chain(rows).collect();
    (lines, columns)
}

#[test]
fn levels_of_a_long_text_are_those_of_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let (lines, columns) = spiked();
    fs::write(folder.path().join("rec.csv"), lines.join("\n") + "\n").unwrap();
    let columns: Vec<(String, &[f64])> =
        columns.iter().map(|(name, values)| (name.clone(), values.as_slice())).collect();
    fs::write(folder.path().join("rec.mat"), matlab(&columns, false)).unwrap();
    let run = |file: &str, arguments: &str| -> Value {
        let told = mechid(folder.path(), &format!("info {file} --time time {arguments} --json"));
        serde_json::from_str(&told).unwrap()
    };
    for arguments in [
        "",
        "--columns sine,square,sine --detrend mean",
        "--start 5001 --period 1000 --periods 265",
    ] {
        let (text, matlab) = (run("rec.csv", arguments), run("rec.mat", arguments));
        for field in ["samples", "window", "sampling", "left_out"] {
            assert_eq!(text[field], matlab[field], "{arguments}: {field}");
        }
        let channels = text["channels"].as_array().unwrap().len();
        assert_eq!(channels, 3, "{arguments}");
        for channel in 0..channels {
            for level in ["name", "mean", "rms", "peak", "crest_factor", "minimum", "maximum"] {
                let of = |report: &Value| report["channels"][channel][level].clone();
                assert_eq!(of(&text), of(&matlab), "{arguments}: {level} of {channel}");
            }
        }
        assert_eq!(matlab["remarks"].as_array().unwrap().len(), 0, "{arguments}");
    }

    let report = run("rec.csv", "--columns square");
    let square = &report["channels"][0];
    let n = SPIKED as f64;
    let close = |level: &str, truth: f64| {
        let value = square[level].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 1e-12, "{level}: {value}, truth {truth}");
    };
    close("mean", 2.0 + 77.0 / n);
    close("rms", (5.0 + (80.0 * 80.0 - 9.0) / n).sqrt());
    close("peak", 80.0);
    close("minimum", 1.0);
    // The period is found from the first part of the record, which does not contain the spike.
    assert_eq!(square["period"]["samples"], 2);
    assert_eq!(
        report["remarks"][0],
        "period, mismatch and strongest lines were computed from samples 1 to 262144 of rec.csv only; \
         the levels are those of all samples up to 270000"
    );
    // A short window is analysed as a whole, at any position.
    let report = run("rec.csv", "--columns square --start 269001");
    assert_eq!(report["remarks"].as_array().unwrap().len(), 0);
    assert_eq!(report["channels"][0]["peak"], 80.0);
    assert!(report["channels"][0]["period"].is_null());
}

#[test]
fn what_is_wrong_near_the_end_of_a_long_text_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let (mut lines, _) = spiked();
    let mut spoil = |line: usize, as_it_is: &str| {
        let was = std::mem::replace(&mut lines[line - 1], as_it_is.to_owned());
        fs::write(folder.path().join("bad.csv"), lines.join("\n")).unwrap();
        lines[line - 1] = was;
    };
    spoil(269_501, "4210.921875,NaN,0");
    let what = "bad.csv, line 269501";
    let message = refused(folder.path(), "info bad.csv --columns sine,square");
    assert!(message.contains(what) && message.contains("square"), "{message}");
    let report = mechid(folder.path(), "info bad.csv --json");
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["channels"].as_array().unwrap().len(), 2);
    assert_eq!(report["channels"][1]["name"], "sine");
    assert!(report["left_out"][0].as_str().unwrap().contains(what), "{report}");

    spoil(269_501, "9999,1,0");
    let message = refused(folder.path(), "info bad.csv --time time");
    assert!(message.contains("not uniform") && message.contains("269501"), "{message}");
    let report = mechid(folder.path(), "info bad.csv");
    assert!(report.contains("left out: time axis: bad.csv: the time steps"), "{report}");

    spoil(269_501, "4210.921875,1");
    let message = refused(folder.path(), "info bad.csv --columns sine");
    assert!(message.contains(what), "{message}");
}

/// A time history shows the whole window, whether the record is kept in memory or not.
#[test]
fn a_long_text_is_drawn_whole() {
    let folder = records();
    let lines = |file: &str| -> Vec<String> {
        mechid(folder.path(), &format!("info {file} --columns f,x --plot all.svg --quiet"));
        let svg = fs::read_to_string(folder.path().join("all.svg")).unwrap();
        let only = "rec.csv; spectra of samples 1 to 262144";
        assert_eq!(svg.contains(only), file == "rec.csv");
        let document = roxmltree::Document::parse(&svg).unwrap();
        let curves = document.descendants().filter(|n| n.attribute("class") == Some("curve"));
        let path = |n: roxmltree::Node<'_, '_>| {
            n.descendants().find_map(|n| n.attribute("d")).unwrap().into()
        };
        curves.step_by(2).map(path).collect()
    };
    let (text, held) = (lines("rec.csv"), lines("rec.mat"));
    assert_eq!(text.len(), 2);
    assert!(text == held);
    // The noise of the last periods, which are not in memory, is visible.
    let heights: Vec<f64> =
        text[0].split([' ', 'L']).skip(1).step_by(2).map(|y| y.parse().unwrap()).collect();
    let spread = |heights: &[f64]| {
        heights.iter().fold(0.0, |most: f64, y| most.max(*y))
            - heights.iter().fold(f64::MAX, |least, y| least.min(*y))
    };
    let end = heights.len() * 97 / 100;
    assert!(spread(&heights[end..]) > 1.3 * spread(&heights[..end]));
}

#[test]
fn the_page_of_a_long_text_is_that_of_the_record_in_memory() {
    let folder = records();
    let page = |file: &str, arguments: &str| {
        let call = format!("report {file} --force f --displacement x {arguments}");
        mechid(folder.path(), &format!("{call} --output page.html --quiet"));
        let page = fs::read_to_string(folder.path().join("page.html")).unwrap();
        page.replace(file, "rec")
    };
    for (arguments, held) in [
        ("--period 1000 --detrend mean --reconstruct-force", 262_000),
        ("--domain time --velocity v --acceleration a", 262_144),
        ("--from-frf h1 --segment 1024", 262_144),
        ("--domain time --velocity v --extent period", 262_144),
    ] {
        let text = page("rec.csv", arguments);
        assert!(text == page("rec.mat", arguments), "{arguments}");
        assert!(text.contains("<td>1 to 270000</td>"), "{arguments}");
        let some = format!(", samples 1 to {held}");
        assert!(text.contains(&some), "{arguments}: no \"{some}\"");
    }
}
