//! Superposition, shifts in time, units, and the agreement of diagonal and modal forms.

use mechid_integrate::*;
use mechid_model::{InitialState, Response, Sdof, SecondOrderSystem};
use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_problems::exact_foh;
use mechid_signal::{Multisine, Phases, Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::common::*;

/// Largest difference, each quantity relative to its own largest value.
fn distance(left: [DMatrix<f64>; 3], right: &Response) -> f64 {
    let gaps = left.iter().zip(parts(right)).map(|(l, r)| (l - r).amax() / r.amax());
    gaps.fold(0.0, f64::max)
}

fn owned(response: &Response) -> [DMatrix<f64>; 3] {
    parts(response).map(Clone::clone)
}

/// Returns a moving initial state, or rest for the scheme that requires it.
fn start(scheme: &dyn Scheme, dof: usize) -> InitialState {
    let rest = scheme.conventions().iter().any(|c| c.choice.contains("at rest"));
    if rest { InitialState::rest(dof) } else { moving(dof) }
}

#[test]
fn responses_superpose() {
    let sampling = Sampling::new(0.02, 150).unwrap();
    for dof in [1, 2, 4] {
        let system = mechid_problems::random_stable(dof, 5);
        let one = force(sampling, dof);
        let other = Record::new(sampling, one.data().map(|f| (3.0 * f).sin())).unwrap();
        let sum = Record::new(sampling, 2.0 * one.data() - 0.5 * other.data()).unwrap();
        for scheme in schemes() {
            let scheme = scheme.as_ref();
            let start = start(scheme, dof);
            let doubled =
                InitialState::new(2.0 * start.displacement(), 2.0 * start.velocity()).unwrap();
            let a = integrate(scheme, &system, &one, &start).unwrap();
            let b = integrate(scheme, &system, &other, &InitialState::rest(dof)).unwrap();
            let both = integrate(scheme, &system, &sum, &doubled).unwrap();
            let (a, b) = (owned(&a), owned(&b));
            let added = std::array::from_fn(|i| 2.0 * &a[i] - 0.5 * &b[i]);
            // The responses differ by the rounding of 150 steps.
            assert!(distance(added, &both) < 1e-12, "{} n {dof}", scheme.name());
        }
    }
}

#[test]
fn the_displacement_alone_is_that_of_the_whole_response() {
    for dof in [1, 2, 5] {
        let system = mechid_problems::random_stable(dof, 2);
        // The numbers of steps are odd and even; a record of one sample has no step.
        for len in [1, 2, 3, 64, 65] {
            let force = force(Sampling::new(1e-3, len).unwrap(), dof);
            for scheme in schemes() {
                let (scheme, start) = (scheme.as_ref(), start(scheme.as_ref(), dof));
                let whole = integrate(scheme, &system, &force, &start).unwrap();
                let alone = integrate_displacement(scheme, &system, &force, &start).unwrap();
                assert_eq!(&alone, whole.displacement(), "{} n {dof} {len}", scheme.name());
            }
        }
    }
}

#[test]
fn a_late_force_moves_the_machine_late() {
    // The first three samples are zero, so that every starting procedure starts without a force.
    let (late, len) = (17, 120);
    let sampling = Sampling::new(0.02, len).unwrap();
    for dof in [1, 3] {
        let system = mechid_problems::random_stable(dof, 8);
        let mut data = force(sampling, dof).into_data();
        data.rows_mut(0, 3).fill(0.0);
        let soon = Record::new(sampling, data.clone()).unwrap();
        let delayed =
            DMatrix::from_fn(len, dof, |k, c| if k < late { 0.0 } else { data[(k - late, c)] });
        let delayed = Record::new(sampling, delayed).unwrap();
        for scheme in schemes() {
            let rest = InitialState::rest(dof);
            let a = integrate(scheme.as_ref(), &system, &soon, &rest).unwrap();
            let b = integrate(scheme.as_ref(), &system, &delayed, &rest).unwrap();
            for (a, b) in parts(&a).iter().zip(parts(&b)) {
                // Only the last step of a record may depend on the force after the end of the
                // record.
                let (a, b) = (a.rows(0, len - late - 1), b.rows(late, len - late - 1));
                assert!((a - b).amax() < 1e-13 * a.amax(), "{} n {dof}", scheme.name());
            }
        }
    }
}

#[test]
fn a_rotated_period_gives_the_rotated_response() {
    let len = 96;
    for dof in [1, 2, 3] {
        let system = mechid_problems::random_stable(dof, 2);
        let force = force(Sampling::new(0.01, len).unwrap(), dof);
        let turned = DMatrix::from_fn(len, dof, |k, c| force.data()[((k + 31) % len, c)]);
        let turned = Record::new(force.sampling(), turned).unwrap();
        for scheme in schemes() {
            let a = integrate_periodic(scheme.as_ref(), &system, &force).unwrap();
            let b = integrate_periodic(scheme.as_ref(), &system, &turned).unwrap();
            let a = owned(&a).map(|p| DMatrix::from_fn(len, dof, |k, c| p[((k + 31) % len, c)]));
            assert!(distance(a, &b) < 1e-12, "{} n {dof}", scheme.name());
        }
    }
}

#[test]
fn units_do_not_matter() {
    // If the units change by factors that are powers of two, all digits of the response must stay
    // the same.
    let (mass, length, time) = (2f64.powi(-7), 2f64.powi(10), 2f64.powi(-9));
    for dof in [1, 2, 3, 6] {
        let s = mechid_problems::random_stable(dof, 4);
        let scaled = SecondOrderSystem::new(
            s.mass() * mass,
            s.damping() * (mass / time),
            s.stiffness() * (mass / (time * time)),
        )
        .unwrap();
        let plain = force(Sampling::new(0.01, 80).unwrap(), dof);
        let force = Record::new(
            Sampling::new(0.01 * time, 80).unwrap(),
            plain.data() * (mass * length / (time * time)),
        )
        .unwrap();
        for scheme in schemes() {
            let scheme = scheme.as_ref();
            let start = start(scheme, dof);
            let start_scaled = InitialState::new(
                start.displacement() * length,
                start.velocity() * (length / time),
            )
            .unwrap();
            let a = integrate(scheme, &s, &plain, &start).unwrap();
            let b = integrate(scheme, &scaled, &force, &start_scaled).unwrap();
            let units = [length, length / time, length / (time * time)];
            for ((a, b), unit) in parts(&a).iter().zip(parts(&b)).zip(units) {
                assert_eq!(&(*a * unit), b, "{} n {dof}", scheme.name());
            }
            let a = integrate_periodic(scheme, &s, &plain).unwrap();
            let b = integrate_periodic(scheme, &scaled, &force).unwrap();
            let a = owned(&a);
            let a = std::array::from_fn(|i| &a[i] * units[i]);
            assert!(distance(a, &b) < 1e-12, "{} n {dof}, periodic", scheme.name());
        }
    }
}

#[test]
fn a_diagonal_system_is_its_single_degrees_of_freedom() {
    let singles: Vec<Sdof> =
        [(1.0, 0.1, 9.0), (2.0, 0.0, 30.0), (0.5, 0.8, 1.0), (3.0, 5.0, 400.0)]
            .map(|(m, c, k)| Sdof::new(m, c, k).unwrap())
            .to_vec();
    let diagonal = |f: fn(&Sdof) -> f64| {
        DMatrix::from_diagonal(&DVector::from_iterator(4, singles.iter().map(f)))
    };
    let system = SecondOrderSystem::new(
        diagonal(Sdof::mass),
        diagonal(Sdof::damping),
        diagonal(Sdof::stiffness),
    )
    .unwrap();
    let force = force(Sampling::new(0.05, 400).unwrap(), 4);
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let start = start(scheme, 4);
        let all = integrate(scheme, &system, &force, &start).unwrap();
        for (c, single) in singles.iter().enumerate() {
            let one = Record::from_channel(force.sampling(), force.channel(c).to_vec()).unwrap();
            let start = InitialState::new(
                DVector::from_element(1, start.displacement()[c]),
                DVector::from_element(1, start.velocity()[c]),
            )
            .unwrap();
            let alone = integrate(scheme, &single.system(), &one, &start).unwrap();
            let column = owned(&all).map(|p| p.columns(c, 1).into_owned());
            // The responses may differ only by the rounding errors of 400 steps. In the second
            // oscillator, which is undamped, these errors do not decay.
            assert!(distance(column, &alone) < 1e-11, "{} channel {c}", scheme.name());
        }
    }
}

