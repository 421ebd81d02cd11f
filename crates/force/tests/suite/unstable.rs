//! Machines whose free response grows; the unknown force keeps the response bounded.

use mechid_force::{
    Filter, ForceError, ForceUnknowns, Measurement, Noise, Rule, Start, Tuning, discretised,
    frequency_domain, kalman, regularised, relative_error,
};
use mechid_model::{Discretisation, Response, ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Extent, Record, Sampling};
use nalgebra::{DMatrix, dmatrix};

const MASS: f64 = 25.0;

/// Returns the system m ẍ − m σ² x = F, whose free response grows like exp σt.
fn falling(rate: f64) -> SecondOrderSystem {
    let (m, k) = (dmatrix![MASS], dmatrix![-MASS * rate * rate]);
    SecondOrderSystem::new(m, dmatrix![0.0], k).unwrap()
}

/// Returns a displacement that starts from rest and has the frequencies 25 and 60 rad/s, and the
/// force that causes it, in closed form.
fn held_up(rate: f64, sampling: Sampling) -> (Measurement, Record) {
    let (w, u) = (25.0, 60.0);
    let x = |t: f64| (w * t).cos() - (u * t).cos() + (w * t).sin() - w / u * (u * t).sin();
    let a = |t: f64| {
        let slow = (w * t).cos() + (w * t).sin();
        -w * w * slow + u * u * (u * t).cos() + w * u * (u * t).sin()
    };
    let force = Record::from_fn(sampling, |t| 1e-3 * MASS * (a(t) - rate * rate * x(t)));
    let seen = Record::from_fn(sampling, |t| 1e-3 * x(t)).unwrap();
    (Measurement::from_record(ResponseQuantity::Displacement, seen), force.unwrap())
}

const FILTERS: [Filter; 3] =
    [Filter::Tikhonov(Rule::Likelihood), Filter::TruncatedSvd(Rule::Gcv), Filter::Shrinkage];

#[test]
fn an_open_record_is_solved_or_refused_by_the_growth_over_it() {
    let sampling = Sampling::new(0.002, 200).unwrap();
    for growth in [1.0, 5.0, 13.5, 20.0, 100.0, 1000.0, 30_000.0] {
        let rate = growth / sampling.duration();
        let (system, (seen, force)) = (falling(rate), held_up(rate, sampling));
        for start in [Start::FromRest, Start::InMotion] {
            for filter in FILTERS {
                let extent = ForceUnknowns::Samples(start);
                let found = regularised(&system, &seen, &[0], &extent, filter, &Noise::Unknown);
                match found {
                    Ok(found) => {
                        assert!(growth < 14.0, "{growth} {start:?} {filter:?}");
                        let error = relative_error(found.force.record(), &force).unwrap();
                        assert!(error < 0.1, "{growth} {start:?} {filter:?}: {error}");
                    }
                    Err(ForceError::Unstable { rate: told, .. }) => {
                        assert!(growth > 14.0 && (told - rate).abs() < 1e-9 * rate);
                    }
                    Err(other) => panic!("{growth} {start:?} {filter:?}: {other}"),
                }
            }
        }
    }
}

#[test]
fn the_kalman_smoother_needs_no_more_than_a_step_that_does_not_grow_too_much() {
    let sampling = Sampling::new(0.002, 200).unwrap();
    for growth in [1.0, 20.0, 100.0, 600.0, 3000.0] {
        let rate = growth / sampling.duration();
        let (seen, force) = held_up(rate, sampling);
        let found = kalman(&falling(rate), &seen, &[0], Start::InMotion, &Tuning::Likelihood);
        let error = relative_error(found.unwrap().force.record(), &force).unwrap();
        assert!(error < 0.01, "{growth}: {error}");
    }
    // The free response grows by e¹⁵⁰ or e¹⁵⁰⁰ in one step.
    for rate in [75_000.0, 750_000.0] {
        let (seen, _) = held_up(rate, sampling);
        let refused = kalman(&falling(rate), &seen, &[0], Start::InMotion, &Tuning::Likelihood);
        let expected = matches!(
            refused,
            Err(ForceError::NoLikelihood | ForceError::Unstable { .. } | ForceError::Unseen { .. })
        );
        assert!(expected, "{rate}: {refused:?}");
    }
}

#[test]
fn a_whole_period_asks_for_no_stability() {
    // With k = −10⁶ N/m and lines 2 and 5 in x, the force D(ω) X is known in closed form.
    let system = falling(200.0);
    let sampling = Sampling::new(0.005, 256).unwrap();
    let wave = |gain: fn(f64) -> f64| {
        Record::from_fn(sampling, move |t| {
            let (w, u) = (2.0 * sampling.omega0(), 5.0 * sampling.omega0());
            gain(w) * (w * t).cos() - 0.4 * gain(u) * (u * t + 0.3).sin()
        })
        .unwrap()
    };
    let force = wave(|w| MASS * (-w * w - 4e4));
    let seen = Measurement::from_record(ResponseQuantity::Displacement, wave(|_| 1.0));
    let found = frequency_domain(&system, &seen, &[0], &[2, 5], &Noise::Unknown).unwrap();
    assert!(relative_error(found.record(), &force).unwrap() < 1e-12);
    for filter in [Filter::Tikhonov(Rule::Likelihood), Filter::Shrinkage] {
        let extent = ForceUnknowns::Lines(vec![2, 5]);
        let found = regularised(&system, &seen, &[0], &extent, filter, &Noise::Unknown).unwrap();
        let error = relative_error(found.force.record(), &force).unwrap();
        assert!(error < 1e-6, "{filter:?}: {error}");
    }
}

#[test]
fn negative_damping_of_any_size_ends_in_a_force_or_an_error() {
    let sampling = Sampling::new(0.01, 100).unwrap();
    let (seen, _) = held_up(1.0, sampling);
    let zeros = Record::new(sampling, DMatrix::zeros(100, 1)).unwrap();
    let response = Response::new(seen.record().clone(), zeros.clone(), zeros).unwrap();
    for exponent in 0..60 {
        let c = -(10f64.powf(0.25 * f64::from(exponent)));
        let system = SecondOrderSystem::new(dmatrix![MASS], dmatrix![c], dmatrix![1e6]).unwrap();
        for start in [Start::FromRest, Start::InMotion] {
            for filter in FILTERS {
                let extent = ForceUnknowns::Samples(start);
                let _ = regularised(&system, &seen, &[0], &extent, filter, &Noise::Unknown);
            }
            let _ = kalman(&system, &seen, &[0], start, &Tuning::Likelihood);
        }
        for discretisation in
            [Discretisation::Euler, Discretisation::ZeroOrderHold, Discretisation::FirstOrderHold]
        {
            let found = discretised(&system, &response, discretisation, Extent::Open);
            let told = match &found {
                Err(ForceError::StepTooLong { .. } | ForceError::Unstable { .. }) => true,
                other => other.is_ok(),
            };
            assert!(told, "{c} {discretisation:?}: {found:?}");
        }
    }
}
