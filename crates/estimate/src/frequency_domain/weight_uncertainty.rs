//! Uncertainty of an estimate due to the estimated noise spectrum of its weights.

use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{DMatrix, DVector};

use super::Whitened;
use crate::Unknowns;
use crate::limits::MAX_LEVERAGES;

/// Correction of the covariance of an estimate, and the degrees of freedom of this covariance.
pub(super) struct WeightUncertainty {
    /// Matrix to add to the inverse of the Fisher information.
    pub(super) excess: DMatrix<f64>,
    /// Smallest number of degrees of freedom among the variances of the parameters.
    pub(super) degrees_of_freedom: f64,
}

impl WeightUncertainty {
    /// Computes the correction for an estimate with the entries `values` from lines that are
    /// weighted by `noise`. `None` if the noise is not a smooth spectrum, or for large fits.
    ///
    /// The logarithms of the noise powers are B β with the basis B; the information about β is ν
    /// times the identity matrix. With the orthonormal sensitivities Q_l of line l, P_i = Σ b_li
    /// Q_lᵀQ_l and h_l = Σ b_li², the covariance of the estimate grows by Λ = (Σ h_l Q_lᵀQ_l − Σ
    /// P_i P_i)/ν, and the inverse of the Fisher information is too small by the same matrix.
    ///
    /// # Source
    /// Kenward & Roger (1997), Biometrics 53, 983–997; degrees of freedom: Satterthwaite (1946),
    /// Biometrics Bulletin 2, 110–114.
    pub(super) fn new(
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
        let variances = root.row_iter().zip(spread.iter());
        let freedom = variances.map(|(c, spread)| 2.0 * c.norm_squared().powi(2) / spread);
        Some(Self {
            excess: &root * excess * root.transpose() * 2.0,
            degrees_of_freedom: freedom.fold(f64::INFINITY, f64::min),
        })
    }
}
