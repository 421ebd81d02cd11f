//! Forces that are constant or linear between samples, and AC-coupled channels; the reference is
//! the exact response.

use std::f64::consts::TAU;

use mechid_analysis::identify::{Acquisition, Form, OpenFit, Source, Structure};
use mechid_analysis::{HitRule, Identified, Identify, Measurement, ResponseQuantity, identify};
use mechid_checks::{Alternative, Cause, Channel, Finding, Quantity};
use mechid_model::{Discretisation, Sdof};
use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_problems::{RandomTest, exact_harmonic_periodic};
use mechid_signal::{NoiseLevel, Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

const HELD: Discretisation = Discretisation::ZeroOrderHold;

/// Returns an oscillator of 3 kg at 8 Hz with a damping ratio of 0.05.
fn light() -> Sdof {
    let omega = TAU * 8.0;
    Sdof::new(3.0, 2.0 * 0.05 * omega * 3.0, 3.0 * omega * omega).unwrap()
}

/// White force of 30 s, sampled at 100 Hz, constant or linear between its samples, and the response
/// from rest with 0.3 % noise.
fn simulated(between: Discretisation, kind: ResponseQuantity, seed: u64) -> Measurement {
    let sampling = Sampling::from_rate_hz(100.0, 3000).unwrap();
    let force = noise::white(sampling, 1, 100.0, seed).unwrap();
    let response = match between {
        Discretisation::ZeroOrderHold => light().held_force_response(&force, 0.0, 0.0),
        _ => light().linear_force_response(&force, 0.0, 0.0),
    };
    let response = response.unwrap();
    let response = match kind {
        ResponseQuantity::Displacement => response.displacement(),
        ResponseQuantity::Velocity => response.velocity(),
        ResponseQuantity::Acceleration => response.acceleration(),
    };
    let noisy = noise::add_white(response, NoiseLevel::FractionOfRms(0.003), seed + 1000);
    Measurement::from_records(&force, &[(kind, &noisy.unwrap())]).unwrap()
}

pub fn cause(found: &Identified) -> Option<Cause> {
    let checks = found.summary().checks.iter().filter(|check| check.is_conspicuous());
    let mut causes = checks.filter_map(|check| match &check.finding {
        Finding::Alternative(Alternative { cause, .. }) => Some(cause.clone()),
        _ => None,
    });
    causes.next()
}

/// Returns the number of parameters whose 95 % interval contains the true value.
fn held(found: &Identified, truth: [f64; 3]) -> usize {
    let holds = |(name, exact): (&str, f64)| {
        let [low, high] = found.estimate().parameter(name).unwrap().interval(0.95).unwrap();
        usize::from((low..=high).contains(&exact))
    };
    ["m", "c", "k"].into_iter().zip(truth).map(holds).sum()
}

fn open(between: Option<Discretisation>, coupled: &[&str]) -> Identify {
    let ac_coupling = coupled.iter().map(|text| text.parse().unwrap()).collect();
    let acquisition = Acquisition { between_samples: between, ac_coupling };
    Identify::from(Source::Open(OpenFit { acquisition, ..OpenFit::default() }))
}

/// If the intervals are right, the probability that fewer than 20 of 24 intervals of 95 % contain
/// the true value is 0.006.
#[test]
fn a_simulated_force_is_named_and_allowed_for() {
    let truth = [light().mass(), light().damping(), light().stiffness()];
    for (between, kind) in [
        (Discretisation::FirstOrderHold, ResponseQuantity::Acceleration),
        (Discretisation::ZeroOrderHold, ResponseQuantity::Displacement),
        (Discretisation::ZeroOrderHold, ResponseQuantity::Acceleration),
    ] {
        let holding = (0..8_u64).into_par_iter().map(|seed| {
            let test = [simulated(between, kind, seed)];
            let found = identify(&test, &open(Some(between), &[])).unwrap();
            assert_eq!(cause(&found), None);
            held(&found, truth)
        });
        let holding: usize = holding.sum();
        assert!(holding >= 20, "{between}, {kind}: {holding}");
        let usual = identify(&[simulated(between, kind, 0)], &Identify::default()).unwrap();
        // Here the fit makes a wrong assumption about the force between the samples. The errors of
        // the estimates are therefore many times the standard errors due to noise, but the
        // intervals must still contain the true values.
        assert_eq!(held(&usual, truth), 3, "{usual}");
        let note = "those of the model that explains the residual";
        assert!(usual.to_string().contains(note), "{usual}");
        let expected = Some(Cause::BetweenSamples { between_samples: between });
        assert_eq!(cause(&usual), expected, "{}", usual.summary().all_checks());
    }
}

/// Accelerations of a tower of five storeys, with 2 % noise. A white force, held between its
/// samples, acts on the top storey. The response is the sum of the closed-form responses of the
/// modes.
fn tower(samples: usize) -> (Measurement, [f64; 5]) {
    let masses = [1000.0, 1000.0, 900.0, 900.0, 700.0];
    let springs = [1.2e6, 1e6, 9e5, 8e5, 6e5];
    let stiffness = DMatrix::from_fn(5, 5, |i: usize, j: usize| match i.abs_diff(j) {
        0 => springs[i] + springs.get(i + 1).unwrap_or(&0.0),
        1 => -springs[i.max(j)],
        _ => 0.0,
    });
    let root = |i: usize| f64::sqrt(masses[i]);
    let scaled = DMatrix::from_fn(5, 5, |i, j| stiffness[(i, j)] / (root(i) * root(j)));
    let modes = hermitian_eigen(scaled).unwrap();
    let sampling = Sampling::from_rate_hz(100.0, samples).unwrap();
    let white = noise::white(sampling, 1, 100.0, 5).unwrap();
    let mut accelerations = DMatrix::zeros(samples, 5);
    for (mode, &square) in modes.eigenvalues.iter().enumerate() {
        let shape = DVector::from_fn(5, |i, _| modes.eigenvectors[(i, mode)] / root(i));
        let force = Record::new(sampling, white.data() * shape[4]).unwrap();
        let oscillator = Sdof::new(1.0, 2e-3 * square, square).unwrap();
        let response = oscillator.held_force_response(&force, 0.0, 0.0).unwrap();
        accelerations += response.acceleration().data() * shape.transpose();
    }
    let response = Record::new(sampling, accelerations).unwrap();
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.02), 6).unwrap();
    let force = DMatrix::from_fn(samples, 5, |k, i| if i == 4 { white.data()[k] } else { 0.0 });
    let force = Record::new(sampling, force).unwrap();
    let kind = ResponseQuantity::Acceleration;
    (Measurement::from_records(&force, &[(kind, &noisy)]).unwrap(), masses)
}

