//! Uncertainty of an estimate due to the estimated noise spectra of its weights.

use mechid_spectra::LineData;
use nalgebra::{DMatrix, DVector};

use super::covariance::Information;

impl Information {
    /// Adds the contribution of the errors of noise spectra to the covariance, and returns the
    /// smallest number of degrees of freedom among the variances of the parameters. `jacobian` is
    /// the derivative of the residual, and `bases` are the basis functions of the log powers of
    /// each record. `None`, without a change of the covariance, if a parameter is not determined.
    ///
    /// The logarithms of the noise powers are B β with the basis B; the information about β is the
    /// identity matrix. With the orthonormal sensitivities Q_l of line l, P_i = Σ b_li Q_lᵀQ_l and
    /// h_l = Σ b_li², the covariance of the estimate grows by Λ = Σ h_l Q_lᵀQ_l − Σ P_i P_i, and
    /// the inverse of the Fisher information is too small by the same matrix.
    ///
    /// # Source
    /// Kenward & Roger (1997), Biometrics 53, 983–997; degrees of freedom: Satterthwaite (1946),
    /// Biometrics Bulletin 2, 110–114.
    pub(super) fn add_weight_uncertainty(
        &mut self,
        data: &LineData,
        jacobian: &DMatrix<f64>,
        bases: &[DMatrix<f64>],
    ) -> Option<f64> {
        let (count, outputs) = (self.free.len(), data.outputs().ncols());
        (self.rank == count && count > 0).then_some(())?;
        let mut columns = jacobian.select_columns(&self.free);
        for (mut column, scale) in columns.column_iter_mut().zip(self.scale.iter()) {
            column.unscale_mut(*scale);
        }
        let factors = columns.qr();
        let (q, r) = (factors.q(), factors.r());
        let mut root = DMatrix::identity(count, count);
        r.solve_upper_triangular_mut(&mut root).then_some(())?;
        root.row_iter_mut().zip(self.scale.iter()).for_each(|(mut row, by)| row.unscale_mut(*by));
        let mut excess = DMatrix::<f64>::zeros(count, count);
        let mut spread = DVector::<f64>::zeros(count);
        for ((rows, _), basis) in data.records().iter().zip(bases) {
            for output in 0..outputs {
                let at: Vec<usize> = rows
                    .clone()
                    .flat_map(|line| [0, 1].map(|part| 2 * (outputs * line + output) + part))
                    .collect();
                let sensitivity = q.select_rows(&at);
                for term in basis.column_iter() {
                    let mut weighted = sensitivity.clone();
                    for (at, mut row) in weighted.row_iter_mut().enumerate() {
                        row *= term[at / 2];
                    }
                    let p = sensitivity.tr_mul(&weighted);
                    excess += weighted.tr_mul(&weighted) - &p * &p;
                    for (spread, c) in spread.iter_mut().zip(root.row_iter()) {
                        *spread += (c * &p).dot(&c).powi(2);
                    }
                }
            }
        }
        let more = &root * excess * root.transpose() * 2.0;
        for (i, row) in self.free.iter().enumerate() {
            for (j, column) in self.free.iter().enumerate() {
                self.covariance[(*row, *column)] += more[(i, j)];
            }
        }
        let variances = root.row_iter().zip(spread.iter());
        let freedom = variances.map(|(c, spread)| 2.0 * c.norm_squared().powi(2) / spread);
        Some(freedom.fold(f64::INFINITY, f64::min))
    }
}
