//! Checks of the reference solutions against complex modal superposition and prescribed motions,
//! and with refined and repeated forces.

use mechid_model::{InitialState, ModelError, Response, SecondOrderSystem};
use mechid_problems::{
    ProblemError, exact_foh, exact_foh_periodic, exact_harmonic, exact_harmonic_periodic,
    exact_zoh, exact_zoh_periodic, random_stable, steffen_rade,
};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, DVector, dmatrix, dvector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Tolerance of a modal superposition: the condition number of the modal matrices, below about 10⁴
/// for these small systems, times ε.
const MODAL: f64 = 1e-11;

fn random_force(dof: usize, len: usize, dt: f64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let data = DMatrix::from_fn(len, dof, |_, _| rng.random_range(-10.0..10.0));
    Record::new(Sampling::new(dt, len).unwrap(), data).unwrap()
}

fn some_state(dof: usize) -> InitialState {
    let x = DVector::from_fn(dof, |i, _| 0.01 * (i as f64 + 1.0));
    let v = DVector::from_fn(dof, |i, _| 0.3 - 0.2 * i as f64);
    InitialState::new(x, v).unwrap()
}

/// Largest difference relative to the largest value, over x, v and a.
fn gap(p: &Response, q: &Response) -> f64 {
    let relative = |a: &Record, b: &Record| (a.data() - b.data()).amax() / b.data().amax();
    relative(p.displacement(), q.displacement())
        .max(relative(p.velocity(), q.velocity()))
        .max(relative(p.acceleration(), q.acceleration()))
}

/// Returns the force repeated `times` times.
fn repeated(force: &Record, times: usize) -> Record {
    let (len, dof) = (force.len(), force.channels());
    let data = DMatrix::from_fn(len * times, dof, |k, j| force.data()[(k % len, j)]);
    Record::new(force.sampling().with_len(len * times).unwrap(), data).unwrap()
}

/// Returns the superposition of the 2n complex modes q̇ = λ q + b F, each integrated in closed
/// form. During a step the force is constant or, if `linear` is true, changes linearly.
fn by_modes(
    system: &SecondOrderSystem,
    force: &Record,
    start: &InitialState,
    linear: bool,
) -> Response {
    let (n, dt) = (system.dof(), force.sampling().dt());
    let mut columns = Vec::new();
    for mode in system.modes().unwrap() {
        let l = mode.eigenvalue();
        let column = DVector::from_fn(2 * n, |i, _| {
            mode.shape()[i % n] * if i < n { 1.0.into() } else { l }
        });
        columns.push((l, column.clone()));
        if mode.oscillates() {
            columns.push((l.conj(), column.map(|z| z.conj())));
        }
    }
    let vectors = DMatrix::from_columns(&columns.iter().map(|c| c.1.clone()).collect::<Vec<_>>());
    let to_modal = vectors.clone().lu();
    let state = DVector::from_fn(2 * n, |i, _| {
        if i < n { start.displacement()[i] } else { start.velocity()[i - n] }
    });
    let mut q = to_modal.solve(&state.map(Complex::from)).unwrap();
    let mass = system.mass().clone().lu();
    let mut input = DMatrix::zeros(2 * n, n);
    input.view_mut((n, 0), (n, n)).copy_from(&mass.solve(&DMatrix::identity(n, n)).unwrap());
    let input = to_modal.solve(&input.map(Complex::from)).unwrap();

    let mut out = [(); 3].map(|()| DMatrix::zeros(force.len(), n));
    for k in 0..force.len() {
        let f = |k: usize| force.data().row(k % force.len()).transpose();
        let (left, right) = (f(k), if linear { f(k + 1) } else { f(k) });
        let z = (&vectors * &q).map(|z| z.re);
        let (x, v) = (z.rows(0, n).into_owned(), z.rows(n, n).into_owned());
        let a = mass.solve(&(&left - system.damping() * &v - system.stiffness() * &x)).unwrap();
        for (matrix, row) in out.iter_mut().zip([x, v, a]) {
            matrix.set_row(k, &row.transpose());
        }
        let (b0, b1) = (&input * left.map(Complex::from), &input * right.map(Complex::from));
        for (i, (l, _)) in columns.iter().enumerate() {
            let growth = (l * dt).exp();
            let held = (growth - 1.0) / l;
            let ramp = (growth - 1.0 - l * dt) / (l * l * dt);
            q[i] = growth * q[i] + held * b0[i] + ramp * (b1[i] - b0[i]);
        }
    }
    let [x, v, a] = out.map(|m| Record::new(force.sampling(), m).unwrap());
    Response::new(x, v, a).unwrap()
}

