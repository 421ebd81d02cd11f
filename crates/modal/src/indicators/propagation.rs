//! Errors of a quantity that depends on uncertain shapes.

use nalgebra::{DMatrix, DVector};

/// Step of the central differences, relative to the root mean square of the variables: the fourth
/// root of the rounding error balances rounding and truncation of second differences.
const DIFFERENCE_STEP: f64 = 1e-4;

/// Indicator between 0 and 1, with the effect of the errors of the shapes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indicator {
    /// Value, a pure number.
    pub value: f64,
    /// Standard error of the value.
    pub standard_error: f64,
    /// Mean decrease of the value due to errors of the shapes; positive near a maximum.
    pub expected_loss: f64,
}

/// Returns f at `point` with its error to second order, for normally distributed variables: the
/// variance is gᵀCg + ½ tr (HC)², the bias ½ tr HC, with the gradient g and the Hessian H of f.
pub(super) fn propagate(
    f: impl Fn(&DVector<f64>) -> f64,
    point: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Indicator {
    let (len, value) = (point.len(), f(point));
    let step = DIFFERENCE_STEP * point.norm() / (len.max(1) as f64).sqrt();
    let at = |moves: &[(usize, f64)]| {
        let mut moved = point.clone();
        for (index, sign) in moves {
            moved[*index] += sign * step;
        }
        f(&moved)
    };
    let sides: Vec<[f64; 2]> = (0..len).map(|i| [at(&[(i, 1.0)]), at(&[(i, -1.0)])]).collect();
    let gradient = DVector::from_fn(len, |i, _| (sides[i][0] - sides[i][1]) / (2.0 * step));
    let mut hessian = DMatrix::zeros(len, len);
    for i in 0..len {
        hessian[(i, i)] = (sides[i][0] - 2.0 * value + sides[i][1]) / (step * step);
        for j in 0..i {
            let corners =
                at(&[(i, 1.0), (j, 1.0)]) - at(&[(i, 1.0), (j, -1.0)]) - at(&[(i, -1.0), (j, 1.0)])
                    + at(&[(i, -1.0), (j, -1.0)]);
            hessian[(i, j)] = corners / (4.0 * step * step);
            hessian[(j, i)] = hessian[(i, j)];
        }
    }
    let curved = hessian * covariance;
    let first = gradient.dot(&(covariance * &gradient));
    let second = 0.5 * curved.component_mul(&curved.transpose()).sum();
    Indicator {
        value,
        standard_error: (first + second).max(0.0).sqrt(),
        expected_loss: -0.5 * curved.trace(),
    }
}
