//! Indicators of modes and of mode shapes: modal assurance criterion (MAC), modal phase
//! collinearity (MPC), mean phase, and the indicator functions of frequency responses.

mod functions;
mod propagation;
mod shape;
mod within_set;

pub use functions::{complex_mode_indicator, multivariate_mode_indicator};
pub use propagation::Indicator;
pub use shape::ShapeWithCovariance;
pub(crate) use within_set::mac_standard_errors;
pub use within_set::mac_within_set;

use nalgebra::{Complex, DMatrix, DVector, DVectorView};
use thiserror::Error;

use propagation::propagate;

/// Error of the indicators.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum IndicatorError {
    /// Two sizes that must be equal are different.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Name of the counted items.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number given.
        got: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what}: value {index} is not a finite number")]
    NotFinite {
        /// Name of the data.
        what: &'static str,
        /// Position of the value, counted from 0.
        index: usize,
    },
    /// A shape has no entry other than zero.
    #[error("a mode shape of {entries} entries is zero: it has no direction to compare")]
    ZeroShape {
        /// Number of entries of the shape.
        entries: usize,
    },
    /// A singular value iteration did not converge.
    #[error("the singular values of the frequency response at line {line} did not converge")]
    NotConverged {
        /// Line, counted from 0.
        line: usize,
    },
}

/// Returns the modal assurance criterion |aᴴb|²/(aᴴa bᴴb) of two complex shapes: 1 if they are
/// multiples of one another, 0 if they are orthogonal. The value is 0 if a shape is zero.
///
/// # Panics
/// If the shapes differ in length.
///
/// # Source
/// Allemang & Brown (1982), Proceedings of the 1st International Modal Analysis Conference,
/// 110–116.
///
/// ```
/// use mechid_modal::indicators::mac;
/// use nalgebra::{Complex, DVector};
///
/// let shape = DVector::from_vec(vec![Complex::new(1.0, 0.0), Complex::new(0.0, 1.0)]);
/// let turned = &shape * Complex::new(0.0, -3.0);
/// assert!((mac(&shape, &turned) - 1.0).abs() < 1e-15);
/// assert!(mac(&shape, &shape.conjugate()) < 1e-15);
/// ```
pub fn mac(a: &DVector<Complex<f64>>, b: &DVector<Complex<f64>>) -> f64 {
    mac_of_views(a.as_view(), b.as_view())
}

fn mac_of_views(a: DVectorView<'_, Complex<f64>>, b: DVectorView<'_, Complex<f64>>) -> f64 {
    let size = a.norm_squared() * b.norm_squared();
    if size > 0.0 { a.dotc(&b).norm_sqr() / size } else { 0.0 }
}

/// Returns the MAC of every pair of columns of `a` (outputs × modes) and `b` (outputs × modes of
/// another result). The result has a row for each mode of `a` and a column for each mode of `b`.
///
/// # Errors
/// [`IndicatorError::Size`] if the numbers of outputs differ.
///
/// # Source
/// As [`mac`].
pub fn mac_matrix(
    a: &DMatrix<Complex<f64>>,
    b: &DMatrix<Complex<f64>>,
) -> Result<DMatrix<f64>, IndicatorError> {
    check_size("outputs of the second set of shapes", a.nrows(), b.nrows())?;
    let entry = |i, j| mac_of_views(a.column(i).as_view(), b.column(j).as_view());
    Ok(DMatrix::from_fn(a.ncols(), b.ncols(), entry))
}

