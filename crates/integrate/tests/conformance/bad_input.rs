//! Impossible computations are refused with an error that contains the offending numbers; no
//! function panics.

use mechid_integrate::*;
use mechid_model::{InitialState, ModelError, Sdof, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::common::*;

fn sdof() -> SecondOrderSystem {
    Sdof::new(1.0, 0.1, 1.0).unwrap().system()
}

#[test]
fn parameters_out_of_range() {
    for theta in [0.999, f64::NAN, f64::INFINITY] {
        let refused = WilsonTheta::new(theta).unwrap_err();
        assert!(matches!(refused, IntegrateError::Parameter { parameter: "θ", least: 1.0, .. }));
    }
    for (beta, gamma, name) in
        [(-0.1, 0.5, "β"), (1.1, 0.5, "β"), (0.25, -0.5, "γ"), (0.25, f64::NAN, "γ")]
    {
        match Newmark::new(beta, gamma).unwrap_err() {
            IntegrateError::Parameter { parameter, .. } => assert_eq!(parameter, name),
            other => panic!("{other}"),
        }
    }
    assert_eq!(
        Newmark::new(2.0, 0.5).unwrap_err().to_string(),
        "Newmark: β must lie between 0 and 1, got 2"
    );
}

#[test]
fn steps_that_are_none() {
    for scheme in schemes() {
        for dt in [0.0, -1.0, f64::INFINITY] {
            let refused = scheme.prepare(&sdof(), dt).err();
            assert_eq!(refused, Some(IntegrateError::TimeStep { dt }), "{}", scheme.name());
        }
        assert!(scheme.prepare(&sdof(), f64::NAN).is_err());
    }
}

#[test]
fn shapes_that_do_not_fit() {
    let wide = force(Sampling::new(0.1, 10).unwrap(), 2);
    let one = force(Sampling::new(0.1, 10).unwrap(), 1);
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let rest = InitialState::rest(1);
        let refused = IntegrateError::Components { what: "the force", got: 2, dof: 1 };
        assert_eq!(integrate(scheme, &sdof(), &wide, &rest).unwrap_err(), refused);
        assert_eq!(integrate_periodic(scheme, &sdof(), &wide).unwrap_err(), refused);
        assert_eq!(
            integrate(scheme, &sdof(), &one, &InitialState::rest(2)).unwrap_err(),
            IntegrateError::Model(ModelError::StateLength { got: 2, dof: 1 })
        );
    }
}

#[test]
fn mid_step_forces_missing_or_misfitting() {
    let one = force(Sampling::new(0.1, 10).unwrap(), 1);
    let rest = InitialState::rest(1);
    let scheme = &RungeKutta4::SUPPLIED;
    for refused in [
        integrate(scheme, &sdof(), &one, &rest),
        integrate_periodic(&AllowUnstable(scheme), &sdof(), &one),
    ] {
        assert!(matches!(refused, Err(IntegrateError::MidStepMissing { .. })));
    }
    let short = force(Sampling::new(0.1, 9).unwrap(), 1);
    let refused = integrate(scheme, &sdof(), SampledForce::with_mid_step(&one, &short), &rest);
    assert!(matches!(refused, Err(IntegrateError::MidStepSampling { got: 9, expected: 10, .. })));
    let wide = force(Sampling::new(0.1, 10).unwrap(), 3);
    let refused = integrate(scheme, &sdof(), SampledForce::with_mid_step(&one, &wide), &rest);
    assert!(matches!(refused, Err(IntegrateError::Components { got: 3, dof: 1, .. })));
}

#[test]
fn starts_that_cannot_be() {
    let one = force(Sampling::new(0.1, 10).unwrap(), 1);
    let rest = CentralDifference { start: CentralDifferenceStart::Rest };
    let moving =
        InitialState::new(DVector::from_element(1, 0.0), DVector::from_element(1, 2.0)).unwrap();
    assert_eq!(
        integrate(&rest, &sdof(), &one, &moving).unwrap_err(),
        IntegrateError::NotAtRest { component: 1, velocity: 2.0 }
    );
    let given = |at_dt: Vec<f64>, at_2dt: Vec<f64>| Houbolt {
        start: HouboltStart::Given { at_dt, at_2dt },
    };
    let refused = given(vec![0.0], vec![0.0, 0.0]).prepare(&sdof(), 0.1).err().unwrap();
    assert!(matches!(refused, IntegrateError::Components { got: 2, dof: 1, .. }));
    let refused = given(vec![f64::NAN], vec![0.0]).prepare(&sdof(), 0.1).err().unwrap();
    assert!(matches!(refused, IntegrateError::NotFinite { component: 1, .. }));
}

