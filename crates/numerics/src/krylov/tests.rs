//! Tests of the Krylov spaces against dense factorisations and known eigenvalues.

use std::convert::Infallible;

use nalgebra::{DMatrix, DVector};

use crate::error::NumericsError;
use crate::krylov::arnoldi::{Arnoldi, Dominant, dominant};
use crate::krylov::gmres::solve;
use crate::krylov::start_vector::start_vector;

/// A matrix with eigenvalues within the unit circle, most of them near zero.
fn contraction(len: usize) -> DMatrix<f64> {
    let number = |i: usize, j: usize| ((7 * i * i + 5 * j + 3) as f64).sin();
    let turned = DMatrix::from_fn(len, len, number).qr().q();
    let factors = DVector::from_fn(len, |i, _| 0.95 * 0.8f64.powi(i as i32));
    &turned * DMatrix::from_diagonal(&factors) * turned.transpose()
}

/// The solution must equal the solution by the LU factors of the whole matrix. For 80 equations,
/// fewer than 50 products of the operator must be enough.
#[test]
fn equations_are_solved_in_few_products() {
    let (matrix, len) = (contraction(80), 80);
    let right = DVector::from_fn(len, |i, _| (i as f64 * 1.3).cos());
    let apply = |v: &[f64], product: &mut [f64]| {
        (&matrix * DVector::from_column_slice(v))
            .iter()
            .zip(product)
            .for_each(|(p, out)| *out = *p);
        Ok::<_, NumericsError>(())
    };
    let found = solve(&right, 1e-12, 60, apply).unwrap();
    let exact = (DMatrix::identity(len, len) - &matrix).lu().solve(&right).unwrap();
    assert!((found.vector - &exact).norm() < 1e-10 * exact.norm());
    assert!(found.products < 50, "{}", found.products);
    assert!(found.residual <= 1e-12 && found.reciprocal_condition > 0.01);
    // If the space is too small, the reported residual is still the residual of the returned
    // vector.
    let found = solve(&right, 1e-12, 5, apply).unwrap();
    let left = &right - (DMatrix::identity(len, len) - &matrix) * found.vector;
    assert!((left.norm() / right.norm() - found.residual).abs() < 1e-12);
    assert!(found.residual > 1e-6);
}

#[test]
fn what_is_singular_shows_a_reciprocal_condition_of_zero() {
    let apply = |v: &[f64], product: &mut [f64]| {
        product.copy_from_slice(v);
        Ok::<_, NumericsError>(())
    };
    let found = solve(&DVector::from_element(5, 1.0), 1e-12, 5, apply).unwrap();
    assert_eq!((found.reciprocal_condition, found.residual), (0.0, 1.0));
}

#[test]
fn the_residual_of_the_largest_eigenvalue_tells_its_error() {
    let matrix = contraction(80);
    let mut space = Arnoldi::new(DVector::from_fn(80, |i, _| (i as f64).cos()), 40);
    let mut before = f64::INFINITY;
    for size in [4, 8, 16, 32] {
        while space.size() < size {
            let Ok(_) = space.extend(|v, product| {
                let found = &matrix * DVector::from_column_slice(v);
                product.copy_from_slice(found.as_slice());
                Ok::<_, Infallible>(())
            });
        }
        let Dominant { value, residual, .. } = space.dominant().unwrap();
        // For a symmetric matrix, the error of the eigenvalue is not larger than the residual.
        assert!((value - 0.95).norm() <= residual + 1e-13, "{size}: {residual:e}");
        assert!(residual < before, "{size}: {residual:e}");
        before = residual;
    }
    assert!(before < 1e-4, "{before:e}");
}

#[test]
fn the_largest_of_many_eigenvalues_is_found() {
    // The operator rotates two components and multiplies them by 1.2; its factors for all other
    // components are below 1.
    let apply = |x: &[f64], y: &mut [f64]| {
        for (i, (y, x)) in y.iter_mut().zip(x).enumerate() {
            *y = x * (0.9 * (i as f64 * 0.7).cos());
        }
        (y[0], y[1]) = (1.2 * (0.6 * x[0] - 0.8 * x[1]), 1.2 * (0.8 * x[0] + 0.6 * x[1]));
    };
    let found = dominant(start_vector(202), 32, apply).unwrap();
    assert!((found.value.norm() - 1.2).abs() < 1e-6, "{found:?}");
    assert!((found.value.im.abs() - 0.96).abs() < 1e-6);
    let inside: f64 = found.vector.iter().take(2).map(|v| v.norm_sqr()).sum();
    assert!((inside - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn small_operators_are_exact() {
    let found = dominant(start_vector(2), 32, |x, y| (y[0], y[1]) = (3.0 * x[0], -4.0 * x[1]));
    let found = found.unwrap();
    assert!((found.value.re + 4.0).abs() < 1e-14, "{found:?}");
}
