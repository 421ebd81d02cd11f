//! Correlation of a residual from line to line.

use mechid_signal::correlation::{Correlation, probability_above_of};
use nalgebra::Complex;

use super::limits::{LINES_PER_CORRELATION, MAX_DISTANCES};

/// Returns the correlation of a residual from line to line: real and imaginary part of the sum of
/// r̄(l) r(l+d), minus their expectation, at the distances d = `first`, `first` + 1 … in lines.
/// `explained` are orthonormal columns that span the effect of the parameters. `None` if there are
/// too few lines or the residual is zero.
///
/// For given |r|, the phases of independent lines are random for any noise spectrum: this gives the
/// variances of the products and the covariances of their squares.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on model
/// validation; White (1980), Econometrica 48, 817–838, for the variance.
pub(crate) fn correlation_of_lines(
    residual: &[Complex<f64>],
    explained: &[Vec<Complex<f64>>],
    first: usize,
) -> Option<Correlation> {
    let last = (first + MAX_DISTANCES - 1).min(residual.len() / LINES_PER_CORRELATION);
    if last < first {
        return None;
    }
    let product = |r: &[Complex<f64>], distance: usize| -> Complex<f64> {
        r.iter().zip(&r[distance..]).map(|(a, b)| a.conj() * b).sum()
    };
    let powers: Vec<f64> = residual.iter().map(|r| r.norm_sqr()).collect();
    let power: f64 = powers.iter().sum();
    if power == 0.0 {
        return None;
    }
    let explained_power: f64 = explained.iter().flatten().map(|q| q.norm_sqr()).sum();
    // Variance of a real or imaginary part before the fit of the parameters.
    let unit = power / (2.0 * residual.len() as f64 - explained_power);
    let variance = |distance: usize| -> f64 {
        powers.iter().zip(&powers[distance..]).map(|(a, b)| a * b).sum()
    };
    let (mut coefficients, mut statistic) = (Vec::new(), 0.0);
    for distance in first..=last {
        let expected: Complex<f64> = explained.iter().map(|q| product(q, distance)).sum();
        let deviation = product(residual, distance) + expected * unit;
        coefficients.extend([deviation.re / power, deviation.im / power]);
        statistic += deviation.norm_sqr() / variance(distance);
    }
    let mut square = 0.0;
    for a in first..=last {
        for b in first..=last {
            square += covariance_of_squares(&powers, a, b) / (variance(a) * variance(b));
        }
    }
    Some(Correlation {
        coefficients,
        bound: 1.96 * (0.5 / residual.len() as f64).sqrt(),
        statistic,
        // The squared magnitude of a complex number is a sum of two squares, and the mean of each
        // square is half of the mean of the sum.
        p_value: probability_above_of(statistic, (last + 1 - first) as f64, 0.5 * square),
    })
}

/// Returns the covariance of |p(a)|² and |p(b)|², where p(d) = Σ r̄(l) r(l + d) and the r have
/// random phases and the given squares |r|².
fn covariance_of_squares(powers: &[f64], a: usize, b: usize) -> f64 {
    let parallelograms: f64 = (0..powers.len().saturating_sub(a + b))
        .map(|l| powers[l] * powers[l + a] * powers[l + b] * powers[l + a + b])
        .sum();
    let diagonal = || -> f64 {
        let pairs = || powers.iter().zip(&powers[a..]).map(|(x, y)| x * y);
        pairs().sum::<f64>().powi(2) - pairs().map(|pair| pair * pair).sum::<f64>()
    };
    2.0 * parallelograms + if a == b { diagonal() } else { 0.0 }
}
