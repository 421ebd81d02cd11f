//! The printed formulas of each scheme hold between the samples it returns.

use mechid_integrate::*;
use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::common::*;

const SIZES: [usize; 7] = [1, 2, 3, 5, 10, 20, 50];
const DT: f64 = 0.004;
const LEN: usize = 24;

/// Returns a stable system without symmetry, its force and its response. The response begins in a
/// moving initial state if `start` is true, otherwise at rest.
fn run(scheme: &dyn Scheme, dof: usize, start: bool) -> (SecondOrderSystem, Record, Response) {
    let system = mechid_problems::random_stable(dof, 11);
    let force = force(Sampling::new(DT, LEN).unwrap(), dof);
    let initial = if start { moving(dof) } else { mechid_model::InitialState::rest(dof) };
    let response = integrate(scheme, &system, &force, &initial).unwrap();
    (system, force, response)
}

/// Returns sample k of x, ẋ and ẍ.
fn at(response: &Response, k: usize) -> [DVector<f64>; 3] {
    parts(response).map(|p| p.row(k).transpose())
}

fn load(force: &Record, k: usize) -> DVector<f64> {
    force.data().row(k).transpose()
}

/// Returns the norm of M ẍ + C ẋ + K x − F, relative to the sum of the norms of its terms.
fn imbalance(s: &SecondOrderSystem, [x, v, a]: [DVector<f64>; 3], f: DVector<f64>) -> f64 {
    let terms = [s.mass() * a, s.damping() * v, s.stiffness() * x, -f];
    let size: f64 = terms.iter().map(|t| t.norm()).sum();
    terms.iter().sum::<DVector<f64>>().norm() / size
}

/// Returns whether two vectors agree to rounding. Difference quotients have the rounding error of x
/// divided by Δt or Δt², which `scale` must include.
fn close(left: &DVector<f64>, right: &DVector<f64>, scale: f64) -> bool {
    (left - right).norm() <= 1e-12 * scale
}

#[test]
fn equilibrium_holds_at_every_sample_but_where_it_is_asked_for_elsewhere() {
    let elsewhere = |s: &dyn Scheme| {
        s.name().starts_with("Wilson")
            || s.conventions().iter().any(|c| c.choice.contains("carried"))
    };
    for scheme in schemes().iter().filter(|s| !elsewhere(s.as_ref())) {
        for dof in SIZES {
            let moving = !scheme.conventions().iter().any(|c| c.choice.contains("at rest"));
            let (system, force, response) = run(scheme.as_ref(), dof, moving);
            for k in 0..LEN {
                let gap = imbalance(&system, at(&response, k), load(&force, k));
                assert!(gap < 1e-11, "{} n {dof} sample {k}: {gap:e}", scheme.name());
            }
        }
    }
}

#[test]
fn newmark_steps_by_its_two_formulas() {
    for scheme in
        [Newmark::AVERAGE_ACCELERATION, Newmark::FOX_GOODWIN, Newmark::new(0.3, 0.6).unwrap()]
    {
        let (beta, gamma) = (scheme.beta(), scheme.gamma());
        for dof in SIZES {
            let (_, _, response) = run(&scheme, dof, true);
            for k in 1..LEN {
                let ([x, v, a], [xn, vn, an]) = (at(&response, k - 1), at(&response, k));
                let vs = &v + DT * ((1.0 - gamma) * &a + gamma * &an);
                let xs = &x + DT * &v + DT * DT * ((0.5 - beta) * &a + beta * &an);
                assert!(close(&xn, &xs, x.norm() + DT * v.norm()), "n {dof} sample {k}");
                assert!(close(&vn, &vs, v.norm() + DT * a.norm()), "n {dof} sample {k}");
            }
        }
    }
}

