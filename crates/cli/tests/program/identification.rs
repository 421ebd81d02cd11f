//! Arguments and reports of `mechid identify` and `mechid frf`, on records in closed form.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use mechid::model::{InitialState, KyxSign, Response, Sdof, SecondOrderSystem};
use mechid::signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use mechid_problems::{
    dissertation_bearing, exact_foh, exact_harmonic_periodic, exact_zoh, exact_zoh_periodic,
};
use serde_json::Value;

fn run(folder: &Path, arguments: &str) -> (bool, String, String) {
    let output = Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code() == Some(0), text(output.stdout), text(output.stderr))
}

fn json(folder: &Path, arguments: &str) -> Value {
    let (done, told, error) = run(folder, &format!("{arguments} --json"));
    assert!(done, "{arguments}: {error}");
    serde_json::from_str(&told).unwrap()
}

/// Runs the program, which must fail with exit code 2 and one message with all of `parts`, and
/// write no file.
fn refused(folder: &Path, arguments: &str, parts: &[&str]) {
    let before = fs::read_dir(folder).unwrap().count();
    let output = Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(output.stdout.is_empty() && message.starts_with("error: "), "{message}");
    for part in parts {
        assert!(message.contains(part), "{arguments}: no \"{part}\" in: {message}");
    }
    assert_eq!(fs::read_dir(folder).unwrap().count(), before, "{arguments}");
}

/// Writes the columns time, f (or f1, f2), x, v and a.
fn write(folder: &Path, name: &str, force: &Record, motion: &Response) {
    let quantities = [
        ("f", force),
        ("x", motion.displacement()),
        ("v", motion.velocity()),
        ("a", motion.acceleration()),
    ];
    let mut columns = Vec::new();
    for (letter, record) in quantities {
        for channel in 0..record.channels() {
            let number =
                if record.channels() > 1 { (channel + 1).to_string() } else { String::new() };
            columns.push((format!("{letter}{number}"), record.channel(channel)));
        }
    }
    fs::write(folder.join(name), mechid::io::csv_text(force.sampling(), &columns)).unwrap();
}

fn noisy(motion: &Response, share: f64, seed: u64) -> Response {
    let add = |record: &Record, seed| {
        noise::add_white(record, NoiseLevel::FractionOfRms(share), seed).unwrap()
    };
    let (x, v, a) = (motion.displacement(), motion.velocity(), motion.acceleration());
    Response::new(add(x, seed), add(v, seed + 1), add(a, seed + 2)).unwrap()
}

fn oscillator() -> SecondOrderSystem {
    Sdof::new(2.0, 6.0, 800.0).unwrap().system()
}

/// A multisine of twenty lines with a period of 256 samples, which gives 31 samples per cycle of
/// the oscillator.
fn multisine(seed: u64) -> Record {
    let sampling = Sampling::new(0.01, 256).unwrap();
    let force = Multisine::flat(1..=20, 3.0, Phases::Random { seed }).unwrap();
    force.sample(sampling).unwrap()
}

fn parameter(report: &Value, name: &str, field: &str) -> f64 {
    let rows = report["parameters"].as_array().unwrap();
    rows.iter().find(|row| row["name"] == name).unwrap()[field].as_f64().unwrap()
}

/// Returns the largest relative error of m, c and k.
fn error(report: &Value) -> f64 {
    let truth = [("m", 2.0), ("c", 6.0), ("k", 800.0)];
    let of = |(name, truth): &(&str, f64)| (parameter(report, name, "value") / truth - 1.0).abs();
    truth.iter().map(of).fold(0.0, f64::max)
}

fn verdict(report: &Value, when: &str, subject: &str) -> String {
    let checks = report["checks"].as_array().unwrap();
    let found = checks.iter().find(|c| c["when"] == when && c["subject"] == subject);
    found.unwrap_or_else(|| panic!("no {subject} {when} in {report}"))["verdict"]
        .as_str()
        .unwrap()
        .to_owned()
}

