//! Least squares on the equation of motion, line by line.

use mechid_spectra::FrequencyData;
use mechid_spectra::SpectraError;
use nalgebra::{Complex, DMatrix};

use crate::limits::WEIGHTING_CLEAR;
use crate::{EquationOfMotion, Estimate, EstimateError, Unknowns};

/// Estimates M, C and K by least squares on −ω²M X + iωC X + K X = F at every row, with separate
/// real and imaginary parts.
///
/// It is exact for exact spectra, and fast: it needs no iteration and no initial estimate. Noise on
/// the motion is part of the regressors, multiplied by ω and ω², and biases the estimate; the
/// standard errors do not include this bias. Use it if the noise is negligible, and as the initial
/// estimate of [`output_error`](super::output_error).
///
/// Parameters that the lines do not determine are listed in [`Estimate::undetermined`].
///
/// ```
/// use mechid_model::ResponseQuantity;
/// use mechid_estimate::Unknowns;
/// use mechid_spectra::FrequencyData;
/// use mechid_estimate::frequency_domain::equation_error;
/// use nalgebra::{Complex, DMatrix};
///
/// // 10 ẍ + 180 ẋ + 5000 x = F at three frequencies.
/// let omega = vec![10.0, 20.0, 30.0];
/// let force = DMatrix::from_element(3, 1, Complex::new(50.0, 0.0));
/// let displacement = DMatrix::from_fn(3, 1, |row, _| {
///     let w = omega[row];
///     force[(row, 0)] / Complex::new(5000.0 - 10.0 * w * w, 180.0 * w)
/// });
/// let quantity = ResponseQuantity::Displacement;
/// let data = FrequencyData::from_amplitudes(omega, force, displacement, quantity)?;
/// let estimate = equation_error(&data, &Unknowns::unknown_mass(1)?)?;
/// assert!((estimate.stiffness()[(0, 0)] - 5000.0).abs() < 1e-9);
/// # Ok::<(), mechid_estimate::EstimateError>(())
/// ```
///
/// # Errors
/// [`SpectraError::NoExcitedLine`](mechid_spectra::SpectraError::NoExcitedLine) if no row carries
/// force, [`EstimateError::OnlyRatios`] if an equation of motion has neither force nor a known
/// entry, and the errors of [`EquationOfMotion::solve`].
///
/// # Source
/// Dissertation eqs. (4.6.12) and (4.6.31).
pub fn equation_error(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<Estimate, EstimateError> {
    equation_rows(data)?.solve(unknowns)
}

/// Returns the rows of [`equation_error`], to merge with the rows of other data or to solve for
/// several sets of unknowns.
///
/// # Errors
/// [`SpectraError::NoExcitedLine`](mechid_spectra::SpectraError::NoExcitedLine) if no row carries
/// force.
pub fn equation_rows(data: &FrequencyData) -> Result<EquationOfMotion, EstimateError> {
    weighted_rows(data, 0.0, |_| 1.0)
}

/// Returns estimates of [`equation_error`] in which every row is divided by the standard deviation
/// of its equation error, so that noisy lines have little weight. The standard deviation follows
/// from the stated noise and the measured receptance. The first estimate uses all lines, the second
/// only lines with little noise: a noisy line with hardly any force would make the stiffness far
/// too small.
///
/// There is no estimate if no noise is stated, or if the lines do not determine a parameter.
pub(super) fn weighted_equation_errors<'a>(
    data: &'a FrequencyData,
    unknowns: &'a Unknowns,
) -> impl Iterator<Item = Estimate> + 'a {
    [f64::INFINITY, WEIGHTING_CLEAR].into_iter().filter_map(|clear| {
        let rows = weighted_rows(data, 0.0, noise_weight(data, clear)?);
        let solution = rows.ok()?.solve(unknowns).ok()?;
        solution.check_determined().ok().map(|()| solution)
    })
}

/// Returns the weight of each row for the search for a delay. The weight follows from the stated
/// noise and is 0 on lines with much noise; it is 1 if no noise is stated.
pub(super) fn delay_weight(data: &FrequencyData) -> Vec<f64> {
    match noise_weight(data, WEIGHTING_CLEAR) {
        Some(weight) => (0..data.len()).map(weight).collect(),
        None => vec![1.0; data.len()],
    }
}

/// Returns, for each row, the inverse standard deviation of the equation error that the stated
/// noise causes; 0 if the noise power of the motion is more than the fraction `clear` of the power
/// of the motion.
fn noise_weight(data: &FrequencyData, clear: f64) -> Option<impl Fn(usize) -> f64> {
    let noise = data.noise()?;
    let n = data.dof();
    Some(move |row: usize| {
        let spread = noise.covariance(row).diagonal().map(|variance| variance.re);
        let (motion, force) =
            (data.displacement().row(row).norm_squared(), data.force().row(row).norm_squared());
        let of_motion = spread.rows(0, n).sum();
        if motion == 0.0 || force == 0.0 || of_motion > clear * motion {
            return 0.0;
        }
        (force * (of_motion / motion) + spread.rows(n, n).sum()).sqrt().recip()
    })
}

/// Returns the rows of [`equation_error`] with a weight on each line; the force is delayed by
/// `delay` seconds.
pub(super) fn weighted_rows(
    data: &FrequencyData,
    delay: f64,
    weight: impl Fn(usize) -> f64,
) -> Result<EquationOfMotion, EstimateError> {
    if data.force().iter().all(|f| *f == Complex::default()) {
        return Err(SpectraError::NoExcitedLine.into());
    }
    let late = |row: usize| Complex::cis(-data.omega()[row] * delay);
    let weight: Vec<f64> = (0..data.len()).map(weight).collect();
    let (n, motions) = (data.dof(), motions(data, &weight));
    let force = real_rows(data.force(), |row, f| f * late(row) * weight[row]);
    let mut rows = EquationOfMotion::new(n);
    rows.push_rows(
        motions.columns(0, n),
        motions.columns(n, n),
        motions.columns(2 * n, n),
        force.as_view(),
    )?;
    Ok(rows)
}

/// Returns acceleration, velocity and displacement of every degree of freedom, side by side, with a
/// weight on each line.
pub(super) fn motions(data: &FrequencyData, weight: &[f64]) -> DMatrix<f64> {
    let (n, x) = (data.dof(), data.displacement());
    let s = |row: usize| Complex::new(0.0, data.omega()[row]);
    let mut motions = DMatrix::zeros(2 * data.len(), 3 * n);
    let acceleration = real_rows(x, |row, x| s(row) * s(row) * x * weight[row]);
    motions.columns_mut(0, n).copy_from(&acceleration);
    motions.columns_mut(n, n).copy_from(&real_rows(x, |row, x| s(row) * x * weight[row]));
    motions.columns_mut(2 * n, n).copy_from(&real_rows(x, |row, x| x * weight[row]));
    motions
}

/// Returns the real parts of all rows, then the imaginary parts.
pub(super) fn real_rows(
    amplitudes: &DMatrix<Complex<f64>>,
    factor: impl Fn(usize, Complex<f64>) -> Complex<f64>,
) -> DMatrix<f64> {
    let len = amplitudes.nrows();
    let mut real = DMatrix::zeros(2 * len, amplitudes.ncols());
    for (from, mut to) in amplitudes.column_iter().zip(real.column_iter_mut()) {
        let (re, im) = to.as_mut_slice().split_at_mut(len);
        for (row, z) in from.iter().enumerate() {
            let z = factor(row, *z);
            (re[row], im[row]) = (z.re, z.im);
        }
    }
    real
}
