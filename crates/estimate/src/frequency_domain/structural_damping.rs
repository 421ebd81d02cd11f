//! Fit of structural damping instead of viscous damping.

use mechid_model::Matrix;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::equation_error::{motions, real_rows};
use crate::limits::INITIAL_ROUNDS;
use crate::{EquationOfMotion, Estimate, Unknowns};

/// Fit of −ω²M X + iD X + K X = F, with a damping D that does not depend on the frequency.
#[derive(Debug, Clone)]
pub struct StructuralDamping {
    /// Loss factor, a ratio: projection of the structural damping matrix D on the stiffness matrix
    /// K.
    pub loss_factor: f64,
    /// Modelled displacement, rows × n, in m.
    pub displacement: DMatrix<Complex<f64>>,
}

/// Fits structural damping. The `unknowns` are those of an equation of motion; D (N/m) has the
/// unknowns of C. Each round of least squares is weighted by the receptance of the round before.
/// `None` if a known entry of C is not zero, or if the data do not determine an entry.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), section 2.4 (structural damping); Sanathanan & Koerner
/// (1963), IEEE Trans. Automatic Control 8, 56–58, for the weights.
pub fn structural_damping(data: &FrequencyData, unknowns: &Unknowns) -> Option<StructuralDamping> {
    let n = unknowns.dof();
    let known = |row, column| unknowns.fixed(Matrix::Damping, row, column).unwrap_or(0.0);
    if (0..n).any(|row| (0..n).any(|column| known(row, column) != 0.0)) {
        return None;
    }
    let unit = |row: usize| data.measured().per_displacement(data.omega()[row]).norm();
    let mut weight = vec![1.0; data.len()];
    let mut fit = solve(data, &weight, unknowns)?;
    for _ in 0..INITIAL_ROUNDS {
        for (row, weight) in weight.iter_mut().enumerate() {
            *weight = unit(row) / dynamic_stiffness(&fit, data.omega()[row]).norm();
        }
        fit = solve(data, &weight, unknowns)?;
    }
    let mut displacement = DMatrix::zeros(data.len(), n);
    for (row, omega) in data.omega().iter().enumerate() {
        let force = data.force().row(row).transpose();
        let response = dynamic_stiffness(&fit, *omega).lu().solve(&force)?;
        displacement.row_mut(row).copy_from(&response.transpose());
    }
    let loss_factor = fit.damping().dot(&fit.stiffness()) / fit.stiffness().norm_squared();
    let is_finite = loss_factor.is_finite() && displacement.iter().all(|x| x.is_finite());
    is_finite.then_some(StructuralDamping { loss_factor, displacement })
}

/// Solves the least-squares problem; `weight` has one weight for each line.
fn solve(data: &FrequencyData, weight: &[f64], unknowns: &Unknowns) -> Option<Estimate> {
    if weight.iter().any(|weight| !weight.is_finite()) {
        return None;
    }
    let (n, motions) = (unknowns.dof(), motions(data, weight));
    let in_quadrature =
        real_rows(data.displacement(), |row, x| Complex::new(0.0, 1.0) * x * weight[row]);
    let force = real_rows(data.force(), |row, f| f * weight[row]);
    let mut rows = EquationOfMotion::new(n);
    let (acceleration, displacement) = (motions.columns(0, n), motions.columns(2 * n, n));
    rows.push_rows(acceleration, in_quadrature.as_view(), displacement, force.as_view()).ok()?;
    let fit = rows.solve(unknowns).ok()?;
    fit.undetermined().is_empty().then_some(fit)
}

/// Returns −ω²M + iD + K, in N/m.
fn dynamic_stiffness(fit: &Estimate, omega: f64) -> DMatrix<Complex<f64>> {
    let part = |m: f64, d: f64, k: f64| Complex::new(k - omega * omega * m, d);
    fit.mass().zip_zip_map(&fit.damping(), &fit.stiffness(), part)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use mechid_model::ResponseQuantity;

    use super::*;

    /// The fit to exact responses of two masses, whose springs have the same loss factor, returns
    /// this loss factor for every measured quantity.
    #[test]
    fn exact_responses_give_the_loss_factor() {
        let mass = DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 0.0, 5.0]);
        let stiffness = DMatrix::from_row_slice(2, 2, &[9e4, -4e4, -4e4, 7e4]);
        let omega: Vec<f64> = (1..=80).map(|line| TAU * 0.5 * f64::from(line)).collect();
        for measured in ResponseQuantity::ALL {
            let response: Vec<_> = omega
                .iter()
                .map(|w| {
                    let part = |m: f64, k: f64| Complex::new(k - w * w * m, 0.3 * k);
                    let inverse = mass.zip_map(&stiffness, part).lu().try_inverse().unwrap();
                    inverse * measured.per_displacement(*w)
                })
                .collect();
            let data = FrequencyData::from_responses(&omega, &response, None, measured, &[0, 1]);
            let (data, unknowns) = (data.unwrap(), Unknowns::unknown_mass(2).unwrap());
            let fit = structural_damping(&data, &unknowns).unwrap();
            assert!((fit.loss_factor - 0.3).abs() < 1e-9, "{}", fit.loss_factor);
            let residual = (&fit.displacement - data.displacement()).norm();
            assert!(residual < 1e-9 * data.displacement().norm());
            let viscous = unknowns.fix(Matrix::Damping, 0, 0, 2.0).unwrap();
            assert!(structural_damping(&data, &viscous).is_none());
        }
    }
}