#[test]
fn checks_tell_a_good_record_from_a_bad_one() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let sampling = Sampling::new(0.01, 400).unwrap();
    let force = noise::white(sampling, 1, 5.0, 3).unwrap();
    let rest = InitialState::rest(1);
    write(folder, "held.csv", &force, &exact_zoh(&oscillator(), &force, &rest).unwrap());
    let common = "identify held.csv --force f --displacement x --velocity v --domain time";
    let held = json(folder, &format!("{common} --between-samples held"));
    for (when, subject) in [
        ("before", "excitation"),
        ("before", "conditioning"),
        ("before", "step"),
        ("after", "whiteness"),
        ("after", "cross-correlation"),
    ] {
        assert_eq!(verdict(&held, when, subject), "good", "{subject}");
    }
    // A response from rest is not periodic: its end does not meet its beginning.
    let period = json(folder, &format!("{common} --between-samples held --extent period"));
    assert_ne!(verdict(&period, "before", "periodicity"), "good");
    // The noise of each sample of the motion affects the residuals of two successive steps, so the
    // residual is coloured.
    let motion = exact_zoh(&oscillator(), &force, &rest).unwrap();
    write(folder, "noisy.csv", &force, &noisy(&motion, 0.01, 9));
    let coloured =
        json(folder, &format!("{common} --between-samples held").replace("held.csv", "noisy.csv"));
    assert_eq!(verdict(&coloured, "after", "whiteness"), "doubtful");
    let euler = json(folder, &format!("{common} --between-samples euler"));
    let step = euler["checks"].as_array().unwrap().iter().find(|c| c["subject"] == "step").unwrap();
    let finding = &step["finding"];
    assert!((finding["frequency_hz"].as_f64().unwrap() - 3.18).abs() < 0.01, "{step}");
    assert!(finding["limit"] == "euler" && finding["bias"].as_f64().unwrap() > 0.01, "{step}");
    let (_, text, _) = run(folder, &format!("{common} --between-samples euler"));
    assert!(text.contains(&format!("\n  step: {}", step["text"].as_str().unwrap())));

    // One line gives two equations, so three unknowns need two lines.
    let one = Multisine::flat([3], 5.0, Phases::Zero).unwrap().sample(sampling).unwrap();
    let two = Multisine::flat([3, 9], 5.0, Phases::Zero).unwrap().sample(sampling).unwrap();
    for (name, force) in [("one.csv", one), ("two.csv", two)] {
        let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
        write(folder, name, &force, &noisy(&motion, 0.01, 5));
    }
    let columns = "--force f --displacement x";
    refused(folder, &format!("identify one.csv {columns}"), &["do not determine 3 unknowns"]);
    let tight = json(folder, &format!("identify one.csv {columns} --mass 2"));
    assert_eq!(verdict(&tight, "before", "excitation"), "doubtful");
    let good = json(folder, &format!("identify two.csv {columns}"));
    assert_eq!(verdict(&good, "before", "excitation"), "good");
    // Two lines give four real equations. With three parameters, one residual degree of freedom
    // remains, which is too few for a statistical test.
    let tested = |check: &Value| !check["finding"]["p_value"].is_null();
    assert!(!good["checks"].as_array().unwrap().iter().any(tested), "{good}");
    // The stated period is wrong: the record repeats every 400 samples.
    let wrong = json(folder, &format!("identify two.csv {columns} --period 190"));
    assert_eq!(verdict(&wrong, "before", "periodicity"), "bad");
}

#[test]
fn another_record_is_predicted() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let sampling = Sampling::new(0.01, 600).unwrap();
    for (name, seed, share) in [("a.csv", 1, 0.0), ("b.csv", 2, 0.0), ("c.csv", 3, 0.1)] {
        let force = noise::white(sampling, 1, 5.0, seed).unwrap();
        let motion = exact_foh(&oscillator(), &force, &InitialState::rest(1)).unwrap();
        write(folder, name, &force, &noisy(&motion, share, seed));
    }
    let common = "identify a.csv --force f --displacement x --velocity v --domain time";
    let fits = |report: &Value| -> Vec<f64> {
        let channels = report["validation"]["channels"].as_array().unwrap();
        channels.iter().map(|c| c["fit_percent"].as_f64().unwrap()).collect()
    };
    let exact = json(folder, &format!("{common} --validate b.csv"));
    assert_eq!(fits(&exact).len(), 2);
    assert!(fits(&exact).iter().all(|fit| *fit > 99.9999), "{exact}");
    // The prediction differs from the validation record only by the noise of this record.
    let noise = json(folder, &format!("{common} --validate c.csv:101"));
    assert_eq!(noise["validation"]["first_sample"], 101);
    assert!(fits(&noise).iter().all(|fit| (fit - 90.0).abs() < 1.5), "{noise}");
    // The text report names a validation window of the same record.
    let own = format!("{common} --period 300 --periods 1 --validate :301:200");
    let (done, text, message) = run(folder, &own);
    assert!(done, "{message}");
    assert!(text.contains("prediction of a.csv, samples 301 to 500 "), "{text}");

    // The next records are whole periods of a steady state.
    for (name, seed) in [("p.csv", 1), ("q.csv", 2)] {
        let force = multisine(seed).repeated(3).unwrap();
        let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
        write(folder, name, &force, &motion);
    }
    let steady = json(
        folder,
        "identify p.csv --force f --displacement x --period 256 --validate q.csv:1:600",
    );
    assert_eq!(steady["validation"]["last_sample"], 512);
    assert!(fits(&steady)[0] > 99.9999);

    refused(folder, &format!("{common} --validate :0"), &["counted from 1"]);
    refused(folder, &format!("{common} --validate d.csv"), &["cannot read d.csv"]);
    refused(folder, &format!("{common} --validate b.csv:700"), &["b.csv has 600"]);
    let short = "identify p.csv --force f --displacement x --period 256 --validate q.csv:1:100";
    refused(folder, short, &["--validate: 100 samples are less than one period of 256"]);
}

