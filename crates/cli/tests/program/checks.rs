//! Checks of `mechid identify` before and after a fit, for all estimators.

use std::path::Path;

use mechid::model::{InitialState, Response, Sdof, SecondOrderSystem};
use mechid::signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use mechid_problems::{exact_foh, exact_harmonic_periodic, exact_zoh};
use serde_json::Value;

use crate::{mechid, refused};

fn oscillator() -> SecondOrderSystem {
    Sdof::new(2.0, 6.0, 800.0).unwrap().system()
}

fn noisy(record: &Record, share: f64, seed: u64) -> Record {
    noise::add_white(record, NoiseLevel::FractionOfRms(share), seed).unwrap()
}

/// Writes the columns time, f, x and v; both motions have noise, given as a share of their RMS.
fn write(folder: &Path, name: &str, force: &Record, motion: &Response, share: f64) {
    let motions = [(motion.displacement(), 1), (motion.velocity(), 2)];
    let [x, v] = motions.map(|(record, seed)| match share {
        0.0 => record.clone(),
        _ => noisy(record, share, seed),
    });
    let columns = [("f", force), ("x", &x), ("v", &v)];
    let columns = columns.map(|(name, record)| (name.to_owned(), record.channel(0)));
    let text = mechid::io::csv_text(force.sampling(), &columns);
    std::fs::write(folder.join(name), text).unwrap();
}

/// Writes a record of four periods of 256 samples.
fn periodic(folder: &Path, name: &str, seed: u64, share: f64) {
    let force = Multisine::flat(4..=60, 2.0, Phases::Random { seed }).unwrap();
    let force = force.sample(Sampling::new(0.01, 256).unwrap()).unwrap().repeated(4).unwrap();
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    write(folder, name, &force, &motion, share);
}

/// Returns all checks of a subject.
fn checks(folder: &Path, arguments: &str, subject: &str) -> Vec<Value> {
    let report: Value =
        serde_json::from_str(&mechid(folder, &format!("{arguments} --json"))).unwrap();
    let all = report["checks"].as_array().unwrap().iter();
    all.filter(|check| check["subject"] == subject).cloned().collect()
}

fn verdicts(folder: &Path, arguments: &str, subject: &str) -> Vec<String> {
    let verdict = |check: &Value| check["verdict"].as_str().unwrap().to_owned();
    checks(folder, arguments, subject).iter().map(verdict).collect()
}

#[test]
fn a_wrong_period_is_warned_of_however_the_spectra_are_fitted() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    periodic(folder, "p.csv", 1, 0.01);
    for method in ["least-squares", "instrumental", "maximum-likelihood"] {
        let common = format!(
            "identify p.csv --force f --displacement x --lines 4:60 --method {method} --period"
        );
        assert_eq!(verdicts(folder, &format!("{common} 256"), "periodicity"), ["good"], "{method}");
        for (wrong, fault) in [(255, "neighbour"), (257, "neighbour"), (384, "other")] {
            let found = checks(folder, &format!("{common} {wrong}"), "periodicity");
            let named = found.iter().any(|check| {
                let finding = &check["finding"];
                check["verdict"] == "bad"
                    && finding["kind"] == "wrong_period"
                    && finding["claimed"] == wrong
                    && finding["fault"] == fault
                    && finding["period"] == 256
            });
            assert!(named, "{method} {wrong}: {found:?}");
        }
    }
    let from_frf = "identify p.csv --force f --displacement x --from-frf h1 --period";
    assert!(verdicts(folder, &format!("{from_frf} 256"), "periodicity").is_empty());
    assert_eq!(verdicts(folder, &format!("{from_frf} 255"), "periodicity"), ["bad"]);
}

#[test]
fn every_way_to_fit_is_looked_at_afterwards_record_by_record() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    periodic(folder, "p.csv", 1, 0.01);
    periodic(folder, "q.csv", 2, 0.01);
    let spectra = "identify p.csv q.csv --force f --displacement x --period 256";
    for method in ["--method least-squares", "--method instrumental", "--method maximum-likelihood"]
    {
        for subject in ["misfit", "whiteness", "cross-correlation"] {
            let found = verdicts(folder, &format!("{spectra} {method}"), subject);
            assert_eq!(found.len(), 2, "{method} {subject}");
            if method.ends_with("likelihood") {
                assert_eq!(found, ["good", "good"], "{subject}");
            }
        }
    }
    let samples = "identify p.csv q.csv --force f --displacement x --velocity v --domain time";
    for more in ["--extent period", "--between-samples held", "--derivatives spectral"] {
        let samples = match more {
            "--derivatives spectral" => samples.replace(" --velocity v", ""),
            _ => samples.into(),
        };
        for subject in ["whiteness", "cross-correlation"] {
            assert_eq!(verdicts(folder, &format!("{samples} {more}"), subject).len(), 2, "{more}");
        }
    }
}