#[test]
fn central_differences_are_central() {
    for dof in SIZES {
        let (_, _, response) = run(&CentralDifference::default(), dof, true);
        for k in 1..LEN - 1 {
            let (before, [x, v, a], after) =
                (at(&response, k - 1), at(&response, k), at(&response, k + 1));
            let vs = (&after[0] - &before[0]) / (2.0 * DT);
            let accs = (&after[0] - 2.0 * &x + &before[0]) / (DT * DT);
            assert!(close(&v, &vs, x.norm() / DT + v.norm()), "n {dof} sample {k}");
            assert!(close(&a, &accs, x.norm() / (DT * DT) + a.norm()), "n {dof} sample {k}");
        }
        // The start from rest assumes x(−Δt) = x(0) = 0.
        let rest = CentralDifference { start: CentralDifferenceStart::Rest };
        let (_, _, response) = run(&rest, dof, false);
        let ([_, v, a], [x1, ..]) = (at(&response, 0), at(&response, 1));
        assert!(close(&v, &(&x1 / (2.0 * DT)), v.norm()));
        assert!(close(&a, &(&x1 / (DT * DT)), a.norm()));
    }
}

#[test]
fn houbolt_differences_go_back_over_four_samples() {
    for scheme in [Houbolt::default(), Houbolt { start: HouboltStart::CentralDifference }] {
        for dof in SIZES {
            let (_, _, response) = run(&scheme, dof, true);
            for k in 3..LEN {
                let x = [0, 1, 2, 3].map(|back| at(&response, k - back)[0].clone());
                let [_, v, a] = at(&response, k);
                let vs = (11.0 * &x[0] - 18.0 * &x[1] + 9.0 * &x[2] - 2.0 * &x[3]) / (6.0 * DT);
                let accs = (2.0 * &x[0] - 5.0 * &x[1] + 4.0 * &x[2] - &x[3]) / (DT * DT);
                let size = x[0].norm();
                assert!(close(&v, &vs, 10.0 * size / DT), "n {dof} sample {k}");
                assert!(close(&a, &accs, 10.0 * size / (DT * DT)), "n {dof} sample {k}");
            }
        }
    }
}

#[test]
fn houbolt_takes_the_callers_start() {
    let [x1, x2] = [vec![0.21, 0.09], vec![0.23, 0.08]];
    let start = HouboltStart::Given { at_dt: x1.clone(), at_2dt: x2.clone() };
    let (system, force, response) = run(&Houbolt { start }, 2, true);
    let x = response.displacement().data();
    assert_eq!([x[(1, 0)], x[(1, 1)]], x1[..]);
    assert_eq!([x[(2, 0)], x[(2, 1)]], x2[..]);
    let v = response.velocity().data();
    assert!((v[(1, 0)] - (x2[0] - x[(0, 0)]) / (2.0 * DT)).abs() < 1e-12);
    assert!((v[(2, 1)] - (3.0 * x2[1] - 4.0 * x1[1] + x[(0, 1)]) / (2.0 * DT)).abs() < 1e-11);
    for k in 0..LEN {
        assert!(imbalance(&system, at(&response, k), load(&force, k)) < 1e-11);
    }
    for k in 3..LEN {
        let past = [0, 1, 2, 3].map(|back| at(&response, k - back)[0].clone());
        let a = (2.0 * &past[0] - 5.0 * &past[1] + 4.0 * &past[2] - &past[3]) / (DT * DT);
        assert!(close(&at(&response, k)[2], &a, 10.0 / (DT * DT)), "sample {k}");
    }
}

