//! Tests which steps `prepare` refuses for large systems, whose whole amplification matrix is not
//! computed.

use mechid_integrate::*;
use mechid_model::{Sdof, SecondOrderSystem, SparseSystem, band, lumped, triplets};
use nalgebra::DMatrix;

use crate::common::*;

/// A chain of `n` masses of 1 kg between walls on springs of 900 N/m: ω_i² = 3600 sin² (iπ/2(n+1)).
fn chain(n: usize, damping: f64) -> SparseSystem {
    let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
    SparseSystem::new(band(n, &[(0, 1.0)]), &stiffness * damping, stiffness).unwrap()
}

fn highest(n: usize) -> f64 {
    60.0 * (n as f64 * std::f64::consts::FRAC_PI_2 / (n as f64 + 1.0)).sin()
}

#[test]
fn known_limits_are_those_of_one_degree_of_freedom() {
    for scheme in schemes() {
        let (scheme, name) = (scheme.as_ref(), scheme.name());
        for ratio in [0.0, 1e-3, 0.1, 0.7, 1.5, 20.0] {
            let system = Sdof::new(1.0, 2.0 * ratio, 1.0).unwrap().system();
            let limit = critical_step(scheme, &system).unwrap();
            let fastest =
                system.eigenvalues().unwrap().iter().map(|l| l.norm()).fold(0.0, f64::max);
            match scheme.stable_steps() {
                StableSteps::All => assert_eq!(limit, None, "{name} ζ {ratio}"),
                // Damping can only increase the limit.
                StableSteps::Frequencies(known) => {
                    let gap = limit.map(|limit| limit / known - 1.0);
                    assert!(gap.is_none_or(|gap| gap > -1e-9), "{name} ζ {ratio}: {gap:?}");
                    assert!(ratio > 0.0 || gap.is_some_and(|gap| gap < 1e-9), "{name}: {gap:?}");
                }
                StableSteps::Eigenvalues(known) => {
                    let limit = limit.unwrap() * fastest;
                    assert!(limit > known && limit < 1.2 * known, "{name} ζ {ratio}: {limit}");
                }
                StableSteps::Unknown => {}
            }
        }
    }
}

#[test]
fn a_long_chain_is_refused_just_beyond_the_limit() {
    let wilson = WilsonTheta::new(1.2).unwrap();
    for n in [30, 300, 3000] {
        for damping in [0.0, 1e-3] {
            let chain = chain(n, damping);
            for scheme in schemes() {
                let (scheme, name) = (scheme.as_ref(), scheme.name());
                if n > 250 && name == "matrix exponential" {
                    let refused = scheme.prepare(&chain, 1e-3).err();
                    let expected = IntegrateError::TooManyDof {
                        scheme: "matrix exponential",
                        dof: n,
                        most: 250,
                    };
                    assert_eq!(refused, Some(expected));
                    continue;
                }
                let limit = match scheme.stable_steps() {
                    StableSteps::All => {
                        for angle in [1e-3, 1.0, 1e4] {
                            let accepted = scheme.prepare(&chain, angle / highest(n)).is_ok();
                            assert!(accepted, "{name} n {n}, {angle}");
                        }
                        assert_eq!(critical_step(scheme, &chain).unwrap(), None);
                        continue;
                    }
                    StableSteps::Frequencies(limit) => limit / highest(n),
                    _ if damping > 0.0 => continue,
                    // This is the limit of the Runge–Kutta scheme without damping.
                    _ => 8_f64.sqrt() / highest(n),
                };
                assert!(scheme.prepare(&chain, 0.999 * limit).is_ok(), "{name} n {n}");
                // A step 5 % above the limit must be refused, and the reported limit must agree
                // with the closed form.
                match scheme.prepare(&chain, 1.05 * limit).err() {
                    Some(IntegrateError::Unstable { critical_step: Some(said), .. }) => {
                        let gap = said / limit - 1.0;
                        assert!(gap.abs() < 3e-3, "{name} n {n}: {gap}");
                    }
                    other => panic!("{name} n {n} ζ {damping}: {other:?}"),
                }
            }
            if n > 300 {
                continue;
            }
            // No limit in closed form is known for this scheme; its amplification matrix gives the
            // limit.
            let limit = critical_step(&wilson, &Sdof::new(1.0, 0.0, 1.0).unwrap().system());
            let limit = limit.unwrap().unwrap() / highest(n);
            assert!(wilson.prepare(&chain, 0.99 * limit).is_ok());
            assert!(damping > 0.0 || wilson.prepare(&chain, 1.05 * limit).is_err());
        }
    }
}

/// The matrices C and K are full and not symmetric. A step must be accepted if the exact spectral
/// radius is at most 1 to rounding, and refused otherwise. For schemes with a limit, the steps are
/// below and above this limit.
#[test]
fn full_systems_without_symmetry_are_judged_by_their_eigenvalues() {
    let wilson = WilsonTheta::new(1.4).unwrap();
    let judged: [&dyn Scheme; 5] = [
        &Newmark::AVERAGE_ACCELERATION,
        &CentralDifference::default(),
        &Houbolt::default(),
        &wilson,
        &RungeKutta4::LINEAR,
    ];
    for seed in 0..2 {
        let system = mechid_problems::random_stable(24, seed);
        let scale = 1.0 / 60.0;
        for scheme in judged {
            let name = scheme.name();
            for angle in [0.1, 1.0, 1.8, 2.4, 3.0, 5.0, 100.0] {
                let dt = angle * scale;
                let radius = spectral_radius(scheme, &system, dt).unwrap();
                let accepted = scheme.prepare(&system, dt).is_ok();
                assert_eq!(accepted, radius < 1.0 + 1e-6, "{name} seed {seed} {angle}: {radius}");
            }
        }
    }
}

