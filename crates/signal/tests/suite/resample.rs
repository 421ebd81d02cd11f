//! Tests of interpolated values against closed forms and defining equations.

use mechid_signal::resample::{refine, resample};
use mechid_signal::{
    Interpolation, Interpolator, Multisine, Phases, Record, Sampling, SignalError,
};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

const ALL: [Interpolation; 5] = [
    Interpolation::Linear,
    Interpolation::NaturalSpline,
    Interpolation::NotAKnotSpline,
    Interpolation::Pchip,
    Interpolation::BandLimited,
];

fn record(x: &[f64]) -> Record {
    Record::from_channel(Sampling::new(0.5, x.len()).unwrap(), x.to_vec()).unwrap()
}

fn refined(x: &[f64], factor: usize, method: Interpolation) -> Vec<f64> {
    refine(&record(x), factor, method).unwrap().channel(0).to_vec()
}

/// Returns the natural spline at the fraction `u` of interval `k`. The textbook equations for the
/// second derivatives m (m = 0 at both ends) are solved with a dense matrix: m_{k−1} + 4 m_k +
/// m_{k+1} = 6 (y_{k+1} − 2 y_k + y_{k−1}) for a step of 1.
fn natural_by_moments(y: &[f64], k: usize, u: f64) -> f64 {
    let n = y.len();
    let mut a = DMatrix::<f64>::identity(n, n);
    let mut b = DVector::zeros(n);
    for i in 1..n - 1 {
        a[(i, i - 1)] = 1.0;
        a[(i, i)] = 4.0;
        a[(i, i + 1)] = 1.0;
        b[i] = 6.0 * (y[i + 1] - 2.0 * y[i] + y[i - 1]);
    }
    let m = a.lu().solve(&b).unwrap();
    let v = 1.0 - u;
    v * y[k] + u * y[k + 1] + ((v.powi(3) - v) * m[k] + (u.powi(3) - u) * m[k + 1]) / 6.0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn samples_are_kept(x in prop::collection::vec(-10.0..10.0f64, 2..40), factor in 1usize..5) {
        for method in ALL {
            let fine = refined(&x, factor, method);
            for (k, v) in x.iter().enumerate() {
                prop_assert!((fine[k * factor] - v).abs() < 1e-12, "{method:?}");
            }
        }
    }

    #[test]
    fn not_a_knot_splines_reproduce_cubics(c in prop::array::uniform4(-2.0..2.0f64), n in 4usize..30) {
        let cubic = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
        let x: Vec<f64> = (0..n).map(|k| cubic(0.5 * k as f64)).collect();
        let fine = refined(&x, 4, Interpolation::NotAKnotSpline);
        for (k, v) in fine.iter().enumerate() {
            // The values are up to 2·15³, and the end equations of the spline lose one or two
            // digits.
            prop_assert!((v - cubic(0.125 * k as f64)).abs() < 1e-9);
        }
    }

    #[test]
    fn natural_splines_are_the_textbook_ones(x in prop::collection::vec(-10.0..10.0f64, 2..40)) {
        let fine = refined(&x, 4, Interpolation::NaturalSpline);
        for (i, v) in fine[..fine.len() - 1].iter().enumerate() {
            let expected = natural_by_moments(&x, i / 4, (i % 4) as f64 / 4.0);
            prop_assert!((v - expected).abs() < 1e-11);
        }
    }

    #[test]
    fn pchip_and_lines_stay_between_neighbours(x in prop::collection::vec(-10.0..10.0f64, 2..40)) {
        for method in [Interpolation::Linear, Interpolation::Pchip] {
            let fine = refined(&x, 5, method);
            for (k, w) in x.windows(2).enumerate() {
                let piece = &fine[5 * k..=5 * (k + 1)];
                // The values between two samples are monotone, apart from rounding.
                let rising = (w[1] - w[0]).signum();
                prop_assert!(piece.windows(2).all(|p| (p[1] - p[0]) * rising > -1e-12), "{method:?}");
            }
        }
    }

    #[test]
    fn band_limited_is_exact_for_multisines(
        phases in prop::collection::vec(-3.0..3.0f64, 1..20),
        t in -20.0..20.0f64,
        extra in 0usize..9,
    ) {
        let m = Multisine::flat(1..=phases.len(), 1.0, Phases::Given(phases.clone())).unwrap();
        let s = Sampling::new(0.1, 2 * phases.len() + 1 + extra).unwrap();
        let i = Interpolator::new(&m.sample(s).unwrap(), Interpolation::BandLimited).unwrap();
        // t is up to 70 periods, so that the phase of line 20 has an error of 70·20·2π·ε.
        prop_assert!((i.value(t, 0).unwrap() - m.value(t, s.omega0())).abs() < 1e-10);
    }
}