#[test]
fn functions_that_yield_no_number() {
    let sampling = Sampling::new(0.1, 10).unwrap();
    for scheme in [&Newmark::AVERAGE_ACCELERATION as &dyn Scheme, &RungeKutta4::SUPPLIED] {
        let refused =
            integrate_function(scheme, &sdof(), sampling, &InitialState::rest(1), |t, f| {
                f[0] = if t > 0.44 { f64::NAN } else { 1.0 };
            });
        match refused.unwrap_err() {
            IntegrateError::NotFinite { component: 1, time, .. } => {
                assert!((0.44..0.51).contains(&time))
            }
            other => panic!("{other}"),
        }
    }
}

#[test]
fn effective_masses_that_are_singular() {
    // With K = −4/Δt²·M, the effective mass of average acceleration is M + ¼Δt²K = 0.
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    let system = SecondOrderSystem::new(one(1.0), one(0.0), one(-400.0)).unwrap();
    let refused = Newmark::AVERAGE_ACCELERATION.prepare(&system, 0.1).err().unwrap();
    assert!(matches!(refused, IntegrateError::SingularEffectiveMass { .. }), "{refused}");
}

#[test]
fn overflow_is_an_error_and_not_a_record_of_infinities() {
    let system = Sdof::new(1.0, 0.0, 1.0).unwrap().system();
    let force = force(Sampling::new(10.0, 400).unwrap(), 1);
    let scheme = CentralDifference::default();
    let rest = InitialState::rest(1);
    match integrate(&scheme, &system, &force, &rest).unwrap_err() {
        IntegrateError::Unstable { critical_step: Some(limit), spectral_radius, .. } => {
            assert!((limit - 2.0).abs() < 1e-8 && spectral_radius > 90.0);
        }
        other => panic!("{other}"),
    }
    let refused = integrate(&AllowUnstable(&scheme), &system, &force, &rest);
    assert!(matches!(refused, Err(IntegrateError::Overflow { component: 1, .. })), "{refused:?}");
    assert!(integrate_periodic(&AllowUnstable(&scheme), &system, &force).is_err());
}

#[test]
fn entries_of_any_size_are_computed_or_refused() {
    for (m, c, k) in [(1e-300, 1e300, 1e300), (1e300, 0.0, 1e-300), (1e-12, 1e12, 1.0)] {
        let one = |v: f64| DMatrix::from_element(1, 1, v);
        let Ok(system) = SecondOrderSystem::new(one(m), one(c), one(k)) else { continue };
        let force = force(Sampling::new(1e-3, 20).unwrap(), 1);
        for scheme in schemes() {
            // Any result is allowed here, but no panic and no endless loop.
            let _ = integrate(scheme.as_ref(), &system, &force, &InitialState::rest(1));
            let _ = integrate_periodic(scheme.as_ref(), &system, &force);
        }
    }
}

#[test]
fn records_of_one_or_two_samples_are_integrated() {
    for len in [1, 2, 3] {
        for dof in [1, 3] {
            let system = mechid_problems::random_stable(dof, 1);
            let force = Record::new(
                Sampling::new(0.01, len).unwrap(),
                DMatrix::from_element(len, dof, 1.0),
            )
            .unwrap();
            for scheme in schemes() {
                let rest = InitialState::rest(dof);
                let response = integrate(scheme.as_ref(), &system, &force, &rest).unwrap();
                assert_eq!((response.displacement().len(), response.dof()), (len, dof));
                // A constant force has a constant steady state with K x = F.
                let steady = integrate_periodic(scheme.as_ref(), &system, &force).unwrap();
                let x = steady.displacement().data().row(0).transpose();
                let held = system.stiffness() * &x;
                assert!(held.iter().all(|f| (f - 1.0).abs() < 1e-9), "{} {held}", scheme.name());
            }
        }
    }
}
