//! Period elongation, amplitude decay and amplification against closed forms and published points.

use std::f64::consts::{PI, SQRT_2, TAU};

use mechid_integrate::*;
use mechid_model::Sdof;
use nalgebra::{Complex, Matrix3, Schur};

/// Returns the amplification matrix for (x, Δt ẋ, Δt² ẍ), which does not depend on units.
fn amplification(scheme: &dyn Scheme, zeta: f64, angle: f64) -> Matrix3<f64> {
    let dt = 0.01;
    let system = Sdof::from_modal(1.0, zeta, angle / dt).unwrap().system();
    let mut stepper = scheme.prepare_unchecked(&system, dt).unwrap();
    let a = Transition::from_stepper(stepper.as_mut()).amplification();
    Matrix3::from_fn(|i, j| a[(i, j)] * f64::powi(dt, i as i32 - j as i32))
}

/// Converts a matrix that Bathe (1982), section 9.4, prints for (ẍ, ẋ, x) to the order (x, Δt ẋ,
/// Δt² ẍ).
fn reordered(printed: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| printed[2 - i][2 - j])
}

/// Returns Newmark's matrix as printed; α and δ are Bathe's names for β and γ.
fn printed_newmark(alpha: f64, delta: f64, zeta: f64, w: f64) -> Matrix3<f64> {
    let b = 1.0 / (1.0 / (w * w) + 2.0 * zeta * delta / w + alpha);
    let k = zeta * b / w;
    let h = 0.5 - alpha;
    reordered([
        [-h * b - 2.0 * (1.0 - delta) * k, -b - 2.0 * k, -b],
        [
            1.0 - delta - h * delta * b - 2.0 * (1.0 - delta) * delta * k,
            1.0 - b * delta - 2.0 * delta * k,
            -b * delta,
        ],
        [
            h - h * alpha * b - 2.0 * (1.0 - delta) * alpha * k,
            1.0 - alpha * b - 2.0 * alpha * k,
            1.0 - alpha * b,
        ],
    ])
}

/// Returns the amplification matrix of Wilson's scheme as Bathe (1982) prints it, in the order of
/// [`reordered`].
fn printed_wilson(theta: f64, zeta: f64, w: f64) -> Matrix3<f64> {
    let b = 1.0 / (theta / (w * w) + zeta * theta * theta / w + theta.powi(3) / 6.0);
    let k = zeta * b / w;
    let t = theta;
    reordered([
        [1.0 - b * t * t / 3.0 - 1.0 / t - k * t, -b * t - 2.0 * k, -b],
        [1.0 - 0.5 / t - b * t * t / 6.0 - k * t / 2.0, 1.0 - b * t / 2.0 - k, -b / 2.0],
        [
            0.5 - 1.0 / (6.0 * t) - b * t * t / 18.0 - k * t / 6.0,
            1.0 - b * t / 6.0 - k / 3.0,
            1.0 - b / 6.0,
        ],
    ])
}

const ANGLES: [f64; 6] = [1e-3, 0.1, 0.5, 1.0, 3.0, 50.0];

#[test]
fn newmark_is_the_printed_matrix() {
    for (alpha, delta) in [(0.25, 0.5), (1.0 / 6.0, 0.5), (1.0 / 12.0, 0.5), (0.0, 0.5), (0.3, 0.6)]
    {
        for (zeta, w) in ANGLES.iter().flat_map(|w| [(0.0, *w), (0.05, *w), (0.7, *w)]) {
            let printed = printed_newmark(alpha, delta, zeta, w);
            let ours = amplification(&Newmark::new(alpha, delta).unwrap(), zeta, w);
            let scale = printed.amax();
            assert!((ours - printed).amax() < 1e-13 * scale, "{alpha} {zeta} {w}");
        }
    }
}

#[test]
fn wilson_is_the_printed_matrix() {
    for theta in [1.0, 1.37, 1.4, 2.0] {
        for (zeta, w) in ANGLES.iter().flat_map(|w| [(0.0, *w), (0.05, *w), (0.7, *w)]) {
            let printed = printed_wilson(theta, zeta, w);
            let ours = amplification(&WilsonTheta::new(theta).unwrap(), zeta, w);
            assert!((ours - printed).amax() < 1e-13 * printed.amax(), "{theta} {zeta} {w}");
        }
    }
}

