//! Random tests: windows cut from the exact steady state under a random force with a much longer
//! period.

use mechid_analysis::frf::{Estimator, frf};
use mechid_analysis::identify::{ForceNoiseSource, Method, OpenFit, OpenNoise, Source};
use mechid_analysis::sweep::{self, Kind};
use mechid_analysis::{
    AnalysisError, FrfSettings, Identified, Identify, IdentifyResponses, Machine, Measurement,
    ModesSettings, Predict, ResponseQuantity, Segmentation, SweepSettings, identify,
    identify_responses, modes_of_responses, predict, sweep_record,
};
use mechid_checks::Linearity;
use mechid_checks::{Finding, Power, Subject};
use mechid_estimate::Estimate;
use mechid_io::FrequencyResponses;
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::{Fault, RandomTest, exact_harmonic_periodic};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::Pooling;
use nalgebra::{DMatrix, DVector, dmatrix};
use rayon::prelude::*;

const SAMPLES: usize = 2048;
const KIND: ResponseQuantity = ResponseQuantity::Displacement;

/// Oscillator of 10 kg at 25 Hz with a damping ratio of 0.01, sampled at 500 Hz.
fn rig() -> RandomTest {
    let omega = 25.0 * std::f64::consts::TAU;
    let system = Sdof::new(10.0, 0.02 * 10.0 * omega, 10.0 * omega * omega).unwrap().system();
    let sampling = Sampling::new(0.002, SAMPLES).unwrap();
    RandomTest { system, sampling, quantity: KIND, force: 100.0 }
}

/// A measurement with 1 % noise on the response.
fn measured([force, response]: [Record; 2], seed: u64) -> Measurement {
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), seed + 100_000);
    Measurement::from_records(&force, &[(KIND, &noisy.unwrap())]).unwrap()
}

fn random_test(seed: u64) -> Measurement {
    measured(rig().measure(seed).unwrap(), seed)
}

fn holds(identified: &Identified, name: &str) -> bool {
    let truth = match name {
        "m" => rig().system.mass()[(0, 0)],
        "c" => rig().system.damping()[(0, 0)],
        _ => rig().system.stiffness()[(0, 0)],
    };
    let [low, high] = identified.estimate().parameter(name).unwrap().interval(0.95).unwrap();
    (low..=high).contains(&truth)
}

fn warns(identified: &Identified) -> bool {
    identified.summary().checks.iter().any(|check| check.is_conspicuous())
}

fn is_open(identified: &Identified) -> bool {
    let fitted = identified.fitted();
    fitted.drawn.is_some() && fitted.coherence.is_none()
}

/// If the intervals are right, the probability that fewer than 42 of 50 intervals of 95 % contain
/// the true value is 0.002. At most 1 in 50 correct records may warn.
#[test]
fn a_random_test_needs_no_settings() {
    const RUNS: u64 = 50;
    let each: Vec<[bool; 5]> = (0..RUNS)
        .into_par_iter()
        .map(|seed| {
            let found = identify(&[random_test(seed)], &Identify::default()).unwrap();
            let [m, c, k] = ["m", "c", "k"].map(|name| holds(&found, name));
            [is_open(&found), m, c, k, warns(&found)]
        })
        .collect();
    let [open, m, c, k, warned] =
        [0, 1, 2, 3, 4].map(|at| each.iter().filter(|run| run[at]).count());
    assert_eq!(open, 50);
    assert!(m >= 42 && c >= 42 && k >= 42, "{m} {c} {k}");
    assert!(warned <= 4, "{warned} of 50 warn");
}

#[test]
fn several_records_have_ends_of_their_own() {
    let tests: Vec<Measurement> = (0..3).map(random_test).collect();
    let all = identify(&tests, &Identify::default()).unwrap();
    let one = identify(&tests[..1], &Identify::default()).unwrap();
    let error = |found: &Identified| found.estimate().parameter("k").unwrap().standard_error;
    assert!(is_open(&all) && !warns(&all), "{all}");
    // In the band of the fit the coherence equals that of a frequency response of the record.
    let coherence = one.coherence().unwrap().unwrap();
    let table = frf(&tests[0], &FrfSettings::default()).unwrap();
    let skipped =
        table.frequency_hz.iter().position(|hz| *hz >= coherence.frequency_hz[0]).unwrap();
    assert!(coherence.frequency_hz.len() > 30);
    for (at, value) in coherence.values.iter().enumerate() {
        assert_eq!(coherence.frequency_hz[at], table.frequency_hz[skipped + at]);
        assert!((value - table.coherence[0].values[skipped + at]).abs() < 1e-12);
    }
    // With three times the data, the error is smaller by a factor of about √3.
    let gain = error(&one) / error(&all);
    assert!((1.2..2.4).contains(&gain), "{gain}");
}

