//! Analyses with a time limit. The limits count steps, so that no test depends on a clock.

use mechid_analysis::identify::{Method, Nonlinear, Source, TermEstimator, TermFit};
use mechid_analysis::modes::ModalTest;
use mechid_analysis::{
    AnalysisError, Channels, DecaySettings, ElementData, Identified, Identify, IdentifyElements,
    Measurement, ModesSettings, ResponseQuantity, SavedAnalysis, decay, identify,
    identify_elements, identify_responses, modes, time_limit,
};
use mechid_numerics::time_limit::{TimeLimit, ended, within};
use mechid_signal::{Sampling, noise};
use nalgebra::Complex;
use serde::Serialize;

use super::modes::plain;

/// Numbers of polls after which the work ends.
const POLLS: [u64; 4] = [0, 1, 5, 40];

fn example(file: &str) -> String {
    format!("{}/../../examples/{file}", env!("CARGO_MANIFEST_DIR"))
}

/// Ends the `work` after each of several numbers of polls. A result must report the time limit if,
/// and only if, a search ended early. A failure must be due to the limit, because `work` without a
/// limit succeeds.
fn says_so<T: Serialize>(work: impl Fn() -> Result<T, AnalysisError>) {
    let json = |result: &T| serde_json::to_string(result).unwrap();
    let whole = json(&work().unwrap());
    let unlimited = within(Some(TimeLimit::from_polls(u64::MAX)), &work).unwrap();
    assert_eq!(json(&unlimited), whole, "a limit that is not reached changes the result");
    assert!(!whole.contains("time limit"), "{whole}");
    for polls in POLLS {
        let limited = || (work(), ended());
        let (result, ended) = within(Some(TimeLimit::from_polls(polls)), limited);
        match result {
            Ok(result) => {
                let says = json(&result).contains("the time limit of 0 s ended the work early");
                assert_eq!(says, ended.is_some(), "{polls} polls");
            }
            Err(error) => assert!(ended.is_some(), "{polls} polls: {error}"),
        }
    }
}

fn machine() -> Measurement {
    let channels = Channels::new("force", ResponseQuantity::Displacement, "displacement");
    Measurement::open(example("machine.csv"), &channels).unwrap()
}

#[test]
fn a_machine_is_identified_as_far_as_the_time_allows() {
    let likely = Identify::spectra(Method::MaximumLikelihood);
    let (open, periods) = ([machine()], [machine().period(256).unwrap()]);
    says_so(|| identify(&open, &likely));
    says_so(|| identify(&periods, &likely));
    let terms: Nonlinear = "k3: x1^3".parse().unwrap();
    let estimator = TermEstimator::OutputError;
    let terms = Identify::from(Source::Terms(TermFit { terms, estimator, ..TermFit::default() }));
    says_so(|| identify(&periods, &terms));
}

#[test]
fn a_table_of_responses_has_a_limit() {
    // Every twentieth line is sufficient for this test, and makes it faster.
    let mut table = plain([1.0; 3], 1);
    let thin = |values: &[Complex<f64>]| values.iter().step_by(20).copied().collect();
    table.functions.iter_mut().for_each(|function| function.values = thin(&function.values));
    table.frequency_hz = table.frequency_hz.iter().step_by(20).copied().collect();
    says_so(|| identify_responses(&[table.clone()], &Default::default()));
}

#[test]
fn the_result_is_the_best_so_far() {
    let how = Identify::spectra(Method::MaximumLikelihood);
    let test = [machine().period(256).unwrap()];
    let misfit = |found: &Identified| found.summary().fit.misfit_ratio.unwrap();
    let whole = misfit(&identify(&test, &how).unwrap());
    let mut last = f64::INFINITY;
    for polls in 0..12 {
        let found = within(Some(TimeLimit::from_polls(polls)), || identify(&test, &how)).unwrap();
        let now = misfit(&found);
        assert!(now <= last * (1.0 + 1e-9) && now >= whole * (1.0 - 1e-9), "{polls}: {now} {last}");
        last = now;
    }
    assert!((last / whole - 1.0).abs() < 1e-6, "{last} {whole}");
}