#[test]
fn houbolt_steps_like_the_printed_row() {
    // The printed row gives x(t+Δt) from x(t), x(t−Δt) and x(t−2Δt). The state follows from four
    // displacements.
    let (xs, dt) = ([0.7, -0.4, 0.2, 0.9], 0.01);
    for (zeta, w) in ANGLES.iter().flat_map(|w| [(0.0, *w), (0.05, *w), (0.7, *w)]) {
        let b = 1.0 / (2.0 / (w * w) + 11.0 * zeta / (3.0 * w) + 1.0);
        let k = zeta * b / w;
        let q = b / (w * w);
        let printed =
            (5.0 * q + 6.0 * k) * xs[0] - (4.0 * q + 3.0 * k) * xs[1] + (q + 2.0 / 3.0 * k) * xs[2];
        let system = Sdof::from_modal(1.0, zeta, w / dt).unwrap().system();
        let mut stepper = Houbolt::default().prepare_unchecked(&system, dt).unwrap();
        let state = [
            xs[0],
            (11.0 * xs[0] - 18.0 * xs[1] + 9.0 * xs[2] - 2.0 * xs[3]) / (6.0 * dt),
            (2.0 * xs[0] - 5.0 * xs[1] + 4.0 * xs[2] - xs[3]) / (dt * dt),
            (xs[0] - 3.0 * xs[1] + 3.0 * xs[2] - xs[3]) / (dt * dt),
        ];
        let none = [0.0];
        let loads = Loads { time: 0.0, now: &none, middle: &none, next: &none, beyond: &none };
        let mut change = [0.0; 4];
        stepper.change(&state, &loads, &mut change).unwrap();
        assert!((xs[0] + change[0] - printed).abs() < 1e-13, "{zeta} {w}");
        // The velocity and the acceleration must be the printed differences of the new
        // displacements.
        let x = [printed, xs[0], xs[1], xs[2]];
        let v = (11.0 * x[0] - 18.0 * x[1] + 9.0 * x[2] - 2.0 * x[3]) / (6.0 * dt);
        let a = (2.0 * x[0] - 5.0 * x[1] + 4.0 * x[2] - x[3]) / (dt * dt);
        assert!((state[1] + change[1] - v).abs() < 1e-12 * (1.0 / dt), "{zeta} {w}");
        assert!((state[2] + change[2] - a).abs() < 1e-12 * (1.0 / (dt * dt)), "{zeta} {w}");
    }
}

/// Returns e^{z} to fourth order, z = −ζΩ ± iΩ√(1−ζ²): the factor of an eigenvalue in a Runge–Kutta
/// step.
fn runge_kutta_factor(zeta: f64, w: f64) -> Complex<f64> {
    let z = Complex::new(-zeta * w, w * (1.0 - zeta * zeta).sqrt());
    1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))
}

#[test]
fn charts_follow_the_closed_forms() {
    let newmarks = [
        (Newmark::AVERAGE_ACCELERATION, 0.25),
        (Newmark::LINEAR_ACCELERATION, 1.0 / 6.0),
        (Newmark::FOX_GOODWIN, 1.0 / 12.0),
    ];
    for ratio in [0.003, 0.01, 0.05, 0.1, 0.2, 0.3] {
        let w = TAU * ratio;
        // With γ = ½ and without damping, the angle per step has a closed form, and there is no
        // decay.
        let mut cases: Vec<(Box<dyn Scheme>, f64)> =
            vec![(Box::new(CentralDifference::default()), 2.0 * (w / 2.0).asin())];
        for (scheme, beta) in newmarks {
            // The closed form cos Ω̄ = 1 − ½Ω²/(1 + βΩ²) is written with sin² (Ω̄/2), which keeps
            // the digits at small steps.
            let half = (0.25 * w * w / (1.0 + beta * w * w)).sqrt().asin();
            cases.push((Box::new(scheme), 2.0 * half));
        }
        for (scheme, turn) in cases {
            let found = accuracy(scheme.as_ref(), 0.0, ratio).unwrap();
            let name = scheme.name();
            let elongation = found.period_elongation.unwrap();
            assert!((elongation - (w / turn - 1.0)).abs() < 1e-12, "{name} {ratio}: {elongation}");
            assert!(found.amplitude_decay.unwrap().abs() < 1e-12, "{name} {ratio}");
            assert!(found.numerical_damping_ratio.unwrap().abs() < 1e-12, "{name} {ratio}");
            assert!((found.spectral_radius - 1.0).abs() < 1e-10, "{name} {ratio}");
        }
        for zeta in [0.0, 0.02, 0.3] {
            let factor = runge_kutta_factor(zeta, w);
            let found = accuracy(&RungeKutta4::LINEAR, zeta, ratio).unwrap();
            let elongation = w * (1.0 - zeta * zeta).sqrt() / factor.arg() - 1.0;
            assert!(
                (found.period_elongation.unwrap() - elongation).abs() < 1e-12,
                "{zeta} {ratio}"
            );
            let log = factor.ln();
            let damping = -log.re / log.norm() - zeta;
            assert!((found.numerical_damping_ratio.unwrap() - damping).abs() < 1e-12);
        }
    }
}