#[test]
fn wilson_is_in_equilibrium_at_theta() {
    for (load_at, theta) in [
        (WilsonLoad::Projected, 1.4),
        (WilsonLoad::Projected, 2.0),
        (WilsonLoad::Interpolated, 1.4),
    ] {
        let scheme = WilsonTheta::new(theta).unwrap().with_load(load_at);
        let long = theta * DT;
        for dof in SIZES {
            let (system, force, response) = run(&scheme, dof, true);
            for k in 0..LEN - 1 {
                let ([x, v, a], [xn, vn, an]) = (at(&response, k), at(&response, k + 1));
                // The acceleration is linear over the step.
                let vs = &v + 0.5 * DT * (&a + &an);
                let xs = &x + DT * &v + DT * DT / 6.0 * (2.0 * &a + &an);
                assert!(close(&xn, &xs, x.norm() + DT * v.norm()), "n {dof} sample {k}");
                assert!(close(&vn, &vs, v.norm() + DT * a.norm()), "n {dof} sample {k}");
                // The acceleration is linear up to t + θΔt, where equilibrium with the load holds.
                let a_theta = &a + theta * (&an - &a);
                let v_theta = &v + 0.5 * long * (&a + &a_theta);
                let x_theta = &x + long * &v + long * long / 6.0 * (2.0 * &a + &a_theta);
                let (now, next) = (load(&force, k), load(&force, k + 1));
                let projected = &now + theta * (&next - &now);
                let f = if load_at == WilsonLoad::Interpolated && k + 2 < LEN {
                    &next + (theta - 1.0) * (load(&force, k + 2) - &next)
                } else {
                    projected
                };
                let gap = imbalance(&system, [x_theta, v_theta, a_theta], f);
                assert!(gap < 1e-11, "n {dof} sample {k}: {gap:e}");
            }
        }
    }
}

#[test]
fn generalised_alpha_is_in_equilibrium_between_the_samples() {
    for scheme in [
        GeneralisedAlpha::new(0.8).unwrap(),
        GeneralisedAlpha::hilber_hughes_taylor(0.6).unwrap(),
        GeneralisedAlpha::wood_bossak_zienkiewicz(0.2).unwrap(),
    ] {
        let scheme = scheme.with_acceleration(AlphaAcceleration::Carried);
        let (beta, gamma) = (scheme.beta(), scheme.gamma());
        let (alpha_m, alpha_f) = (scheme.alpha_m(), scheme.alpha_f());
        for dof in SIZES {
            let (system, force, response) = run(&scheme, dof, true);
            for k in 1..LEN {
                let ([x, v, a], [xn, vn, an]) = (at(&response, k - 1), at(&response, k));
                let vs = &v + DT * ((1.0 - gamma) * &a + gamma * &an);
                let xs = &x + DT * &v + DT * DT * ((0.5 - beta) * &a + beta * &an);
                assert!(close(&xn, &xs, x.norm() + DT * v.norm()), "n {dof} sample {k}");
                assert!(close(&vn, &vs, v.norm() + DT * a.norm()), "n {dof} sample {k}");
                let between = |share: f64, old: &DVector<f64>, new: &DVector<f64>| {
                    (1.0 - share) * new + share * old
                };
                let state = [
                    between(alpha_f, &x, &xn),
                    between(alpha_f, &v, &vn),
                    between(alpha_m, &a, &an),
                ];
                let f = between(alpha_f, &load(&force, k - 1), &load(&force, k));
                let gap = imbalance(&system, state, f);
                assert!(gap < 1e-11, "{} n {dof} sample {k}: {gap:e}", scheme.name());
            }
        }
    }
}

/// The parameters must be those that Chung & Hulbert (1993) print for ρ∞ = 0 and ρ∞ = 1, and those
/// of HHT with α = −0.1.
#[test]
fn generalised_alpha_has_the_printed_parameters() {
    let of = |s: GeneralisedAlpha| [s.alpha_m(), s.alpha_f(), s.beta(), s.gamma()];
    let gap = |found: [f64; 4], printed: [f64; 4]| {
        found.iter().zip(printed).map(|(f, p)| (f - p).abs()).fold(0.0, f64::max)
    };
    let found = of(GeneralisedAlpha::new(0.0).unwrap());
    assert!(gap(found, [-1.0, 0.0, 1.0, 1.5]) < 1e-15, "{found:?}");
    let found = of(GeneralisedAlpha::new(1.0).unwrap());
    assert!(gap(found, [0.5, 0.5, 0.25, 0.5]) < 1e-15, "{found:?}");
    let found = of(GeneralisedAlpha::hilber_hughes_taylor(0.9 / 1.1).unwrap());
    assert!(gap(found, [0.0, 0.1, 0.3025, 0.6]) < 1e-15, "{found:?}");
}

