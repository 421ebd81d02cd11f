//! Dynamic stiffness and receptance.

use nalgebra::{Complex, ComplexField, DMatrix};

use crate::error::require;
use crate::{ModelError, SecondOrderSystem};

impl SecondOrderSystem {
    /// Returns the dynamic stiffness D(ω) = K − ω²M + iωC, n×n, in N/m: D X = F for amplitudes of
    /// exp(iωt).
    ///
    /// # Source
    /// Ewins (2000), the receptance matrix of a viscously damped system; line by line it is
    /// Dissertation eqs. (4.6.9)–(4.6.10).
    pub fn dynamic_stiffness(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let (m, c, k) = (self.mass(), self.damping(), self.stiffness());
        DMatrix::from_fn(self.dof(), self.dof(), |i, j| {
            Complex::new(k[(i, j)] - omega * omega * m[(i, j)], omega * c[(i, j)])
        })
    }

    /// Returns the receptance H(ω) = D(ω)⁻¹, n×n, in m/N: X = H F for amplitudes of exp(iωt).
    ///
    /// Entry (i, j) is the displacement of degree of freedom i under a unit force on j.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] if ω is not finite, [`ModelError::SingularDynamicStiffness`] if
    /// D(ω) cannot be inverted in double precision.
    ///
    /// # Source
    /// Ewins (2000), the receptance matrix of a viscously damped system.
    pub fn receptance(&self, omega: f64) -> Result<DMatrix<Complex<f64>>, ModelError> {
        require("angular frequency", omega, "finite", true)?;
        let stiffness = self.dynamic_stiffness(omega);
        let terms = one_norm(self.stiffness())
            + omega * omega * one_norm(self.mass())
            + omega.abs() * one_norm(self.damping());
        let receptance = stiffness
            .lu()
            .solve(&DMatrix::identity(self.dof(), self.dof()))
            .ok_or(ModelError::SingularDynamicStiffness { omega, reciprocal_condition: 0.0 })?;
        let reciprocal_condition = 1.0 / (terms * one_norm(&receptance));
        // At a resonance the terms of D cancel, with a rounding error of about 2ε of their size. If
        // the reciprocal condition is below this limit, no digit of the inverse is right. The
        // comparison also rejects NaN.
        if reciprocal_condition > 2.0 * f64::EPSILON {
            Ok(receptance)
        } else {
            Err(ModelError::SingularDynamicStiffness { omega, reciprocal_condition })
        }
    }

    /// Returns the receptance at each of the given angular frequencies (rad/s).
    ///
    /// # Errors
    /// As [`receptance`](Self::receptance), at the first frequency without a receptance.
    pub fn receptances(&self, omegas: &[f64]) -> Result<Vec<DMatrix<Complex<f64>>>, ModelError> {
        omegas.iter().map(|&omega| self.receptance(omega)).collect()
    }
}

/// Returns the largest column sum of moduli.
fn one_norm<T: ComplexField<RealField = f64>>(matrix: &DMatrix<T>) -> f64 {
    matrix.column_iter().map(|c| c.iter().map(|z| z.clone().modulus()).sum()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    #[test]
    fn one_degree_of_freedom_by_hand() {
        // 8 − 9·2 + 3·1.5i = −10 + 4.5i; its inverse is (−10 − 4.5i)/120.25.
        let s = SecondOrderSystem::new(dmatrix![2.0], dmatrix![1.5], dmatrix![8.0]).unwrap();
        assert_eq!(s.dynamic_stiffness(3.0)[(0, 0)], Complex::new(-10.0, 4.5));
        let h = s.receptance(3.0).unwrap()[(0, 0)];
        assert!((h - Complex::new(-10.0, -4.5) / 120.25).norm() < 1e-16);
        assert_eq!(s.receptances(&[0.0, 3.0]).unwrap()[0][(0, 0)], Complex::from(0.125));
    }

    #[test]
    fn an_undamped_resonance_has_no_receptance() {
        // Two equal masses on three equal springs: resonances at 1 and √3.
        let s = SecondOrderSystem::new(
            DMatrix::identity(2, 2),
            DMatrix::zeros(2, 2),
            dmatrix![2.0, -1.0; -1.0, 2.0],
        )
        .unwrap();
        for omega in [1.0, 3f64.sqrt()] {
            assert!(matches!(
                s.receptance(omega),
                Err(ModelError::SingularDynamicStiffness { omega: at, .. }) if at == omega
            ));
        }
        assert!(s.receptance(1.0 + 1e-9).is_ok());
        assert!(matches!(s.receptance(f64::NAN), Err(ModelError::Parameter { .. })));
        // Here ω² overflows; the function must return an error instead of NaN.
        assert!(s.receptance(1e200).is_err());
    }
}
