//! Weighted residual of a fit and its sensitivities, without what transients explain.

use std::ops::Range;

use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{DMatrix, DVector};

use crate::Unknowns;
use crate::frequency_domain::Whitened;
use crate::frequency_domain::pulse_covariance::{ForceResponses, orthonormal, transient_basis};

/// Weighted residual and sensitivities at some values of the parameters.
pub(super) struct Linearised {
    /// Residual e without the part that the transients explain.
    pub(super) residual: DVector<f64>,
    /// Orthonormal basis Q of the sensitivities without the part that the transients explain.
    pub(super) basis: DMatrix<f64>,
    /// Change of every parameter per unit of each basis column, parameters × columns.
    pub(super) root: DMatrix<f64>,
    /// Range of the residuals of each open record, and an orthonormal basis of its transient.
    pub(super) transients: Vec<(Range<usize>, DMatrix<f64>)>,
    /// Responses to unit forces, if the noise of forces acts for some samples only.
    pub(super) responses: Option<ForceResponses>,
    /// Coefficients Qᵀe.
    coefficients: DVector<f64>,
}

impl Linearised {
    /// Linearises a fit of `data`, also given without its transients (`closed`). `None` if a
    /// receptance does not exist, a covariance is singular, or the sensitivities are linearly
    /// dependent.
    pub(super) fn new(
        [data, closed]: [&FrequencyData; 2],
        unknowns: &Unknowns,
        entries: &DVector<f64>,
        noise: &NoiseSpectrum,
    ) -> Option<Self> {
        let covariance = |row: usize| noise.covariance(row).clone();
        let Whitened { mut residual, mut sensitivity } =
            Whitened::new(closed, unknowns, entries, covariance)?;
        let responses = if data.transient().ncols() > 0 {
            Some(ForceResponses::new(data, unknowns, entries, noise)?)
        } else {
            None
        };
        let mut transients = Vec::new();
        if let Some(responses) = &responses {
            for record in 0..data.transient().ncols() / 2 {
                transients.push(transient_basis(data, record, responses)?);
            }
        }
        for (rows, transient) in &transients {
            let mut part = residual.rows_mut(rows.start, rows.len());
            part -= transient * transient.tr_mul(&part);
        }
        remove(&transients, &mut sensitivity);
        let (basis, root) = orthonormal(sensitivity)?;
        let coefficients = basis.tr_mul(&residual);
        let responses = responses.filter(|_| !data.pulses().is_empty());
        Some(Self { residual, basis, root, transients, responses, coefficients })
    }

    pub(super) fn cost(&self) -> f64 {
        self.residual.norm_squared()
    }

    /// Length of the step to the most likely parameters, in standard errors from the residual.
    pub(super) fn step_in_errors(&self) -> f64 {
        let unit = self.cost() / self.residual.len() as f64;
        (self.coefficients.norm_squared() / unit).sqrt()
    }

    /// Returns the Gauss–Newton step of the parameters.
    pub(super) fn step(&self) -> DVector<f64> {
        &self.root * &self.coefficients
    }

    /// Removes the part of the residual that the parameters still explain.
    pub(super) fn finish_step(&mut self) {
        self.residual -= &self.basis * &self.coefficients;
        self.coefficients.fill(0.0);
    }

    /// Changes from independent unknowns to the entries, whose derivative is `tangent`.
    pub(super) fn relate(&mut self, tangent: &DMatrix<f64>) {
        self.root = tangent * &self.root;
    }

    /// Returns D_p Q of a part without the components that the parameters and the transients of all
    /// data explain.
    pub(super) fn unexplained(&self, mut part: DMatrix<f64>) -> DMatrix<f64> {
        let explained = self.basis.tr_mul(&part);
        part -= &self.basis * explained;
        remove(&self.transients, &mut part);
        part
    }

    /// Number of residuals minus the number of parameters and transient loads.
    pub(super) fn free(&self) -> f64 {
        let transients: usize = self.transients.iter().map(|(_, columns)| columns.ncols()).sum();
        self.residual.len() as f64 - (self.basis.ncols() + transients) as f64
    }
}

/// Removes the components that the transients explain from columns over all residuals.
pub(super) fn remove(transients: &[(Range<usize>, DMatrix<f64>)], columns: &mut DMatrix<f64>) {
    for (rows, transient) in transients {
        let mut part = columns.rows_mut(rows.start, rows.len());
        let explained = transient.tr_mul(&part);
        part -= transient * explained;
    }
}