/// Reference: the generator. The amplitude of the run-out is a tenth of the RMS value of the
/// response, so the RMS of the run-out is 0.1/√2 of that value. The result must list the run-out of
/// each record, but only one remark must report it.
#[test]
fn run_out_is_taken_off_and_told_once() {
    let tests: Vec<Measurement> = (0..2)
        .map(|seed| {
            let [force, response] = rig().measure(seed).unwrap();
            let run_out = Fault::RunOut { rotation_hz: 31.37, amplitudes: vec![0.1] };
            measured([force, run_out.apply(&response, seed).unwrap()], seed)
        })
        .collect();
    let found = identify(&tests, &Identify::default()).unwrap();
    let summary = found.summary();
    assert_eq!(summary.fit.sinusoids.len(), 2);
    for row in &summary.fit.sinusoids {
        assert!((row.frequency_hz - 31.37).abs() < 1e-2, "{row:?}");
        assert!((row.share * 2_f64.sqrt() - 0.1).abs() < 2e-3, "{row:?}");
    }
    let told: Vec<&String> =
        summary.remarks.iter().filter(|remark| remark.contains("run-out")).collect();
    assert!(
        told.len() == 1 && told[0].starts_with("1 sinusoid not caused by the forces"),
        "{told:?}"
    );
    let right = identify(&[random_test(1)], &Identify::default()).unwrap();
    assert!(right.summary().fit.sinusoids.is_empty());
}

/// Reference: the delay that the generator applies. It shifts one whole period of the response in
/// time, and the record is a window cut from this period.
#[test]
fn a_late_response_is_told_by_its_delay() {
    let late = |samples: f64, seed: u64| {
        let [force, response] = rig().period(seed).unwrap();
        let response = Fault::Delay { samples }.apply(&response, seed).unwrap();
        let [force, response] =
            [force, response].map(|all| all.window(SAMPLES / 2 + 1, SAMPLES).unwrap());
        measured([force, response], seed)
    };
    let fitted = |tests: &[Measurement]| {
        let found = identify(tests, &Identify::default()).unwrap();
        let checks = found.summary().checks.iter();
        let delay = checks.filter(|check| check.subject == Subject::Delay);
        let told: Vec<f64> = delay.filter_map(|check| check.value).collect();
        (found, told)
    };
    let one = |samples: f64, seed: u64| {
        let (found, told) = fitted(&[late(samples, seed)]);
        assert!(
            matches!(told[..], [found] if (found - samples).abs() < 0.03),
            "{samples}, seed {seed}: {told:?}"
        );
        found
    };
    one(-2.0, 0);
    one(0.1, 1);
    // The intervals include the difference between the parameters with and without a correction of
    // the delay.
    let found = one(3.3, 0);
    let system = rig().system;
    let truth = [system.mass(), system.damping(), system.stiffness()];
    let truth =
        truth.iter().flat_map(|matrix| matrix.transpose().iter().copied().collect::<Vec<_>>());
    let held = found.estimate().parameters().zip(truth);
    let held = held.filter(|(p, exact)| (p.value - exact).abs() < 1.96 * p.standard_error);
    let (held, all) = (held.count(), found.estimate().parameters().len());
    assert!(10 * held >= 9 * all, "{held} of {all}: {found}");
    let (_, both) = fitted(&[late(0.5, 4), late(0.5, 5)]);
    assert!(matches!(both[..], [found] if (found - 0.5).abs() < 0.02), "{both:?}");
}