/// With a band-limited force, the weights of the five channels converge slowly or not at all. This
/// must not end the fit.
#[test]
fn a_chain_under_a_simulated_force_is_fitted() {
    let (measured, masses) = tower(2048);
    let chain = Structure { forms: vec![Form::Chain] };
    let stated = Identify { structure: chain.clone(), ..open(Some(HELD), &[]) };
    let found = identify(std::slice::from_ref(&measured), &stated).unwrap();
    let errors = (1..=5).zip(masses).map(|(at, mass)| {
        let parameter = found.estimate().parameter(&format!("m{at}{at}")).unwrap();
        (parameter.value - mass).abs() / parameter.standard_error
    });
    assert!(errors.fold(0.0, f64::max) < 3.5, "{found}");
    let usual = Identify { structure: chain, ..Identify::default() };
    let usual = identify(&[measured], &usual).unwrap();
    let expected = Cause::BetweenSamples { between_samples: HELD };
    assert_eq!(cause(&usual), Some(expected), "{usual}");
}

/// Oscillator of 10 kg at 22 Hz with a damping ratio of 0.015, sampled at 512 Hz for 10 s.
fn heavy() -> Sdof {
    let omega = TAU * 22.0;
    Sdof::new(10.0, 2.0 * 0.015 * omega * 10.0, 10.0 * omega * omega).unwrap()
}

