//! The augmented Kalman smoother on forces that agree with its assumptions, and on impossible
//! requests.

use mechid_force::{
    Channel, ForceError, ForceModel, KalmanForce, Measurement, Start, Tuning, kalman,
    relative_error,
};
use mechid_model::{InitialState, KyxSign, Response, ResponseQuantity, SecondOrderSystem};
use mechid_problems::{dissertation_bearing, dissertation_sdof, exact_foh, random_stable};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{DMatrix, dvector};

/// Returns a random walk of `walk` N/√s on one degree of freedom.
fn walking(sampling: Sampling, dof: usize, forced: usize, walk: f64, seed: u64) -> Record {
    let steps = noise::white(sampling, 1, walk * sampling.dt().sqrt(), seed).unwrap();
    let mut sum = 0.0;
    let path: Vec<f64> = steps
        .channel(0)
        .iter()
        .map(|step| {
            sum += step;
            sum
        })
        .collect();
    let data =
        DMatrix::from_fn(sampling.len(), dof, |k, i| if i == forced { path[k] } else { 0.0 });
    Record::new(sampling, data).unwrap()
}

/// Returns displacements with white noise of `level` times their RMS value.
fn displacements(response: &Response, level: f64, seed: u64) -> Measurement {
    let level = NoiseLevel::FractionOfRms(level);
    let noisy = noise::add_white(response.displacement(), level, seed).unwrap();
    Measurement::from_record(ResponseQuantity::Displacement, noisy)
}

/// Returns the intensity τ √(2 ω_c), in N/√s, of the random walk that a force of order 1
/// approximates over short times.
fn walk(found: &KalmanForce, force: usize) -> f64 {
    found.model.rms[force] * (2.0 * std::f64::consts::TAU * found.model.corner_hz).sqrt()
}

/// Mean square of the ratio of the error to the stated standard error, for one degree of freedom.
fn normalised_mean_square_error(found: &KalmanForce, truth: &Record, dof: usize) -> f64 {
    let (record, error) = (found.force.record(), found.force.standard_error().unwrap());
    let parts = (0..truth.len()).map(|k| {
        ((record.channel(dof)[k] - truth.channel(dof)[k]) / error.channel(dof)[k]).powi(2)
    });
    parts.sum::<f64>() / truth.len() as f64
}

#[test]
fn likelihood_finds_the_walk_the_noise_and_an_honest_error() {
    let machines = [
        (dissertation_sdof().system(), 0, 0.01),
        (dissertation_bearing(KyxSign::Minus).system(), 1, 0.05),
    ];
    for (system, forced, dt) in machines {
        let sampling = Sampling::new(dt, 4000).unwrap();
        let truth = walking(sampling, system.dof(), forced, 40.0, 5);
        let rest = InitialState::rest(system.dof());
        let response = exact_foh(&system, &truth, &rest).unwrap();
        let measured = displacements(&response, 0.02, 9);
        let found =
            kalman(&system, &measured, &[forced], Start::FromRest, &Tuning::Likelihood).unwrap();
        // 4000 samples determine a standard deviation to 1 %. The limits below are wider, because
        // the walk and the noise are partly confounded.
        assert_eq!(found.model.order, 1);
        let walk = walk(&found, 0);
        assert!((walk / 40.0 - 1.0).abs() < 0.1, "walk {walk}");
        for (c, level) in found.noise_std.iter().enumerate() {
            let size = response.displacement().column(c).norm() / 4000f64.sqrt();
            assert!((level / (0.02 * size) - 1.0).abs() < 0.05, "channel {c}: {level}");
        }
        // The errors of neighbouring samples are correlated, so the record has only about a hundred
        // independent errors.
        let normalised_mean_square_error = normalised_mean_square_error(&found, &truth, forced);
        assert!(
            (0.75..1.3).contains(&normalised_mean_square_error),
            "{normalised_mean_square_error:.3}"
        );
        // The smoothed motion is nearer to the truth than the measurement.
        let moved = relative_error(&found.displacement, response.displacement()).unwrap();
        assert!(moved < 0.01, "{moved:.4}");
        let fast = relative_error(&found.velocity, response.velocity()).unwrap();
        assert!(fast < 0.2, "{fast:.3}");
    }
}

#[test]
fn two_forces_have_walks_of_their_own() {
    let system = random_stable(3, 4);
    let sampling = Sampling::new(0.005, 3000).unwrap();
    let (first, last) = (walking(sampling, 3, 0, 10.0, 1), walking(sampling, 3, 2, 80.0, 2));
    let truth = Record::new(sampling, first.data() + last.data()).unwrap();
    let response = exact_foh(&system, &truth, &InitialState::rest(3)).unwrap();
    let measured = displacements(&response, 0.002, 9);
    let found = kalman(&system, &measured, &[2, 0], Start::InMotion, &Tuning::Likelihood).unwrap();
    for (f, expected) in [80.0, 10.0].into_iter().enumerate() {
        let walk = walk(&found, f);
        assert!((walk / expected - 1.0).abs() < 0.3, "{walk} {:?}", found.model);
    }
    assert!(found.force.record().column(1).amax() == 0.0);
    for dof in [0, 2] {
        let normalised_mean_square_error = normalised_mean_square_error(&found, &truth, dof);
        assert!(
            (0.6..1.5).contains(&normalised_mean_square_error),
            "degree of freedom {dof}: {normalised_mean_square_error:.3}"
        );
    }
}