/// Reference: the generator. Two masses with a force on one of them. If the model has no delay, the
/// search finds no minimum in most records with a late response; the error must name the delay.
#[test]
fn a_delay_that_stops_the_search_is_named() {
    let mass = DMatrix::from_diagonal(&DVector::from_vec(vec![1.39, 2.51]));
    let stiffness = dmatrix![9357.0, -6014.0; -6014.0, 6014.0];
    let damping = &stiffness * 3.8e-4 + &mass * 0.052;
    let system = SecondOrderSystem::new(mass, damping, stiffness);
    let sampling = Sampling::from_rate_hz(141.7, SAMPLES).unwrap();
    let rig = RandomTest { system: system.unwrap(), sampling, quantity: KIND, force: 100.0 };
    let told = |samples: f64, seed: u64| {
        let [mut force, _] = rig.period(seed).unwrap();
        force = {
            let mut one = force.data().clone();
            one.column_mut(0).fill(0.0);
            Record::new(force.sampling(), one).unwrap()
        };
        let steady = exact_harmonic_periodic(&rig.system, &force).unwrap();
        let late = Fault::Delay { samples }.apply(steady.displacement(), seed).unwrap();
        let [force, late] = [force, late].map(|all| all.window(SAMPLES / 2, SAMPLES).unwrap());
        match identify(&[measured([force, late], seed)], &Identify::default()) {
            Ok(found) => {
                let delays = found.summary().checks.iter();
                let mut delays = delays.filter(|check| check.subject == Subject::Delay);
                (false, delays.next().map(|check| check.finding.to_string()))
            }
            Err(error) => (true, Some(error.to_string())),
        }
    };
    let late: Vec<_> = (0..8).into_par_iter().map(|seed| told(2.5, seed)).collect();
    let is_named = |text: &Option<String>| {
        text.as_ref().is_some_and(|text| text.contains("the response is 2.5"))
    };
    assert!(late.iter().all(|(_, text)| is_named(text)), "{late:?}");
    assert!(late.iter().filter(|(failed, _)| *failed).count() >= 1, "{late:?}");
    let right: Vec<_> = (0..8).into_par_iter().map(|seed| told(0.0, seed)).collect();
    assert!(right.iter().all(|told| *told == (false, None)), "{right:?}");
}

/// Reference: the generator. A signal of 0.2 % of the force moves the machine, and its spectrum
/// extends above the band. Above the band it looks like noise of the force channel. The noise level
/// must therefore come from the residual, and the intervals must contain the true values. If true
/// noise of the same size replaces the signal, the noise level must come from the lines above the
/// band.
#[test]
fn a_signal_above_the_band_is_no_noise() {
    const RUNS: u64 = 20;
    let rig = rig();
    let told = |seed: u64, is_signal: bool| {
        let [force, response] = rig.period(seed).unwrap();
        let level = NoiseLevel::FractionOfRms(0.002);
        let more = noise::add_white(&force, level, seed + 300_000).unwrap();
        let response = if is_signal {
            exact_harmonic_periodic(&rig.system, &more).unwrap().displacement().clone()
        } else {
            response
        };
        let level = NoiseLevel::FractionOfRms(0.0003);
        let noisy = noise::add_white(&response, level, seed + 400_000).unwrap();
        let [force, noisy] = [more, noisy].map(|all| all.window(SAMPLES / 2, SAMPLES).unwrap());
        let test = Measurement::from_records(&force, &[(KIND, &noisy)]).unwrap();
        let found = identify(&[test], &Identify::default()).unwrap();
        let held = ["m", "c", "k"].iter().filter(|name| holds(&found, name)).count();
        let is_reduced = found.summary().fit.force_noise[0].source == ForceNoiseSource::Residual;
        (is_reduced, held, warns(&found))
    };
    let count = |is_signal: bool| {
        let all: Vec<_> = (0..RUNS).into_par_iter().map(|seed| told(seed, is_signal)).collect();
        let reduced = all.iter().filter(|(is_reduced, ..)| *is_reduced).count();
        let held: usize = all.iter().map(|(_, held, _)| held).sum();
        (reduced, held, all.iter().filter(|(.., warns)| *warns).count())
    };
    let (reduced, held, warned) = count(true);
    assert!(reduced >= 18 && held >= 53 && warned <= 2, "{reduced} {held} {warned}");
    let (reduced, held, warned) = count(false);
    assert!(reduced <= 1 && held >= 53 && warned <= 2, "{reduced} {held} {warned}");
}