/// Right records: accelerations under a random force up to 30 Hz, sampled at 128 Hz, with 2 % noise
/// on both channels. Between 30 and 50 Hz the measured force is only noise. A held or linear force
/// reduces this noise; this must not count as an explanation of the residual.
#[test]
fn noise_of_the_force_is_no_force_between_samples() {
    let sampling = Sampling::from_rate_hz(128.0, 2048).unwrap();
    let quantity = ResponseQuantity::Acceleration;
    let rig = RandomTest { system: heavy().system(), sampling, quantity, force: 50.0 };
    let warns = |seed: &u64| {
        let [force, _] = rig.period(*seed).unwrap();
        let mut lines = Spectrum::from_record(&force).lines().clone();
        let spacing = force.sampling().rate_hz() / force.len() as f64;
        for (line, mut row) in lines.row_iter_mut().enumerate() {
            row *= Complex::from(if line as f64 * spacing > 30.0 { 0.0 } else { 1.0 });
        }
        let force = Spectrum::from_lines(force.sampling(), lines).unwrap().to_record().unwrap();
        let steady = exact_harmonic_periodic(&rig.system, &force).unwrap();
        let noisy = |record: &Record, seed: u64| {
            let noisy = noise::add_white(record, NoiseLevel::FractionOfRms(0.02), seed).unwrap();
            noisy.window(1024, 2048).unwrap()
        };
        let response = noisy(steady.acceleration(), seed + 2000);
        let force = noisy(&force, seed + 1000);
        let test = Measurement::from_records(&force, &[(quantity, &response)]).unwrap();
        let found = identify(&[test], &Identify::default()).unwrap();
        found.summary().checks.iter().any(|check| check.is_conspicuous())
    };
    let warned = (0..24_u64).into_par_iter().filter(warns).count();
    assert!(warned <= 1, "{warned}");
}

/// Five hits of 50 ms on the oscillator [`light`], sampled at 100 Hz. The force is held or linear
/// between its samples, and the response, from rest, has 0.3 % noise.
fn simulated_hits(between: Discretisation, kind: ResponseQuantity, seed: u64) -> Measurement {
    let sampling = Sampling::from_rate_hz(100.0, 5 * 1024).unwrap();
    let force = |sample: usize| match sample % 1024 {
        at @ 50..=53 => 80.0 * (std::f64::consts::PI * (at - 49) as f64 / 5.0).sin(),
        _ => 0.0,
    };
    let force = DMatrix::from_fn(sampling.len(), 1, |sample, _| force(sample));
    let force = Record::new(sampling, force).unwrap();
    let response = match between {
        Discretisation::ZeroOrderHold => light().held_force_response(&force, 0.0, 0.0),
        _ => light().linear_force_response(&force, 0.0, 0.0),
    };
    let response = response.unwrap();
    let response = match kind {
        ResponseQuantity::Acceleration => response.acceleration(),
        _ => response.displacement(),
    };
    let noisy = noise::add_white(response, NoiseLevel::FractionOfRms(0.003), seed).unwrap();
    let level = NoiseLevel::StandardDeviation(0.01);
    let force = noise::add_white(&force, level, seed + 1000).unwrap();
    Measurement::from_records(&force, &[(kind, &noisy)]).unwrap()
}

/// The closed-form response to hits of a simulation. The check must name the force between the
/// samples, as in other records, and the intervals must contain the true values.
#[test]
fn the_force_of_simulated_hits_is_named_and_allowed_for() {
    let truth = [light().mass(), light().damping(), light().stiffness()];
    (0..6_u64).into_par_iter().for_each(|seed| {
        let between = if seed % 2 == 0 { HELD } else { Discretisation::FirstOrderHold };
        for kind in [ResponseQuantity::Displacement, ResponseQuantity::Acceleration] {
            let test = simulated_hits(between, kind, seed);
            let found = identify(&[test], &Identify::hits(HitRule::default())).unwrap();
            let expected = Some(Cause::BetweenSamples { between_samples: between });
            assert_eq!(cause(&found), expected, "{kind}: {}", found.summary().all_checks());
            assert_eq!(held(&found, truth), 3, "{found}");
        }
    });
}

/// Steady state after a first-order high-pass filter with the corner `hz`, exact on the lines of
/// its period.
pub fn coupled(record: &Record, hz: f64) -> Record {
    let spectrum = Spectrum::from_record(record);
    let spacing = TAU * record.sampling().rate_hz() / record.len() as f64;
    let mut lines = spectrum.lines().clone();
    for (line, mut row) in lines.row_iter_mut().enumerate() {
        let s = Complex::new(0.0, spacing * line as f64);
        row *= s / (s + TAU * hz);
    }
    Spectrum::from_lines(record.sampling(), lines).unwrap().to_record().unwrap()
}