/// Checks that the error that the end conditions of a natural spline cause decreases inwards by the
/// factor 2 − √3 per sample.
#[test]
fn natural_splines_forget_their_ends() {
    let cubic = |t: f64| t * t * t;
    let x: Vec<f64> = (0..41).map(|k| cubic(0.5 * k as f64)).collect();
    let fine = refined(&x, 2, Interpolation::NaturalSpline);
    let error = |k: usize| (fine[2 * k + 1] - cubic(0.5 * k as f64 + 0.25)).abs();
    let ratio = error(36) / error(37);
    assert!((ratio - (2.0 - f64::sqrt(3.0))).abs() < 1e-3, "{ratio}");
    assert!(error(20) < 1e-8);
}

#[test]
fn pchip_by_hand() {
    // The secants are 1, 3 and 0. The slopes at the four samples are (3·1 − 3)/2 = 0, 2·1·3/4 =
    // 1.5, 0 and 0. The last slope is 0, because (3·0 − 3)/2 does not have the sign of the last
    // secant, which is 0. The values in the middle are (y0 + y1)/2 + (d0 − d1)/8.
    let fine = refined(&[0.0, 1.0, 4.0, 4.0], 2, Interpolation::Pchip);
    assert_eq!(fine, [0.0, 0.3125, 1.0, 2.6875, 4.0, 4.0, 4.0]);
}

/// Checks that the interpolation errors of sin t decrease as h² for straight lines and as h⁴ for
/// splines, the orders of the textbooks.
#[test]
fn orders_of_convergence() {
    let error = |n: usize, method| {
        let s = Sampling::new(2.0 / n as f64, n + 1).unwrap();
        let r = Record::from_fn(s, f64::sin).unwrap();
        let i = Interpolator::new(&r, method).unwrap();
        let points = (0..1000).map(|k| 0.5 + k as f64 / 1000.0);
        points.map(|t| (i.value(t, 0).unwrap() - t.sin()).abs()).fold(0.0, f64::max)
    };
    for (method, order) in [
        (Interpolation::Linear, 2.0),
        (Interpolation::NaturalSpline, 4.0),
        (Interpolation::NotAKnotSpline, 4.0),
    ] {
        let observed = (error(64, method) / error(128, method)).log2();
        assert!((observed - order).abs() < 0.1, "{method:?}: {observed}");
    }
}

#[test]
fn a_period_can_be_sampled_anew() {
    let m = Multisine::flat(1..=9, 1.0, Phases::Random { seed: 4 }).unwrap();
    let s = Sampling::new(0.1, 20).unwrap();
    let r = m.sample(s).unwrap();
    // The two resampled records must equal the multisine. The 33 samples of the same period come
    // from a transform, the 27 samples of another duration from sums of the Fourier series.
    for other in [Sampling::new(2.0 / 33.0, 33).unwrap(), Sampling::new(0.13, 27).unwrap()] {
        let again = resample(&r, other, Interpolation::BandLimited).unwrap();
        for (t, x) in other.times().zip(again.channel(0)) {
            assert!((x - m.value(t, s.omega0())).abs() < 1e-12);
        }
    }
    // The Nyquist line of an even period stays a cosine.
    let fine = refined(&[1.0, -1.0, 1.0, -1.0], 2, Interpolation::BandLimited);
    for (k, x) in fine.iter().enumerate() {
        assert!((x - [1.0, 0.0, -1.0, 0.0][k % 4]).abs() < 1e-15);
    }
}

#[test]
fn impossible_requests_are_refused() {
    let two = record(&[1.0, 2.0]);
    let linear = Interpolator::new(&two, Interpolation::Linear).unwrap();
    assert_eq!(linear.value(0.5, 0), Ok(2.0));
    let beyond = SignalError::Range { what: "time", value: 0.6, low: 0.0, high: 0.5 };
    assert_eq!(linear.value(0.6, 0), Err(beyond));
    assert!(linear.value(f64::NAN, 0).is_err());
    for method in ALL {
        assert!(Interpolator::new(&two, method).unwrap().value(0.25, 0).unwrap() <= 2.0);
        let one = Interpolator::new(&record(&[1.0]), method);
        assert_eq!(one.is_ok(), method == Interpolation::BandLimited);
        assert!(refine(&two, 0, method).is_err());
    }
}
