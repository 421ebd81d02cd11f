//! Regularised reconstruction, compared with explicit normal equations.

use mechid_force::{
    Channel, Filter, ForceError, ForceUnknowns, Measurement, Noise, OPEN_UNKNOWNS, Rule, Start,
    regularised, relative_error,
};
use mechid_model::{InitialState, Response, ResponseQuantity, SecondOrderSystem};
use mechid_problems::{exact_foh, exact_harmonic_periodic, random_stable};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

const DT: f64 = 0.01;

fn sampling(len: usize) -> Sampling {
    Sampling::new(DT, len).unwrap()
}

/// Returns two channels: the displacement of the first and the acceleration of the last degree of
/// freedom.
fn channels(dof: usize) -> Vec<Channel> {
    vec![
        Channel { dof: 0, quantity: ResponseQuantity::Displacement },
        Channel { dof: dof - 1, quantity: ResponseQuantity::Acceleration },
    ]
}

fn measure(response: &Response) -> Measurement {
    let (len, dof) = (response.sampling().len(), response.dof());
    let (x, a) = (response.displacement().data(), response.acceleration().data());
    let data = DMatrix::from_fn(len, 2, |k, c| if c == 0 { x[(k, 0)] } else { a[(k, dof - 1)] });
    Measurement::new(Record::new(response.sampling(), data).unwrap(), channels(dof)).unwrap()
}

/// Returns a force, samples × n; `value` gives the samples of the forced degrees of freedom.
fn force(len: usize, dof: usize, forced: &[usize], value: impl Fn(usize, usize) -> f64) -> Record {
    let data =
        DMatrix::from_fn(len, dof, |k, i| if forced.contains(&i) { value(k, i) } else { 0.0 });
    Record::new(sampling(len), data).unwrap()
}

/// Returns a matrix with one column for each sample of each force. The column has the scaled
/// response, channel after channel, to a force that is 1 at this sample and 0 at all others.
fn columns(
    len: usize,
    dof: usize,
    forced: &[usize],
    scale: &[f64],
    answer: impl Fn(&Record) -> Response,
) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(2 * len, forced.len() * len);
    for (f, at) in forced.iter().enumerate() {
        for j in 0..len {
            let pulse = force(len, dof, &[*at], |k, _| f64::from(u8::from(k == j)));
            matrix.set_column(f * len + j, &stacked(&measure(&answer(&pulse)), scale));
        }
    }
    matrix
}

fn stacked(measured: &Measurement, scale: &[f64]) -> DVector<f64> {
    let data = measured.record().data();
    DVector::from_fn(2 * data.nrows(), |i, _| {
        let (k, c) = (i % data.nrows(), i / data.nrows());
        data[(k, c)] / scale[c]
    })
}

/// Solves (GᵀG + λ²D) u = Gᵀy, where D is zero for the unknowns of the initial state.
fn normal_equations(
    g: &DMatrix<f64>,
    y: &DVector<f64>,
    lambda: f64,
    damped: usize,
) -> DVector<f64> {
    let mut left = g.tr_mul(g);
    (0..damped).for_each(|i| left[(i, i)] += lambda * lambda);
    left.lu().solve(&g.tr_mul(y)).unwrap()
}

fn wobble(k: usize, i: usize) -> f64 {
    (0.21 * k as f64 + i as f64).sin() + 0.4 * (0.9 * k as f64).cos()
}

/// Rounding of the normal equations: a condition number of about 1e6 at the λ used, times 1e-16,
/// with a margin.
const ROUNDING: f64 = 1e-8;

fn assert_same(found: &Record, forced: &[usize], expected: &DVector<f64>) {
    let len = found.len();
    for (f, dof) in forced.iter().enumerate() {
        for k in 0..len {
            let (a, b) = (found.channel(*dof)[k], expected[f * len + k]);
            assert!((a - b).abs() < ROUNDING * expected.amax(), "force {f}, sample {k}: {a} {b}");
        }
    }
}