/// The response is compared with the scheme of 2005 as it is printed: the trapezoidal rule over
/// half a step, then ẋ' = (x − 4 x½ + 3 x')/Δt and ẍ' likewise, with equilibrium at the end of both
/// sub-steps.
#[test]
fn bathe_is_the_printed_composite() {
    for dof in SIZES {
        let (system, force, response) = run(&Bathe::HALVES, dof, true);
        let factored =
            |q: f64| (system.mass() + system.damping() * q + system.stiffness() * (q * q)).lu();
        let (half, whole) = (factored(0.25 * DT), factored(DT / 3.0));
        for k in 0..LEN - 1 {
            let ([x, v, a], [xn, vn, an]) = (at(&response, k), at(&response, k + 1));
            let q = 0.25 * DT;
            let (vh, xh) = (&v + q * &a, &x + 2.0 * q * &v + q * q * &a);
            let middle = 0.5 * (load(&force, k) + load(&force, k + 1));
            let am =
                half.solve(&(middle - system.damping() * &vh - system.stiffness() * &xh)).unwrap();
            let (xm, vm) = (xh + q * q * &am, vh + q * &am);
            // The printed differences for ẋ' and ẍ' give x' and ẋ' as functions of the unknown ẍ'.
            let q = DT / 3.0;
            let vh = (4.0 * &vm - &v) / 3.0;
            let xh = (4.0 * &xm - &x) / 3.0 + q * &vh;
            let an_ = whole
                .solve(&(load(&force, k + 1) - system.damping() * &vh - system.stiffness() * &xh))
                .unwrap();
            let (vn_, xn_) = (vh + q * &an_, xh + q * q * &an_);
            let size = x.norm() + DT * v.norm();
            assert!(close(&xn, &xn_, size), "n {dof} sample {k}");
            assert!(close(&vn, &vn_, size / DT + v.norm()), "n {dof} sample {k}");
            assert!(close(&an, &an_, size / (DT * DT) + a.norm()), "n {dof} sample {k}");
        }
    }
}

#[test]
fn the_matrix_exponential_is_the_exact_response() {
    for dof in [1, 2, 5, 20] {
        let system = mechid_problems::random_stable(dof, 11);
        // The steps range from a small fraction of the period of the fastest motion to several of
        // these periods.
        for dt in [1e-4, DT, 0.3] {
            let force = force(Sampling::new(dt, LEN).unwrap(), dof);
            let start = moving(dof);
            let held = mechid_problems::exact_zoh(&system, &force, &start).unwrap();
            let linear = mechid_problems::exact_foh(&system, &force, &start).unwrap();
            for (scheme, truth) in
                [(MatrixExponential::HELD, held), (MatrixExponential::LINEAR, linear)]
            {
                let found = integrate(&scheme, &system, &force, &start).unwrap();
                for (found, truth) in parts(&found).iter().zip(parts(&truth)) {
                    let gap = (*found - truth).amax() / truth.amax();
                    assert!(gap < 1e-11, "n {dof} Δt {dt}: {gap:e}");
                }
            }
        }
    }
}

