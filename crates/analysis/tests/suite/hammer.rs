//! Hammer tests of two masses; the reference is their response in closed form.

use mechid_analysis::identify::{Band, LineChoice};
use mechid_analysis::modes::ModalTest;
use mechid_analysis::{
    AnalysisError, Channels, FrfSettings, HitRule, Identified, Identify, IdentifyResponses,
    Measurement, ModesSettings, ResponseQuantity, frf, frf_of_records, identify,
    identify_responses, modes,
};
use mechid_checks::{Cause, Subject};
use mechid_io::FrequencyResponses;
use mechid_model::Sdof;
use mechid_problems::{HammerRecord, HammerTest, exact_harmonic_periodic};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, Window, noise};
use nalgebra::{Complex, DMatrix, dmatrix};
use rayon::prelude::*;

use crate::acquisition::{cause, coupled};

const ACCELERATION: ResponseQuantity = ResponseQuantity::Acceleration;

/// Two masses with modes at 24 and 61 Hz, struck five times in 2.5 s.
fn rig(quantity: ResponseQuantity) -> HammerTest {
    HammerTest {
        frequencies_hz: vec![24.0, 61.0],
        damping_ratios: vec![0.01, 0.015],
        shapes: dmatrix![0.3, -0.2; 0.25, 0.35],
        sampling: Sampling::from_rate_hz(1024.0, 2560).unwrap(),
        quantity,
        hits: 5,
        peak: 200.0,
        duration: 0.01,
        force_noise: 0.01,
    }
}

fn measured(rig: &HammerTest, record: &HammerRecord, dof: usize) -> Measurement {
    let response = &record.response;
    let columns =
        [("f", record.force.channel(0)), ("x1", response.channel(0)), ("x2", response.channel(1))];
    let channels = Channels::new("f", rig.quantity, "x1,x2");
    let channels = &channels.struck(&[dof + 1], 1).unwrap()[0];
    let test = Measurement::from_columns(record.force.sampling(), &columns, channels).unwrap();
    test.named(&format!("point {}", dof + 1))
}

/// Hits on one of the masses with noise on the response; two of the five hits are bad.
fn hammer(rig: &HammerTest, dof: usize, seed: u64) -> Measurement {
    let record = rig.measure(dof, 2, 2 * seed + dof as u64).unwrap();
    let level = match rig.quantity {
        ResponseQuantity::Acceleration => 0.05,
        _ => 2e-6,
    };
    let level = NoiseLevel::StandardDeviation(level);
    let seed = 1_000_000 + 2 * seed + dof as u64;
    let response = noise::add_white(&record.response, level, seed).unwrap();
    measured(rig, &HammerRecord { response, ..record }, dof)
}

const BAND: Band = Band { low_hz: 2.0, high_hz: 150.0 };

fn hits(rule: HitRule) -> Identify {
    Identify::hits(rule).lines(LineChoice::Band(BAND))
}

fn settings() -> Identify {
    hits(HitRule::default())
}

fn roving(quantity: ResponseQuantity, seed: u64) -> Identified {
    let rig = rig(quantity);
    identify(&[hammer(&rig, 0, seed), hammer(&rig, 1, seed)], &settings()).unwrap()
}

/// The same test with a force channel for each mass. The channel of the mass that is not struck has
/// noise and a part of the other force.
fn with_both_forces(rig: &HammerTest, dof: usize, noise_n: f64, part: f64) -> Measurement {
    let record = rig.measure(dof, 2, dof as u64).unwrap();
    let level = NoiseLevel::StandardDeviation(0.05);
    let response = noise::add_white(&record.response, level, 7).unwrap();
    let struck = record.force.channel(0);
    let channel = noise::white(record.force.sampling(), 1, noise_n, 8).unwrap();
    let other: Vec<f64> =
        channel.channel(0).iter().zip(struck).map(|(noise, f)| noise + part * f).collect();
    let mut forces = [struck, &other];
    forces.swap(0, dof);
    let force = Record::from_channels(record.force.sampling(), &forces).unwrap();
    Measurement::from_records(&force, &[(rig.quantity, &response)]).unwrap()
}