fn random_test(response_hz: Option<f64>, force_hz: Option<f64>, seed: u64) -> Measurement {
    let sampling = Sampling::from_rate_hz(512.0, 5120).unwrap();
    coupled_test(&heavy(), sampling, [response_hz, force_hz], seed)
}

/// Random test whose response and force pass high-pass filters with these corner frequencies in Hz;
/// `None`: no filter.
fn coupled_test(
    oscillator: &Sdof,
    sampling: Sampling,
    [response_hz, force_hz]: [Option<f64>; 2],
    seed: u64,
) -> Measurement {
    let quantity = ResponseQuantity::Acceleration;
    let rig = RandomTest { system: oscillator.system(), sampling, quantity, force: 50.0 };
    let [force, response] = rig.period(seed).unwrap();
    let force = force_hz.map_or(force.clone(), |hz| coupled(&force, hz));
    let response = response_hz.map_or(response.clone(), |hz| coupled(&response, hz));
    let len = sampling.len();
    let [force, response] = [force, response].map(|all| all.window(len / 2 + 1, len).unwrap());
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), seed + 1000).unwrap();
    Measurement::from_records(&force, &[(quantity, &noisy)]).unwrap()
}

/// If the intervals are right, the probability that fewer than 20 of 24 intervals of 95 % contain
/// the true value is 0.006. Without the corner frequency, the model lacks the high-pass; the
/// intervals are wider and still contain the true values.
#[test]
fn an_ac_coupled_response_is_allowed_for() {
    let truth = [heavy().mass(), heavy().damping(), heavy().stiffness()];
    let errors = |fit: &Identified| -> f64 {
        fit.estimate().parameters().map(|one| one.standard_error / one.value.abs()).sum()
    };
    let both = (0..8_u64).into_par_iter().map(|seed| {
        let test = [random_test(Some(3.0), None, seed)];
        let fitted = |coupled: &[&str]| identify(&test, &open(None, coupled)).unwrap();
        let (with, without) = (fitted(&["acceleration 1=3"]), fitted(&[]));
        ([held(&with, truth), held(&without, truth)], [errors(&with), errors(&without)])
    });
    let add = |a: ([usize; 2], [f64; 2]), b: ([usize; 2], [f64; 2])| {
        ([a.0[0] + b.0[0], a.0[1] + b.0[1]], [a.1[0] + b.1[0], a.1[1] + b.1[1]])
    };
    let ([with, without], [narrow, wide]) = both.reduce(|| ([0; 2], [0.0; 2]), add);
    assert!(with >= 20 && without >= 20, "{with} with it, {without} without");
    assert!(narrow < 0.5 * wide, "{narrow} {wide}");
    for seed in 0..2 {
        let alike = random_test(Some(0.5), Some(0.5), seed);
        for test in [random_test(None, None, seed), alike] {
            let found = identify(&[test], &Identify::default()).unwrap();
            assert_eq!(cause(&found), None, "{}", found.summary().all_checks());
        }
    }
    let wrong = identify(&[random_test(None, None, 0)], &open(None, &["a9=0.5"])).unwrap_err();
    assert!(wrong.to_string().contains("no fitted channel a9"), "{wrong}");
}

/// The response channel has a high-pass filter with a corner frequency of 3 Hz. The check of every
/// record names the AC coupling and its corner frequency.
#[test]
fn an_ac_coupled_response_is_named() {
    (0..4_u64).into_par_iter().for_each(|seed| {
        let test = random_test(Some(3.0), None, seed);
        let found = identify(&[test], &Identify::default()).unwrap();
        let Some(Cause::AcCoupling { channels, corner_hz }) = cause(&found) else {
            panic!("{seed}: {}", found.summary().all_checks());
        };
        let quantity = Quantity::Response(ResponseQuantity::Acceleration);
        assert_eq!(channels, [Channel { quantity, index: 0 }], "{seed}");
        assert!((corner_hz - 3.0).abs() < 0.3, "{seed}: {corner_hz} Hz");
    });
}