#[test]
fn anchors_at_ten_steps_per_period() {
    let percent = |scheme: &dyn Scheme| {
        let found = accuracy(scheme, 0.0, 0.1).unwrap();
        (100.0 * found.period_elongation.unwrap(), 100.0 * found.amplitude_decay.unwrap())
    };
    let houbolt = Houbolt::default();
    let wilson = WilsonTheta::new(1.4).unwrap();
    let central = CentralDifference::default();
    // The expected period elongations are given in per cent, to four decimals.
    for (scheme, elongation) in [
        (&Newmark::AVERAGE_ACCELERATION as &dyn Scheme, 3.2075),
        (&Newmark::LINEAR_ACCELERATION, 1.6002),
        (&central, -1.6934),
        (&houbolt, 12.3206),
        (&wilson, 6.1462),
        (&RungeKutta4::LINEAR, 0.1122),
    ] {
        let found = percent(scheme).0;
        assert!((found - elongation).abs() < 0.5e-4 + 1e-9, "{}: {found}", scheme.name());
    }
    // The decays have the order of the curves of Bathe & Wilson (1973), which are cited from
    // memory: Houbolt by far the most, Wilson (θ = 1.4) some, Newmark none.
    let decay =
        [&houbolt as &dyn Scheme, &wilson, &Newmark::AVERAGE_ACCELERATION].map(|s| percent(s).1);
    assert!(decay[0] > 2.0 * decay[1] && decay[1] > 1.0 && decay[2].abs() < 1e-9, "{decay:?}");
}

/// Returns period elongation and amplitude decay of the principal root, the complex root of largest
/// modulus.
fn principal_point(matrix: Matrix3<f64>, w: f64) -> [f64; 2] {
    let roots = Schur::new(matrix).complex_eigenvalues();
    // The modulus of a spurious pair is smaller than that of the principal root.
    let root = roots.iter().filter(|l| l.im > 1e-9).max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let root = root.expect("it oscillates");
    [w / root.arg() - 1.0, 1.0 - (TAU * root.norm().ln() / root.arg()).exp()]
}