/// A shaft that whirls has a growing motion; this growth is not an instability of the scheme.
#[test]
fn growth_of_its_own_is_no_instability_of_the_scheme() {
    let n = 60;
    let shaft = band(2 * n, &[(-2, -900.0), (0, 1900.0), (2, -900.0)]);
    // The cross-coupling acts at one bearing. Even degrees of freedom are in plane x, odd degrees
    // of freedom in plane y.
    let film = triplets(2 * n, [(0, 1, 300.0), (1, 0, -300.0)]).unwrap();
    let whirling =
        SparseSystem::new(band(2 * n, &[(0, 1.0)]), &shaft * 1e-5, shaft + film).unwrap();
    let dense = SecondOrderSystem::new(
        DMatrix::from(whirling.matrix(mechid_model::Matrix::Mass)),
        DMatrix::from(whirling.matrix(mechid_model::Matrix::Damping)),
        DMatrix::from(whirling.matrix(mechid_model::Matrix::Stiffness)),
    )
    .unwrap();
    let own = dense.eigenvalues().unwrap().iter().map(|l| l.re).fold(0.0, f64::max);
    assert!(own > 0.1, "{own}");
    for scheme in schemes() {
        assert!(scheme.prepare(&whirling, 5e-3).is_ok(), "{}", scheme.name());
    }
    let beyond = CentralDifference::default().prepare(&whirling, 0.05).err();
    assert!(matches!(
        beyond,
        Some(IntegrateError::Unstable { critical_step: Some(limit), .. }) if limit < 0.05
    ));
}

#[test]
fn the_spectral_radius_of_a_long_chain_is_that_of_its_fastest_mode() {
    let n = 400;
    let chain = chain(n, 0.0);
    let scheme = CentralDifference::default();
    let dt = 2.2 / highest(n);
    let fastest = Sdof::from_modal(1.0, 0.0, highest(n)).unwrap().system();
    let expected = spectral_radius(&scheme, &fastest, dt).unwrap();
    let found = spectral_radius(&scheme, &chain, dt).unwrap();
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
}

/// `prepare` accepts a step just below the limit of the central difference and refuses a step just
/// above it. With unequal masses only a few masses take part in the fastest motion, and iterations
/// converge to this motion slowly. The reference limit is found by bisection: the signs of the
/// pivots of a tridiagonal pencil show whether the pencil has eigenvalues above a value (Sturm's
/// sequence).
#[test]
fn a_chain_of_unequal_masses_is_refused_just_beyond_the_limit() {
    let n = 4000;
    let mass: Vec<f64> =
        (0..n).map(|i| 1.0 + 0.2 * (0.618_033_988_75 * (i * i) as f64).fract()).collect();
    let spring = 3000.0;
    let diagonal = |i: usize| if i + 1 == n { spring } else { 2.0 * spring };
    let is_above = |value: f64| {
        let mut pivot = f64::INFINITY;
        (0..n).all(|i| {
            let before = if i == 0 { 0.0 } else { spring * spring / pivot };
            pivot = value * mass[i] - diagonal(i) - before;
            pivot > 0.0
        })
    };
    let (mut low, mut high) =
        (0.0, 4.0 * spring / mass.iter().copied().fold(f64::INFINITY, f64::min));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if is_above(middle) { &mut high } else { &mut low }) = middle;
    }
    let limit = 2.0 / high.sqrt();
    let stiffness = (0..n).flat_map(|i| {
        let beside = (i + 1 < n).then_some([(i, i + 1, -spring), (i + 1, i, -spring)]);
        std::iter::once((i, i, diagonal(i))).chain(beside.into_iter().flatten())
    });
    let stiffness = triplets(n, stiffness).unwrap();
    let chain = SparseSystem::new(lumped(&mass), lumped(&vec![0.0; n]), stiffness).unwrap();
    let scheme = Newmark::CENTRAL_DIFFERENCE;
    assert!(scheme.prepare(&chain, limit * (1.0 - 1e-6)).is_ok());
    let refused = scheme.prepare(&chain, limit * (1.0 + 1e-6)).err();
    let Some(IntegrateError::Unstable { critical_step: Some(said), .. }) = refused else {
        panic!("{refused:?}")
    };
    assert!(said <= limit && said > limit * (1.0 - 1e-4), "{said} {limit}");
    let found = critical_steps(&[&scheme, &Newmark::LINEAR_ACCELERATION], &chain).unwrap();
    assert_eq!(found[0], Some(said));
    assert!((found[1].unwrap() / (said * 3_f64.sqrt()) - 1.0).abs() < 1e-9, "{found:?}");
}