/// The force channel has a high-pass filter with a corner frequency of 0.5 Hz, which a check must
/// name. In some records a force that is held between its samples also explains the residual up to
/// the noise, but the correction of the high-pass gives a smaller residual power.
#[test]
fn an_ac_coupled_force_is_named() {
    let omega = TAU * 12.0;
    let oscillator = Sdof::new(5.0, 2.0 * 0.02 * omega * 5.0, 5.0 * omega * omega).unwrap();
    let sampling = Sampling::from_rate_hz(256.0, 8192).unwrap();
    (0..4_u64).into_par_iter().for_each(|seed| {
        let test = coupled_test(&oscillator, sampling, [None, Some(0.5)], seed);
        let found = identify(&[test], &Identify::default()).unwrap();
        let Some(Cause::AcCoupling { channels, corner_hz }) = cause(&found) else {
            panic!("{seed}: {}", found.summary().all_checks());
        };
        assert_eq!(channels, [Channel { quantity: Quantity::Force, index: 0 }], "{seed}");
        assert!((corner_hz - 0.5).abs() < 0.05, "{seed}: {corner_hz} Hz");
    });
}

/// The force is held between its samples, and the check must say so. In some of these records, a
/// fit that assumes a linear force between the samples also passes the tests of the residual,
/// although 90 % of the residual power of the default fit remains. With a held force, less than 1 %
/// of this power remains.
#[test]
fn a_held_force_is_not_taken_for_a_linear_one() {
    let omega = TAU * 5.0;
    let oscillator = Sdof::new(5.0, 2.0 * 0.05 * omega * 5.0, 5.0 * omega * omega).unwrap();
    let sampling = Sampling::from_rate_hz(200.0, 4096).unwrap();
    (0..4_u64).into_par_iter().for_each(|seed| {
        let force = noise::white(sampling, 1, 50.0, seed).unwrap();
        let response = oscillator.held_force_response(&force, 0.0, 0.0).unwrap();
        let noisy = noise::add_white(
            response.acceleration(),
            NoiseLevel::FractionOfRms(0.003),
            seed + 1000,
        );
        let channel = [(ResponseQuantity::Acceleration, &noisy.unwrap())];
        let test = Measurement::from_records(&force, &channel).unwrap();
        let found = identify(&[test], &Identify::default()).unwrap();
        let expected = Some(Cause::BetweenSamples { between_samples: HELD });
        assert_eq!(cause(&found), expected, "{seed}: {}", found.summary().all_checks());
    });
}

/// The responses are stated as another quantity than was measured: a check or the failure of the
/// search names the measured quantity. With the right quantity, nothing is named, even if the noise
/// is a fifth of the response.
#[test]
fn a_wrong_quantity_is_named() {
    let sampling = Sampling::from_rate_hz(512.0, 5120).unwrap();
    let test = |measured: ResponseQuantity, stated: ResponseQuantity, noise: f64, seed: u64| {
        let system = heavy().system();
        let rig = RandomTest { system, sampling, quantity: measured, force: 50.0 };
        let [force, response] = rig.measure(seed).unwrap();
        let noise = NoiseLevel::FractionOfRms(noise);
        let noisy = noise::add_white(&response, noise, seed + 1000).unwrap();
        Measurement::from_records(&force, &[(stated, &noisy)]).unwrap()
    };
    let all = ResponseQuantity::ALL;
    let pairs = all.into_iter().flat_map(|measured| all.map(|stated| (measured, stated)));
    let cases: Vec<_> = pairs.flat_map(|pair| [0, 1].map(|seed| (pair, seed))).collect();
    cases.into_par_iter().for_each(|((measured, stated), seed)| {
        if measured == stated {
            for noise in [0.01, 0.2] {
                let found = identify(&[test(measured, stated, noise, seed)], &Identify::default());
                let found = found.unwrap();
                assert_eq!(cause(&found), None, "{}", found.summary().all_checks());
            }
            return;
        }
        let found = identify(&[test(measured, stated, 0.01, seed)], &Identify::default());
        let text = match &found {
            Ok(found) => found.summary().all_checks().to_string(),
            Err(error) => error.to_string(),
        };
        let expected = format!("the responses are those of {measured}, not of {stated}");
        assert!(text.contains(&expected), "{measured} as {stated}, {seed}: {text}");
    });
}
