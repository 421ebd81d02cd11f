//! Monotone piecewise cubics.
//!
//! # Source
//! Fritsch and Butland (1984), *A method for constructing local monotone piecewise cubic
//! interpolants*, SIAM J. Sci. Stat. Comput. 5(2); the three-point formula at the ends, with its
//! two limits, is that of the PCHIP package.

/// Returns the slopes per step: at an inner sample the harmonic mean of the two secants, or 0 if
/// they differ in sign.
pub(super) fn slopes(y: &[f64]) -> Vec<f64> {
    let n = y.len();
    if n == 2 {
        return vec![y[1] - y[0]; 2];
    }
    let secants: Vec<f64> = y.windows(2).map(|w| w[1] - w[0]).collect();
    let harmonic_mean =
        |w: &[f64]| if w[0] * w[1] > 0.0 { 2.0 * w[0] * (w[1] / (w[0] + w[1])) } else { 0.0 };
    let mut slopes = vec![end(secants[0], secants[1])];
    slopes.extend(secants.windows(2).map(harmonic_mean));
    slopes.push(end(secants[n - 2], secants[n - 3]));
    slopes
}

/// Returns the slope of the parabola at an end, limited so that the curve neither turns back nor
/// overshoots.
fn end(outer: f64, inner: f64) -> f64 {
    let slope = 0.5 * (3.0 * outer - inner);
    if slope * outer <= 0.0 {
        0.0
    } else if outer * inner < 0.0 && slope.abs() > 3.0 * outer.abs() {
        3.0 * outer
    } else {
        slope
    }
}