/// Reference: the same test with zeros in the force channel of the mass that is not struck. If this
/// channel contains a few per cent of the other force, it counts as a force.
#[test]
fn a_column_that_shows_noise_alone_is_no_second_hammer() {
    let rig = rig(ACCELERATION);
    let both = |noise_n, part| [0, 1].map(|dof| with_both_forces(&rig, dof, noise_n, part));
    let exact = identify(&both(0.0, 0.0), &settings()).unwrap();
    let is_told = |remark: &&String| remark.contains("contains only noise");
    assert_eq!(exact.summary().remarks.iter().filter(is_told).count(), 0);
    for noise_n in [0.05, 0.2, 2.0] {
        let found = identify(&both(noise_n, 0.0), &settings()).unwrap();
        assert_eq!(found.summary().remarks.iter().filter(is_told).count(), 2, "{found}");
        for (one, other) in found.estimate().parameters().zip(exact.estimate().parameters()) {
            assert!((one.value - other.value).abs() < 1e-9 * other.value.abs(), "{found}");
        }
        let settings = FrfSettings { hits: Some(HitRule::default()), ..FrfSettings::default() };
        let table = frf(&both(noise_n, 0.0)[0], &settings).unwrap();
        assert_eq!((table.responses.len(), table.remarks.iter().filter(is_told).count()), (2, 1));
    }
    for noise_n in [0.0, 0.2] {
        let refused = identify(&both(noise_n, 0.02), &settings()).unwrap_err();
        assert!(refused.to_string().contains("2 forces act"), "{refused}");
    }
}

/// The responses are late or early by whole samples, as with a converter that scans its channels.
/// The check of the delay must find this number of samples.
#[test]
fn a_late_response_to_hits_is_told_by_its_delay() {
    for (late, seed) in [(0_isize, 2), (3, 0), (1, 1), (-2, 0)] {
        let rig = rig(ACCELERATION);
        let tests: Vec<Measurement> = (0..2)
            .map(|dof| {
                let record = rig.measure(dof, 0, 2 * seed + dof as u64).unwrap();
                let all = record.response.data();
                let data = DMatrix::from_fn(all.nrows(), all.ncols(), |row, column| {
                    row.checked_add_signed(-late)
                        .and_then(|at| all.get((at, column)))
                        .copied()
                        .unwrap_or(0.0)
                });
                let response = Record::new(record.response.sampling(), data).unwrap();
                let level = NoiseLevel::StandardDeviation(0.05);
                let response = noise::add_white(&response, level, 90 + seed).unwrap();
                measured(&rig, &HammerRecord { response, ..record }, dof)
            })
            .collect();
        let found = identify(&tests, &settings()).unwrap();
        let checks = found.summary().checks.iter();
        let delays: Vec<f64> = checks
            .filter(|check| check.subject == Subject::Delay)
            .filter_map(|check| check.value)
            .collect();
        // The hits have the same kinds of findings, which the text states once.
        let warnings = found.summary().checks.iter().filter(|check| check.is_conspicuous());
        let whiteness = warnings.filter(|check| check.subject == Subject::Whiteness).count();
        let text = found.to_string();
        let lines = text.lines().filter(|line| line.starts_with("  whiteness: ")).count();
        assert_eq!(whiteness > lines, late != 0, "{whiteness} {lines}");
        assert_eq!(text.contains(" (likewise in "), late != 0, "{text}");
        match late {
            0 => assert!(delays.is_empty(), "{delays:?}"),
            _ => assert!(
                matches!(delays[..], [samples] if (samples - late as f64).abs() < 0.05),
                "{late}: {delays:?}"
            ),
        }
    }
}