#[test]
fn modes_may_be_integrated_one_by_one() {
    // M = I, K symmetric, C = 0.3 M + 0.002 K: x = V q with the eigenvectors V of K.
    let n = 5;
    let stiffness = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 90.0 + 10.0 * i as f64,
        1 => -40.0,
        _ => 3.0,
    });
    let damping = DMatrix::identity(n, n) * 0.3 + &stiffness * 0.002;
    let system =
        SecondOrderSystem::new(DMatrix::identity(n, n), damping, stiffness.clone()).unwrap();
    let eigen = hermitian_eigen(stiffness).unwrap();
    let force = force(Sampling::new(0.02, 300).unwrap(), n);
    let modal_force = force.data() * &eigen.eigenvectors;
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let start = start(scheme, n);
        let direct = integrate(scheme, &system, &force, &start).unwrap();
        let mut sum = [(); 3].map(|()| DMatrix::zeros(300, n));
        for (r, &k) in eigen.eigenvalues.iter().enumerate() {
            let shape = eigen.eigenvectors.column(r);
            let mode = Sdof::new(1.0, 0.3 + 0.002 * k, k).unwrap().system();
            let f =
                Record::from_channel(force.sampling(), modal_force.column(r).as_slice().to_vec())
                    .unwrap();
            let start = InitialState::new(
                DVector::from_element(1, shape.dot(start.displacement())),
                DVector::from_element(1, shape.dot(start.velocity())),
            )
            .unwrap();
            let motion = integrate(scheme, &mode, &f, &start).unwrap();
            for (sum, q) in sum.iter_mut().zip(parts(&motion)) {
                *sum += q * shape.transpose();
            }
        }
        assert!(distance(sum, &direct) < 1e-11, "{}", scheme.name());
    }
}