/// The force is linear between the samples, so a correct model without noise leaves only rounding
/// as residual. The checks of the residual find a wrong mass, and noise.
#[test]
fn a_refined_fit_is_judged_from_measured_sample_to_measured_sample() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = noise::white(Sampling::new(0.01, 600).unwrap(), 1, 5.0, 3).unwrap();
    let motion = exact_foh(&oscillator(), &force, &InitialState::rest(1)).unwrap();
    write(folder, "clean.csv", &force, &motion, 0.0);
    write(folder, "noisy.csv", &force, &motion, 0.001);
    let refined = "--force f --displacement x --velocity v --domain time \
                   --between-samples linear --refine 4:linear";
    for subject in ["whiteness", "cross-correlation"] {
        let found = verdicts(folder, &format!("identify clean.csv {refined} --mass 2"), subject);
        assert_eq!(found.len(), 1);
    }
    let wrong = format!("identify clean.csv {refined} --mass 2.2");
    assert_eq!(verdicts(folder, &wrong, "cross-correlation"), ["doubtful"]);
    let [check] = &checks(folder, &format!("identify noisy.csv {refined}"), "whiteness")[..] else {
        panic!("one channel");
    };
    assert_eq!(check["verdict"], "doubtful");
    let span = &check["finding"]["span"];
    assert_eq!(span["lags"], 1, "{check}");
    assert!(span["first_coefficient"].as_f64().unwrap() < 0.0, "{check}");
}

#[test]
fn a_fit_of_responses_to_a_random_force_is_judged_line_by_line() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let force = noise::white(Sampling::new(0.01, 1 << 14).unwrap(), 1, 5.0, 7).unwrap();
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    write(folder, "r.csv", &force, &motion, 0.05);
    let common = "identify r.csv --force f --displacement x --segment 2048 --band-hz 0.5:12 \
                  --from-frf h1";
    for subject in ["misfit", "linearity", "whiteness"] {
        assert_eq!(verdicts(folder, common, subject), ["good"], "{subject}");
    }
    let heading = mechid(folder, common);
    assert!(heading.starts_with("r.csv: samples 1 to 16384, 100 Hz\n"), "{heading}");
    let wrong = format!("{common} --mass 2.2");
    for subject in ["misfit", "whiteness"] {
        assert_eq!(verdicts(folder, &wrong, subject), ["doubtful"], "{subject}");
    }
}

#[test]
fn an_unstable_machine_is_not_led_through_a_long_record() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    // On a negative spring, such as a magnetic bearing without control, the motion grows by a
    // factor e in 0.100 s.
    let one = |value: f64| nalgebra::DMatrix::from_element(1, 1, value);
    let system = SecondOrderSystem::new(one(1.0), one(0.0), one(-100.0)).unwrap();
    let rest = InitialState::rest(1);
    let force = noise::white(Sampling::new(0.01, 200).unwrap(), 1, 5.0, 7).unwrap();
    write(folder, "fit.csv", &force, &exact_zoh(&system, &force, &rest).unwrap(), 0.0);
    let force = noise::white(Sampling::new(0.01, 20_000).unwrap(), 1, 5.0, 8).unwrap();
    write(folder, "long.csv", &force, &exact_zoh(&oscillator(), &force, &rest).unwrap(), 0.0);
    let common = "identify fit.csv --force f --displacement x --velocity v --domain time \
                  --between-samples held";
    assert_eq!(verdicts(folder, common, "instability"), ["doubtful"]);
    let told = refused(folder, &format!("{common} --validate long.csv"));
    assert!(told.starts_with("error: long.csv: the identified system is unstable"), "{told}");
    assert!(told.contains("grows e-fold every 0.100 s"), "{told}");
}