#[test]
fn held_and_linear_agree_with_modal_superposition() {
    for (dof, seed) in [(1, 1), (2, 2), (3, 3), (5, 4)] {
        let system = random_stable(dof, seed);
        // About 20 samples in the shortest natural period.
        let force = random_force(dof, 300, 0.005);
        let start = some_state(dof);
        let held = exact_zoh(&system, &force, &start).unwrap();
        assert!(gap(&held, &by_modes(&system, &force, &start, false)) < MODAL, "dof {dof}");
        let linear = exact_foh(&system, &force, &start).unwrap();
        assert!(gap(&linear, &by_modes(&system, &force, &start, true)) < MODAL, "dof {dof}");
        assert!(gap(&held, &linear) > 1e-3, "the two conventions must differ");
    }
}

#[test]
fn long_steps_are_as_exact_as_short_ones() {
    // A force that is held between samples does not change if it is sampled eight times as fast, so
    // both responses must be equal.
    let system = random_stable(4, 11);
    let (coarse, ratio) = (random_force(4, 40, 0.4), 8);
    let len = coarse.len() * ratio;
    let data = DMatrix::from_fn(len, 4, |k, j| coarse.data()[(k / ratio, j)]);
    let fine = Record::new(Sampling::new(0.05, len).unwrap(), data).unwrap();
    let start = some_state(4);
    let p = exact_zoh(&system, &coarse, &start).unwrap();
    let q = exact_zoh(&system, &fine, &start).unwrap();
    let every = DMatrix::from_fn(coarse.len(), 4, |k, j| q.displacement().data()[(k * ratio, j)]);
    let scale = every.amax();
    assert!((p.displacement().data() - every).amax() < 1e-12 * scale);
}

#[test]
fn periodic_motions_repeat_and_attract() {
    let system = steffen_rade();
    let force = random_force(2, 128, 0.01);
    type Periodic = fn(&SecondOrderSystem, &Record) -> Result<Response, ProblemError>;
    type Started = fn(&SecondOrderSystem, &Record, &InitialState) -> Result<Response, ProblemError>;
    let pairs: [(Periodic, Started); 3] = [
        (exact_zoh_periodic, exact_zoh),
        (exact_foh_periodic, exact_foh),
        (exact_harmonic_periodic, exact_harmonic),
    ];
    for (periodic, started) in pairs {
        let steady = periodic(&system, &force).unwrap();
        // The slowest mode decays by exp(−0.1869·2π·3.17·1.28) < 0.01 per period, so that 12
        // periods are enough.
        let long = started(&system, &repeated(&force, 12), &some_state(2)).unwrap();
        let last = |r: &Record| r.window(11 * 128, 128).unwrap();
        let last = Response::new(
            last(long.displacement()),
            last(long.velocity()),
            last(long.acceleration()),
        )
        .unwrap();
        assert!(gap(&last, &steady) < 1e-12);
    }
}

#[test]
fn very_light_damping_still_closes() {
    // With ζ = 1e-6, the transient would last a hundred thousand periods.
    let system = SecondOrderSystem::new(dmatrix![1.0], dmatrix![2e-5], dmatrix![100.0]).unwrap();
    let force = random_force(1, 64, 0.013);
    let steady = exact_zoh_periodic(&system, &force).unwrap();
    let start = InitialState::new(
        dvector![steady.displacement().data()[0]],
        dvector![steady.velocity().data()[0]],
    )
    .unwrap();
    let twice = exact_zoh(&system, &repeated(&force, 2), &start).unwrap();
    let second = twice.displacement().window(64, 64).unwrap();
    let scale = second.data().amax();
    assert!((second.data() - steady.displacement().data()).amax() < 1e-12 * scale);
}

#[test]
fn a_prescribed_motion_is_found_from_its_force() {
    // x_j(t) = A_j cos(3 ω0 t) + B_j sin(7 ω0 t); the force follows from the equation of motion.
    for len in [64, 65] {
        let system = random_stable(3, 5);
        let sampling = Sampling::new(0.02, len).unwrap();
        let (w3, w7) = (3.0 * sampling.omega0(), 7.0 * sampling.omega0());
        let (a, b) = (dvector![1.0, -0.5, 0.2], dvector![0.3, 0.8, -0.6]);
        let rows: Vec<[DVector<f64>; 4]> = sampling
            .times()
            .map(|t| {
                let ((s3, c3), (s7, c7)) = ((w3 * t).sin_cos(), (w7 * t).sin_cos());
                let x = &a * c3 + &b * s7;
                let v = -&a * (w3 * s3) + &b * (w7 * c7);
                let acc = -&a * (w3 * w3 * c3) - &b * (w7 * w7 * s7);
                let f = system.mass() * &acc + system.damping() * &v + system.stiffness() * &x;
                [x, v, acc, f]
            })
            .collect();
        let record = |i: usize| {
            Record::new(sampling, DMatrix::from_fn(len, 3, |k, j| rows[k][i][j])).unwrap()
        };
        let expected = Response::new(record(0), record(1), record(2)).unwrap();
        let found = exact_harmonic_periodic(&system, &record(3)).unwrap();
        assert!(gap(&found, &expected) < 1e-12, "len {len}");
        // If the given initial state is that of the periodic motion, the response must be the
        // periodic motion. For any other initial state, the response must begin with this state.
        let on = InitialState::new(rows[0][0].clone(), rows[0][1].clone()).unwrap();
        assert!(gap(&exact_harmonic(&system, &record(3), &on).unwrap(), &expected) < 1e-12);
        let off = exact_harmonic(&system, &record(3), &some_state(3)).unwrap();
        assert!((off.displacement().data()[(0, 1)] - 0.02).abs() < 1e-12);
        assert!((off.velocity().data()[(0, 0)] - 0.3).abs() < 1e-12 * w7);
    }
}