#[test]
fn one_kind_of_motion_is_enough_with_derivatives() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = multisine(4);
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    write(folder, "p.csv", &force, &motion);
    for motion in ["--displacement x", "--acceleration a"] {
        let common = format!("identify p.csv --force f {motion} --domain time");
        let found = json(folder, &format!("{common} --derivatives spectral"));
        assert!(error(&found) < 1e-9, "{motion}: {found}");
        assert_eq!(verdict(&found, "before", "periodicity"), "good");
        // The polynomial of order 8 covers eleven samples, less than one cycle of the highest line
        // (thirteen samples), so its error is small.
        let found = json(folder, &format!("{common} --derivatives savitzky-golay:11:8"));
        assert!(error(&found) < 0.02, "{motion}: {found}");
        refused(folder, &common, &["--derivatives sets how", "savitzky-golay:WINDOW:ORDER"]);
    }
    let common = "identify p.csv --force f --domain time";
    let both = "--displacement x --velocity v --derivatives spectral";
    refused(
        folder,
        &format!("{common} {both}"),
        &["from the displacement alone or from the acceler"],
    );
    let twice = "--acceleration a --derivatives savitzky-golay:11:8 --between-samples held";
    refused(folder, &format!("{common} {twice}"), &["leave --between-samples out"]);
    let even = "--acceleration a --derivatives savitzky-golay:10:4";
    refused(folder, &format!("{common} {even}"), &["an odd number of samples, not 10"]);
    let long = "--acceleration a --derivatives savitzky-golay:301:4";
    refused(folder, &format!("{common} {long}"), &["256 samples, but at least 301"]);
}

#[test]
fn intermediate_points_make_the_step_smaller_and_nothing_more_certain() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = multisine(5);
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    write(folder, "p.csv", &force, &motion);
    let common = "identify p.csv --force f --displacement x --velocity v --domain time \
                  --extent period --between-samples euler";
    let once = json(folder, common);
    for (way, better) in [("band-limited", 6.0), ("spline", 6.0), ("linear", 1.05)] {
        let finer = json(folder, &format!("{common} --refine 8:{way}"));
        assert!(error(&finer) < error(&once) / better, "{way}: {} {}", error(&finer), error(&once));
        let freedom = finer["covariance"]["degrees_of_freedom"].as_u64().unwrap();
        let measured = once["covariance"]["degrees_of_freedom"].as_u64().unwrap();
        // After linear or spline interpolation the refined record is open: it has one interval
        // fewer than the period, so one equation may be missing.
        assert!(measured - freedom <= 1, "{way}: {freedom} {measured}");
    }
    refused(folder, &format!("{common} --refine 8"), &["FACTOR:linear"]);
    refused(folder, &format!("{common} --refine 0:linear"), &["FACTOR:linear"]);
}

#[test]
fn a_whole_period_closes() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = noise::white(Sampling::new(0.01, 200).unwrap(), 1, 5.0, 3).unwrap();
    write(folder, "p.csv", &force, &exact_zoh_periodic(&oscillator(), &force).unwrap());
    let common = "identify p.csv --force f --displacement x --velocity v";
    let held = format!("{common} --domain time --between-samples held");
    for (extent, equations) in [("open", 199), ("period", 200)] {
        let found = json(folder, &format!("{held} --extent {extent} --plot {extent}.svg"));
        assert_eq!(found["fit"]["equations"], equations);
        assert!(error(&found) < 1e-8, "{found}");
        let drawn = fs::read_to_string(folder.join(format!("{extent}.svg"))).unwrap();
        for part in ["<title>p.csv: 3.183 Hz", "measured", "predicted", "Residual of x (m)"] {
            assert!(drawn.contains(part), "no {part}");
        }
    }
    let segments = format!("{common} --from-frf h1 --segment 64 --extent period");
    refused(folder, &segments, &["--extent: it belongs to", "not to --from-frf"]);
    for option in ["--unit f=kHz", "--scale real=2"] {
        let table = format!("identify h.csv --frf-table {option}");
        refused(folder, &table, &["belongs to records", "states its units in its header"]);
    }
    let weights = format!("{common} --method least-squares --noise smooth");
    refused(folder, &weights, &["--noise: available only with --method maximum-likelihood"]);
    let weights = format!("{common} --noise per-line --extent period");
    refused(folder, &weights, &["--noise: per-line takes the noise of each line"]);
    let lines = "--domain time --lines odd --plot a.svg";
    refused(
        folder,
        &format!("{common} {lines}"),
        &["--lines: it belongs to", "not to --domain time"],
    );
}