#[test]
fn open_records_solve_their_normal_equations() {
    for (dof, forced) in [(1, vec![0]), (3, vec![2]), (3, vec![2, 0])] {
        let system = random_stable(dof, 7);
        let (len, scale) = (40, [1e-4, 2e-1]);
        let rest = InitialState::rest(dof);
        let truth = force(len, dof, &forced, wobble);
        let exact = measure(&exact_foh(&system, &truth, &rest).unwrap());
        let noisy = noise::add_white(exact.record(), NoiseLevel::FractionOfRms(0.1), 3).unwrap();
        let measured = Measurement::new(noisy, channels(dof)).unwrap();
        let mut g = columns(len, dof, &forced, &scale, |f| exact_foh(&system, f, &rest).unwrap());
        let lambda = 0.05 * g.norm() / (g.ncols() as f64).sqrt();
        for start in [Start::FromRest, Start::InMotion] {
            if start == Start::InMotion {
                g = with_starts(&system, g, &scale);
            }
            let filter = Filter::Tikhonov(Rule::Given(lambda));
            let (extent, level) =
                (ForceUnknowns::Samples(start), Noise::PerChannel(scale.to_vec()));
            let found = regularised(&system, &measured, &forced, &extent, filter, &level).unwrap();
            let y = stacked(&measured, &scale);
            let expected = normal_equations(&g, &y, lambda, forced.len() * len);
            assert_same(found.force.record(), &forced, &expected);
        }
    }
}

/// Appends columns with the responses to a unit displacement and to a unit velocity of each degree
/// of freedom at the first sample.
fn with_starts(system: &SecondOrderSystem, g: DMatrix<f64>, scale: &[f64]) -> DMatrix<f64> {
    let (dof, rows, forces) = (system.dof(), g.nrows(), g.ncols());
    let silence = force(rows / 2, dof, &[], |_, _| 0.0);
    let mut all = g.insert_columns(forces, 2 * dof, 0.0);
    for i in 0..2 * dof {
        let unit = |from: usize| DVector::from_fn(dof, |j, _| f64::from(u8::from(i == from + j)));
        let start = InitialState::new(unit(0), unit(dof)).unwrap();
        let motion = exact_foh(system, &silence, &start).unwrap();
        all.set_column(forces + i, &stacked(&measure(&motion), scale));
    }
    all
}

#[test]
fn whole_periods_solve_their_normal_equations() {
    for (dof, forced) in [(1, vec![0]), (3, vec![2]), (3, vec![2, 0])] {
        let system = random_stable(dof, 11);
        // An odd length has no Nyquist line, so that the lines contain the whole force.
        let (len, scale) = (31, [1e-4, 2e-1]);
        let truth = force(len, dof, &forced, wobble);
        let answer = |f: &Record| exact_harmonic_periodic(&system, f).unwrap();
        let exact = measure(&answer(&truth));
        let noisy = noise::add_white(exact.record(), NoiseLevel::FractionOfRms(0.1), 3).unwrap();
        let measured = Measurement::new(noisy, channels(dof)).unwrap();
        let g = columns(len, dof, &forced, &scale, answer);
        let lambda = 0.05 * g.norm() / (g.ncols() as f64).sqrt();
        let filter = Filter::Tikhonov(Rule::Given(lambda));
        let level = Noise::PerChannel(scale.to_vec());
        let found =
            regularised(&system, &measured, &forced, &ForceUnknowns::EveryLine, filter, &level)
                .unwrap();
        let y = stacked(&measured, &scale);
        let expected = normal_equations(&g, &y, lambda, g.ncols());
        assert_same(found.force.record(), &forced, &expected);
    }
}

#[test]
fn truncation_that_drops_nothing_is_least_squares() {
    let system = random_stable(2, 5);
    let truth = force(31, 2, &[1], wobble);
    let measured = measure(&exact_harmonic_periodic(&system, &truth).unwrap());
    for filter in [Filter::TruncatedSvd(Rule::Given(1e-9)), Filter::Tikhonov(Rule::Given(1e-9))] {
        let noise = Noise::Unknown;
        let found =
            regularised(&system, &measured, &[1], &ForceUnknowns::EveryLine, filter, &noise)
                .unwrap();
        let error = relative_error(found.force.record(), &truth).unwrap();
        assert!(error < 1e-9, "{filter:?}: {error:.1e}");
        assert!((found.unknowns - 31.0).abs() < 1e-6);
    }
}