/// Reference: the true modes, and a first-order high-pass of the responses at 3 Hz, exact on the
/// lines of the record. The corner frequency is approximate, because each window also begins with a
/// transient of the high-pass itself, which the fit does not model.
#[test]
fn ac_coupled_responses_to_hits_are_named() {
    let rig = rig(ACCELERATION);
    (0..3).into_par_iter().for_each(|seed| {
        let tests = [0, 1].map(|dof| {
            let record = rig.measure(dof, 0, 2 * seed + dof as u64).unwrap();
            let level = NoiseLevel::StandardDeviation(0.02);
            let response = noise::add_white(&coupled(&record.response, 3.0), level, 900 + seed);
            measured(&rig, &HammerRecord { response: response.unwrap(), ..record }, dof)
        });
        let found = identify(&tests, &settings()).unwrap();
        let Some(Cause::AcCoupling { channels, corner_hz }) = cause(&found) else {
            panic!("{found}")
        };
        assert_eq!(channels.len(), 2, "{channels:?}");
        assert!((corner_hz - 3.0).abs() < 0.6, "{corner_hz}");
        for (mode, ratio) in found.summary().modes.iter().zip(&rig.damping_ratios) {
            let damping = &mode.row.damping_ratio;
            let [low, high] = damping.interval.unwrap();
            assert!((low..=high).contains(ratio), "{low} to {high} for {ratio}");
            assert!(damping.standard_error.unwrap() < 0.2 * ratio, "{found}");
        }
    });
}

/// Noise of 0.5 % of the peak on the samples of a pulse is common to all lines of the hit: this
/// noise increases the standard errors only slightly, and no check of the residual warns of the
/// noise. The probability that fewer than 20 of 24 intervals of modes contain the true value is
/// 0.006.
#[test]
fn noise_of_the_force_is_common_to_all_lines_of_a_hit() {
    let fits = |noise_n: f64| -> Vec<Identified> {
        let rig = HammerTest { force_noise: noise_n, ..rig(ACCELERATION) };
        let seeds = (0..6_u64).into_par_iter();
        seeds
            .map(|seed| {
                let tests: Vec<Measurement> = (0..2)
                    .map(|dof| {
                        let record = rig.measure(dof, 0, 2 * seed + dof as u64).unwrap();
                        let level = NoiseLevel::StandardDeviation(0.02);
                        let response = noise::add_white(&record.response, level, 900 + seed);
                        let response = response.unwrap();
                        measured(&rig, &HammerRecord { response, ..record }, dof)
                    })
                    .collect();
                identify(&tests, &settings()).unwrap()
            })
            .collect()
    };
    let (noisy, quiet) = (fits(1.0), fits(1e-3));
    let warnings = |found: &Identified| {
        found.summary().checks.iter().filter(|check| check.is_conspicuous()).count()
    };
    let warned = noisy.iter().filter(|found| warnings(found) > 0).count();
    assert!(warned <= 1, "{warned} of 6 warn");
    let rig = rig(ACCELERATION);
    let (mut holding, mut squares) = (0, [0.0_f64; 2]);
    for pair in noisy.iter().zip(&quiet) {
        let [noisy, quiet] = [pair.0, pair.1].map(|found| &found.summary().modes);
        for (mode, (hz, ratio)) in rig.frequencies_hz.iter().zip(&rig.damping_ratios).enumerate() {
            let row = &noisy[mode].row;
            for (value, truth) in [(&row.natural_frequency_hz, hz), (&row.damping_ratio, ratio)] {
                let [low, high] = value.interval.unwrap();
                holding += usize::from((low..=high).contains(truth));
            }
            for (square, modes) in squares.iter_mut().zip([noisy, quiet]) {
                *square += modes[mode].row.damping_ratio.standard_error.unwrap().powi(2);
            }
        }
    }
    assert!(holding >= 20, "{holding} of 24");
    let larger = (squares[0] / squares[1]).sqrt();
    assert!((0.9..1.3).contains(&larger), "standard errors are {larger} times as large");
}