/// If the record repeats but no period is stated, a remark states the number of samples after which
/// the record repeats.
#[test]
fn periods_taken_as_one_are_told() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = noise::white(Sampling::new(0.01, 200).unwrap(), 1, 5.0, 3).unwrap();
    let force = force.repeated(3).unwrap();
    write(folder, "p.csv", &force, &exact_zoh_periodic(&oscillator(), &force).unwrap());
    let call = "identify p.csv --force f --displacement x --lines 1:20";
    let told = |call: &str| json(folder, call)["remarks"].to_string();
    let words = "repeats every 200 samples";
    assert!(told(&call.replace("1:20", "3:3:60")).contains(words));
    assert!(!told(&format!("{call} --period 200")).contains(words));
}

#[test]
fn masses_may_be_known_in_part() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let system = dissertation_bearing(KyxSign::Minus).system();
    let sampling = Sampling::new(0.2, 512).unwrap();
    let lines = |seed, first| {
        let force = Multisine::flat((first..100).step_by(2), 5.0, Phases::Random { seed }).unwrap();
        force.sample(sampling).unwrap().channel(0).to_vec()
    };
    let force = Record::from_channels(sampling, &[lines(1, 3), lines(2, 4)]).unwrap();
    write(folder, "b.csv", &force, &exact_harmonic_periodic(&system, &force).unwrap());
    let common = "identify b.csv --force f1,f2 --displacement x1,x2 --mass";
    let found = json(folder, &format!("{common} 14.8,unknown"));
    assert_eq!(found["fit"]["unknowns"], 9);
    let rows = found["parameters"].as_array().unwrap();
    let known: Vec<bool> = rows[..4].iter().map(|row| row["known"].as_bool().unwrap()).collect();
    assert_eq!(known, [true, true, true, false]);
    assert!((parameter(&found, "m22", "value") / 14.8 - 1.0).abs() < 1e-9);
    refused(
        folder,
        &format!("{common} 14.8,heavy"),
        &["\"heavy\" is neither a number nor unknown"],
    );
    refused(folder, &format!("{common} 1e300,1e300"), &["exceeds the range of double precision"]);
    refused(folder, &format!("{common} unknown,-1"), &["got -1 kg"]);
}

/// Two records fitted together give the exact parameters. Each record has a force on one line only,
/// so a single record does not determine the three unknowns.
#[test]
fn several_records_are_one_fit() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let sampling = Sampling::new(0.01, 256).unwrap();
    for (name, line) in [("a.csv", 4), ("b.csv", 11)] {
        let force = Multisine::flat([line], 5.0, Phases::Zero).unwrap().sample(sampling).unwrap();
        let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
        write(folder, name, &force, &motion);
    }
    let columns = "--force f --displacement x";
    let found = json(folder, &format!("identify a.csv b.csv {columns}"));
    assert!(error(&found) < 1e-9, "{found}");
    assert_eq!(found["records"][1]["file"], "b.csv");
    assert_eq!(found["records"][1]["last_sample"], 256);
    let columns = "--force f --displacement x --velocity v --acceleration a --domain time";
    let found = json(folder, &format!("identify a.csv b.csv {columns}"));
    assert!(error(&found) < 1e-9, "{found}");
    assert_eq!(found["fit"]["equations"], 512);
    let (_, text, _) = run(folder, &format!("identify a.csv b.csv {columns}"));
    assert!(text.contains("b.csv: samples 1 to 256, 100 Hz\n"), "{text}");
    assert!(text.contains("excitation: f is persistently exciting of order 2"), "{text}");
    refused(folder, &format!("identify a.csv d.csv {columns}"), &["cannot read d.csv"]);
}

