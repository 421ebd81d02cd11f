//! Closed forms of one degree of freedom, compared with numbers computed by hand, with the three
//! cases of damping in textbooks, with the equation of motion, and with one another.

use mechid_model::{ModelError, Response, Sdof};
use mechid_signal::{Record, Sampling};
use nalgebra::Complex;
use proptest::prelude::*;

/// Returns an oscillator with m = 2 kg, k = 8 N/m and the damping `c`: ωn = 2 rad/s, critical
/// damping 8 N·s/m.
fn sdof(c: f64) -> Sdof {
    Sdof::new(2.0, c, 8.0).unwrap()
}

fn sample(r: &Response, k: usize) -> [f64; 3] {
    [r.displacement(), r.velocity(), r.acceleration()].map(|q| q.channel(0)[k])
}

fn assert_close(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= tolerance * e.abs().max(1.0), "{found:?} against {expected:?}");
    }
}

/// Largest difference of displacement relative to the largest displacement.
fn gap(p: &Response, q: &Response) -> f64 {
    let (p, q) = (p.displacement().data(), q.displacement().data());
    (p - q).amax() / q.amax()
}

#[test]
fn free_motion_by_hand() {
    // The expected values at t = 0.75 for x0 = 0.3 and v0 = −1.1 were computed with 50 digits from
    // the three textbook formulas.
    let cases = [
        (0.0, [-0.527_401_082_131_919, -0.676_307_913_796_905_9, 2.109_604_328_527_676]),
        (4.8, [-0.131_062_100_813_983_7, -0.133_635_624_782_646_04, 0.844_973_902_734_285_3]),
        (8.0, [-0.016_734_762_011_132_237, -0.078_095_556_051_950_44, 0.379_321_272_252_330_7]),
        (10.0, [0.029_022_103_322_797_543, -0.068_851_758_017_088_7, 0.228_170_376_794_251_3]),
    ];
    // ẍ is a difference of terms that are several times as large as ẍ; the tolerance is therefore
    // about 10 ε.
    let sampling = Sampling::new(0.75, 2).unwrap();
    for (c, expected) in cases {
        let free = sdof(c).free_response(sampling, 0.3, -1.1).unwrap();
        assert_close(sample(&free, 1), expected, 2e-15);
        let a0 = (1.1 * c - 8.0 * 0.3) / 2.0;
        assert_close(sample(&free, 0), [0.3, -1.1, a0], 4e-16);
    }
}

#[test]
fn step_by_hand() {
    // The response at t = 0.75 s to a step of 5 N, with c = 4.8 N·s/m, is compared.
    let step = sdof(4.8).step_response(Sampling::new(0.75, 2).unwrap(), 5.0, 0.0, 0.0).unwrap();
    let (x, v) = (0.355_295_137_826_922_5, 0.592_091_896_947_866);
    assert_close(sample(&step, 1), [x, v, (5.0 - 4.8 * v - 8.0 * x) / 2.0], 2e-15);
    assert_eq!(sample(&step, 0), [0.0, 0.0, 2.5]);
}

#[test]
fn the_regimes_meet_without_a_seam() {
    let sampling = Sampling::new(0.01, 1000).unwrap();
    let critical = sdof(8.0);
    for off in [1e-6, 1e-9, 1e-12, 1e-15] {
        for c in [8.0 * (1.0 - off), 8.0 * (1.0 + off)] {
            let force = Record::from_channel(sampling, (0..1000).map(|k| (k % 7) as f64).collect());
            let force = force.unwrap();
            let near = sdof(c);
            // The motion depends smoothly on c: its relative change is about as large as the
            // relative change of c. The recurrence accumulates the rounding of about 50 steps.
            let tolerance = off + 1e-13;
            let free = |s: &Sdof| s.free_response(sampling, 1.0, 3.0).unwrap();
            assert!(gap(&free(&near), &free(&critical)) < tolerance, "{c}");
            let linear = |s: &Sdof| s.linear_force_response(&force, 0.0, 0.0).unwrap();
            assert!(gap(&linear(&near), &linear(&critical)) < tolerance, "{c}");
        }
    }
}

#[test]
fn small_steps_keep_their_digits() {
    // For t = 1e-6 s, far below the natural period, the step response is ½ (F/m) t² (1 − 2ζωn t/3 −
    // …).
    let t = 1e-6;
    let step = sdof(4.8).step_response(Sampling::new(t, 2).unwrap(), 4.0, 0.0, 0.0).unwrap();
    let expected = 0.5 * (4.0 / 2.0) * t * t * (1.0 - 2.4 * t / 3.0);
    // The first term that this series of the step response omits has a relative size below (ωn t)²
    // / 12 < 1e-12.
    assert!((sample(&step, 1)[0] / expected - 1.0).abs() < 1e-12);
}