/// Six runs give 72 intervals of 95 %, three runs give 36. Only 85 % of them must contain the true
/// value, because the twelve intervals of a run are correlated. The damping ratios scatter by some
/// thousandths of their values.
#[test]
fn a_roving_hammer_finds_the_machine() {
    for (quantity, runs) in [(ACCELERATION, 6), (ResponseQuantity::Displacement, 3)] {
        let truth = rig(quantity).system().unwrap();
        let all: Vec<Identified> =
            (0..runs).into_par_iter().map(|seed| roving(quantity, seed)).collect();
        let (mut held, mut total, mut warned) = (0, 0, 0);
        for found in &all {
            let hits = &found.summary().hits;
            assert_eq!(hits.len(), 10);
            assert_eq!(hits.iter().filter(|hit| hit.used).count(), 6, "{found}");
            assert_eq!(found.summary().records.len(), 6);
            for p in found.estimate().parameters() {
                let entry = (p.parameter.row(), p.parameter.column());
                let [low, high] = p.interval(0.95).unwrap();
                held +=
                    usize::from((low..=high).contains(&truth.matrix(p.parameter.matrix())[entry]));
                total += 1;
            }
            for (mode, ratio) in found.summary().modes.iter().zip([0.01, 0.015]) {
                assert!((mode.row.damping_ratio.value / ratio - 1.0).abs() < 0.02, "{found}");
            }
            warned += usize::from(found.checks().iter().any(|check| check.is_conspicuous()));
        }
        assert!(100 * held >= 85 * total, "{quantity}: {held} of {total}");
        assert!(warned <= 1, "{quantity}: {warned} of {runs} warn");
    }
}

/// The spectra of the hits in the figures are responses to the one force that acts. On every line,
/// the acceleration must agree with that of the machine to within six standard deviations of the
/// noise. This standard deviation is 0.05 m/s² for a sample, and 2/√N times this value for a line
/// of a window of N samples.
#[test]
fn the_receptance_of_hits_is_that_of_the_machine() {
    let truth = rig(ACCELERATION).system().unwrap();
    let found = roving(ACCELERATION, 1);
    let data = found.drawn_spectra().unwrap();
    assert_eq!(data.len(), found.spectra().unwrap().len());
    let samples =
        found.summary().records.iter().map(|hit| hit.window.period_samples).min().unwrap();
    let noise = 0.05 * 2.0 / (samples as f64).sqrt();
    let (mut seen, mut largest, mut worst) = ([0; 2], 0.0_f64, 0.0_f64);
    for (row, omega) in data.omega().iter().enumerate() {
        let struck = usize::from(data.force()[(row, 0)] == Complex::ZERO);
        assert_eq!(data.force()[(row, 1 - struck)], Complex::ZERO, "row {row}");
        seen[struck] += 1;
        let h = truth.receptance(*omega).unwrap();
        for motion in 0..2 {
            let measured = data.displacement()[(row, motion)];
            let exact = h[(motion, struck)] * data.force()[(row, struck)];
            let square = omega * omega;
            largest = largest.max(square * exact.norm());
            worst = worst.max(square * (measured - exact).norm());
        }
    }
    assert!(seen.iter().all(|lines| *lines > 200), "{seen:?}");
    let coherence = found.coherence().unwrap().expect("six hits on two places");
    assert_eq!((coherence.averages.as_str(), coherence.values.ncols()), ("6 hits", 2));
    assert!(coherence.frequency_hz.iter().all(|hz| (2.0..=150.0).contains(hz)));
    assert!(coherence.values.iter().all(|value| (0.0..=1.0).contains(value)));
    assert!(worst < 6.0 * noise && worst < 0.01 * largest, "{worst} of {largest}, noise {noise}");
}