#[test]
fn coefficients_of_elements_have_a_limit() {
    let drawing = std::fs::read_to_string(example("frame/frame.json")).unwrap();
    let how = IdentifyElements::new(serde_json::from_str(&drawing).unwrap());
    let record = Measurement::open(example("frame/frame.csv"), &how.channels().unwrap()).unwrap();
    let data = ElementData::from_records(&[record], &how).unwrap();
    says_so(|| identify_elements(&data, &how));
}

#[test]
fn modes_have_a_limit() {
    let channels = Channels::new("force", ResponseQuantity::Acceleration, "a1,a2");
    let hammer = [Measurement::open(example("hammer-1.csv"), &channels).unwrap()];
    says_so(|| modes(&hammer, &ModesSettings::default()));
    let channels = Channels::from_responses(ResponseQuantity::Acceleration, "a1,a2,a3");
    let free = Measurement::open(example("decay.csv"), &channels).unwrap();
    says_so(|| decay(&free, &DecaySettings::default()));
    let test = ModalTest::Decay { from_s: None, to_s: None };
    let settings = ModesSettings { test, ..ModesSettings::default() };
    says_so(|| modes(std::slice::from_ref(&free), &settings));
    let test = ModalTest::Ambient { without_hz: Vec::new(), without_harmonics: false };
    let settings = ModesSettings { test, modes: Some(1), ..ModesSettings::default() };
    let ambient = [ambient()];
    says_so(|| modes(&ambient, &settings));
}

/// Response of one mode at 9 Hz with 2 % damping to white noise, at two points.
fn ambient() -> Measurement {
    let sampling = Sampling::from_rate_hz(64.0, 4000).unwrap();
    let driven = noise::white(sampling, 3, 1.0, 7).unwrap();
    let pole = Complex::from_polar((-0.02 * 0.884_f64).exp(), 0.884);
    let mut mode = vec![0.0, 0.0];
    for k in 2..sampling.len() {
        let next = 2.0 * pole.re * mode[k - 1] - pole.norm_sqr() * mode[k - 2];
        mode.push(next + driven.channel(0)[k]);
    }
    let at = |size: f64, channel: usize| -> Vec<f64> {
        let noise = driven.channel(channel);
        mode.iter().zip(noise).map(|(x, e)| size * x + 0.3 * e).collect()
    };
    let (x, y) = (at(1.0, 1), at(-0.7, 2));
    let channels = Channels::from_responses(ResponseQuantity::Acceleration, "x,y");
    Measurement::from_columns(sampling, &[("x", &x[..]), ("y", &y[..])], &channels).unwrap()
}

#[test]
fn a_limit_without_a_result_is_named() {
    let channels = Channels::from_responses(ResponseQuantity::Acceleration, "a1,a2,a3");
    let free = Measurement::open(example("decay.csv"), &channels).unwrap();
    let none = time_limit::within(Some(0.0), || decay(&free, &DecaySettings::default()));
    let error = none.unwrap_err();
    assert_eq!(error.code(), "analysis.time-limit");
    assert!(error.to_string().contains("time limit of 0 s"), "{error}");
    for seconds in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = time_limit::within(Some(seconds), || Ok::<_, AnalysisError>(()));
        assert_eq!(refused.unwrap_err().code(), "analysis.setting");
    }
    // If the file is missing, the error is the read error, not the time limit.
    let lost = time_limit::within(Some(0.0), || Measurement::open("lost.csv", &channels));
    assert_eq!(lost.unwrap_err().code(), "io.read");
}