/// Returns the MAC of two uncertain, independent shapes with its standard error and its expected
/// decrease.
///
/// If the shapes agree, the MAC is at its maximum: its gradient is zero, and errors of the shapes
/// reduce the MAC by `expected_loss` on average. For this reason the standard error includes terms
/// of second order.
///
/// # Errors
/// [`IndicatorError::Size`], [`IndicatorError::ZeroShape`].
///
/// # Source
/// Greś, Döhler & Mevel (2021), Mechanical Systems and Signal Processing 152, 107326 (uncertainty
/// of the modal assurance criterion by the delta method of first and second order).
pub fn mac_with_error(
    a: &ShapeWithCovariance,
    b: &ShapeWithCovariance,
) -> Result<Indicator, IndicatorError> {
    let outputs = a.shape().len();
    check_size("entries of the second shape", outputs, b.shape().len())?;
    let half = 2 * outputs;
    let mut covariance = DMatrix::zeros(2 * half, 2 * half);
    covariance.view_mut((0, 0), (half, half)).copy_from(a.covariance());
    covariance.view_mut((half, half), (half, half)).copy_from(b.covariance());
    let point = DVector::from_iterator(2 * half, stacked(a.shape()).chain(stacked(b.shape())));
    let value = |x: &DVector<f64>| {
        let (first, second) = (unstacked(x.rows(0, half)), unstacked(x.rows(half, half)));
        mac(&first, &second)
    };
    Ok(propagate(value, &point, &covariance))
}

/// Returns the modal phase collinearity |φᵀφ|²/(φᴴφ)²: 1 for a shape whose entries are all in phase
/// or in opposition, as for a structure with proportional damping, and 0 for a travelling wave.
///
/// # Source
/// Juang & Pappa (1985), Journal of Guidance, Control, and Dynamics 8, 620–627; Pappa, Elliott &
/// Schenk (1993), ibid. 16, 832–838.
///
/// ```
/// use mechid_modal::indicators::mpc;
/// use nalgebra::{Complex, DVector};
///
/// let real = DVector::from_vec(vec![Complex::new(0.6, 0.8), Complex::new(-0.3, -0.4)]);
/// assert!((mpc(&real) - 1.0).abs() < 1e-15);
/// ```
pub fn mpc(shape: &DVector<Complex<f64>>) -> f64 {
    mac(shape, &shape.conjugate())
}

/// Returns the modal phase collinearity of an uncertain shape with its standard error.
///
/// # Source
/// As [`mpc`], by the delta method of first and second order.
pub fn mpc_with_error(shape: &ShapeWithCovariance) -> Indicator {
    let len = 2 * shape.shape().len();
    let point = DVector::from_iterator(len, stacked(shape.shape()));
    propagate(|x| mpc(&unstacked(x.rows(0, len))), &point, shape.covariance())
}

/// Returns the mean phase of the entries of a shape, in rad, in (−π/2, π/2]: the direction in the
/// complex plane about which they scatter least.
///
/// # Source
/// The direction of the first principal component of the real and imaginary parts; Pappa, Elliott &
/// Schenk (1993), Journal of Guidance, Control, and Dynamics 16, 832–838.
pub fn mean_phase(shape: &DVector<Complex<f64>>) -> f64 {
    0.5 * shape.iter().map(|z| z * z).sum::<Complex<f64>>().arg()
}

/// Returns the real and imaginary parts of a shape, the real parts first.
fn stacked(shape: &DVector<Complex<f64>>) -> impl Iterator<Item = f64> {
    shape.iter().map(|z| z.re).chain(shape.iter().map(|z| z.im))
}

fn unstacked(parts: nalgebra::DVectorView<'_, f64>) -> DVector<Complex<f64>> {
    let len = parts.len() / 2;
    DVector::from_fn(len, |i, _| Complex::new(parts[i], parts[i + len]))
}

