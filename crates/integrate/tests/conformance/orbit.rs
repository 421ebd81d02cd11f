//! Periodic responses of nonlinear systems, judged by chosen responses, by Liouville's formula and
//! by harmonic balance.

use std::f64::consts::TAU;

use mechid_integrate::*;
use mechid_model::{InitialState, SecondOrderSystem, SparseSystem, band};
use mechid_signal::{Record, Sampling};
use nalgebra::{DMatrix, dvector};

use crate::common::*;

fn oscillator(m: f64, c: f64, k: f64) -> SecondOrderSystem {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    SecondOrderSystem::new(one(m), one(c), one(k)).unwrap()
}

fn released(x: f64, v: f64) -> InitialState {
    InitialState::new(dvector![x], dvector![v]).unwrap()
}

fn one_period(omega: f64, len: usize, force: impl Fn(f64) -> f64) -> Record {
    let sampling = Sampling::new(TAU / omega / len as f64, len).unwrap();
    Record::from_channel(sampling, (0..len).map(|k| force(sampling.time(k))).collect()).unwrap()
}

/// In ẍ + c ẋ + x + x³ = F, the force is such that x = cos 2t. The orbit converges with the order
/// of each scheme, and the product of the multipliers is e^(−cT), by Liouville's formula.
#[test]
fn a_chosen_response_is_an_orbit_with_the_multipliers_of_its_damping() {
    let (c, omega) = (0.4, 2.0);
    let linear = oscillator(1.0, c, 1.0);
    let cubic = terms("k3: x1^3", &[1.0]);
    let system = SystemWithForces::new(&linear).with(cubic).unwrap();
    let product = (-c * TAU / omega).exp();
    for scheme in schemes().iter().filter(|s| s.name() != "matrix exponential") {
        let (scheme, name) = (scheme.as_ref(), scheme.name());
        let has = |choice: &str| scheme.conventions().iter().any(|c| c.choice.contains(choice));
        if has("at rest") {
            continue;
        }
        let errors = |len: usize| {
            let force = one_period(omega, len, |t| {
                let (s, x) = (omega * t).sin_cos();
                (1.0 - omega * omega) * x - c * omega * s + x.powi(3)
            });
            let near = released(0.9, 0.1);
            let orbit = periodic_orbit(scheme, &system, &force, &near, 0).unwrap();
            let [x, v, _] = parts(orbit.response());
            let largest = |found: &DMatrix<f64>, truth: &dyn Fn(f64) -> f64| {
                let gap = |k: usize| (found[(k, 0)] - truth(force.sampling().time(k))).abs();
                (0..len).map(gap).fold(0.0, f64::max)
            };
            let found: f64 = orbit.multipliers().iter().map(|m| m.norm()).product();
            assert_eq!((orbit.multipliers().len(), orbit.is_stable()), (2, true), "{name}");
            // The two multipliers are complex conjugates, so that the modulus of each is the square
            // root of their product.
            let multiplier = orbit.multipliers()[0];
            let missed = (multiplier.norm() - product.sqrt()).abs();
            let stated = orbit.scheme_error().unwrap();
            assert!(multiplier.im != 0.0 && missed <= stated, "{name}: {missed:e} {stated:e}");
            assert!(len < 120 || stated < 0.3, "{name}: {stated}");
            [
                largest(x, &|t| (omega * t).cos()),
                largest(v, &|t| -omega * (omega * t).sin()),
                (found / product - 1.0).abs(),
            ]
        };
        let (coarse, fine) = (errors(60), errors(120));
        let order = if name.starts_with("Newmark (β = 0.3025") || has("held") { 1.0 } else { 2.0 };
        for (coarse, fine) in coarse.into_iter().zip(fine).take(2) {
            let found = (coarse / fine).log2();
            assert!((found - order).abs() < 0.3, "{name}: {found} {coarse:e} {fine:e}");
        }
        // The numerical damping of a scheme changes the product of the multipliers. The change is
        // of first order in the step for schemes of first order, otherwise of third order.
        assert!(fine[2] < if order == 1.0 { 0.2 } else { 0.01 }, "{name}: {:e}", fine[2]);
    }
}