#[test]
fn the_limit_of_a_record_is_in_its_row() {
    let analysis = SavedAnalysis {
        channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
        identify: Identify::spectra(Method::MaximumLikelihood),
        ..SavedAnalysis::default()
    };
    let limited = SavedAnalysis { time_limit: Some(0.0), ..analysis.clone() };
    assert!(!serde_json::to_string(&analysis).unwrap().contains("time_limit"));
    let codes = |analysis: &SavedAnalysis| -> Vec<String> {
        let row = analysis.row("rig", || analysis.open(example("machine.csv")));
        assert_eq!(row.error, None);
        row.findings.into_iter().map(|finding| finding.code).collect()
    };
    assert!(codes(&limited).contains(&"time_limit".to_owned()));
    // `SavedAnalysis::row` ignores a time limit that the calling code sets.
    let around = within(Some(TimeLimit::from_polls(0)), || codes(&analysis));
    assert!(!around.contains(&"time_limit".to_owned()));
}

/// The fits of forty exact periods of 250 samples, without noise, end within 300 polls of the time
/// limit and give the exact mass. The response is the sum of its lines in closed form.
#[test]
fn ten_thousand_rows_without_noise_take_few_steps() {
    let (period, periods) = (250, 40);
    let sampling = Sampling::from_rate_hz(128.0, period * periods).unwrap();
    let [mass, damping, stiffness] = [25.0, 188.5, 142_122.0];
    let lines = (1..=60).map(|line| {
        let omega = std::f64::consts::TAU * f64::from(line) * 128.0 / period as f64;
        let phase = -std::f64::consts::PI * f64::from(line * line) / 60.0;
        let dynamic = Complex::new(stiffness - mass * omega * omega, damping * omega);
        (omega, Complex::from_polar(1.0, phase), dynamic)
    });
    let lines: Vec<_> = lines.collect();
    let sum = |value: &dyn Fn(Complex<f64>, Complex<f64>) -> Complex<f64>| -> Vec<f64> {
        let at = |t: f64| {
            let part = |(omega, force, dynamic): &(f64, Complex<f64>, Complex<f64>)| {
                (value(*force, *dynamic) * Complex::from_polar(1.0, omega * t)).re
            };
            lines.iter().map(part).sum()
        };
        sampling.times().map(at).collect()
    };
    let (force, displacement) = (sum(&|force, _| force), sum(&|force, dynamic| force / dynamic));
    let channels = Channels::new("f", ResponseQuantity::Displacement, "x");
    let columns = [("f", &force[..]), ("x", &displacement[..])];
    let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
    for how in [Identify::default(), Identify::spectra(Method::MaximumLikelihood)] {
        for test in [test.clone(), test.clone().period(period).unwrap()] {
            let fit = || (identify(&[test], &how).unwrap(), ended());
            let (found, ended) = within(Some(TimeLimit::from_polls(300)), fit);
            assert_eq!(ended, None);
            let found = found.estimate().parameter("m").unwrap().value;
            assert!((found / mass - 1.0).abs() < 1e-6, "{found}");
        }
    }
}

/// The operations of a search do not depend on the number of threads, so a limit of operations ends
/// it at the same step.
#[test]
fn a_limit_of_operations_gives_the_same_result_with_any_number_of_threads() {
    let how = Identify::spectra(Method::MaximumLikelihood);
    let test = [machine()];
    let with = |threads: usize, operations: f64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let limit = Some(TimeLimit::from_operations(operations));
            within(limit, || (identify(&test, &how).map_err(|e| e.to_string()), ended()))
        })
    };
    let mut early = 0;
    for operations in [0.0, 1e5, 1e6, 3e6, 1e7, f64::MAX] {
        let (result, ended) = with(1, operations);
        let (again, ended_again) = with(2, operations);
        let json = |result: &Result<Identified, String>| match result {
            Ok(identified) => serde_json::to_string(identified).unwrap(),
            Err(error) => error.clone(),
        };
        assert_eq!((json(&result), ended), (json(&again), ended_again), "{operations}");
        if let Ok(identified) = &result {
            let says = json(&result).contains("the searches reached the limit of the work");
            assert_eq!(says, ended.is_some(), "{operations}: {}", identified.summary().file);
        }
        early += usize::from(ended.is_some());
    }
    assert!((1..6).contains(&early), "{early} of 6 limits ended a search");
}