#[test]
fn hits_that_are_left_out_are_told_with_their_reasons() {
    let found = roving(ACCELERATION, 3);
    let text = found.to_string();
    let (first, _) = text.split_once("\n").unwrap();
    assert_eq!(first, "point 1: 3 of 5 hits on degree of freedom 1 used, 1024 Hz");
    let bad: Vec<_> = found.summary().hits.iter().filter(|hit| !hit.used).collect();
    assert_eq!(bad.len(), 4);
    for hit in bad {
        assert!(text.contains(&format!("  {hit}\n")) && !hit.reasons.is_empty(), "{text}");
    }
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["file"], "point 1");
    assert_eq!(json["hits"].as_array().unwrap().len(), 10);
    assert_eq!(json["analysis"]["hits"]["trigger_percent"], 0.5);
    // Saved settings without a rule for hits do not have the field `hits`.
    let one = serde_json::to_value(Identify::default()).unwrap();
    assert!(one.get("hits").is_none());
}

/// A tap of 3 % of the usual force between two hits is too light to be a double hit. If the force
/// did not include the tap, the response to the tap would be attributed to the hit before it.
#[test]
fn light_taps_between_hits_are_listed_and_cost_no_good_hit() {
    let rig = rig(ACCELERATION);
    let tap = HammerTest { hits: 1, peak: 6.0, force_noise: 0.0, ..rig.clone() };
    let (mut inside, mut all) = (0, 0);
    for seed in 0..10 {
        let hits = rig.measure(0, 0, seed).unwrap();
        let tap = tap.measure(0, 0, seed).unwrap();
        let sum = |a: &Record, b: &Record| Record::new(a.sampling(), a.data() + b.data()).unwrap();
        let level = NoiseLevel::StandardDeviation(0.05);
        let response = sum(&hits.response, &tap.response);
        let response = noise::add_white(&response, level, 3_000_000 + seed).unwrap();
        let force = sum(&hits.force, &tap.force);
        let record = HammerRecord { force, response, hits: hits.hits.clone() };
        let found = identify(&[measured(&rig, &record, 0)], &settings()).unwrap();
        let (rows, at) = (&found.summary().hits, tap.hits[0].0);
        let apart = at - hits.hits[0].0;
        let of_tap = rows.iter().find(|row| (row.time_s - at).abs() < 0.01);
        match of_tap {
            Some(row) => assert!(row.reasons[0].starts_with("weak hit"), "seed {seed}: {row}"),
            // A tap soon after a hit counts as part of that hit.
            None => assert!(apart < 0.12, "seed {seed}: {apart} s"),
        }
        let used = rows.iter().filter(|row| row.used).count();
        assert!(used == 5 || (used == 4 && apart < 0.16), "seed {seed}: {used} used, {apart} s");
        if of_tap.is_none() {
            continue;
        }
        for (mode, truth) in found.summary().modes.iter().zip(&rig.damping_ratios) {
            let [low, high] = mode.row.damping_ratio.interval.unwrap();
            inside += usize::from((low..=high).contains(truth));
            all += 1;
        }
    }
    assert!(all >= 14 && inside + 2 >= all, "{inside} of {all}");
}

/// A hammer test that is not cut into hits shows a warning; a record of another test does not.
#[test]
fn a_hammer_test_that_is_not_cut_is_told_of() {
    let rig = rig(ACCELERATION);
    let is_told = |test: &Measurement| {
        let how = Identify::default().lines(LineChoice::Band(BAND));
        let found = identify(std::slice::from_ref(test), &how).unwrap();
        found.summary().remarks.iter().any(|remark| remark.contains("`hits` cuts"))
    };
    assert!(is_told(&hammer(&rig, 0, 1)) && is_told(&hammer(&rig, 1, 2)));
    let sampling = Sampling::from_rate_hz(256.0, 4096).unwrap();
    let force = Multisine::flat(8..=1000, 1.0, Phases::Random { seed: 1 }).unwrap();
    let force = force.sample(sampling).unwrap();
    let machine = Sdof::new(25.0, 188.0, 142_000.0).unwrap().system();
    let exact = exact_harmonic_periodic(&machine, &force).unwrap();
    let x = noise::add_white(exact.displacement(), NoiseLevel::FractionOfRms(0.01), 2).unwrap();
    let responses = [(ResponseQuantity::Displacement, &x)];
    let test = Measurement::from_records(&force, &responses).unwrap();
    let found = identify(std::slice::from_ref(&test), &Identify::default()).unwrap();
    assert!(!found.to_string().contains("`hits`"), "{found}");
}