#[test]
fn stiff_overdamped_motion_keeps_its_slow_part() {
    // The roots are about −1e8 and −4e-8; after one second only the slow one remains.
    let slow = Sdof::new(1.0, 1e8, 4.0).unwrap();
    let free = slow.free_response(Sampling::new(1.0, 2).unwrap(), 1.0, 0.0).unwrap();
    let expected = (-4e-8f64).exp();
    assert!((sample(&free, 1)[0] - expected).abs() < 1e-15);
    assert!((sample(&free, 1)[1] / (-4e-8 * expected) - 1.0).abs() < 1e-14);
}

#[test]
fn undamped_resonance_grows_linearly() {
    // The exact response from rest to the force F cos(ωn t) is x = F t sin(ωn t) / (2 m ωn).
    let sampling = Sampling::new(0.037, 2000).unwrap();
    let r = sdof(0.0).harmonic_response(sampling, 3.0.into(), 2.0, 0.0, 0.0).unwrap();
    let largest = 3.0 * sampling.duration() / 8.0;
    for (k, t) in sampling.times().enumerate() {
        let expected = 3.0 * t * (2.0 * t).sin() / 8.0;
        // The phase 2t is at most 148 rad; its rounding error is at most 148 ε.
        assert!((sample(&r, k)[0] - expected).abs() < 1e-13 * largest);
    }
    assert!(matches!(
        sdof(0.0).harmonic_steady_state(sampling, 3.0.into(), 2.0),
        Err(ModelError::SingularDynamicStiffness { omega, .. }) if omega == 2.0
    ));
}

#[test]
fn the_harmonic_transient_dies_into_the_steady_state() {
    // The slowest root is −0.5 1/s (c = 2) or −0.53 1/s (c = 16). After 80 s the transient is
    // e^{−0.5·80} = 4e-18 of its initial size.
    let sampling = Sampling::new(0.05, 1640).unwrap();
    for c in [2.0, 8.0, 16.0] {
        let force = Complex::from_polar(5.0, 0.7);
        let whole = sdof(c).harmonic_response(sampling, force, 1.7, 0.4, -2.0).unwrap();
        let steady = sdof(c).harmonic_steady_state(sampling, force, 1.7).unwrap();
        assert_close(
            sample(&whole, 0),
            {
                let a = (5.0 * 0.7f64.cos() + 2.0 * c - 8.0 * 0.4) / 2.0;
                [0.4, -2.0, a]
            },
            1e-15,
        );
        for k in 1600..1640 {
            assert_close(sample(&whole, k), sample(&steady, k), 1e-14);
        }
    }
}

/// Returns the sum of step responses: each jump of the force adds one step response that begins at
/// the sample of the jump. The sum needs O(N²) operations, and no recurrence.
fn sum_of_steps(s: &Sdof, force: &[f64], dt: f64) -> Vec<f64> {
    let unit = s.step_response(Sampling::new(dt, force.len()).unwrap(), 1.0, 0.0, 0.0).unwrap();
    let unit = unit.displacement().channel(0).to_vec();
    let jump = |j: usize| force[j] - if j == 0 { 0.0 } else { force[j - 1] };
    (0..force.len()).map(|k| (0..=k).map(|j| jump(j) * unit[k - j]).sum()).collect()
}

fn forces(len: usize) -> Vec<f64> {
    (0..len).map(|k| ((k * k % 17) as f64) - 8.0 + if k == 0 { 3.0 } else { 0.0 }).collect()
}

#[test]
fn a_held_force_is_a_sum_of_steps() {
    for (c, dt) in [(0.0, 0.1), (4.8, 0.1), (8.0, 0.1), (30.0, 0.1), (4.8, 3.0), (8.0, 2.0)] {
        let force = forces(120);
        let sampling = Sampling::new(dt, 120).unwrap();
        let record = Record::from_channel(sampling, force.clone()).unwrap();
        let held = sdof(c).held_force_response(&record, 0.0, 0.0).unwrap();
        let sum = sum_of_steps(&sdof(c), &force, dt);
        let largest = sum.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for (k, expected) in sum.iter().enumerate() {
            // The tolerance allows for the rounding of 120 terms.
            assert!((sample(&held, k)[0] - expected).abs() < 1e-13 * largest, "c {c}, k {k}");
        }
    }
}