fn check_size(what: &'static str, expected: usize, got: usize) -> Result<(), IndicatorError> {
    if expected == got { Ok(()) } else { Err(IndicatorError::Size { what, expected, got }) }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn shape(parts: &[(f64, f64)]) -> DVector<Complex<f64>> {
        DVector::from_iterator(parts.len(), parts.iter().map(|&(re, im)| Complex::new(re, im)))
    }

    #[test]
    fn values_by_hand() {
        // The MAC is |1·3 + 2·(−1)|² / (5 · 10) = 0.02.
        let (a, b) = (shape(&[(1.0, 0.0), (2.0, 0.0)]), shape(&[(3.0, 0.0), (-1.0, 0.0)]));
        assert!((mac(&a, &b) - 0.02).abs() < 1e-15);
        let set = DMatrix::from_columns(&[a.clone(), b.clone()]);
        let matrix = mac_matrix(&set, &set).unwrap();
        assert!((matrix - nalgebra::dmatrix![1.0, 0.02; 0.02, 1.0]).norm() < 1e-15);
        // Two entries of equal size with a phase difference of 90 degrees give φᵀφ = 1 − 1 = 0.
        assert_eq!(mpc(&shape(&[(1.0, 0.0), (0.0, 1.0)])), 0.0);
        // All entries are on a line at 30 degrees in the complex plane, with alternating signs.
        let line = Complex::cis(std::f64::consts::FRAC_PI_6);
        let line = DVector::from_vec(vec![line, -line * 2.0, line * 0.1]);
        assert!((mean_phase(&line) - std::f64::consts::FRAC_PI_6).abs() < 1e-15);
        assert_eq!(mac(&a, &shape(&[(0.0, 0.0); 2])), 0.0);
        assert!(mac_matrix(&set, &DMatrix::zeros(3, 1)).is_err());
    }

    #[test]
    fn shapes_are_normalised_to_the_entry_of_the_largest_modulus() {
        // The second entry has a larger |Re| + |Im| than the first entry, but a smaller modulus.
        let entries = shape(&[(1.0, 0.0), (-0.7, 0.7)]);
        let uncertain = ShapeWithCovariance::from_standard_errors(entries, &[0.1; 2]).unwrap();
        let normalised = uncertain.normalised();
        assert_eq!(normalised.shape()[0], Complex::from(1.0));
        assert_eq!(normalised.standard_errors()[0], 0.0);
        // The real part and the imaginary part of each entry have a standard error of 0.1, and
        // |φ₂/φ₁|² = 0.98.
        let expected = (2.0f64 * 0.01 * (1.0 + 0.98)).sqrt();
        assert!((normalised.standard_errors()[1] - expected).abs() < 1e-12);
        assert_eq!(uncertain.normalised_to(2), None);
    }

    /// Reference: the scatter of a MAC and an MPC over many random draws of the shapes.
    #[test]
    fn standard_errors_are_the_scatter_of_draws() {
        let a = shape(&[(1.0, 0.0), (0.7, 0.1), (-0.4, 0.05)]);
        for b in [a.clone(), shape(&[(0.2, 0.1), (0.9, 0.0), (-0.5, 0.3)])] {
            let error = 0.03;
            let uncertain = |mean: &DVector<Complex<f64>>| {
                ShapeWithCovariance::from_standard_errors(mean.clone(), &[error; 3]).unwrap()
            };
            let predicted = mac_with_error(&uncertain(&a), &uncertain(&b)).unwrap();
            let predicted_mpc = mpc_with_error(&uncertain(&b));
            let mut random = ChaCha8Rng::seed_from_u64(5);
            let mut draw = |mean: &DVector<Complex<f64>>| {
                mean.map(|z| {
                    let [x, y] = [(); 2].map(|()| StandardNormal.sample(&mut random));
                    z + Complex::<f64>::new(x, y) * error
                })
            };
            let draws: Vec<[f64; 2]> = (0..20_000)
                .map(|_| {
                    let (first, second) = (draw(&a), draw(&b));
                    [mac(&first, &second), mpc(&second)]
                })
                .collect();
            for (column, predicted) in [predicted, predicted_mpc].into_iter().enumerate() {
                let mean = draws.iter().map(|d| d[column]).sum::<f64>() / draws.len() as f64;
                let variance = draws.iter().map(|d| (d[column] - mean).powi(2)).sum::<f64>();
                let scatter = (variance / draws.len() as f64).sqrt();
                let ratio = predicted.standard_error / scatter;
                assert!((ratio - 1.0).abs() < 0.05, "{column}: {ratio}");
                let loss = predicted.value - mean;
                let gap = (loss - predicted.expected_loss).abs();
                assert!(gap < 4.0 * scatter / 141.0 + 0.05 * loss.abs(), "{column}: {gap}");
            }
        }
    }
}