/// Several records without a period are cut into segments like a single one, unless they end at
/// rest.
#[test]
fn several_random_records_are_not_averaged_whole() {
    let sampling = Sampling::from_rate_hz(256.0, 3000).unwrap();
    let of = |seed: u64, still: bool, draw: u64| {
        let mut force = noise::white(sampling, 1, 1.0, seed).unwrap().channel(0).to_vec();
        if still {
            force[1500..].fill(0.0);
        }
        // The response is that of a mass of 2 kg, with a little noise.
        let noise = noise::white(sampling, 1, 1e-9, 100 + draw).unwrap();
        let response: Vec<f64> =
            force.iter().zip(noise.channel(0)).map(|(f, noise)| 0.5 * f + noise).collect();
        let channels = Channels::new("f", ACCELERATION, "a");
        Measurement::from_columns(sampling, &[("f", &force), ("a", &response)], &channels).unwrap()
    };
    let window = |records: &[Measurement]| {
        let table = frf_of_records(records, &FrfSettings::default()).unwrap();
        (table.segments.window, table.segments.count, table.remarks.len())
    };
    let (of_random, count, remarks) = window(&[0, 1, 2].map(|seed| of(seed, false, seed)));
    assert!(of_random == Some(Window::Hann) && count > 3 && remarks == 1, "{count} {remarks}");
    assert_eq!(window(&[0, 1, 2].map(|seed| of(seed, true, seed))), (None, 3, 0));
    assert_eq!(window(&[0, 1, 2].map(|draw| of(0, false, draw))).0, None);
}

/// Frequency responses have no lines at which the force channel shows only noise.
#[test]
fn lines_without_force_are_left_out_of_segments() {
    let sampling = Sampling::from_rate_hz(256.0, 8192).unwrap();
    for seed in 0..10 {
        let force = Multisine::flat(8..=2048, 1.0, Phases::Random { seed }).unwrap();
        let force = force.sample(sampling).unwrap();
        let response = Record::new(sampling, force.data() * 0.5).unwrap();
        let noisy = |record: &Record, seed: u64| {
            let level = NoiseLevel::FractionOfRms(0.005);
            noise::add_white(record, level, seed).unwrap().channel(0).to_vec()
        };
        let (f, a) = (noisy(&force, 2 * seed), noisy(&response, 2 * seed + 1));
        let channels = Channels::new("f", ACCELERATION, "a");
        let test = Measurement::from_columns(sampling, &[("f", &f), ("a", &a)], &channels).unwrap();
        let table = frf(&test, &FrfSettings::default()).unwrap();
        let last = *table.frequency_hz.last().unwrap();
        // The force ends at 64 Hz.
        assert!((56.0..=66.0).contains(&last), "{last} Hz");
        let largest = table.responses[0].magnitude.iter().copied().fold(0.0, f64::max);
        assert!((largest - 0.5).abs() < 0.02, "{largest}");
        // All lines that the user chose are kept.
        let how = FrfSettings { lines: "1:20".parse().unwrap(), ..FrfSettings::default() };
        assert_eq!(frf(&test, &how).unwrap().frequency_hz.len(), 20);
    }
}

