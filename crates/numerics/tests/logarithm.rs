//! Tests of the matrix logarithm against the exponential and against closed forms.

use mechid_numerics::NumericsError;
use mechid_numerics::logarithm::logarithm;
use nalgebra::{DMatrix, dmatrix};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random(size: usize, seed: u64) -> DMatrix<f64> {
    let mut source = ChaCha8Rng::seed_from_u64(seed);
    DMatrix::from_fn(size, size, |_, _| source.random_range(-1.0..1.0))
}

/// Returns the exponential as a slow but simple reference: the matrix is halved many times, its
/// power series is summed, and the result is squared as many times.
fn exponential(a: &DMatrix<f64>) -> DMatrix<f64> {
    let halvings = (a.norm().log2().ceil().max(0.0) as i32) + 4;
    let small = a / 2f64.powi(halvings);
    // The series of E = exp − I is summed, because adding I before the squarings would lose digits
    // of E. A squaring of I + E changes E to 2 E + E².
    let mut term = small.clone();
    let mut sum = small.clone();
    for k in 2..=20 {
        term = &term * &small / k as f64;
        sum += &term;
    }
    for _ in 0..halvings {
        sum = &sum * 2.0 + &sum * &sum;
    }
    sum + DMatrix::identity(a.nrows(), a.ncols())
}

fn error(got: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    (got - expected).norm() / expected.norm()
}

/// Returns a full matrix with these eigenvalues: real ones, and complex pairs as (real part,
/// imaginary part).
fn with_eigenvalues(reals: &[f64], pairs: &[(f64, f64)], seed: u64) -> DMatrix<f64> {
    let size = reals.len() + 2 * pairs.len();
    let mut blocks = DMatrix::zeros(size, size);
    for (at, value) in reals.iter().enumerate() {
        blocks[(at, at)] = *value;
    }
    for (at, (re, im)) in pairs.iter().enumerate() {
        let at = reals.len() + 2 * at;
        blocks.view_mut((at, at), (2, 2)).copy_from(&dmatrix![*re, *im; -*im, *re]);
    }
    let v: DMatrix<f64> = random(size, seed) + 3.0 * DMatrix::identity(size, size);
    let lu = v.clone().lu();
    lu.solve(&(&blocks * &v)).unwrap()
}

#[test]
fn closed_forms() {
    // A Jordan block I + N has only one eigenvector; its logarithm is N − N²/2.
    let jordan = dmatrix![1.0, 1.0, 0.0; 0.0, 1.0, 1.0; 0.0, 0.0, 1.0];
    let expected = dmatrix![0.0, 1.0, -0.5; 0.0, 0.0, 1.0; 0.0, 0.0, 0.0];
    assert!((logarithm(&jordan).unwrap() - expected).norm() < 1e-14);
    // A rotation by 3 rad, nearly half a turn, with decay.
    let (s, c) = 3f64.sin_cos();
    let turn = dmatrix![c, -s; s, c] * (-0.2f64).exp();
    let expected = dmatrix![-0.2, -3.0; 3.0, -0.2];
    assert!((logarithm(&turn).unwrap() - expected).norm() < 1e-14);
    assert_eq!(logarithm(&DMatrix::identity(3, 3)).unwrap(), DMatrix::zeros(3, 3));
    assert!((logarithm(&dmatrix![0.01]).unwrap()[(0, 0)] - 0.01f64.ln()).abs() < 1e-14);
}

#[test]
fn clustered_eigenvalues_cost_no_accuracy() {
    for gap in [1e-2, 1e-5, 1e-8, 1e-12, 0.0] {
        let a = with_eigenvalues(&[0.7, 0.7 + gap, 0.7 - gap], &[(0.7, gap), (0.5, 0.5)], 5);
        let log = logarithm(&a).unwrap();
        assert!(error(&exponential(&log), &a) < 1e-12, "gap {gap}");
    }
}

#[test]
fn nearly_defective_matrices_are_as_accurate_as_their_conditioning_allows() {
    // The eigenvalues 0.9 and 0.9 + gap are coupled by an entry of 1. The off-diagonal entry of the
    // exact logarithm is the divided difference of ln, (ln(0.9 + gap) − ln 0.9)/gap. The formula
    // ln1p(gap/0.9)/gap gives it without cancellation.
    for gap in [1e-1, 1e-4, 1e-8, 1e-13] {
        let a = dmatrix![0.9, 1.0; 0.0, 0.9 + gap];
        let actual_gap = a[(1, 1)] - 0.9;
        let log = logarithm(&a).unwrap();
        let expected = dmatrix![
            0.9f64.ln(), (actual_gap / 0.9).ln_1p() / actual_gap; 0.0, (0.9 + gap).ln()
        ];
        assert!(error(&log, &expected) < 1e-14, "gap {gap}: {log} {expected}");
        // In rotated coordinates the same matrix is not triangular. The Schur form gives the
        // difference of the two eigenvalues only with an error of about √ε, but the logarithm is
        // not sensitive to this difference (the condition number of the logarithm is below 10
        // here).
        let q = random(2, 3).qr().q();
        let turned = &q * &a * q.transpose();
        let expected = &q * expected * q.transpose();
        assert!(error(&logarithm(&turned).unwrap(), &expected) < 1e-13, "gap {gap}");
    }
}

#[test]
fn matrices_close_to_the_identity_keep_their_relative_accuracy() {
    for size in [1e-3, 1e-6, 1e-10] {
        let step = random(4, 9) * size;
        let a = DMatrix::identity(4, 4) + &step;
        // Because `a` is rounded to double precision, `x` differs slightly from `step`.
        let x = &a - DMatrix::identity(4, 4);
        let series = &x - &x * &x / 2.0 + &x * &x * &x / 3.0 - &x * &x * &x * &x / 4.0;
        // The first omitted term of the series is x⁵/5, about size⁴ times the first term.
        let bound = 1e-14 + 10.0 * size.powi(4);
        assert!(error(&logarithm(&a).unwrap(), &series) < bound, "size {size}");
    }
}

#[test]
fn what_has_no_logarithm_is_refused_with_its_eigenvalue() {
    for eigenvalue in [-0.4, 0.0] {
        let a = with_eigenvalues(&[eigenvalue, 0.3], &[(0.2, 0.4)], 4);
        let Err(NumericsError::NoLogarithm { eigenvalue: got }) = logarithm(&a) else {
            panic!("eigenvalue {eigenvalue} accepted")
        };
        assert!((got - eigenvalue).abs() < 1e-14);
    }
    assert!(logarithm(&DMatrix::zeros(2, 3)).is_err());
    assert!(logarithm(&dmatrix![f64::INFINITY]).is_err());
    let message = NumericsError::NoLogarithm { eigenvalue: -0.4 }.to_string();
    assert!(message.contains("sample faster"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_exponential_undoes_the_logarithm(size in 1usize..12, seed in 0u64..10_000) {
        // The imaginary parts of the eigenvalues of the exponent are within ±π, so that the
        // exponent is the principal logarithm.
        let exponent = random(size, seed);
        let a = exponential(&exponent);
        let log = logarithm(&a).unwrap();
        prop_assert!(error(&exponential(&log), &a) < 1e-12);
        prop_assert!(error(&log, &exponent) < 1e-11);
    }
}
