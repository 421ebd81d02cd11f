//! Stability over random systems.

use mechid_integrate::*;
use mechid_model::SecondOrderSystem;
use nalgebra::DMatrix;
use proptest::prelude::*;

/// B Bᵀ + floor·I from the entries of B.
fn definite(dof: usize, entries: &[f64], floor: f64) -> DMatrix<f64> {
    let b = DMatrix::from_column_slice(dof, dof, &entries[..dof * dof]);
    &b * b.transpose() + DMatrix::identity(dof, dof) * floor
}

prop_compose! {
    /// Systems with M and K symmetric positive definite, and C symmetric positive semidefinite and
    /// independent of M and K.
    fn passive()(
        dof in 1usize..=4,
        m in prop::collection::vec(-1.0..1.0f64, 16),
        c in prop::collection::vec(-1.0..1.0f64, 16),
        k in prop::collection::vec(-3.0..3.0f64, 16),
        damped in 0.0..2.0f64,
    ) -> SecondOrderSystem {
        SecondOrderSystem::new(
            definite(dof, &m, 0.3),
            definite(dof, &c, 0.0) * damped,
            definite(dof, &k, 0.1),
        ).unwrap()
    }
}

/// Highest natural frequency without damping.
fn fastest(system: &SecondOrderSystem) -> f64 {
    let n = system.dof();
    let undamped = SecondOrderSystem::new(
        system.mass().clone(),
        DMatrix::zeros(n, n),
        system.stiffness().clone(),
    );
    undamped.unwrap().eigenvalues().unwrap().iter().map(|l| l.norm()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn unconditionally_stable_schemes_are_stable_at_any_step(
        system in passive(),
        exponent in -3.0..5.0f64,
    ) {
        let dt = 10f64.powf(exponent) / fastest(&system);
        let schemes: [&dyn Scheme; 5] = [
            &Newmark::AVERAGE_ACCELERATION,
            &Newmark::new(0.3025, 0.6).unwrap(),
            &Houbolt::default(),
            &WilsonTheta::new(1.37).unwrap(),
            &WilsonTheta::new(1.4).unwrap(),
        ];
        for scheme in schemes {
            let radius = spectral_radius(scheme, &system, dt).unwrap();
            // At very large steps eigenvalues meet at −1, where rounding moves them by √ε.
            prop_assert!(radius <= 1.0 + 1e-6, "{} at {dt}: {radius}", scheme.name());
            prop_assert!(scheme.prepare(&system, dt).is_ok());
        }
    }

    #[test]
    fn central_difference_is_stable_exactly_up_to_two(system in passive()) {
        let expected = 2.0 / fastest(&system);
        for scheme in [&CentralDifference::default() as &dyn Scheme, &Newmark::CENTRAL_DIFFERENCE] {
            let limit = critical_step(scheme, &system).unwrap().unwrap();
            // With damping, the eigenvalue passes −1 slowly, so that the tolerated growth of 1e-9
            // moves the limit.
            prop_assert!((limit / expected - 1.0).abs() < 1e-6, "{limit} {expected}");
            prop_assert!(scheme.prepare(&system, 0.999 * expected).is_ok());
            let refused = scheme.prepare(&system, 1.01 * expected);
            match refused {
                Err(IntegrateError::Unstable { critical_step: Some(said), .. }) => {
                    prop_assert!((said / expected - 1.0).abs() < 1e-6);
                }
                other => prop_assert!(false, "{:?}", other.map(|_| ())),
            }
        }
    }

    #[test]
    fn runge_kutta_is_limited_by_its_polynomial(system in passive()) {
        // In each step, the motion of every eigenvalue λ of the system is multiplied by its own
        // factor R(λΔt).
        let limit = critical_step(&RungeKutta4::LINEAR, &system).unwrap().unwrap();
        let eigenvalues = system.eigenvalues().unwrap();
        let growth = |dt: f64| {
            eigenvalues
                .iter()
                .map(|l| {
                    let z = l * dt;
                    (1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))).norm()
                })
                .fold(0.0, f64::max)
        };
        prop_assert!(growth(0.9999 * limit) <= 1.0 + 1e-8);
        prop_assert!(growth(1.0001 * limit) > 1.0);
    }

    #[test]
    fn stable_oil_films_are_no_obstacle(dof in 1usize..=4, seed in 0u64..1000, exponent in -3.0..3.0f64) {
        // C and K are not symmetric. Average acceleration is the trapezoidal rule, which is stable
        // for every stable system.
        let system = mechid_problems::random_stable(dof, seed);
        let dt = 10f64.powf(exponent) / 60.0;
        let radius = spectral_radius(&Newmark::AVERAGE_ACCELERATION, &system, dt).unwrap();
        prop_assert!(radius <= 1.0 + 1e-7, "{radius}");
    }
}

#[test]
fn a_system_unstable_by_itself_may_grow() {
    // An oil film that whirls: its cross-coupled stiffness acts as negative damping, so that the
    // motion of the system itself grows.
    let system = SecondOrderSystem::new(
        DMatrix::identity(2, 2),
        DMatrix::identity(2, 2) * 0.1,
        nalgebra::dmatrix![10.0, 5.0; -5.0, 10.0],
    )
    .unwrap();
    assert!(system.eigenvalues().unwrap().iter().any(|l| l.re > 0.1));
    assert!(CentralDifference::default().prepare(&system, 0.01).is_ok());
    assert!(RungeKutta4::LINEAR.prepare(&system, 0.01).is_ok());
    assert!(matches!(
        CentralDifference::default().prepare(&system, 1.0),
        Err(IntegrateError::Unstable { critical_step: Some(limit), .. }) if (0.3..0.7).contains(&limit)
    ));
}

#[test]
fn a_free_body_is_no_instability() {
    // Rigid-body motion has the double eigenvalue 1. Rounding splits it, but every scheme must
    // still accept the step.
    let chain = DMatrix::from_fn(6, 6, |i, j| match i.abs_diff(j) {
        0 if i == 0 || i == 5 => 100.0,
        0 => 200.0,
        1 => -100.0,
        _ => 0.0,
    });
    let system =
        SecondOrderSystem::new(DMatrix::identity(6, 6), DMatrix::zeros(6, 6), chain).unwrap();
    for scheme in crate::common::schemes() {
        assert!(scheme.prepare(&system, 0.01).is_ok(), "{}", scheme.name());
    }
    let limit = critical_step(&CentralDifference::default(), &system).unwrap().unwrap();
    assert!((limit / (2.0 / fastest(&system)) - 1.0).abs() < 1e-4, "{limit}");
}
