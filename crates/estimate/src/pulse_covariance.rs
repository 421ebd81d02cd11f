//! Errors of pulses: noise of the inputs that is common to all lines of a record.

use mechid_numerics::products::transposed_product;
use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;

use crate::limits::PULSE_SUMS;

/// Covariance I + P Pᵀ of the weighted errors of a record. The columns of P are the weighted
/// effects of the amplitudes of the pulse errors of this record; P is stored in blocks of rows.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 2.1.4 (formula of Sherman,
/// Morrison and Woodbury).
pub(crate) struct PulseCovariance {
    /// Rows of P.
    pub(crate) effects: Vec<DMatrix<f64>>,
    /// Cholesky factor of I + PᵀP, where P is `effects`.
    factor: Cholesky<f64, Dyn>,
}

impl PulseCovariance {
    /// Computes the Cholesky factor of I + PᵀP; `None` if an effect is not finite or there is no
    /// block.
    pub(crate) fn new(effects: Vec<DMatrix<f64>>) -> Option<Self> {
        let count = effects.first()?.ncols();
        let products: Vec<_> = effects
            .par_chunks(effects.len().div_ceil(PULSE_SUMS))
            .map(|blocks| {
                blocks.iter().fold(DMatrix::zeros(count, count), |sum, block| {
                    sum + transposed_product(block.as_view(), block.as_view())
                })
            })
            .collect();
        let sum = products.iter().fold(DMatrix::identity(count, count), |sum, part| sum + part);
        sum.iter().all(|value| value.is_finite()).then_some(())?;
        Some(Self { effects, factor: Cholesky::new(sum)? })
    }

    /// Replaces the columns v of a matrix, in blocks of rows, by v − P b with (I + PᵀP) b = Pᵀv,
    /// and returns b. If the rows of b are appended to the new columns, the product of two of these
    /// columns is v₁ᵀ(I + P Pᵀ)⁻¹v₂ with the original columns v₁ and v₂.
    pub(crate) fn whiten(&self, parts: &mut [&mut DMatrix<f64>]) -> DMatrix<f64> {
        let columns = parts.first().map_or(0, |part| part.ncols());
        let pairs = self.effects.par_iter().zip(parts.par_iter());
        let products: Vec<_> = pairs
            .map(|(effects, part)| transposed_product(effects.as_view(), part.as_view()))
            .collect();
        let zeros = DMatrix::zeros(self.factor.l_dirty().nrows(), columns);
        let mut amplitudes = products.iter().fold(zeros, |sum, block| sum + block);
        self.factor.solve_mut(&mut amplitudes);
        let pairs = self.effects.par_iter().zip(parts.par_iter_mut());
        pairs.for_each(|(effects, part)| part.gemm(-1.0, effects, &amplitudes, 1.0));
        amplitudes
    }

    /// Returns Vᵀ(I + PᵀP)⁻¹V for V = Pᵀv, the part of the products vᵀv that the errors of the
    /// pulses explain.
    pub(crate) fn explained(&self, products: &DMatrix<f64>) -> DMatrix<f64> {
        products.tr_mul(&self.factor.solve(products))
    }

    /// Returns the blocks of rows of X with X Xᵀ = P (I + PᵀP)⁻¹Pᵀ: I − X Xᵀ is the covariance of
    /// the columns v − P b that [`Self::whiten`] makes from errors v. `None` if a factor is
    /// singular.
    pub(crate) fn explained_columns(&self) -> Option<Vec<DMatrix<f64>>> {
        let lower = self.factor.l();
        let columns = |effects: &DMatrix<f64>| {
            Some(lower.solve_lower_triangular(&effects.transpose())?.transpose())
        };
        self.effects.par_iter().map(columns).collect()
    }

    /// Returns the number of amplitudes that the lines determine. Each amplitude counts as the
    /// fraction of its information that comes from the lines.
    pub(crate) fn determined(&self) -> f64 {
        self.factor.l_dirty().nrows() as f64 - self.factor.inverse().trace()
    }

    /// Returns the logarithm of the determinant of the covariance.
    pub(crate) fn log_determinant(&self) -> f64 {
        2.0 * self.factor.l_dirty().diagonal().iter().map(|root| root.ln()).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_with_the_inverse_covariance() {
        let number = |at: usize| ((at * 7919 + 13) % 101) as f64 / 50.0 - 1.0;
        let effects = DMatrix::from_fn(12, 4, |i, j| 3.0 * number(4 * i + j));
        let vectors = DMatrix::from_fn(12, 2, |i, j| number(100 + 2 * i + j));
        let covariance = DMatrix::identity(12, 12) + &effects * effects.transpose();
        let expected = vectors.tr_mul(&covariance.clone().lu().solve(&vectors).unwrap());
        let blocks = |all: &DMatrix<f64>| vec![all.rows(0, 7).into(), all.rows(7, 5).into()];
        let pulses = PulseCovariance::new(blocks(&effects)).unwrap();
        let mut parts: Vec<DMatrix<f64>> = blocks(&vectors);
        let amplitudes = pulses.whiten(&mut parts.iter_mut().collect::<Vec<_>>());
        let products: DMatrix<f64> = parts.iter().map(|part| part.tr_mul(part)).sum();
        let whitened = products + amplitudes.tr_mul(&amplitudes);
        assert!((&whitened - &expected).norm() < 1e-12 * expected.norm());
        let explained = vectors.tr_mul(&vectors) - pulses.explained(&effects.tr_mul(&vectors));
        assert!((explained - &expected).norm() < 1e-12 * expected.norm());
        let columns = pulses.explained_columns().unwrap();
        let first = covariance.clone().lu().try_inverse().unwrap().view((0, 0), (7, 7))
            - DMatrix::<f64>::identity(7, 7);
        assert!((first + &columns[0] * columns[0].transpose()).norm() < 1e-12);
        let trace = 12.0 - covariance.clone().lu().try_inverse().unwrap().trace();
        assert!((pulses.determined() - trace).abs() < 1e-12);
        assert!((pulses.log_determinant() - covariance.determinant().ln()).abs() < 1e-10);
    }
}