/// Reference: the generator. The force has lines up to half the sampling rate, so no line shows its
/// noise of 2 % alone. The residual must show this noise, the intervals must contain the true
/// values, and nothing must be warned of. Without noise, the force must count as exact.
#[test]
fn noise_of_a_force_up_to_half_the_sampling_rate_is_found() {
    const RUNS: u64 = 20;
    let rig = rig();
    let told = |seed: u64, fraction: f64| {
        let sampling = Sampling::new(0.002, 4 * SAMPLES).unwrap();
        let force = noise::white(sampling, 1, 100.0, seed).unwrap();
        let steady = exact_harmonic_periodic(&rig.system, &force).unwrap();
        let noisy = |record: &Record, fraction: f64, seed: u64| {
            let level = NoiseLevel::FractionOfRms(fraction);
            let noisy = noise::add_white(record, level, seed).unwrap();
            noisy.window(SAMPLES / 2, SAMPLES).unwrap()
        };
        let response = noisy(steady.displacement(), 0.01, seed + 500_000);
        let force = noisy(&force, fraction, seed + 600_000);
        let test = Measurement::from_records(&force, &[(KIND, &response)]).unwrap();
        let found = identify(&[test], &Identify::default()).unwrap();
        let held = ["m", "c", "k"].iter().filter(|name| holds(&found, name)).count();
        let source = found.summary().fit.force_noise[0].source;
        (source == ForceNoiseSource::Residual, held, warns(&found))
    };
    let count = |fraction: f64| {
        let all: Vec<_> = (0..RUNS).into_par_iter().map(|seed| told(seed, fraction)).collect();
        let found = all.iter().filter(|(is_found, ..)| *is_found).count();
        let held: usize = all.iter().map(|(_, held, _)| held).sum();
        (found, held, all.iter().filter(|(.., warns)| *warns).count())
    };
    let (found, held, warned) = count(0.02);
    assert!(found >= 19 && held >= 53 && warned <= 1, "{found} {held} {warned}");
    let (found, held, warned) = count(0.0);
    assert!(found <= 2 && held >= 53 && warned <= 1, "{found} {held} {warned}");
}

#[test]
fn a_period_stays_one() {
    let open = |seed: u64| {
        let test = measured(rig().period(seed).unwrap(), seed);
        let how = Identify::spectra(Method::MaximumLikelihood);
        is_open(&identify(&[test], &how).unwrap())
    };
    let wrong = (0..16).into_par_iter().filter(|seed| open(*seed)).count();
    assert_eq!(wrong, 0, "of 16");
    // If the user states the period, the record is not taken for an open one.
    let periods = random_test(0).period(SAMPLES).unwrap();
    assert!(!is_open(&identify(&[periods], &Identify::default()).unwrap()));
}

/// Noise biases least squares, so a single period with visible noise is fitted by maximum
/// likelihood. At least 42 of the 48 intervals of 95 % must contain the true value.
#[test]
fn noise_on_one_period_biases_nothing() {
    let each: Vec<(usize, bool)> = (0..16)
        .into_par_iter()
        .map(|seed| {
            let [force, response] = rig().period(seed).unwrap();
            let noisy =
                noise::add_white(&response, NoiseLevel::FractionOfRms(0.05), seed + 100_000);
            let measured = Measurement::from_records(&force, &[(KIND, &noisy.unwrap())]).unwrap();
            let period = force.len();
            let by = |how: &Identify| identify(&[measured.clone().period(period).unwrap()], how);
            let found = by(&Identify::default()).unwrap();
            let held = ["m", "c", "k"].iter().filter(|name| holds(&found, name)).count();
            let remarks = found.summary().remarks.join("\n");
            assert!(remarks.contains("maximum likelihood was used"), "{remarks}");
            assert!(!holds(&by(&Identify::spectra(Method::LeastSquares)).unwrap(), "m"));
            (held, warns(&found))
        })
        .collect();
    let held: usize = each.iter().map(|(held, _)| held).sum();
    let warned = each.iter().filter(|(_, warned)| *warned).count();
    assert!(held >= 42 && warned <= 1, "{held} of 48, {warned} warn");
}

#[test]
fn an_open_record_has_no_period() {
    let open = Identify::from(Source::Open(OpenFit::default()));
    let error = identify(&[random_test(0).period(SAMPLES).unwrap()], &open).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "extent", .. }), "{error}");
    assert!(is_open(&identify(&[random_test(0)], &open).unwrap()));
    let noise = OpenNoise { response: Pooling::PerLine, force: None };
    let per_line = Identify::from(Source::Open(OpenFit { noise, ..OpenFit::default() }));
    let error = identify(&[random_test(0)], &per_line).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "noise", .. }), "{error}");
}

/// Identifies `runs` records with noise on force and response. Returns the share of the 95 %
/// intervals that contain the true value, the number of records with a warning, and the results.
fn judged(
    rig: &RandomTest,
    force_noise: f64,
    how: &Identify,
    runs: u64,
) -> (f64, usize, Vec<Identified>) {
    let all: Vec<Identified> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let [force, response] = rig.measure(seed).unwrap();
            let level = NoiseLevel::FractionOfRms(force_noise);
            let force = noise::add_white(&force, level, seed + 200_000).unwrap();
            identify(&[measured([force, response], seed)], how).unwrap()
        })
        .collect();
    let holds = |found: &Identified| {
        let held = found.estimate().parameters().filter(|p| {
            let (row, column) = (p.parameter.row(), p.parameter.column());
            let truth = rig.system.matrix(p.parameter.matrix())[(row, column)];
            let [low, high] = p.interval(0.95).unwrap();
            (low..=high).contains(&truth)
        });
        held.count() as f64 / found.estimate().parameters().len() as f64
    };
    let share = all.iter().map(holds).sum::<f64>() / runs as f64;
    let warned = all.iter().filter(|found| warns(found)).count();
    (share, warned, all)
}

