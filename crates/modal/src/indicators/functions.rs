//! Indicator functions of tables of frequency responses.

use nalgebra::{Complex, DMatrix};

use super::IndicatorError;
use crate::decomposition;

/// Returns the complex mode indicator function: the singular values of H (outputs × inputs) on each
/// line, in falling order. The result is lines × min(outputs, inputs), in the unit of H.
///
/// Peaks of the first singular value are modes; a peak of the second singular value on the same
/// line is a second mode.
///
/// # Errors
/// [`IndicatorError::Size`] if the responses differ in shape, [`IndicatorError::NotConverged`] also
/// for entries that are not finite.
///
/// # Source
/// Shih, Tsuei, Allemang & Brown (1988), Mechanical Systems and Signal Processing 2, 367–377.
pub fn complex_mode_indicator(
    responses: &[DMatrix<Complex<f64>>],
) -> Result<DMatrix<f64>, IndicatorError> {
    let (outputs, inputs) = shape_of(responses)?;
    let mut indicator = DMatrix::zeros(responses.len(), outputs.min(inputs));
    for (line, response) in responses.iter().enumerate() {
        let values = decomposition::singular_values(response.clone())
            .ok_or(IndicatorError::NotConverged { line })?;
        indicator.row_mut(line).tr_copy_from(&values);
    }
    Ok(indicator)
}

/// Returns the multivariate mode indicator function: for each line and each of q combinations of
/// the q forces, the power of the response in phase with the force, divided by the total power of
/// the response. The values of a line are in rising order; the result is lines × q.
///
/// A value falls from about 1 towards 0 where a real mode is in phase resonance. The responses are
/// displacements or accelerations per unit force.
///
/// # Errors
/// As [`complex_mode_indicator`].
///
/// # Source
/// Williams, Crowley & Vold (1985), Proceedings of the 3rd International Modal Analysis Conference,
/// 66–70.
pub fn multivariate_mode_indicator(
    responses: &[DMatrix<Complex<f64>>],
) -> Result<DMatrix<f64>, IndicatorError> {
    let (_, inputs) = shape_of(responses)?;
    let mut indicator = DMatrix::zeros(responses.len(), inputs);
    for (line, response) in responses.iter().enumerate() {
        let failed = IndicatorError::NotConverged { line };
        let (real, imaginary) = (response.map(|z| z.re), response.map(|z| z.im));
        let in_phase = real.tr_mul(&real);
        let power = &in_phase + imaginary.tr_mul(&imaginary);
        // The Cholesky factor of A + B reduces A f = λ (A + B) f to a symmetric eigenvalue problem.
        let lower = power.cholesky().ok_or(failed.clone())?.unpack();
        let half = lower.solve_lower_triangular(&in_phase).ok_or(failed.clone())?;
        let whitened = lower.solve_lower_triangular(&half.transpose()).ok_or(failed.clone())?;
        let eigen = decomposition::hermitian_eigen(whitened).ok_or(failed)?;
        let mut values: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
        values.sort_by(f64::total_cmp);
        for (combination, value) in values.into_iter().enumerate() {
            indicator[(line, combination)] = value.clamp(0.0, 1.0);
        }
    }
    Ok(indicator)
}

fn shape_of(responses: &[DMatrix<Complex<f64>>]) -> Result<(usize, usize), IndicatorError> {
    let Some(first) = responses.first() else { return Ok((0, 0)) };
    for response in responses {
        super::check_size("outputs of a frequency response", first.nrows(), response.nrows())?;
        super::check_size("inputs of a frequency response", first.ncols(), response.ncols())?;
    }
    Ok(first.shape())
}

#[cfg(test)]
mod tests {
    use nalgebra::dvector;

    use super::*;

    /// Returns the responses of two orthogonal modes of equal size at one frequency, and of a third
    /// mode at a higher frequency.
    fn responses(omegas: &[f64]) -> Vec<DMatrix<Complex<f64>>> {
        let shapes = [dvector![1.0, 1.0, 0.5], dvector![1.0, -1.0, 0.0], dvector![0.5, 0.5, -2.0]];
        let at = |omega: f64| {
            let mut response = DMatrix::zeros(3, 2);
            for (shape, natural) in shapes.iter().zip([10.0, 10.0, 17.0]) {
                let denominator =
                    Complex::new(natural * natural - omega * omega, 0.02 * natural * omega);
                let outer = shape * shape.rows(0, 2).transpose();
                response += outer.map(|v| Complex::from(v) / denominator);
            }
            response
        };
        omegas.iter().map(|omega| at(*omega)).collect()
    }

    #[test]
    fn a_repeated_mode_shows_in_the_second_value() {
        let indicator = complex_mode_indicator(&responses(&[13.5, 10.0, 17.0])).unwrap();
        assert!(indicator[(1, 1)] > 0.3 * indicator[(1, 0)]);
        assert!(indicator[(2, 1)] < 0.05 * indicator[(2, 0)]);
        // The third mode without the other modes has at its resonance the response |φ| |φ_in| / (2
        // ζ ω²), where φ_in contains the two entries of the shape φ at the inputs.
        let alone = 4.5f64.sqrt() * 0.5f64.sqrt() / (0.02 * 289.0);
        assert!((indicator[(2, 0)] / alone - 1.0).abs() < 0.05, "{}", indicator[(2, 0)]);
        assert!(indicator[(2, 0)] > 5.0 * indicator[(0, 0)]);
    }

    #[test]
    fn phase_resonances_are_minima() {
        let indicator = multivariate_mode_indicator(&responses(&[5.0, 10.0, 13.0])).unwrap();
        assert!(indicator[(0, 0)] > 0.9 && indicator[(2, 0)] > 0.8, "{indicator}");
        assert!(indicator[(1, 0)] < 0.05 && indicator[(1, 1)] < 0.05, "{indicator}");
    }

    #[test]
    fn unequal_and_infinite_responses_are_refused() {
        let mut table = responses(&[5.0, 10.0]);
        table[1][(0, 0)] = Complex::from(f64::NAN);
        assert_eq!(complex_mode_indicator(&table), Err(IndicatorError::NotConverged { line: 1 }));
        assert_eq!(
            multivariate_mode_indicator(&table),
            Err(IndicatorError::NotConverged { line: 1 })
        );
        table[1] = DMatrix::zeros(2, 2);
        assert!(matches!(complex_mode_indicator(&table), Err(IndicatorError::Size { .. })));
        assert_eq!(complex_mode_indicator(&[]).unwrap().len(), 0);
    }
}
