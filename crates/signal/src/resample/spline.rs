//! Cubic splines on a uniform axis, as slopes at the samples.
//!
//! Continuity of the second derivative at an inner sample requires, per step, d_{k−1} + 4 d_k +
//! d_{k+1} = 3 (y_{k+1} − y_{k−1}); the two ends add one equation each.
//!
//! # Source
//! de Boor, *A Practical Guide to Splines*, chapter on cubic spline interpolation.

/// Slopes of the spline whose second derivative vanishes at both ends: 2 d_0 + d_1 = 3 (y_1 − y_0).
pub(super) fn natural(y: &[f64]) -> Vec<f64> {
    let n = y.len();
    let end = |outer: f64, inner: f64| 3.0 * (inner - outer);
    solve(y, (2.0, 1.0, end(y[0], y[1])), (2.0, 1.0, -end(y[n - 1], y[n - 2])))
}

/// Slopes of the spline whose third derivative is continuous at the second and the last but one
/// sample: d_0 + 2 d_1 = (5 (y_1 − y_0) + (y_2 − y_1)) / 2. The spline of two samples is a straight
/// line, that of three samples a parabola.
pub(super) fn not_a_knot(y: &[f64]) -> Vec<f64> {
    match *y {
        [a, b] => vec![b - a; 2],
        [a, b, c] => {
            let bend = c - 2.0 * b + a;
            vec![b - a - 0.5 * bend, 0.5 * (c - a), c - b + 0.5 * bend]
        }
        _ => {
            let n = y.len();
            let end = |a: f64, b: f64, c: f64| 0.5 * (5.0 * (b - a) + (c - b));
            let (first, last) = (end(y[0], y[1], y[2]), -end(y[n - 1], y[n - 2], y[n - 3]));
            solve(y, (1.0, 2.0, first), (1.0, 2.0, last))
        }
    }
}

/// Solves the tridiagonal system for the slopes. Each end equation is (coefficient of the slope at
/// the end, coefficient of the neighbouring slope, right-hand side).
fn solve(y: &[f64], first: (f64, f64, f64), last: (f64, f64, f64)) -> Vec<f64> {
    let n = y.len();
    // After elimination d_k + above[k] · d_{k+1} = right[k].
    let (mut above, mut right) = (vec![0.0; n], vec![0.0; n]);
    (above[0], right[0]) = (first.1 / first.0, first.2 / first.0);
    for k in 1..n - 1 {
        let pivot = 4.0 - above[k - 1];
        above[k] = 1.0 / pivot;
        right[k] = (3.0 * (y[k + 1] - y[k - 1]) - right[k - 1]) / pivot;
    }
    let pivot = last.0 - last.1 * above[n - 2];
    right[n - 1] = (last.2 - last.1 * right[n - 2]) / pivot;
    for k in (0..n - 1).rev() {
        right[k] -= above[k] * right[k + 1];
    }
    right
}