fn with_force_noise(force: Option<Vec<f64>>) -> Identify {
    match force {
        None => Identify::default(),
        Some(_) => {
            let noise = OpenNoise { force, ..OpenNoise::default() };
            Identify::from(Source::Open(OpenFit { noise, ..OpenFit::default() }))
        }
    }
}

/// If the intervals are right, the probability that fewer than 88 % of 180 intervals of 95 % (in
/// correlated groups of three) contain the true value is below 0.01. If the noise of 1 % is
/// ignored, a third of the intervals do not contain the true value.
#[test]
fn noise_on_the_force_is_read_above_its_band() {
    let (share, warned, all) = judged(&rig(), 0.01, &with_force_noise(None), 30);
    assert!(share >= 0.88, "{share}");
    assert!(warned <= 3, "{warned} of 30 warn");
    // The RMS of the force is 100 N before band limitation, and 84 N after it. The noise is 1 % of
    // 84 N; 256 lines determine the noise power to about 1/16.
    let levels = all.iter().map(|found| found.summary().fit.force_noise[0].levels_n[0].unwrap());
    let mean = levels.sum::<f64>() / 30.0;
    assert!((mean / 0.837 - 1.0).abs() < 0.03, "{mean}");
    let (exact, ..) = judged(&rig(), 0.01, &with_force_noise(Some(vec![0.0])), 30);
    assert!(exact < share - 0.05, "{exact} taken as exact, {share} with its noise");
}

#[test]
fn a_force_noise_that_is_far_too_large_warns() {
    let how = with_force_noise(Some(vec![30.0]));
    let (.., all) = judged(&rig(), 0.0, &how, 4);
    for found in all {
        let misfit = found.checks().iter().find(|check| check.subject == Subject::Misfit).unwrap();
        assert!(misfit.is_conspicuous(), "{found}");
    }
    // Three levels for one force are refused.
    let refused = identify(&[random_test(0)], &with_force_noise(Some(vec![1.0, 2.0, 3.0])));
    let error = refused.unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "force_noise", .. }), "{error}");
    let period = random_test(0).period(SAMPLES).unwrap();
    let error = identify(&[period], &with_force_noise(Some(vec![1.0]))).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "force_noise", .. }), "{error}");
}

/// Oscillator of 10 kg at 25 Hz with a damping ratio of 0.05; in segments of 512 samples the
/// resonance is 2.6 lines wide.
fn damped() -> RandomTest {
    let omega = 25.0 * std::f64::consts::TAU;
    let system = Sdof::new(10.0, 0.1 * 10.0 * omega, 10.0 * omega * omega).unwrap().system();
    RandomTest { system, ..rig() }
}

/// The window widens the resonance, which biases the damping by several standard errors of the mean
/// of 80 runs. The window also correlates neighbouring lines. The intervals must allow for both
/// effects.
#[test]
fn intervals_of_frequency_responses_hold() {
    let how = Identify::responses(Estimator::H1, Segmentation::with_samples(512));
    let (share, _, all) = judged(&damped(), 0.0, &how, 80);
    assert!(share >= 0.89, "{share}");
    let errors: Vec<f64> = all
        .iter()
        .map(|found| found.summary().modes[0].row.damping_ratio.value / 0.05 - 1.0)
        .collect();
    let mean = errors.iter().sum::<f64>() / 80.0;
    let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 79.0).sqrt();
    assert!(mean.abs() < 3.0 * deviation / 80.0_f64.sqrt(), "{mean} of {deviation}");
}

#[test]
fn resonances_narrower_than_a_line_warn() {
    let lightly = |ratio: f64| {
        let omega = 25.0 * std::f64::consts::TAU;
        let system = Sdof::new(10.0, 20.0 * ratio * omega, 10.0 * omega * omega).unwrap().system();
        RandomTest { system, ..rig() }
    };
    let how = Identify::responses(Estimator::H1, Segmentation::with_samples(512));
    let leaks = |found: &Identified| {
        let mut checks = found.checks().iter();
        checks.find(|check| check.subject == Subject::Leakage).unwrap().is_conspicuous()
    };
    let (.., narrow) = judged(&lightly(0.001), 0.0, &how, 8);
    assert!(narrow.iter().all(leaks));
    let (.., wide) = judged(&damped(), 0.0, &how, 8);
    assert!(!wide.iter().any(leaks));
}

