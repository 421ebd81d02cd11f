//! Rate of false alarms of all checks together: on records that fit the model, at most one in fifty
//! shows a warning.

use mechid_analysis::identify::{Method, SampleFit, Source};
use mechid_analysis::{Identify, Measurement, ResponseQuantity, identify};
use mechid_model::{Discretisation, Sdof};
use mechid_problems::{exact_harmonic_periodic, exact_zoh_periodic};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};

/// Number of records of each kind.
const RECORDS: u64 = 1000;

const PERIOD: usize = 128;
const PERIODS: usize = 4;

fn noisy(record: &Record, seed: u64) -> Record {
    noise::add_white(record, NoiseLevel::FractionOfRms(0.02), seed).unwrap()
}

fn force(seed: u64) -> Record {
    let period = Sampling::new(0.02, PERIOD).unwrap();
    Multisine::flat(1..=40, 10.0, Phases::Random { seed }).unwrap().sample(period).unwrap()
}

/// Number of records with at least one warning.
fn warned(how: &Identify, record: impl Fn(u64) -> Measurement) -> u64 {
    let is_warned = |seed: &u64| {
        let found = identify(&[record(*seed)], how).unwrap();
        assert!(found.checks().iter().any(|check| check.finding.p_value().is_some()));
        found.checks().iter().any(|check| check.is_conspicuous())
    };
    (0..RECORDS).filter(is_warned).count() as u64
}

/// Several periods of a steady state with noise on the force, the displacement, or both.
fn periods(seed: u64, [on_force, on_response]: [bool; 2]) -> Measurement {
    let force = force(seed);
    let system = Sdof::new(10.0, 180.0, 9000.0).unwrap().system();
    let exact = exact_harmonic_periodic(&system, &force).unwrap();
    let measured = |record: &Record, is_noisy: bool, seed: u64| {
        let all = record.repeated(PERIODS).unwrap();
        if is_noisy { noisy(&all, seed) } else { all }
    };
    let force = measured(&force, on_force, 2 * seed);
    let x = measured(exact.displacement(), on_response, 2 * seed + 1);
    let responses = [(ResponseQuantity::Displacement, &x)];
    Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
}

/// Displacement, velocity and acceleration under a force that is constant between samples, with a
/// disturbance. If `disturbed`, the disturbance acts but is not measured; otherwise it is measured
/// but does not act.
fn samples(seed: u64, disturbed: bool) -> Measurement {
    let clean = force(seed).repeated(PERIODS).unwrap();
    let disturbed_force = noisy(&clean, seed);
    let system = Sdof::new(10.0, 180.0, 9000.0).unwrap().system();
    let (acting, measured) =
        if disturbed { (&disturbed_force, &clean) } else { (&clean, &disturbed_force) };
    let exact = exact_zoh_periodic(&system, acting).unwrap();
    let responses = [
        (ResponseQuantity::Displacement, exact.displacement()),
        (ResponseQuantity::Velocity, exact.velocity()),
        (ResponseQuantity::Acceleration, exact.acceleration()),
    ];
    Measurement::from_records(measured, &responses).unwrap()
}

/// Asserts that at most 1 in 50 records has a warning. At the stated rate of 1 in 100, the
/// probability of more than 20 records with a warning in 1,000 is 0.0015.
fn assert_few_warned(how: &Identify, record: impl Fn(u64) -> Measurement) {
    let count = warned(how, record);
    assert!(count <= RECORDS / 50, "{count} of {RECORDS}");
}

#[test]
fn least_squares_on_a_noisy_force() {
    let how = Identify::spectra(Method::LeastSquares);
    assert_few_warned(&how, |seed| periods(seed, [true, false]));
}

#[test]
fn instrumental_variables_with_noise_on_both() {
    let how = Identify::spectra(Method::Instrumental);
    assert_few_warned(&how, |seed| periods(seed, [true, true]));
}

#[test]
fn maximum_likelihood_with_noise_on_both() {
    assert_few_warned(&Identify::default(), |seed| periods(seed, [true, true]));
}

#[test]
fn samples_with_a_noisy_force() {
    let how = Identify::samples();
    assert_few_warned(&how, |seed| samples(seed, false));
}

#[test]
fn samples_with_a_disturbance() {
    let between_samples = Some(Discretisation::ZeroOrderHold);
    let fit = Source::Samples(SampleFit { between_samples, ..SampleFit::default() });
    assert_few_warned(&Identify::from(fit), |seed| samples(seed, true));
}