#[test]
fn the_standard_error_is_what_is_seen() {
    // The true force is white on every line, as Tikhonov's method assumes if λ is regarded as a
    // Bayesian prior.
    let system = random_stable(2, 5);
    let len = 255;
    for filter in [Filter::Tikhonov(Rule::Likelihood), Filter::Shrinkage] {
        let (mut seen, mut stated) = (0.0, 0.0);
        for seed in 0..12 {
            let drive = noise::white(sampling(len), 1, 30.0, 1000 + seed).unwrap();
            let truth = force(len, 2, &[1], |k, _| drive.channel(0)[k]);
            let exact = exact_harmonic_periodic(&system, &truth).unwrap();
            let exact = Measurement::from_record(
                ResponseQuantity::Displacement,
                exact.displacement().clone(),
            );
            let noisy =
                noise::add_white(exact.record(), NoiseLevel::FractionOfRms(0.02), seed).unwrap();
            let measured = Measurement::from_record(ResponseQuantity::Displacement, noisy);
            let noise = Noise::Unknown;
            let found =
                regularised(&system, &measured, &[1], &ForceUnknowns::EveryLine, filter, &noise)
                    .unwrap();
            seen += (found.force.record().data() - truth.data()).norm_squared();
            stated += found.force.standard_error().unwrap().data().norm_squared();
        }
        // 12 × 255 samples determine a variance to 3 %; the plug-in values of σ and τ add about 10
        // %.
        let ratio = (seen / stated).sqrt();
        assert!((0.85..1.15).contains(&ratio), "{filter:?}: {ratio:.3}");
    }
}

#[test]
fn without_noise_every_rule_gives_the_force() {
    let system = random_stable(2, 5);
    for (len, extent) in
        [(63, ForceUnknowns::EveryLine), (48, ForceUnknowns::Samples(Start::InMotion))]
    {
        let truth = force(len, 2, &[1], wobble);
        let response = match extent {
            ForceUnknowns::EveryLine => exact_harmonic_periodic(&system, &truth).unwrap(),
            _ => exact_foh(&system, &truth, &InitialState::rest(2)).unwrap(),
        };
        let measured = measure(&response);
        for filter in [
            Filter::Tikhonov(Rule::Likelihood),
            Filter::Tikhonov(Rule::Gcv),
            Filter::TruncatedSvd(Rule::Likelihood),
            Filter::Shrinkage,
        ] {
            let noise = Noise::Unknown;
            let found = regularised(&system, &measured, &[1], &extent, filter, &noise).unwrap();
            let error = relative_error(found.force.record(), &truth).unwrap();
            // The error may exceed rounding, because the smallest λ of the grid is not zero: it is
            // eight decades below the largest singular value.
            assert!(error < 1e-3, "{extent:?}, {filter:?}: {error:.1e}");
        }
    }
}

#[test]
fn velocities_leave_the_mean_force_at_zero() {
    let system = random_stable(2, 5);
    let truth = force(63, 2, &[1], |k, i| 3.0 + wobble(k, i));
    let response = exact_harmonic_periodic(&system, &truth).unwrap();
    let measured =
        Measurement::from_record(ResponseQuantity::Velocity, response.velocity().clone());
    for filter in [Filter::Tikhonov(Rule::Likelihood), Filter::TruncatedSvd(Rule::Gcv)] {
        let noise = Noise::Unknown;
        let found =
            regularised(&system, &measured, &[1], &ForceUnknowns::EveryLine, filter, &noise)
                .unwrap();
        let (found, expected) = (found.force.record().column(1), truth.column(1));
        assert!(found.mean().abs() < 1e-9, "{filter:?}: {}", found.mean());
        let moving = expected.add_scalar(-expected.mean());
        assert!((found - &moving).norm() < 1e-3 * moving.norm(), "{filter:?}");
    }
}