/// Reference: the half-power width 2ζf. A remark must warn for 1 % damping in segments of 256
/// samples (less than one line wide), but not for 5 % in segments of 1,024 samples (five lines
/// wide).
#[test]
fn frequency_responses_tell_of_a_peak_that_the_window_blunts() {
    let told = |rig: RandomTest, samples: usize| {
        let how =
            FrfSettings { segments: Segmentation::with_samples(samples), ..FrfSettings::default() };
        let table = frf(&measured(rig.measure(1).unwrap(), 1), &how).unwrap();
        table.remarks.iter().any(|remark| remark.contains("the window widens the peak"))
    };
    assert!(told(rig(), 256));
    assert!(!told(damped(), 1024));
}

#[test]
fn the_length_of_segments_is_chosen() {
    let table = frf(&random_test(0), &FrfSettings::default()).unwrap();
    let samples = table.segments.samples;
    assert!(samples.is_power_of_two() && (128..=512).contains(&samples), "{samples}");
    assert!(table.segments.averages >= 6.0, "{}", table.segments.averages);
    assert!(table.remarks.iter().any(|remark| remark.contains("were chosen")), "{table}");
    // A record of whole periods is not cut into segments.
    let period = random_test(0).period(512).unwrap();
    assert_eq!(frf(&period, &FrfSettings::default()).unwrap().segments.window, None);
    let how = Identify::responses(Estimator::H1, Segmentation::default());
    assert!(identify(&[random_test(0)], &how).unwrap().to_string().contains("were chosen"));
}

/// Under a random force the errors of averaged responses are largest at the resonances, and there
/// all sensors move together. In segments of 1,024 samples the resonances are two and five lines
/// wide. The 80 intervals are those of frequency and damping ratio.
#[test]
fn intervals_of_modes_of_averaged_responses_hold() {
    let mode = |hz: f64| (std::f64::consts::TAU * hz).powi(2) * 10.0;
    let [low, high] = [mode(25.0), mode(40.0)];
    // Two equal masses with proportional damping: they move in phase in the first mode, and in
    // opposite phase in the second mode.
    let stiffness = dmatrix![low + high, low - high; low - high, low + high] * 0.5;
    let [slow, fast] = [0.02, 0.03].map(|ratio| 2.0 * ratio * 10.0);
    let [slow, fast] = [slow * (low / 10.0).sqrt(), fast * (high / 10.0).sqrt()];
    let damping = dmatrix![slow + fast, slow - fast; slow - fast, slow + fast] * 0.5;
    let pair = SecondOrderSystem::new(dmatrix![10.0, 0.0; 0.0, 10.0], damping, stiffness);
    let system = pair.unwrap();
    let truth = system.modes().unwrap();
    let sampling = Sampling::new(0.002, 32_768).unwrap();
    let rig = RandomTest { system, sampling, quantity: KIND, force: 100.0 };
    let segments = Segmentation::with_samples(1024);
    let how = FrfSettings { segments, ..FrfSettings::default() };
    let held = |seed: u64| {
        let table = frf(&measured(rig.measure(seed).unwrap(), seed), &how).unwrap();
        let table = FrequencyResponses::parse("a.csv", table.csv().as_bytes()).unwrap();
        let settings = ModesSettings { quantity: Some(KIND), ..ModesSettings::default() };
        let found = modes_of_responses(&[table], &settings).unwrap();
        let rows: Vec<_> = found.summary().modes.iter().map(|mode| &mode.mode.row).collect();
        assert_eq!(rows.len(), truth.len(), "{seed}: {found}");
        let holds = |value: f64, interval: Option<[f64; 2]>| {
            usize::from(interval.is_some_and(|[low, high]| (low..=high).contains(&value)))
        };
        let both = rows.iter().zip(&truth).map(|(row, truth)| {
            let hz = truth.natural_frequency() / std::f64::consts::TAU;
            holds(hz, row.natural_frequency_hz.interval)
                + holds(truth.damping_ratio(), row.damping_ratio.interval)
        });
        both.sum::<usize>()
    };
    let held: usize = (0..20_u64).into_par_iter().map(held).sum();
    // On average 76 of 80 intervals contain the true value, with a standard deviation of 2.
    assert!(held >= 70, "{held}");
}