#[test]
fn runge_kutta_is_the_classical_scheme() {
    for (scheme, weight) in [(RungeKutta4::HELD, 0.0), (RungeKutta4::LINEAR, 0.5)] {
        for dof in SIZES {
            let (system, force, response) = run(&scheme, dof, true);
            let s = system.state_matrix();
            let mass = system.mass().clone().lu();
            let lifted = |f: &DVector<f64>| {
                let mut b = DVector::zeros(2 * dof);
                b.rows_mut(dof, dof).copy_from(&mass.solve(f).unwrap());
                b
            };
            let state = |k: usize| {
                let [x, v, _] = at(&response, k);
                DVector::from_iterator(2 * dof, x.iter().chain(v.iter()).copied())
            };
            for k in 1..LEN {
                let (z, now, next) = (state(k - 1), load(&force, k - 1), load(&force, k));
                let middle = (1.0 - weight) * &now + weight * &next;
                let k1 = &s * &z + lifted(&now);
                let k2 = &s * (&z + 0.5 * DT * &k1) + lifted(&middle);
                let k3 = &s * (&z + 0.5 * DT * &k2) + lifted(&middle);
                let k4 = &s * (&z + DT * &k3) + lifted(&next);
                let new = &z + DT / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                assert!((state(k) - &new).norm() < 1e-11 * new.norm(), "n {dof} sample {k}");
            }
        }
    }
}

#[test]
fn every_size_from_1_to_50_follows_its_transition() {
    for dof in 1..=50 {
        let system = mechid_problems::random_stable(dof, dof as u64);
        let force = force(Sampling::new(DT, 8).unwrap(), dof);
        for scheme in schemes()
            .iter()
            .filter(|s| !s.conventions()[1..].iter().any(|c| c.choice.contains("at rest")))
        {
            let mut stepper = scheme.prepare(&system, DT).unwrap();
            let transition = Transition::from_stepper(stepper.as_mut());
            let start = moving(dof);
            let response = integrate(scheme.as_ref(), &system, &force, &start).unwrap();
            // The last step is repeated with the matrices of the transition, from the stored
            // motion. Schemes whose state has more than the motion, such as Houbolt's, are skipped.
            if transition.change.nrows() > 3 * dof {
                continue;
            }
            let z = |k: usize| {
                let m = at(&response, k);
                DVector::from_iterator(3 * dof, m.iter().flat_map(|p| p.iter().copied()))
            };
            let mut new = z(6) + &transition.change * z(6);
            for (instant, b) in &transition.loads {
                new += b * match instant {
                    Instant::Now => load(&force, 6),
                    Instant::Next => load(&force, 7),
                    _ => 2.0 * load(&force, 7) - load(&force, 6),
                };
            }
            let gap = (new - z(7)).norm() / z(7).norm();
            assert!(gap < 1e-11, "{} n {dof}: {gap:e}", scheme.name());
        }
    }
}

/// Two degrees of freedom use the loop of fixed size, and four use the stepper itself; both give
/// the same response.
#[test]
fn fixed_size_loop_and_stepper_agree() {
    let one = mechid_problems::random_stable(2, 3);
    let twice = |m: &DMatrix<f64>| {
        let mut big = DMatrix::zeros(4, 4);
        big.view_mut((0, 0), (2, 2)).copy_from(m);
        big.view_mut((2, 2), (2, 2)).copy_from(m);
        big
    };
    let both =
        SecondOrderSystem::new(twice(one.mass()), twice(one.damping()), twice(one.stiffness()))
            .unwrap();
    let wide = force(Sampling::new(DT, 500).unwrap(), 4);
    let narrow = Record::new(wide.sampling(), wide.data().columns(0, 2).into_owned()).unwrap();
    for scheme in schemes() {
        let small = integrate(scheme.as_ref(), &one, &narrow, &mechid_model::InitialState::rest(2))
            .unwrap();
        let large =
            integrate(scheme.as_ref(), &both, &wide, &mechid_model::InitialState::rest(4)).unwrap();
        for (s, l) in parts(&small).iter().zip(parts(&large)) {
            let gap = (*s - l.columns(0, 2)).amax() / s.amax();
            // Each of the 500 steps of a stable scheme has a rounding error of ε.
            assert!(gap < 1e-12, "{}: {gap:e}", scheme.name());
        }
    }
}