#[test]
fn bad_requests_are_refused_with_their_numbers() {
    let system = random_stable(2, 5);
    let record = |len: usize, value: f64| {
        let data = DMatrix::from_fn(len, 1, |k, _| value * (k as f64).sin());
        Record::new(sampling(len), data).unwrap()
    };
    let ask = |record: Record, forced: &[usize], extent: &ForceUnknowns, filter: Filter| {
        let measured = Measurement::from_record(ResponseQuantity::Displacement, record);
        regularised(&system, &measured, forced, extent, filter, &Noise::Unknown).unwrap_err()
    };
    let (open, period) = (ForceUnknowns::Samples(Start::InMotion), ForceUnknowns::EveryLine);
    let auto = Filter::Tikhonov(Rule::Likelihood);
    assert_eq!(
        ask(record(OPEN_UNKNOWNS + 1, 1.0), &[0], &open, auto),
        ForceError::TooLarge { unknowns: OPEN_UNKNOWNS + 1, limit: OPEN_UNKNOWNS }
    );
    assert_eq!(
        ask(record(1, 1.0), &[0], &open, auto),
        ForceError::TooShort { samples: 1, needed: 2 }
    );
    assert_eq!(ask(record(20, 0.0), &[0], &period, auto), ForceError::Silent);
    assert_eq!(
        ask(record(20, 1.0), &[0, 1], &period, auto),
        ForceError::MoreForcesThanMeasurements { forces: 2, measurements: 1 }
    );
    for value in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(
            ask(record(20, 1.0), &[0], &period, Filter::TruncatedSvd(Rule::Given(value))),
            ForceError::NotPositive { what: "regularisation parameter", value }
        );
    }
    assert_eq!(
        ask(record(20, 1.0), &[0], &ForceUnknowns::Lines(vec![]), auto),
        ForceError::NoLines
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Twice the measurement gives twice the force, for every rule for the parameter.
    #[test]
    fn every_rule_follows_the_scale(
        values in prop::collection::vec(-1.0..1.0f64, 30),
        factor in 1e-3..1e3f64,
        open in any::<bool>(),
    ) {
        let system = random_stable(1, 3);
        let extent = if open { ForceUnknowns::Samples(Start::FromRest) } else { ForceUnknowns::EveryLine };
        let find = |by: f64, filter: Filter| {
            let scaled = values.iter().map(|v| v * by).collect();
            let record = Record::from_channel(sampling(30), scaled).unwrap();
            let measured = Measurement::from_record(ResponseQuantity::Displacement, record);
            regularised(&system, &measured, &[0], &extent, filter, &Noise::Unknown).unwrap()
        };
        for filter in [
            Filter::Tikhonov(Rule::Gcv),
            Filter::Tikhonov(Rule::Likelihood),
            Filter::TruncatedSvd(Rule::Gcv),
            Filter::Shrinkage,
        ] {
            let (one, other) = (find(1.0, filter), find(factor, filter));
            let (a, b) = (one.force.record().data() * factor, other.force.record().data());
            prop_assert!((&a - b).amax() <= 1e-9 * a.amax(), "{filter:?}");
        }
    }

    /// With a given regularisation parameter, the force is linear in the measurement.
    #[test]
    fn a_given_parameter_makes_a_linear_map(
        first in prop::collection::vec(-1.0..1.0f64, 24),
        second in prop::collection::vec(-1.0..1.0f64, 24),
        weight in -3.0..3.0f64,
    ) {
        let system = random_stable(2, 3);
        let find = |values: Vec<f64>| {
            let record = Record::from_channel(sampling(24), values).unwrap();
            let measured = Measurement::from_record(ResponseQuantity::Acceleration, record);
            let filter = Filter::Tikhonov(Rule::Given(0.03));
            let (extent, noise) = (ForceUnknowns::Samples(Start::InMotion), Noise::PerChannel(vec![1.0]));
            let found = regularised(&system, &measured, &[1], &extent, filter, &noise).unwrap();
            found.force.record().data().clone()
        };
        let sum = first.iter().zip(&second).map(|(a, b)| a + weight * b).collect();
        let expected = find(first.clone()) + find(second.clone()) * weight;
        let found = find(sum);
        prop_assert!((&found - &expected).amax() <= 1e-10 * (1.0 + expected.amax()));
    }
}