#[test]
fn the_three_conventions_meet_on_a_fine_grid() {
    // The force is a cosine with 2,000 samples per period. If the force is linear between the
    // samples, the error of the response is (ωΔt)²/12 of its amplitude. If the force is held, the
    // error is ωΔt/2. The next terms of both errors are smaller by a factor of (ωΔt)² ≈ 1e-5.
    let system = steffen_rade();
    let sampling = Sampling::new(5e-4, 2000).unwrap();
    let data = DMatrix::from_fn(2000, 2, |k, j| {
        (sampling.omega0() * sampling.time(k)).cos() * (1.0 - j as f64)
    });
    let force = Record::new(sampling, data).unwrap();
    let exact = exact_harmonic_periodic(&system, &force).unwrap();
    let linear = exact_foh_periodic(&system, &force).unwrap();
    let step = sampling.omega0() * sampling.dt();
    assert!((gap_of_displacement(&linear, &exact) / (step * step / 12.0) - 1.0).abs() < 1e-3);
    // A held force lags by half a step, which gives a relative error of ω Δt/2.
    let held = exact_zoh_periodic(&system, &force).unwrap();
    assert!((gap_of_displacement(&held, &exact) / (step / 2.0) - 1.0).abs() < 1e-3);
}

fn gap_of_displacement(p: &Response, q: &Response) -> f64 {
    let (p, q) = (p.displacement().data(), q.displacement().data());
    (p - q).amax() / q.amax()
}

#[test]
fn an_undamped_line_has_no_periodic_motion() {
    // The natural frequency of 3 rad/s is exactly on line 3 of a period of 2π s.
    let system = SecondOrderSystem::new(dmatrix![1.0], dmatrix![0.0], dmatrix![9.0]).unwrap();
    let force = random_force(1, 100, std::f64::consts::TAU / 100.0);
    for periodic in [exact_zoh_periodic, exact_foh_periodic] {
        assert!(matches!(
            periodic(&system, &force),
            Err(ProblemError::NoPeriodicMotion { reciprocal_condition, .. }) if reciprocal_condition < 1e-12
        ));
    }
    assert!(matches!(
        exact_harmonic_periodic(&system, &force),
        Err(ProblemError::Model(ModelError::SingularDynamicStiffness { .. }))
    ));
}

#[test]
fn misfits_are_refused_and_overflow_is_told() {
    let system = steffen_rade();
    let (one, two) = (random_force(1, 16, 0.1), random_force(2, 16, 0.1));
    let expected = Err(ProblemError::Model(ModelError::ForceChannels { got: 1, dof: 2 }));
    assert_eq!(exact_zoh_periodic(&system, &one), expected);
    assert_eq!(exact_harmonic_periodic(&system, &one), expected);
    assert_eq!(exact_foh(&system, &one, &InitialState::rest(2)), expected);
    assert_eq!(
        exact_foh(&system, &two, &InitialState::rest(3)),
        Err(ProblemError::Model(ModelError::StateLength { got: 3, dof: 2 }))
    );
    assert!(matches!(
        exact_zoh(&system, &random_force(2, 4, 1e155), &InitialState::rest(2)),
        Err(ProblemError::StepTooLong { .. })
    ));
    let bursting = SecondOrderSystem::new(dmatrix![1.0], dmatrix![-200.0], dmatrix![1.0]).unwrap();
    assert!(exact_zoh(&bursting, &one, &InitialState::rest(1)).is_ok());
    let long = repeated(&one, 4);
    assert!(matches!(
        exact_zoh(&bursting, &long, &InitialState::rest(1)),
        Err(ProblemError::Signal(_))
    ));
    assert!(exact_zoh_periodic(&bursting, &long).is_err());
}
