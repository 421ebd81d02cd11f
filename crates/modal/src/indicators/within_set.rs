//! Modal assurance criterion of two different modes of one result.

use nalgebra::{Complex, DMatrix, DVector};

use super::{Indicator, IndicatorError, ShapeWithCovariance, check_size};

/// Returns the MAC of two modes of one result with its standard error. `cross` is the covariance of
/// the real and imaginary parts of `a` with those of `b` (2p × 2p, the p real parts first), in the
/// product of their units; `None` if their errors are independent.
///
/// The MAC is |z|² with z = aᴴb/(|a||b|). The covariance of z is to first order. The variance of
/// |z|² follows from it exactly, so that the result is also right for orthogonal shapes, where the
/// gradient of the MAC is zero. For equal shapes the standard error is too small: use
/// [`mac_with_error`](super::mac_with_error) for one mode in two results.
///
/// # Errors
/// [`IndicatorError::Size`].
///
/// # Source
/// Delta method of first order; Searle & Gruber, *Linear Models*, 2nd ed. (2017), section 2.5
/// (variance of a quadratic form of normal variables).
pub fn mac_within_set(
    a: &ShapeWithCovariance,
    b: &ShapeWithCovariance,
    cross: Option<&DMatrix<f64>>,
) -> Result<Indicator, IndicatorError> {
    let (first, second) = (a.shape(), b.shape());
    check_size("entries of the second shape", first.len(), second.len())?;
    let [norm, other_norm] = [first, second].map(|shape| shape.norm());
    let scale = norm * other_norm;
    let z = first.dotc(second) / Complex::from(scale);
    let by_first = gradient(first, |k, unit| {
        unit.conj() * second[k] / scale - z * (first[k].conj() * unit).re / (norm * norm)
    });
    let by_second = gradient(second, |k, unit| {
        first[k].conj() * unit / scale
            - z * (second[k].conj() * unit).re / (other_norm * other_norm)
    });
    let mut covariance = &by_first * a.covariance() * by_first.transpose()
        + &by_second * b.covariance() * by_second.transpose();
    if let Some(cross) = cross {
        let len = 2 * first.len();
        check_size("rows of the covariance of two shapes", len, cross.nrows())?;
        check_size("columns of the covariance of two shapes", len, cross.ncols())?;
        let mixed = &by_first * cross * by_second.transpose();
        covariance += &mixed + mixed.transpose();
    }
    let parts = DVector::from_vec(vec![z.re, z.im]);
    let variance = 4.0 * parts.dot(&(&covariance * &parts)) + 2.0 * covariance.norm_squared();
    Ok(Indicator {
        value: z.norm_sqr(),
        standard_error: variance.max(0.0).sqrt(),
        expected_loss: -covariance.trace(),
    })
}

/// Returns the standard error of the MAC of each pair of shapes, in a square matrix with zeros on
/// its diagonal; NaN for a shape that is `None`. `cross` returns the covariance of two shapes, as
/// for [`mac_within_set`].
pub(crate) fn mac_standard_errors(
    shapes: &[Option<ShapeWithCovariance>],
    cross: impl Fn(usize, usize) -> Option<DMatrix<f64>>,
) -> DMatrix<f64> {
    let mut errors = DMatrix::zeros(shapes.len(), shapes.len());
    for (a, b) in (0..shapes.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let pair = shapes[a].as_ref().zip(shapes[b].as_ref());
        let mac = pair.and_then(|(one, two)| mac_within_set(one, two, cross(a, b).as_ref()).ok());
        errors[(a, b)] = mac.map_or(f64::NAN, |mac| mac.standard_error);
        errors[(b, a)] = errors[(a, b)];
    }
    errors
}

/// Returns the derivatives of real and imaginary part (rows) of a complex function of a shape with
/// respect to the real parts and then the imaginary parts of the entries (columns). `change`
/// returns the derivative of the function if an entry changes in the direction 1 (real) or j
/// (imaginary).
fn gradient(
    shape: &DVector<Complex<f64>>,
    change: impl Fn(usize, Complex<f64>) -> Complex<f64>,
) -> DMatrix<f64> {
    let len = shape.len();
    DMatrix::from_fn(2, 2 * len, |part, column| {
        let unit = if column < len { Complex::new(1.0, 0.0) } else { Complex::i() };
        let change = change(column % len, unit);
        if part == 0 { change.re } else { change.im }
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::indicators::mac;

    /// Reference: the scatter of random draws of two shapes with dependent errors, for close shapes
    /// and for orthogonal shapes.
    #[test]
    fn standard_errors_are_the_scatter_of_dependent_draws() {
        let shape = |parts: [f64; 4]| {
            DVector::from_iterator(4, parts.iter().map(|re| Complex::new(*re, 0.1 * re)))
        };
        let a = shape([1.0, 0.8, -0.4, 0.3]);
        for b in [shape([0.9, 0.9, -0.1, 0.2]), shape([0.8, -1.0, 0.3, 0.4])] {
            let mut random = ChaCha8Rng::seed_from_u64(3);
            // Each error is a mixture of 6 normal variables that all entries share and of a
            // separate normal variable.
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let mixture = DMatrix::from_fn(16, 6, |_, _| 0.003 * normal());
            let whole = &mixture * mixture.transpose() + DMatrix::identity(16, 16) * 1e-5;
            let part = |i: usize, j: usize| whole.view((8 * i, 8 * j), (8, 8)).into_owned();
            let [one, two] = [(0, &a), (1, &b)]
                .map(|(at, shape)| ShapeWithCovariance::new(shape.clone(), part(at, at)).unwrap());
            let cross = part(0, 1);
            let predicted = mac_within_set(&one, &two, Some(&cross)).unwrap();
            assert!((predicted.value - mac(&a, &b)).abs() < 1e-14);
            let root = whole.cholesky().unwrap().l();
            let draws: Vec<f64> = (0..10_000)
                .map(|_| {
                    let errors = &root * DVector::from_fn(16, |_, _| normal());
                    let moved = |shape: &DVector<Complex<f64>>, from: usize| {
                        let error = |k: usize| Complex::new(errors[from + k], errors[from + 4 + k]);
                        DVector::from_fn(4, |k, _| shape[k] + error(k))
                    };
                    mac(&moved(&a, 0), &moved(&b, 8))
                })
                .collect();
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            let square = |draw: &f64| (draw - mean).powi(2);
            let scatter = (draws.iter().map(square).sum::<f64>() / draws.len() as f64).sqrt();
            let ratio = predicted.standard_error / scatter;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio} at {}", predicted.value);
            let independent = mac_within_set(&one, &two, None).unwrap().standard_error;
            assert!((independent / scatter - 1.0).abs() > 0.05, "{independent} {scatter}");
        }
    }
}