/// The period elongation and the amplitude decay agree with those from the eigenvalues of the
/// printed amplification matrices, at many values of Δt/T. The printed curves, such as those of
/// Bathe & Wilson (1973), Earthquake Eng. Struct. Dyn. 1, 283–291, cannot be read precisely enough.
/// Houbolt's matrix is the companion matrix of (2 + Ω²) λ³ − 5 λ² + 4 λ − 1.
#[test]
fn charts_follow_the_printed_matrices() {
    for ratio in (1..=20).map(|k| 0.01 * f64::from(k)) {
        let w = TAU * ratio;
        let lead = 2.0 + w * w;
        let houbolt =
            Matrix3::new(5.0 / lead, -4.0 / lead, 1.0 / lead, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        let curves: [(Box<dyn Scheme>, Matrix3<f64>); 4] = [
            (Box::new(Houbolt::default()), houbolt),
            (Box::new(WilsonTheta::new(1.4).unwrap()), printed_wilson(1.4, 0.0, w)),
            (Box::new(WilsonTheta::new(2.0).unwrap()), printed_wilson(2.0, 0.0, w)),
            (Box::new(Newmark::AVERAGE_ACCELERATION), printed_newmark(0.25, 0.5, 0.0, w)),
        ];
        for (scheme, matrix) in curves {
            let [elongation, decay] = principal_point(matrix, w);
            let found = accuracy(scheme.as_ref(), 0.0, ratio).unwrap();
            let name = scheme.name();
            // Three roots lie near 1 at small steps, which makes them sensitive to rounding.
            assert!(
                (found.period_elongation.unwrap() - elongation).abs() < 1e-10,
                "{name} {ratio}"
            );
            assert!((found.amplitude_decay.unwrap() - decay).abs() < 1e-10, "{name} {ratio}");
        }
    }
}

#[test]
fn stability_limits_in_steps_per_period() {
    let system = Sdof::from_modal(1.0, 0.0, 1.0).unwrap().system();
    let limit = |scheme: &dyn Scheme| critical_step(scheme, &system).unwrap().map(|dt| dt / TAU);
    for (scheme, expected) in [
        (&CentralDifference::default() as &dyn Scheme, 1.0 / PI),
        (&Newmark::CENTRAL_DIFFERENCE, 1.0 / PI),
        (&Newmark::LINEAR_ACCELERATION, 3f64.sqrt() / PI),
        (&Newmark::FOX_GOODWIN, 6f64.sqrt() / TAU),
        (&RungeKutta4::LINEAR, SQRT_2 / PI),
    ] {
        let found = limit(scheme).unwrap();
        // A growth of 1e-9 per step is tolerated; this moves a limit by less than 1e-9.
        assert!((found / expected - 1.0).abs() < 1e-9, "{}: {found}", scheme.name());
    }
    for scheme in [&Newmark::AVERAGE_ACCELERATION as &dyn Scheme, &Houbolt::default()] {
        assert_eq!(limit(scheme), None, "{}", scheme.name());
    }
}

/// For the schemes that have ρ∞ as a parameter, ρ at very large steps is ρ∞ by construction.
#[test]
fn the_spectral_radius_at_large_steps_is_the_parameter() {
    let far = |scheme: &dyn Scheme| accuracy(scheme, 0.0, 1e7).unwrap().spectral_radius;
    for rho in [0.0, 0.3, 0.5, 0.8, 1.0] {
        let mut schemes: Vec<Box<dyn Scheme>> = vec![
            Box::new(GeneralisedAlpha::new(rho).unwrap()),
            Box::new(GeneralisedAlpha::wood_bossak_zienkiewicz(rho).unwrap()),
            Box::new(Bathe::new(rho).unwrap()),
        ];
        if rho >= 0.5 {
            schemes.push(Box::new(GeneralisedAlpha::hilber_hughes_taylor(rho).unwrap()));
        }
        for scheme in schemes {
            let found = far(scheme.as_ref());
            // Rounding moves a triple root by about the cube root of ε; the finite step moves it by
            // about the cube root of 1/Ω².
            assert!((found - rho).abs() < 1e-4, "{}: {found}", scheme.name());
        }
    }
    assert!(far(&Bathe::HALVES) < 1e-5);
}

/// The period elongation and the amplitude decay without damping, at Δt/T = 0.1, agree with values
/// from the characteristic polynomials, which were computed independently of this crate.
#[test]
fn anchors_of_the_schemes_with_numerical_damping() {
    for (scheme, elongation, decay) in anchors() {
        let found = accuracy(scheme.as_ref(), 0.0, 0.1).unwrap();
        let (e, d) = (found.period_elongation.unwrap(), found.amplitude_decay.unwrap());
        assert!((e - elongation).abs() < 1e-9, "{}: {e}", scheme.name());
        assert!((d - decay).abs() < 1e-9, "{}: {d}", scheme.name());
    }
    let exact = accuracy(&MatrixExponential::LINEAR, 0.02, 0.3).unwrap();
    assert!(exact.period_elongation.unwrap().abs() < 1e-14);
    assert!(exact.amplitude_decay.unwrap().abs() < 1e-13);
}

/// Returns schemes with their period elongation and amplitude decay at Δt/T = 0.1.
fn anchors() -> Vec<(Box<dyn Scheme>, f64, f64)> {
    vec![
        (Box::new(GeneralisedAlpha::new(0.8).unwrap()), 0.033828405968, 0.000987678193),
        // For ρ∞ = 0 the values are those of Houbolt's scheme.
        (Box::new(GeneralisedAlpha::new(0.0).unwrap()), 0.123205719568, 0.292133199285),
        (
            Box::new(GeneralisedAlpha::hilber_hughes_taylor(0.7).unwrap()),
            0.043444712202,
            0.019166580792,
        ),
        (
            Box::new(GeneralisedAlpha::wood_bossak_zienkiewicz(0.5).unwrap()),
            0.062243585856,
            0.076716049695,
        ),
        (Box::new(Bathe::HALVES), 0.016179374365, 0.005130629683),
        (Box::new(Bathe::new(0.6).unwrap()), 0.010766141343, 0.002314838226),
        (Box::new(Bathe::new(0.0).unwrap()), 0.015714424134, 0.005437741449),
    ]
}

#[test]
fn wilson_becomes_unconditionally_stable_at_1_366() {
    let system = Sdof::from_modal(1.0, 0.0, 1.0).unwrap().system();
    let limited =
        |theta: f64| critical_step(&WilsonTheta::new(theta).unwrap(), &system).unwrap().is_some();
    let (mut below, mut above) = (1.0, 2.0);
    while above - below > 1e-9 {
        let middle = 0.5 * (below + above);
        if limited(middle) { below = middle } else { above = middle }
    }
    // For Ω → ∞ a root passes −1 at θ = (1 + √3)/2 = 1.36603.
    assert!((above - 0.5 * (1.0 + 3f64.sqrt())).abs() < 1e-5, "{above}");
}

#[test]
fn what_does_not_oscillate_has_no_period() {
    assert!(matches!(
        accuracy(&Newmark::AVERAGE_ACCELERATION, 1.0, 0.1),
        Err(IntegrateError::DampingRatio { damping_ratio: 1.0 })
    ));
    assert!(accuracy(&Newmark::AVERAGE_ACCELERATION, 0.0, 0.0).is_err());
    let far = accuracy(&CentralDifference::default(), 0.0, 0.4).unwrap();
    assert!(far.spectral_radius > 1.5 && far.period_elongation.is_none());
}