#[test]
fn a_machine_already_in_motion_needs_to_be_told_so() {
    let system = dissertation_sdof().system();
    let sampling = Sampling::new(0.01, 600).unwrap();
    let truth = walking(sampling, 1, 0, 40.0, 5);
    let start = InitialState::new(dvector![0.05], dvector![-1.0]).unwrap();
    let response = exact_foh(&system, &truth, &start).unwrap();
    let measured = displacements(&response, 0.01, 3);
    let error = |start| {
        let found = kalman(&system, &measured, &[0], start, &Tuning::Likelihood).unwrap();
        let (f, t) = (found.force.record().channel(0), truth.channel(0));
        (0..20).map(|k| (f[k] - t[k]).powi(2)).sum::<f64>().sqrt()
    };
    let (told, not_told) = (error(Start::InMotion), error(Start::FromRest));
    assert!(told < 0.2 * not_told, "{told:.1} {not_told:.1}");
}

#[test]
fn bad_requests_are_refused_with_their_numbers() {
    let system = random_stable(2, 4);
    let sampling = Sampling::new(0.01, 50).unwrap();
    let record = Record::from_channel(sampling, (0..50).map(|k| f64::from(k).sin()).collect());
    let one = Measurement::from_record(ResponseQuantity::Displacement, record.unwrap());
    let ask = |system: &SecondOrderSystem, m: &Measurement, forced: &[usize], tuning: &Tuning| {
        kalman(system, m, forced, Start::InMotion, tuning).unwrap_err()
    };
    let auto = Tuning::Likelihood;
    assert_eq!(
        ask(&system, &one, &[0, 1], &auto),
        ForceError::MoreForcesThanMeasurements { forces: 2, measurements: 1 }
    );
    let short = one.record().window(0, 2).unwrap();
    assert_eq!(
        ask(&system, &Measurement::from_record(ResponseQuantity::Displacement, short), &[0], &auto),
        ForceError::TooShort { samples: 2, needed: 3 }
    );
    let silent = Record::new(sampling, DMatrix::zeros(50, 1)).unwrap();
    let silent = Measurement::from_record(ResponseQuantity::Displacement, silent);
    assert_eq!(ask(&system, &silent, &[0], &auto), ForceError::Silent);
    let given = |order: usize, corner_hz: f64, rms: Vec<f64>| {
        let model = ForceModel { order, corner_hz, rms };
        Tuning::Given { noise_std: vec![0.1], model }
    };
    assert_eq!(
        ask(&system, &one, &[0], &given(2, 1.0, vec![1.0, 1.0])),
        ForceError::ModelCount { models: 2, forces: 1 }
    );
    assert_eq!(
        ask(&system, &one, &[0], &given(17, 1.0, vec![1.0])),
        ForceError::ModelOrder { order: 17, most: 16 }
    );
    assert_eq!(
        ask(&system, &one, &[0], &given(1, 1.0, vec![-1.0])),
        ForceError::NotPositive { what: "RMS value of a force", value: -1.0 }
    );
    assert_eq!(
        ask(&system, &one, &[0], &given(1, 0.0, vec![1.0])),
        ForceError::NotPositive { what: "corner frequency", value: 0.0 }
    );
    assert_eq!(
        ask(&system, &one, &[0], &Tuning::NoiseKnown(vec![0.0])),
        ForceError::NotPositive { what: "noise level", value: 0.0 }
    );
    // A force has no effect on the channels if its degree of freedom is not coupled to a measured
    // one. Two channels that measure the same quantity at the same degree of freedom cannot
    // separate two forces.
    let diagonal = |a: f64, b: f64| DMatrix::from_diagonal(&dvector![a, b]);
    let apart =
        SecondOrderSystem::new(diagonal(1.0, 1.0), diagonal(1.0, 1.0), diagonal(90.0, 70.0))
            .unwrap();
    assert_eq!(ask(&apart, &one, &[1], &auto), ForceError::Unseen { dof: 1 });
    let twice = DMatrix::from_fn(50, 2, |k, _| (k as f64).sin());
    let channel = Channel { dof: 0, quantity: ResponseQuantity::Displacement };
    let twice = Measurement::new(Record::new(sampling, twice).unwrap(), vec![channel; 2]).unwrap();
    assert!(matches!(ask(&system, &twice, &[0, 1], &auto), ForceError::Unseen { .. }));
}