#[test]
fn a_linear_force_is_the_limit_of_finer_and_finer_held_ones() {
    // Each sampling interval of a linear force is divided into r parts, and the force is held at
    // the midpoint value of each part. The error of the response is then O(1/r²); Richardson's
    // combination of the responses for r and 2r parts has an error of O(1/r⁴).
    let dt = 0.2;
    let force = forces(60);
    let refined = |c: f64, r: usize| -> Vec<f64> {
        let len = 59 * r + 1;
        let fine = (0..len).map(|k| {
            let (cell, part) = ((k / r).min(58), (k % r) as f64 + 0.5);
            force[cell] + (force[cell + 1] - force[cell]) * part / r as f64
        });
        let sampling = Sampling::new(dt / r as f64, len).unwrap();
        let record = Record::from_channel(sampling, fine.collect()).unwrap();
        let held = sdof(c).held_force_response(&record, 0.1, 0.2).unwrap();
        held.displacement().channel(0).iter().copied().step_by(r).collect()
    };
    for c in [0.5, 8.0, 30.0] {
        let sampling = Sampling::new(dt, 60).unwrap();
        let record = Record::from_channel(sampling, force.clone()).unwrap();
        let linear = sdof(c).linear_force_response(&record, 0.1, 0.2).unwrap();
        let (coarse, fine) = (refined(c, 32), refined(c, 64));
        let held = sdof(c).held_force_response(&record, 0.1, 0.2).unwrap();
        assert!(gap(&held, &linear) > 0.01, "the two conventions must differ");
        for k in 0..60 {
            let expected = (4.0 * fine[k] - coarse[k]) / 3.0;
            assert!((sample(&linear, k)[0] - expected).abs() < 1e-9, "c {c}, k {k}");
        }
    }
}

#[test]
fn bad_input_is_named() {
    let sampling = Sampling::new(0.1, 4).unwrap();
    let two = Record::from_channels(sampling, &[[0.0; 4], [0.0; 4]]).unwrap();
    assert_eq!(
        sdof(1.0).held_force_response(&two, 0.0, 0.0),
        Err(ModelError::ForceChannels { got: 2, dof: 1 })
    );
    let named = |r: Result<Response, ModelError>| match r {
        Err(ModelError::Parameter { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(named(sdof(1.0).free_response(sampling, f64::NAN, 0.0)), "initial displacement");
    assert_eq!(named(sdof(1.0).free_response(sampling, 0.0, f64::NAN)), "initial velocity");
    assert_eq!(named(sdof(1.0).step_response(sampling, f64::INFINITY, 0.0, 0.0)), "force");
    let omega = f64::NEG_INFINITY;
    assert_eq!(
        named(sdof(1.0).harmonic_response(sampling, 1.0.into(), omega, 0.0, 0.0)),
        "angular frequency"
    );
    // The response of an unstable system overflows here; the function must return an error.
    let far = Sampling::new(100.0, 4).unwrap();
    assert!(matches!(sdof(-30.0).free_response(far, 1.0, 0.0), Err(ModelError::Signal(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Reference: ẋ is the derivative of x, and ẍ is the derivative of ẋ, for any damping and any
    /// frequency. ẍ is computed from the equation of motion, so x satisfies this equation.
    #[test]
    fn harmonic_motion_satisfies_the_equation_of_motion(
        zeta in 0.0..3.0f64, omega_n in 0.5..5.0f64, omega in 0.0..6.0f64, phase in 0.0..6.3f64,
        x0 in -1.0..1.0f64, v0 in -1.0..1.0f64,
    ) {
        let s = Sdof::from_modal(1.5, zeta, omega_n).unwrap();
        let h = 1e-3;
        let force = Complex::from_polar(2.0, phase);
        let r = s.harmonic_response(Sampling::new(h, 400).unwrap(), force, omega, x0, v0).unwrap();
        let derivative = |y: &[f64], k: usize| {
            (y[k - 2] - 8.0 * y[k - 1] + 8.0 * y[k + 1] - y[k + 2]) / (12.0 * h)
        };
        let [x, v, a] = [r.displacement(), r.velocity(), r.acceleration()].map(|q| q.channel(0));
        // The error of the difference formula is h⁴/30 times the fifth derivative, which is below
        // (fastest rate)⁵ times the size of the motion. The rates are at most 30 1/s.
        let fastest = s.poles()[0].norm().max(omega).max(1.0);
        let tolerance = (h * fastest).powi(4) * fastest * 3.0 * (1.0 + fastest) + 1e-10;
        for k in 2..398 {
            prop_assert!((derivative(x, k) - v[k]).abs() < tolerance);
            prop_assert!((derivative(v, k) - a[k]).abs() < tolerance * fastest);
        }
    }

    /// A change of the units of time and force changes the numbers of a response, but not the
    /// response.
    #[test]
    fn responses_are_invariant_to_units(
        zeta in 0.0..3.0f64, second in 0.01..100.0f64, newton in 0.01..100.0f64,
    ) {
        let s = Sdof::from_modal(1.5, zeta, 2.0).unwrap();
        let t = Sdof::new(
            s.mass() * newton * second * second, s.damping() * newton * second, s.stiffness() * newton,
        ).unwrap();
        let f = forces(50);
        let record = |dt: f64, scale: f64| {
            let scaled = f.iter().map(|v| v * scale).collect();
            Record::from_channel(Sampling::new(dt, 50).unwrap(), scaled).unwrap()
        };
        let p = s.linear_force_response(&record(0.3, 1.0), 0.1, 0.2).unwrap();
        let q = t.linear_force_response(&record(0.3 * second, newton), 0.1, 0.2 / second).unwrap();
        for k in 0..50 {
            prop_assert!((sample(&p, k)[0] - sample(&q, k)[0]).abs() < 1e-13 * 8.0);
        }
    }
}
