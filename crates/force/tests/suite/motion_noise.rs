//! The standard error due to noise in a complete motion.

use mechid_force::{
    ForceError, MotionNoise, continuous_with_noise, discretised, discretised_with_noise,
    with_uncertain_system,
};
use mechid_model::{Discretisation, Parameter, Response, SecondOrderSystem, UncertainSystem};
use mechid_signal::{Extent, Record, Sampling, noise};
use nalgebra::{DMatrix, dmatrix};

const DT: f64 = 0.05;

const LEVELS: [[f64; 2]; 3] = [[2e-3, 5e-3], [3e-2, 1e-2], [0.7, 0.4]];

fn rotor() -> SecondOrderSystem {
    SecondOrderSystem::new(
        dmatrix![14.8, 1.0; 0.5, 12.0],
        dmatrix![20.0, 10.0; -10.0, 30.0],
        dmatrix![400.0, 500.0; -200.0, 600.0],
    )
    .unwrap()
}

fn levels() -> MotionNoise {
    let [x, v, a] = LEVELS.map(|level| level.to_vec());
    MotionNoise::new(x, v, a).unwrap()
}

/// Creates a response from `data`, samples × (x, v, a of both directions).
fn response(data: &DMatrix<f64>) -> Response {
    let sampling = Sampling::new(DT, data.nrows()).unwrap();
    let part = |first| Record::new(sampling, data.columns(first, 2).into_owned()).unwrap();
    Response::new(part(0), part(2), part(4)).unwrap()
}

/// Returns a response that consists of noise only, with the level of each channel.
fn noisy(samples: usize, seed: u64) -> Response {
    let white = noise::white(Sampling::new(DT, samples).unwrap(), 6, 1.0, seed).unwrap();
    let data = DMatrix::from_fn(samples, 6, |k, c| LEVELS[c / 2][c % 2] * white.channel(c)[k]);
    response(&data)
}

/// Returns the root mean square of many forces that come from noise alone.
fn scatter(runs: u64, samples: usize, find: impl Fn(&Response) -> Record) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(samples, 2);
    for seed in 0..runs {
        sum += find(&noisy(samples, seed)).data().map(|f| f * f);
    }
    sum.map(|s| (s / runs as f64).sqrt())
}

/// Checks that stated and observed standard deviations agree. A standard deviation from 400 draws
/// has an uncertainty of 1/√800 = 3.5 %. The limit is four times this uncertainty at every sample,
/// and about a third of this limit for the RMS value over all twelve samples.
fn agree(stated: &Record, seen: &DMatrix<f64>) {
    for (stated, seen) in stated.data().iter().zip(seen) {
        assert!((stated / seen - 1.0).abs() < 0.14, "{stated}, seen {seen}");
    }
    for (stated, seen) in stated.data().column_iter().zip(seen.column_iter()) {
        let ratio = stated.norm() / seen.norm();
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }
}

#[test]
fn stated_errors_are_the_scatter_over_noisy_motions() {
    let found = continuous_with_noise(&rotor(), &noisy(12, 0), &levels()).unwrap();
    let find = |r: &Response| mechid_force::continuous(&rotor(), r).unwrap().record().clone();
    agree(found.standard_error().unwrap(), &scatter(400, 12, find));
    for ends in [Extent::Open, Extent::WholePeriod] {
        let linear = Discretisation::FirstOrderHold;
        let found =
            discretised_with_noise(&rotor(), &noisy(12, 0), linear, ends, &levels()).unwrap();
        let find = |r: &Response| discretised(&rotor(), r, linear, ends).unwrap().record().clone();
        agree(found.standard_error().unwrap(), &scatter(400, 12, find));
    }
}

/// The force is linear in the motion. The reference for its variance is the sum of the squared
/// forces that the noise of one sample of one channel causes, over all samples and channels.
#[test]
fn every_discretisation_carries_the_noise_of_every_sample() {
    let forms = Discretisation::ALL;
    for (form, ends) in
        forms.into_iter().flat_map(|f| [(f, Extent::Open), (f, Extent::WholePeriod)])
    {
        for samples in [1, 2, 3, 6] {
            if ends == Extent::Open && samples == 1 {
                continue;
            }
            let still = response(&DMatrix::zeros(samples, 6));
            let found = discretised_with_noise(&rotor(), &still, form, ends, &levels()).unwrap();
            let mut variance = DMatrix::zeros(found.record().len(), 2);
            for (k, c) in (0..samples).flat_map(|k| (0..4).map(move |c| (k, c))) {
                let mut unit = DMatrix::zeros(samples, 6);
                unit[(k, c)] = LEVELS[c / 2][c % 2];
                let force = discretised(&rotor(), &response(&unit), form, ends).unwrap();
                variance += force.record().data().map(|f| f * f);
            }
            let stated = found.standard_error().unwrap().data();
            for (stated, truth) in stated.iter().zip(&variance.map(f64::sqrt)) {
                let what = format!("{form:?}, {ends:?}, {samples} samples");
                assert!((stated / truth - 1.0).abs() < 1e-9, "{what}: {stated}, truth {truth}");
            }
        }
    }
}

#[test]
fn machine_and_noise_add_in_variance() {
    let response = noisy(5, 3);
    let damping = Parameter::named("c21", 2).unwrap();
    let machine = UncertainSystem::new(rotor(), vec![damping], dmatrix![4.0]).unwrap();
    let found = with_uncertain_system(&machine, |system| {
        continuous_with_noise(system, &response, &levels())
    });
    let found = found.unwrap();
    let noise: f64 =
        [(0.5, 0.7), (12.0, 0.4), (-10.0, 3e-2), (30.0, 1e-2), (-200.0, 2e-3), (600.0, 5e-3)]
            .iter()
            .map(|(entry, level): &(f64, f64)| (entry * level).powi(2))
            .sum();
    for (k, stated) in found.standard_error().unwrap().channel(1).iter().enumerate() {
        let machine = 2.0 * response.velocity().channel(0)[k];
        let truth = (noise + machine * machine).sqrt();
        assert!((stated / truth - 1.0).abs() < 1e-9, "sample {k}: {stated}, truth {truth}");
    }
}

#[test]
fn levels_that_cannot_be_are_refused() {
    let negative = MotionNoise::new(vec![1.0, 1.0], vec![1.0, -2.0], vec![]);
    assert_eq!(negative, Err(ForceError::NotPositive { what: "noise level", value: -2.0 }));
    let motion = noisy(4, 1);
    let few = MotionNoise::new(vec![1.0; 2], vec![1.0; 2], vec![]).unwrap();
    let missing = Err(ForceError::ChannelCount { record: 2, described: 0 });
    assert_eq!(continuous_with_noise(&rotor(), &motion, &few), missing);
    let linear = Discretisation::FirstOrderHold;
    assert!(discretised_with_noise(&rotor(), &motion, linear, Extent::Open, &few).is_ok());
    let one = MotionNoise::new(vec![1.0; 2], vec![1.0], vec![]).unwrap();
    let missing = Err(ForceError::ChannelCount { record: 2, described: 1 });
    assert_eq!(discretised_with_noise(&rotor(), &motion, linear, Extent::Open, &one), missing);
}
