//! Uncertainty of an estimate that follows from that of the smooth noise spectrum by which it is
//! weighted.

use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{DMatrix, DVector};

use super::Whitened;
use crate::Unknowns;
use crate::limits::MAX_LEVERAGES;

/// Correction of the covariance of an estimate, and how well that covariance itself is known.
pub(super) struct WeightUncertainty {
    /// Added to the inverse of the Fisher information.
    pub(super) excess: DMatrix<f64>,
    /// Degrees of freedom of the variance of the parameter that has the fewest.
    pub(super) degrees_of_freedom: f64,
}

impl WeightUncertainty {
    /// Judges an estimate at the entries `values`, weighted by `noise`; `None` where the noise is
    /// no smooth spectrum or the fit is a large one.
    ///
    /// With log powers B β of unit information times ν, orthonormal sensitivities Q and P_i = Σ
    /// b_li Q_lᵀQ_l, the estimate scatters more by Λ = (Σ h_l Q_lᵀQ_l − Σ P_i P_i)/ν, and the
    /// inverse of the Fisher information is too small by as much.
    ///
    /// # Source
    /// Kenward & Roger (1997), Biometrics 53, 983–997; degrees of freedom: Satterthwaite (1946),
    /// Biometrics Bulletin 2, 110–114.
    pub(super) fn of(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        noise: &NoiseSpectrum,
    ) -> Option<Self> {
        let (n, count) = (data.dof(), unknowns.independent());
        let parts = noise.smooth_parts()?;
        if 2 * n * data.len() * values.len() > MAX_LEVERAGES {
            return None;
        }
        let covariance = |row: usize| noise.covariance(row).clone();
        let mut sensitivity = Whitened::new(data, unknowns, values, covariance)?.sensitivity;
        let mut scale = DVector::from_element(count, 1.0);
        for (mut column, scale) in sensitivity.column_iter_mut().zip(scale.iter_mut()) {
            *scale = column.norm();
            column.unscale_mut(*scale);
        }
        let qr = sensitivity.qr();
        let (q, r) = (qr.q(), qr.r());
        let mut root = DMatrix::identity(count, count);
        r.solve_upper_triangular_mut(&mut root).then_some(())?;
        root.row_iter_mut().zip(scale.iter()).for_each(|(mut row, scale)| row.unscale_mut(*scale));
        let mut excess = DMatrix::<f64>::zeros(count, count);
        let mut spread = DVector::<f64>::zeros(count);
        let mut first = 0;
        for part in parts {
            for channel in 0..n {
                let rows: Vec<usize> = (0..part.basis.nrows())
                    .flat_map(|line| [0, 1].map(|p| 2 * (n * (first + line) + channel) + p))
                    .collect();
                let sensitivity = q.select_rows(&rows);
                for term in part.basis.column_iter() {
                    let mut weighted = sensitivity.clone();
                    for (at, mut row) in weighted.row_iter_mut().enumerate() {
                        row *= term[at / 2];
                    }
                    let p = sensitivity.tr_mul(&weighted);
                    excess += (weighted.tr_mul(&weighted) - &p * &p) / part.nu;
                    for (spread, c) in spread.iter_mut().zip(root.row_iter()) {
                        *spread += (c * &p).dot(&c).powi(2) / part.nu;
                    }
                }
            }
            first += part.basis.nrows();
        }
        let each = root.row_iter().zip(spread.iter());
        let freedom = each.map(|(c, spread)| 2.0 * c.norm_squared().powi(2) / spread);
        Some(Self {
            excess: &root * excess * root.transpose() * 2.0,
            degrees_of_freedom: freedom.fold(f64::INFINITY, f64::min),
        })
    }
}