/// Three orbits exist where the resonance curve folds over, and the middle one is unstable. The
/// amplitudes follow from one-term harmonic balance, [(k − ω²)A + ¾k₃A³]² + (cωA)² = F².
///
/// # Source
/// Nayfeh & Mook, *Nonlinear Oscillations* (1979), section 4.1.
#[test]
fn the_three_orbits_of_a_folded_resonance_are_found() {
    let (c, k3, f, omega) = (0.05_f64, 0.05_f64, 0.3_f64, 1.2_f64);
    let balance = |a: f64| {
        let elastic = (1.0 - omega * omega) * a + 0.75 * k3 * a.powi(3);
        elastic.powi(2) + (c * omega * a).powi(2) - f * f
    };
    let mut amplitudes = vec![];
    let grid: Vec<f64> = (1..2000).map(|k| 0.002 * f64::from(k)).collect();
    for ends in grid.windows(2).filter(|w| balance(w[0]) * balance(w[1]) <= 0.0) {
        amplitudes.push(0.5 * (ends[0] + ends[1]));
    }
    assert_eq!(amplitudes.len(), 3, "{amplitudes:?}");
    let linear = oscillator(1.0, c, 1.0);
    let cubic = terms("k3: x1^3", &[k3]);
    let system = SystemWithForces::new(&linear).with(cubic).unwrap();
    let force = one_period(omega, 200, |t| f * (omega * t).cos());
    for (k, a) in amplitudes.into_iter().enumerate() {
        // x = A cos(ωt − φ), with the phase φ from the harmonic balance.
        let elastic = (1.0 - omega * omega) * a + 0.75 * k3 * a.powi(3);
        let phase = (c * omega * a).atan2(elastic);
        let near = released(a * phase.cos(), a * omega * phase.sin());
        for scheme in [&Newmark::AVERAGE_ACCELERATION as &dyn Scheme, &Houbolt::default()] {
            let orbit = periodic_orbit(scheme, &system, &force, &near, 0).unwrap();
            let found = orbit.response().displacement().column(0).amax();
            assert!((found / a - 1.0).abs() < 0.03, "{}: {found} {a}", scheme.name());
            let largest = orbit.multipliers()[0];
            assert_eq!(orbit.is_stable(), k != 1, "{}: {largest}", scheme.name());
            assert!(k != 1 || (largest.im == 0.0 && largest.re > 1.1), "{largest}");
        }
    }
    // From rest the motion settles on the lower branch.
    let settled =
        periodic_orbit(&Newmark::AVERAGE_ACCELERATION, &system, &force, &released(0.0, 0.0), 40);
    assert!(settled.unwrap().response().displacement().column(0).amax() < 1.0);
}

#[test]
fn the_orbit_of_a_linear_system_is_its_periodic_response() {
    let system = mechid_problems::random_stable(3, 5);
    let force = force(Sampling::new(0.02, 64).unwrap(), 3);
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let direct = integrate_periodic(scheme, &system, &force).unwrap();
        let rest = InitialState::rest(3);
        let orbit = periodic_orbit(scheme, &system, &force, &rest, 1).unwrap();
        for (found, truth) in parts(orbit.response()).into_iter().zip(parts(&direct)) {
            let gap = (found - truth).amax() / truth.amax();
            assert!(gap < 1e-8, "{}: {gap:e}", scheme.name());
        }
    }
}

#[test]
fn orbits_that_are_not_isolated_or_not_there_are_refused() {
    let free = oscillator(1.0, 0.0, 0.0);
    let scheme = Newmark::AVERAGE_ACCELERATION;
    let of = |system: &dyn System| {
        let force = one_period(1.0, 40, f64::cos);
        periodic_orbit(&scheme, system, &force, &released(0.1, 0.0), 0)
    };
    let refused = of(&free);
    assert!(matches!(refused, Err(IntegrateError::NoPeriodicState { .. })), "{refused:?}");
    // The mean force is larger than the resistance, so that no periodic response exists.
    let pushed = ForceFunction::new(vec![0], |_, _, v, g| g[0] = -1.0 + 0.1 * v[0].tanh());
    let pushed = SystemWithForces::new(&free).with(pushed).unwrap();
    let refused = of(&pushed);
    let none = matches!(
        refused,
        Err(IntegrateError::NoOrbit { .. } | IntegrateError::NoPeriodicState { .. })
    );
    assert!(none, "{refused:?}");
}

