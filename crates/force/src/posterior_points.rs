//! Posterior points: parameters that are about as likely as the best ones, with their weights.

use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::DMatrix;

use crate::error::ForceError;
use crate::limits;

/// Returns points around the parameters of maximum likelihood, with weights that sum to 1. They
/// have the mean and covariance of the posterior. Only the best point is returned if the
/// measurement determines the parameters so well that the other points have no effect.
///
/// `log_likelihood` is `None` for impossible parameters.
///
/// # Source
/// Laplace's approximation; spherical cubature of degree 3 (Arasaratnam & Haykin, 2009), each point
/// weighted by the ratio of its likelihood to the approximation.
pub(crate) fn posterior_points(
    best: &[f64],
    log_likelihood: impl Fn(&[f64]) -> Option<f64>,
) -> Result<Vec<(f64, Vec<f64>)>, ForceError> {
    let alone = vec![(1.0, best.to_vec())];
    let (dimension, Some(greatest)) = (best.len(), log_likelihood(best)) else {
        return Ok(alone);
    };
    let fall = |moves: &[(usize, f64)]| {
        let mut point = best.to_vec();
        moves.iter().for_each(|(i, by)| point[*i] += by);
        log_likelihood(&point).map_or(0.0, |value| greatest - value)
    };
    let ahead: Vec<f64> = (0..dimension).map(|i| fall(&[(i, limits::CURVATURE_STEP)])).collect();
    let mut curvature = DMatrix::zeros(dimension, dimension);
    for i in 0..dimension {
        curvature[(i, i)] = (ahead[i] + fall(&[(i, -limits::CURVATURE_STEP)]))
            / (limits::CURVATURE_STEP * limits::CURVATURE_STEP);
        for j in 0..i {
            let both = fall(&[(i, limits::CURVATURE_STEP), (j, limits::CURVATURE_STEP)])
                - ahead[i]
                - ahead[j];
            curvature[(i, j)] = both / (limits::CURVATURE_STEP * limits::CURVATURE_STEP);
            curvature[(j, i)] = curvature[(i, j)];
        }
    }
    let axes = hermitian_eigen(curvature)?;
    let spread = axes
        .eigenvalues
        .map(|value| value.max(limits::UNDETERMINED_LOGARITHM.powi(-2)).sqrt().recip());
    if dimension == 0 || spread.amax() < limits::NARROW_POSTERIOR {
        return Ok(alone);
    }
    let mut points = Vec::with_capacity(2 * dimension);
    let reach = (dimension as f64).sqrt();
    for (axis, spread) in axes.eigenvectors.column_iter().zip(&spread) {
        for sign in [-1.0, 1.0] {
            let moved = axis.iter().zip(best);
            let point: Vec<f64> = moved.map(|(a, x)| x + sign * reach * spread * a).collect();
            let Some(value) = log_likelihood(&point) else { continue };
            let gained = value - greatest + 0.5 * reach * reach;
            points.push((gained.min(limits::POINT_WEIGHT).exp(), point));
        }
    }
    let sum: f64 = points.iter().map(|(weight, _)| weight).sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return Ok(alone);
    }
    points.iter_mut().for_each(|(weight, _)| *weight /= sum);
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::posterior_points;

    #[test]
    fn a_normal_likelihood_gives_its_mean_and_covariance() {
        // Precision [5 2; 2 3], covariance [3 −2; −2 5]/11.
        let log = |p: &[f64]| {
            let (x, y) = (p[0] - 1.0, p[1] + 2.0);
            Some(-0.5 * (5.0 * x * x + 4.0 * x * y + 3.0 * y * y))
        };
        let points = posterior_points(&[1.0, -2.0], log).unwrap();
        let mean = |f: &dyn Fn(&[f64]) -> f64| points.iter().map(|(w, p)| w * f(p)).sum::<f64>();
        assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-14);
        assert!((mean(&|p| p[0]) - 1.0).abs() < 1e-10 && (mean(&|p| p[1]) + 2.0).abs() < 1e-10);
        let covariance = mean(&|p| (p[0] - 1.0) * (p[1] + 2.0));
        assert!((covariance + 2.0 / 11.0).abs() < 1e-9, "{covariance}");
        assert!((mean(&|p| (p[1] + 2.0).powi(2)) - 5.0 / 11.0).abs() < 1e-9);
    }

    #[test]
    fn parameters_known_well_are_one_point() {
        let points = posterior_points(&[0.5], |p| Some(-1e5 * (p[0] - 0.5).powi(2))).unwrap();
        assert_eq!(points, [(1.0, vec![0.5])]);
    }
}