/// On each channel the force is a flat Schroeder multisine, which begins at a different sample of
/// its period and is linear between samples. The response is compared with the exact response to
/// this force.
#[test]
fn small_steps_approach_the_exact_discretisation() {
    let len = 64;
    let coarse = Sampling::new(0.02, len).unwrap();
    let signal =
        Multisine::flat(1..=12, 1.0, Phases::SchroederBinary).unwrap().sample(coarse).unwrap();
    for dof in [1, 3] {
        let system = mechid_problems::random_stable(dof, 6);
        for shift in [0, 7, 20] {
            let data =
                DMatrix::from_fn(len, dof, |k, c| signal.channel(0)[(k + shift + 9 * c) % len]);
            let force = Record::new(coarse, data).unwrap();
            for scheme in schemes() {
                let scheme = scheme.as_ref();
                let start = start(scheme, dof);
                let exact = exact_foh(&system, &force, &start).unwrap();
                let error = |refine: usize| {
                    let fine = refined(&force, refine);
                    let response = integrate(scheme, &system, &fine, &start).unwrap();
                    let every = owned(&response)
                        .map(|p| DMatrix::from_fn(len, dof, |k, c| p[(k * refine, c)]));
                    distance(every, &exact)
                };
                let (coarse, fine) = (error(40), error(160));
                // A step of a quarter of the size reduces the error by a factor of 4 for schemes of
                // first order, and of 16 for the others.
                let ratio = coarse / fine;
                let name = scheme.name();
                // The matrix exponential of a linear force is the exact discretisation.
                let exact = coarse.max(fine) < 1e-10;
                assert!(
                    exact || fine < 0.05 && ratio > 3.5,
                    "{name} n {dof} shift {shift}: {coarse:e} {fine:e}"
                );
            }
        }
    }
}

/// Returns `force` with each step divided into `times` steps, linear between its samples.
fn refined(force: &Record, times: usize) -> Record {
    let len = (force.len() - 1) * times + 1;
    let data = DMatrix::from_fn(len, force.channels(), |k, c| {
        let (at, part) = (k / times, (k % times) as f64 / times as f64);
        let now = force.data()[(at, c)];
        let next = force.data()[((at + 1).min(force.len() - 1), c)];
        now + part * (next - now)
    });
    Record::new(Sampling::new(force.sampling().dt() / times as f64, len).unwrap(), data).unwrap()
}

#[test]
fn average_acceleration_keeps_the_energy() {
    // ωΔt is small, medium or large; n = 1 and n = 2 use loops of fixed size, n = 3 uses the
    // stepper.
    for (dof, angle) in [(1, 0.05), (1, 0.7), (1, 5.0), (2, 0.3), (3, 0.3)] {
        let stiffness = DMatrix::from_fn(dof, dof, |i, j| if i == j { 3.0 } else { -1.0 });
        let mass = DMatrix::from_diagonal(&DVector::from_fn(dof, |i, _| 1.0 + 0.5 * i as f64));
        let system = SecondOrderSystem::new(mass, DMatrix::zeros(dof, dof), stiffness).unwrap();
        let steps = 1_000_000;
        let still = Record::new(
            Sampling::new(angle / 3f64.sqrt(), steps + 1).unwrap(),
            DMatrix::zeros(steps + 1, dof),
        )
        .unwrap();
        let response =
            integrate(&Newmark::AVERAGE_ACCELERATION, &system, &still, &moving(dof)).unwrap();
        let energy = |k: usize| {
            let x = response.displacement().data().row(k).transpose();
            let v = response.velocity().data().row(k).transpose();
            0.5 * (v.dot(&(system.mass() * &v)) + x.dot(&(system.stiffness() * &x)))
        };
        let begin = energy(0);
        for k in (0..=steps).step_by(997) {
            let drift = energy(k) / begin - 1.0;
            assert!(drift.abs() < 1e-10, "n {dof} ωΔt {angle} step {k}: {drift:e}");
        }
    }
}