/// Every estimator reports the same fault of a faulty channel.
#[test]
fn what_is_wrong_with_a_channel_is_named() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let sampling = Sampling::new(0.01, 256).unwrap();
    let force = Multisine::flat((4..=60).step_by(2), 2.0, Phases::Random { seed: 4 }).unwrap();
    let force = force.sample(sampling).unwrap().repeated(8).unwrap();
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let part = |motion: &Response, first: usize| {
        let cut = |record: &Record| record.window(first, 1024).unwrap();
        let [x, v, a] = [motion.displacement(), motion.velocity(), motion.acceleration()];
        Response::new(cut(x), cut(v), cut(a)).unwrap()
    };
    let at = force.window(64, 1024).unwrap();
    write(folder, "right.csv", &at, &part(&motion, 64), 0.001);
    write(folder, "late.csv", &at, &part(&motion, 61), 0.001);
    let level = 0.5 * at.data().amax();
    let cut = Record::new(at.sampling(), at.data().map(|f| f.clamp(-level, level))).unwrap();
    write(folder, "cut.csv", &cut, &part(&motion, 64), 0.001);
    let [x, v, a] = [motion.displacement(), motion.velocity(), motion.acceleration()];
    let milli = Record::new(force.sampling(), v.data() * 1e3).unwrap();
    let milli = Response::new(x.clone(), milli, a.clone()).unwrap();
    write(folder, "milli.csv", &at, &part(&milli, 64), 0.001);
    let spectra = "--force f --displacement x --period 256";
    let random = "--force f --displacement x --from-frf h1 --segment 256 --lines 4:2:60";
    let time = "--force f --displacement x --velocity v --domain time";
    let all = [spectra, random, time];
    for (record, subject, ways) in [
        ("late.csv", "delay", &all[..]),
        ("cut.csv", "range", &all),
        ("milli.csv", "kinematics", &all[2..]),
    ] {
        for way in ways {
            let said = verdicts(folder, &format!("identify {record} {way}"), subject);
            assert_eq!(said, ["bad"], "{record} {way}");
            assert!(verdicts(folder, &format!("identify right.csv {way}"), subject).is_empty());
        }
    }
    let swapped = "--force x --displacement f";
    let said = verdicts(folder, &format!("identify right.csv {swapped} --period 256"), "power");
    assert_eq!(said, ["bad"]);
    // The message names the fault even if the fit fails.
    let said = refused(folder, &format!("identify right.csv {swapped} --velocity v --domain time"));
    assert!(said.contains("f changes "), "{said}");
}

#[test]
fn a_dead_channel_is_named_whether_it_can_be_fitted_or_not() {
    let place = tempfile::tempdir().unwrap();
    for (name, dead) in [("zero.csv", 0.0), ("offset.csv", 0.25)] {
        let row = |k: i32| format!("{},{},{dead},{}\n", 0.01 * f64::from(k), k % 7, k % 5);
        let text = format!("t,f,x,v\n{}", (0..400).map(row).collect::<String>());
        std::fs::write(place.path().join(name), text).unwrap();
    }
    let said = |way: &str| refused(place.path(), &format!("identify {way}"));
    let zero = said("zero.csv --force f --displacement x");
    assert!(zero.starts_with("error: the data do not determine m, c, k"), "{zero}");
    assert!(zero.contains("; x is 0 in all 400 samples"), "{zero}");
    let time = said("offset.csv --force f --displacement v --velocity x --domain time");
    assert!(time.contains("; x is 0.25 in all 400 samples"), "{time}");
    // The spectrum of a constant consists of rounding errors, so the fit gives a result; a check
    // must report the fault.
    let way = "identify offset.csv --force f --displacement x";
    assert_eq!(verdicts(place.path(), way, "range"), ["bad"]);
}

/// Noise on displacement, velocity and acceleration biases least squares on the equation of motion,
/// and a check reports the bias.
#[test]
fn noise_that_biases_least_squares_in_time_is_told() {
    let place = tempfile::tempdir().unwrap();
    let force = Multisine::flat(4..=60, 2.0, Phases::Random { seed: 6 }).unwrap();
    let force = force.sample(Sampling::new(0.01, 256).unwrap()).unwrap().repeated(8).unwrap();
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let [x, v, a] = [motion.displacement(), motion.velocity(), motion.acceleration()];
    for (name, share) in [("clean.csv", 0.0), ("noisy.csv", 0.05)] {
        let [x, v, a] = [(x, 1), (v, 2), (a, 3)].map(|(record, seed)| match share {
            0.0 => record.clone(),
            _ => noisy(record, share, seed),
        });
        let columns = [("f", &force), ("x", &x), ("v", &v), ("a", &a)];
        let columns = columns.map(|(name, record)| (name.to_owned(), record.channel(0)));
        let text = mechid::io::csv_text(force.sampling(), &columns);
        std::fs::write(place.path().join(name), text).unwrap();
        let command = format!(
            "identify {name} --force f --displacement x --velocity v --acceleration a --domain time"
        );
        let said = verdicts(place.path(), &command, "bias");
        assert_eq!(said.len(), usize::from(share > 0.0), "{said:?}");
    }
    // If the derivatives cause the bias, the report proposes another method.
    let command = "identify noisy.csv --force f --acceleration a --domain time \
                   --derivatives spectral";
    let said = mechid(place.path(), command);
    assert!(said.contains("whole periods on the excited lines only"), "{said}");
}