#[test]
fn frequency_responses_are_estimated_and_fitted() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let system = oscillator();
    let force = multisine(6).repeated(4).unwrap();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    write(folder, "p.csv", &force, &motion);
    let common = "--force f --displacement x --period 256";
    for estimator in ["h1", "h2", "hv"] {
        let files = "--output frf.csv --plot frf.svg";
        let report = json(folder, &format!("frf p.csv {common} --estimator {estimator} {files}"));
        let hz = report["frequency_hz"].as_array().unwrap();
        assert_eq!((hz.len(), &report["segments"]["averages"]), (20, &Value::from(4.0)));
        let table = mechid::io::Table::read(folder.join("frf.csv")).unwrap();
        let column = |name: &str| table.column(name).unwrap();
        let (re, im) = (column("h_1_1_real"), column("h_1_1_imaginary"));
        for (at, hz) in column("frequency_hz").iter().enumerate() {
            let exact = system.receptance(hz * std::f64::consts::TAU).unwrap()[(0, 0)];
            let gap = (re[at] - exact.re).hypot(im[at] - exact.im);
            // The estimator Hv takes a square root, so its error is the square root of the rounding
            // error.
            let tolerance = if estimator == "hv" { 1e-6 } else { 1e-10 };
            assert!(gap < tolerance * exact.norm(), "{estimator} {hz}: {gap}");
            assert!((column("coherence_1")[at] - 1.0).abs() < 1e-9);
        }
        let drawn = fs::read_to_string(folder.join("frf.svg")).unwrap();
        assert!(drawn.contains("Receptance (m/N)") && drawn.contains("Coherence"));
        let found = json(folder, &format!("identify p.csv {common} --from-frf {estimator}"));
        let tolerance = if estimator == "hv" { 1e-6 } else { 1e-9 };
        assert!(error(&found) < tolerance, "{estimator}: {found}");
        assert_eq!(verdict(&found, "before", "coherence"), "good");
        let table = "identify frf.csv --frf-table --quantity displacement --plot fitted.svg";
        let found = json(folder, table);
        assert!(error(&found) < tolerance, "{estimator}: {found}");
        json(folder, &format!("frf p.csv {common} --estimator {estimator} --output frf.unv"));
        let found = json(folder, "identify frf.unv --frf-table --averages 4");
        assert_eq!(
            (&found["quantity"], &found["points"][0]),
            (&"displacement".into(), &"1+X".into())
        );
        // The numbers of a universal file have 13 digits, its frequencies nine.
        assert!(error(&found) < 1e-5, "{estimator}: {found}");
    }
    let (_, text, _) = run(folder, &format!("frf p.csv {common}"));
    assert!(
        text.contains("H1 from 4 periods of 256 samples, equivalent to 4 averages; 20 lines"),
        "{text}"
    );
    refused(
        folder,
        &format!("frf p.csv {common} --periods 1"),
        &["at least 2 averages are needed, got 1"],
    );
    refused(folder, "frf p.csv --displacement x", &["--force"]);

    // Under random excitation with windows, leakage causes an error of some per cent.
    let sampling = Sampling::new(0.01, 1 << 14).unwrap();
    let force = noise::white(sampling, 1, 5.0, 7).unwrap();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    write(folder, "r.csv", &force, &noisy(&motion, 0.05, 8));
    let common = "--force f --displacement x --segment 1024 --band-hz 0.5:12";
    let other = "--force f --displacement x --band-hz 0.5:12 --segment";
    let frf = json(folder, &format!("frf r.csv {common}"));
    assert_eq!(frf["segments"]["hop"], 512);
    let found = json(folder, &format!("identify r.csv {common} --from-frf h1"));
    assert!(error(&found) < 0.03, "{found}");
    let least_squares = format!("identify r.csv {common} --from-frf h1 --method least-squares");
    assert!(error(&json(folder, &least_squares)) > error(&found));
    let three = format!("frf r.csv {other} 1024:75:blackman");
    assert_eq!(json(folder, &three)["segments"]["hop"], 256);
    for (more, part) in [
        ("--from-frf h3", "h3"),
        ("--from-frf h1 --method instrumental", "instrumental variables need single periods"),
        ("", "--segment: it belongs to --from-frf"),
    ] {
        refused(folder, &format!("identify r.csv {common} {more}"), &[part]);
    }
    for (segment, part) in [
        ("1024:100", "at least 0 and below 100 %, got 100"),
        ("1024:-1", "at least 0 and below 100 %, got -1"),
        ("1024:50:hanning", "is not one of hann, hamming, blackman, rectangular"),
        ("0", "is not a number of samples"),
    ] {
        refused(folder, &format!("frf r.csv {other} {segment}"), &[part]);
    }
    let long = "frf r.csv --force f --displacement x --segment 20000 --output frf2.csv";
    refused(folder, long, &["20000"]);
}