/// Coupled masses between walls, one with a cubic spring; the force is such that they have a chosen
/// motion. The orbit converges with second order for many masses, too.
#[test]
fn a_chosen_response_of_many_masses_is_an_orbit() {
    let (dof, omega) = (150, 6.0);
    let stiffness = band(dof, &[(-1, -900.0), (0, 1900.0), (1, -900.0)]);
    let (mass, damping) = (band(dof, &[(0, 1.0)]), band(dof, &[(-1, -1.0), (0, 5.0), (1, -1.0)]));
    let chain = SparseSystem::new(mass, damping, stiffness).unwrap();
    let cubic = terms("k3: x41^3", &[4e3]);
    let system = SystemWithForces::new(&chain).with(cubic).unwrap();
    // The motion is x_i = a_i cos ωt with the shape a_i of a string. The force of the springs
    // between neighbours is then proportional to x_i.
    let shape = |i: usize| (std::f64::consts::PI * (i as f64 + 1.0) / (dof as f64 + 1.0)).sin();
    let curved = 2.0 - 2.0 * (std::f64::consts::PI / (dof as f64 + 1.0)).cos();
    let (k, c) = (100.0 + 900.0 * curved, 3.0 + curved);
    let error = |len: usize| {
        let sampling = Sampling::new(TAU / omega / len as f64, len).unwrap();
        let force = DMatrix::from_fn(len, dof, |sample, i| {
            let (sin, cos) = (omega * sampling.time(sample)).sin_cos();
            let elastic = if i == 40 { 4e3 * (shape(i) * cos).powi(3) } else { 0.0 };
            shape(i) * ((k - omega * omega) * cos - c * omega * sin) + elastic
        });
        let force = Record::new(sampling, force).unwrap();
        let scheme = Newmark::AVERAGE_ACCELERATION;
        let orbit = periodic_orbit(&scheme, &system, &force, &InitialState::rest(dof), 4).unwrap();
        assert!(orbit.is_stable() && orbit.multiplier_error() < 0.1, "{orbit:?}");
        let seen = DMatrix::from_fn(len, dof, |sample, i| {
            shape(i) * (omega * sampling.time(sample)).cos()
        });
        (orbit.response().displacement().data() - seen).amax()
    };
    let (coarse, fine) = (error(40), error(80));
    assert!(((coarse / fine).log2() - 2.0).abs() < 0.2, "{coarse:e} {fine:e}");
}

/// The first of many masses, ẍ + 1.5 ẋ − x + x³ = 0, is at its unstable equilibrium x = 0. A
/// disturbance grows by e^(λT) in a period, with λ² + 1.5 λ − 1 = 0.
#[test]
fn the_instability_of_one_mass_among_many_shows_in_the_largest_multiplier() {
    let dof = 100;
    let mut stiffness = band(dof, &[(0, 9.0)]);
    stiffness.values_mut()[0] = -1.0;
    let damping = band(dof, &[(0, 1.5)]);
    let masses = SparseSystem::new(band(dof, &[(0, 1.0)]), damping, stiffness).unwrap();
    let cubic = terms("k3: x1^3", &[1.0]);
    let system = SystemWithForces::new(&masses).with(cubic).unwrap();
    let none = Record::from_channel(Sampling::new(0.01, 200).unwrap(), vec![0.0; 200]).unwrap();
    let dofs = SelectedDofs { forced: &[7], observed: &[0] };
    let (scheme, rest) = (AllowUnstable(&RungeKutta4::LINEAR), InitialState::rest(dof));
    let orbit = periodic_orbit_selected(&scheme, &system, dofs, &none, &rest, 0).unwrap();
    assert!(!orbit.is_stable());
    let [largest] = orbit.multipliers() else { panic!("{orbit:?}") };
    assert!((largest - std::f64::consts::E).norm() < 1e-5, "{largest}");
    assert_eq!(orbit.response().dof(), 1);
}