/// Reference: a response measured under an exponential window e^(−σt) at the frequency ω equals the
/// response of the machine at s = iω + σ. Without an exponential window, a remark must report that
/// the response has not decayed at the end of the record.
#[test]
fn frequency_responses_are_those_of_the_machine_with_the_decay_of_the_window() {
    let sampling = Sampling::from_rate_hz(1024.0, 5 * 4096).unwrap();
    let rig = HammerTest { sampling, ..rig(ACCELERATION) };
    let test = measured(&rig, &rig.measure(0, 0, 1).unwrap(), 0);
    let how = FrfSettings {
        hits: Some(HitRule::default()),
        exponential_percent: Some(1.0),
        lines: LineChoice::Band(Band { low_hz: 10.0, high_hz: 100.0 }),
        ..FrfSettings::default()
    };
    let table = frf(&test, &how).unwrap();
    let sigma = table.added_decay.unwrap();
    let duration = table.segments.samples as f64 / 1024.0;
    assert!(((-sigma * duration).exp() / 0.01 - 1.0).abs() < 1e-9);
    assert!(table.remarks.len() == 1 && table.remarks[0].contains("exponential"), "{table}");
    let system = rig.system().unwrap();
    let at = |hz: f64, response: usize| {
        let s = Complex::new(sigma, std::f64::consts::TAU * hz);
        let dynamic = system.mass().map(|m| s * s * m)
            + system.damping().map(|c| s * c)
            + system.stiffness().map(Complex::from);
        dynamic.lu().try_inverse().unwrap()[(response, 0)] * s * s
    };
    for (number, response) in table.responses.iter().enumerate() {
        let (mut apart, mut largest) = (0.0_f64, 0.0_f64);
        for (k, hz) in table.frequency_hz.iter().enumerate() {
            let truth = at(*hz, number);
            let found = Complex::new(response.real[k], response.imaginary[k]);
            (apart, largest) = (apart.max((found - truth).norm()), largest.max(truth.norm()));
        }
        assert!(apart < 0.01 * largest, "{number}: {apart} of {largest}");
    }
    // A written table states its window and the measured quantity; so does a universal file.
    let written = [
        ("a.csv", table.csv()),
        ("a.unv", table.to_responses(&[]).unwrap().to_universal_file().unwrap()),
    ];
    for (name, text) in written {
        let read = FrequencyResponses::parse(name, text.as_bytes()).unwrap();
        assert_eq!(read.added_decay, table.added_decay);
        let how = IdentifyResponses { averages: Some(5.0), ..IdentifyResponses::default() };
        let found = identify_responses(std::slice::from_ref(&read), &how).unwrap();
        assert_eq!(found.summary().quantity, "acceleration");
        for (mode, truth) in found.summary().modes.iter().zip(&rig.damping_ratios) {
            let ratio = mode.row.damping_ratio.value / truth;
            assert!((ratio - 1.0).abs() < 0.02, "{name}: {ratio}");
        }
        let quantity = Some(ResponseQuantity::Velocity);
        let error = identify_responses(&[read], &IdentifyResponses { quantity, ..how });
        let error = error.unwrap_err().to_string();
        assert!(error.contains("states acceleration, not velocity"), "{error}");
    }
    // Only the good hits are averaged.
    assert_eq!((table.hits.len(), table.segments.averages), (5, 5.0));

    let plain = frf(&test, &FrfSettings { exponential_percent: None, ..how.clone() }).unwrap();
    assert!(plain.remarks.is_empty(), "{plain}");
    let short = frf(&hammer(&self::rig(ACCELERATION), 0, 1), &how).unwrap();
    assert!(short.remarks.iter().any(|remark| remark.starts_with("before a hit")), "{short}");
    let short = FrfSettings { exponential_percent: None, ..how };
    let short = frf(&hammer(&self::rig(ACCELERATION), 0, 1), &short).unwrap();
    assert!(short.remarks[0].contains("leakage"), "{short}");
}

#[test]
fn what_hits_cannot_be_found_in_is_refused() {
    let rig = rig(ACCELERATION);
    let test = hammer(&rig, 0, 1);
    let refused = |how: &Identify| match identify(std::slice::from_ref(&test), how).unwrap_err() {
        AnalysisError::Setting { setting: "hits", why } => why,
        other => panic!("{other}"),
    };
    refused(&hits(HitRule { trigger_percent: -1.0, ..HitRule::default() }));
    // With windows of 2,000 samples, no hit has a complete window in the record.
    let how = hits(HitRule { samples: Some(2000), ..HitRule::default() });
    let error = identify(std::slice::from_ref(&test), &how).unwrap_err();
    assert!(matches!(error, AnalysisError::NoHit { .. }), "{error}");
    let error = identify(&[test.clone().period(512).unwrap()], &settings()).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "hits", .. }), "{error}");

    let channels = Channels::new("f", ACCELERATION, "x1,x2");
    for (dofs, records) in [(vec![1], 2), (vec![3], 1), (vec![0], 1)] {
        assert!(channels.struck(&dofs, records).is_err(), "{dofs:?}");
    }
    assert!(Channels::new("f,g", ACCELERATION, "x1,x2").struck(&[1], 1).is_err());
}

