//! Measured orders of convergence against the exact answer.

use mechid_integrate::*;
use mechid_model::{InitialState, Response, SecondOrderSystem};
use mechid_numerics::linear_algebra::exponential;
use mechid_signal::Sampling;
use nalgebra::{DMatrix, DVector};

use crate::common::*;

/// Returns the exact motion under [`force_at`] at time `t`, by the matrix exponential of a larger,
/// autonomous system whose extra states are the harmonics and the constant of the force.
fn exact(system: &SecondOrderSystem, initial: &InitialState, t: f64) -> [DVector<f64>; 3] {
    let n = system.dof();
    let a = system.state_matrix();
    let mass = system.mass().clone().lu();
    // Extra states: cos 2t, sin 2t, cos 5.1t, sin 5.1t, 1.
    let mut big = DMatrix::zeros(2 * n + 5, 2 * n + 5);
    big.view_mut((0, 0), (2 * n, 2 * n)).copy_from(&a);
    for (at, omega) in [(0, 2.0), (2, 5.1)] {
        big[(2 * n + at, 2 * n + at + 1)] = -omega;
        big[(2 * n + at + 1, 2 * n + at)] = omega;
    }
    let force = DMatrix::from_fn(n, 5, |c, j| {
        let c = c as f64;
        [3.0 * (0.3 + c).cos(), -3.0 * (0.3 + c).sin(), -c.sin(), c.cos(), 0.7][j]
    });
    big.view_mut((n, 2 * n), (n, 5)).copy_from(&mass.solve(&force).unwrap());
    let mut z = DVector::zeros(2 * n + 5);
    z.rows_mut(0, n).copy_from(initial.displacement());
    z.rows_mut(n, n).copy_from(initial.velocity());
    for one in [2 * n, 2 * n + 2, 2 * n + 4] {
        z[one] = 1.0;
    }
    let end = exponential(&(&big * t)).unwrap() * z;
    let slope = &big * &end;
    [end.rows(0, n).into(), end.rows(n, n).into(), slope.rows(n, n).into()]
}

/// Relative errors of x, ẋ and ẍ at t = 2 s after `steps` steps.
fn errors(scheme: &dyn Scheme, initial: &InitialState, steps: usize) -> [f64; 3] {
    let system = coupled();
    let sampling = Sampling::new(2.0 / steps as f64, steps + 1).unwrap();
    let response = integrate_function(scheme, &system, sampling, initial, force_at).unwrap();
    let truth = exact(&system, initial, 2.0);
    let got = parts(&response);
    std::array::from_fn(|i| (got[i].row(steps).transpose() - &truth[i]).norm() / truth[i].norm())
}

/// Returns the orders of convergence of x, ẋ and ẍ: the slope of ln(error) over ln(Δt) from a step
/// to a quarter of this step.
fn orders(scheme: &dyn Scheme, initial: &InitialState, steps: usize) -> [f64; 3] {
    let (coarse, fine) = (errors(scheme, initial, steps), errors(scheme, initial, 4 * steps));
    std::array::from_fn(|i| (coarse[i] / fine[i]).log2() / 2.0)
}

#[test]
fn every_scheme_converges_with_its_order() {
    let moving = moving(2);
    let expected = |scheme: &dyn Scheme| {
        let name = scheme.name();
        let has = |choice: &str| scheme.conventions().iter().any(|c| c.choice.contains(choice));
        // Three conventions are of first order: γ = 0.6, a force that is held over half a step or a
        // whole step, and a start from rest with F(0) ≠ 0, which neglects or shifts the impulse ½
        // Δt F(0).
        let first = name.contains("Newmark (β = 0.3025") || has("held") || has("at rest");
        let order = match () {
            () if first => 1.0,
            () if name.starts_with("Runge") && has("supplied") => 4.0,
            () => 2.0,
        };
        [order, order, if has("carried") { 1.0 } else { order }]
    };
    let mut all = schemes();
    all.push(Box::new(RungeKutta4::SUPPLIED));
    all.push(Box::new(Bathe::HALVES.with_force(SubStepForce::Supplied)));
    all.push(Box::new(Bathe::new(0.3).unwrap().with_force(SubStepForce::Supplied)));
    for scheme in &all {
        let scheme = scheme.as_ref();
        let rest_only = scheme.conventions().iter().any(|c| c.choice.contains("at rest"));
        let initial = if rest_only { InitialState::rest(2) } else { moving.clone() };
        let measured = orders(scheme, &initial, 400);
        for (order, expected) in measured.into_iter().zip(expected(scheme)) {
            // Between Δt/T of about 1/200 and 1/800, the next term of the error is a few per cent
            // of the first.
            assert!((order - expected).abs() < 0.12, "{}: {measured:?}", scheme.name());
        }
    }
}

#[test]
fn supplied_mid_step_samples_equal_the_function() {
    let system = coupled();
    let sampling = Sampling::new(0.05, 80).unwrap();
    let from_function: Response =
        integrate_function(&RungeKutta4::SUPPLIED, &system, sampling, &moving(2), |t, f| {
            force_at(t, f)
        })
        .unwrap();
    let shifted = DMatrix::from_fn(80, 2, |k, c| {
        let mut f = [0.0; 2];
        force_at((k as f64 + 0.5) * 0.05, &mut f);
        f[c]
    });
    let middle = mechid_signal::Record::new(sampling, shifted).unwrap();
    let samples = force(sampling, 2);
    let with_samples = integrate(
        &RungeKutta4::SUPPLIED,
        &system,
        SampledForce::with_mid_step(&samples, &middle),
        &moving(2),
    )
    .unwrap();
    assert_eq!(from_function, with_samples);
}