/// A file of averaged responses states its segments and their window, so the bias of the window can
/// be corrected as for the record.
#[test]
fn a_table_of_segments_is_fitted_as_its_record() {
    let test = random_test(3);
    let segments = Segmentation::with_samples(256);
    let how = Identify::responses(Estimator::H1, segments.clone());
    let own = identify(std::slice::from_ref(&test), &how).unwrap();
    let table = frf(&test, &FrfSettings { segments, ..FrfSettings::default() }).unwrap();
    let text = FrequencyResponses::parse("a.csv", table.csv().as_bytes()).unwrap();
    let universal = table.to_responses(&[]).unwrap().to_universal_file().unwrap();
    let universal = FrequencyResponses::parse("a.unv", universal.as_bytes()).unwrap();
    for read in [&text, &universal] {
        let found =
            identify_responses(std::slice::from_ref(read), &IdentifyResponses::default()).unwrap();
        for (p, own) in found.estimate().parameters().zip(own.estimate().parameters()) {
            let apart = (p.value - own.value).abs() / own.standard_error;
            // A file has no spectrum of the force, so neighbouring lines cannot be averaged for the
            // weights.
            assert!(apart < 0.1, "{p} {own}");
            assert!((p.standard_error / own.standard_error - 1.0).abs() < 0.1, "{p} {own}");
        }
        let told = |subject: Subject| {
            let mut checks = found.summary().checks.iter();
            checks.any(|check| check.subject == subject && check.is_conspicuous())
        };
        assert!(told(Subject::Leakage), "a resonance of a quarter of a line");
        let remarks = &found.summary().remarks;
        assert!(remarks.iter().any(|remark| remark.contains("bias of the window")), "{found}");
    }
    // If a file does not state its segments, the damping includes the effect of the window.
    let silent = FrequencyResponses { segments: None, ..text };
    let found = identify_responses(&[silent], &IdentifyResponses::default()).unwrap();
    let damping = |found: &Estimate| found.parameter("c").unwrap().value;
    let [found, own] = [damping(found.estimate()), damping(own.estimate())];
    assert!(found > 1.3 * own, "{found} {own}");
}

/// Displacement of the machine of [`rig`] with dry friction, by Runge–Kutta with 16 steps per
/// sample; the force is linear between samples.
fn with_friction(force: &Record, friction: f64) -> Record {
    const FINER: usize = 16;
    let [m, c, k] = [rig().system.mass(), rig().system.damping(), rig().system.stiffness()]
        .map(|matrix| matrix[(0, 0)]);
    let rate =
        |[x, v]: [f64; 2], f: f64| [v, (f - c * v - k * x - friction * (v / 1e-4).tanh()) / m];
    let (h, f) = (force.sampling().dt() / FINER as f64, force.channel(0));
    let (mut z, mut out) = ([0.0, 0.0], Vec::with_capacity(f.len()));
    for pair in f.windows(2) {
        out.push(z[0]);
        for step in 0..FINER {
            let at =
                |part: f64| pair[0] + (pair[1] - pair[0]) * (step as f64 + part) / FINER as f64;
            let next = |d: [f64; 2], part: f64| [z[0] + part * h * d[0], z[1] + part * h * d[1]];
            let a = rate(z, at(0.0));
            let b = rate(next(a, 0.5), at(0.5));
            let c = rate(next(b, 0.5), at(0.5));
            let d = rate(next(c, 1.0), at(1.0));
            let sum = |i: usize| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0;
            z = [z[0] + h * sum(0), z[1] + h * sum(1)];
        }
    }
    out.push(z[0]);
    Record::from_channel(force.sampling(), out).unwrap()
}

/// The dry friction is 3 % of the RMS force. The linear fit describes a part of it as damping; the
/// residual, a few per cent of the response, has the sign of the velocity. A check must name the
/// friction. The same records without friction must not warn.
#[test]
fn dry_friction_under_a_random_force_is_named() {
    let long = RandomTest { sampling: Sampling::new(0.002, 2 * SAMPLES).unwrap(), ..rig() };
    let told = |seed: &u64, friction: f64| -> Option<Power> {
        let [force, _] = long.measure(*seed).unwrap();
        let found = identify(
            &[measured([force.clone(), with_friction(&force, friction)], *seed)],
            &Identify::default(),
        );
        let found = found.unwrap();
        let mut told = found.checks().iter().filter(|check| check.is_conspicuous());
        told.find_map(|check| match check.finding {
            Finding::Linearity(Linearity { power, .. }) => Some(power),
            _ => None,
        })
    };
    let named =
        (0..8_u64).into_par_iter().filter(|seed| told(seed, 3.0) == Some(Power::VelocitySign));
    assert!(named.count() >= 3);
    assert_eq!((0..4_u64).into_par_iter().filter(|seed| told(seed, 0.0).is_some()).count(), 0);
}