/// Records in memory all have the same name, but their hits must be counted once each.
#[test]
fn hits_of_records_with_one_name_are_counted_once() {
    let rig = rig(ACCELERATION);
    let records: Vec<Measurement> =
        (1..4).map(|seed| hammer(&rig, 0, seed).named("the record")).collect();
    let how = FrfSettings { hits: Some(HitRule::default()), ..FrfSettings::default() };
    let table = frf_of_records(&records, &how).unwrap();
    let used = table.hits.iter().filter(|hit| hit.used).count();
    assert_eq!((table.segments.count, used), (used, 9));
    assert_eq!(table.records.iter().map(|record| record.segments).collect::<Vec<_>>(), [3; 3]);
}

/// Two masses with 0.6 and 0.9 % damping, struck every 1.3 s with pulses of six samples: half of
/// the motion remains at the next hit.
fn lightly_damped() -> HammerTest {
    HammerTest {
        frequencies_hz: vec![13.056, 30.829],
        damping_ratios: vec![0.0057, 0.0088],
        shapes: dmatrix![0.27, -0.22; 0.28, 0.36],
        sampling: Sampling::from_rate_hz(512.0, 4096).unwrap(),
        quantity: ACCELERATION,
        hits: 6,
        peak: 150.0,
        duration: 0.012,
        force_noise: 0.02,
    }
}

/// Reference: the closed form. If each hit had a separate transient, the fit could not distinguish
/// the participation of a mode from the transient of a hit. It would find a false mode, which
/// changes the masses by a third.
#[test]
fn hits_in_close_succession_give_modes_and_masses() {
    let rig = lightly_damped();
    for (seed, faults) in [(1, 0), (2, 0), (3, 0), (4, 1), (5, 2)] {
        let test = |dof: usize| {
            let record = rig.measure(dof, faults, 2 * seed + dof as u64).unwrap();
            let level = NoiseLevel::StandardDeviation(0.01);
            let response = noise::add_white(&record.response, level, seed + 100).unwrap();
            let alone = HammerRecord { response, ..record };
            let force = Channels::new("f", ACCELERATION, "x1,x2");
            let columns = [
                ("f", alone.force.channel(0)),
                ("x1", alone.response.channel(0)),
                ("x2", alone.response.channel(1)),
            ];
            Measurement::from_columns(alone.force.sampling(), &columns, &force).unwrap()
        };
        for band_hz in [[3.0, 60.0], [3.0, 150.0]] {
            let mut settings = ModesSettings {
                test: ModalTest::Forced { hits: Some(HitRule::default()) },
                band_hz: Some(band_hz),
                ..ModesSettings::default()
            };
            settings.places.forces = vec!["1".into(), "2".into()];
            settings.places.responses = vec!["1".into(), "2".into()];
            let found = modes(&[test(0), test(1)], &settings).unwrap();
            let rows = &found.summary().modes;
            assert_eq!(rows.len(), 2, "seed {seed}, {band_hz:?}: {found}");
            for (row, shape) in rows.iter().zip(rig.shapes.column_iter()) {
                let (mass, error) =
                    (row.modal_mass.unwrap(), row.modal_mass_standard_error.unwrap());
                let truth = 1.0 / shape.amax().powi(2);
                assert!(
                    (mass - truth).abs() < 4.0 * error + 2e-3 * truth && error < 0.01 * truth,
                    "seed {seed}, {band_hz:?}: {mass} ± {error}, {truth}"
                );
            }
        }
    }
}