/// Reference: the generator. A window cut from a steady state begins in motion. A machine that
/// starts from rest must not be reported, even if the model is not quite correct and the force acts
/// only at the beginning.
#[test]
fn a_record_that_begins_in_motion_is_told_by_its_prediction() {
    let machine = |stiffer: f64| {
        let system = rig().system;
        let [m, c, k] = [system.mass(), system.damping(), system.stiffness()];
        Machine::known(SecondOrderSystem::new(m.clone(), c.clone(), k * stiffer).unwrap())
    };
    let told = |test: &Measurement, stiffer: f64| {
        let found = predict(test, &machine(stiffer), &Predict::default()).unwrap();
        found.summary().remarks.iter().any(|remark| remark.contains("not at rest"))
    };
    assert!((0..8).all(|seed| told(&random_test(seed), 1.0)));
    let settled = predict(&random_test(0), &machine(1.0), &Predict { settle: Some(500) }).unwrap();
    assert!(settled.summary().remarks.is_empty());
    let sampling = rig().sampling;
    for stiffer in [1.0, 1.02] {
        let hit = |k: usize| if (40..48).contains(&k) { 100.0 } else { 0.0 };
        let force = Record::from_channel(sampling, (0..SAMPLES).map(hit).collect()).unwrap();
        let at_rest = measured([force.clone(), with_friction(&force, 0.0)], 1);
        assert!(!told(&at_rest, stiffer), "{stiffer}");
    }
}

#[test]
fn a_sweep_of_spectra_tells_of_a_window_that_is_no_period() {
    let how = SweepSettings {
        kind: Kind::Decimation,
        settings: "1".parse().unwrap(),
        estimator: sweep::Estimator::LeastSquares,
        ..SweepSettings::default()
    };
    let told = |force: Record, response: Record| {
        let test = measured([force, response], 3);
        let swept = sweep_record(&test, &how, None, &|| ()).unwrap();
        swept.remarks.iter().any(|remark| remark.contains("whole periods"))
    };
    let [force, response] = rig().measure(3).unwrap();
    assert!(told(force, response));
    let [force, response] = rig().period(3).unwrap();
    assert!(!told(force, response));
}

/// A chain of six masses of 2 kg with modes from 22 to 98 Hz.
fn chain(rate_hz: f64, samples: usize) -> RandomTest {
    let stiffness = DMatrix::from_fn(6, 6, |i, j| match i.abs_diff(j) {
        0 => 4e5,
        1 => -2e5,
        _ => 0.0,
    });
    let mass = DMatrix::identity(6, 6) * 2.0;
    let damping = &stiffness * 1.5e-4 + &mass * 0.8;
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    let sampling = Sampling::from_rate_hz(rate_hz, samples).unwrap();
    RandomTest { system, sampling, quantity: KIND, force: 100.0 }
}

/// Six sensors and forces have 108 unknowns. An earlier version fitted records with this number of
/// unknowns as whole periods: checks warned, and about one of eight intervals did not contain the
/// true value. The records must be fitted as open records, without a warning.
#[test]
fn six_random_forces_need_no_settings() {
    let chain = chain(500.0, 2048);
    let (_, warned, all) = judged(&chain, 0.0, &Identify::default(), 2);
    assert!(all.iter().all(is_open));
    assert_eq!(warned, 0);
}

/// With six sensors and forces an earlier version did not correct the bias of the window and gave
/// no warning: the damping ratios of such chains were several standard errors too high.
#[test]
fn intervals_of_frequency_responses_of_six_sensors_hold() {
    let chain = chain(512.0, 32_768);
    let how = Identify::responses(Estimator::H1, Segmentation::with_samples(2048));
    let (share, warned, all) = judged(&chain, 0.0, &how, 2);
    assert!(share >= 0.9 && warned == 0, "{share}, {warned} warn");
    let exact = chain.system.modes().unwrap();
    for found in &all {
        for (mode, exact) in found.estimate().modes().unwrap().iter().zip(&exact) {
            let ratio = &mode.damping_ratio;
            let missed = (ratio.value - exact.damping_ratio()) / ratio.standard_error;
            assert!(missed.abs() < 4.0, "{missed} standard errors of {ratio:?}");
        }
    }
}
