//! Weighted residual of a fit and its sensitivities, without the components that the transients
//! explain.

use mechid_numerics::products::transposed_product;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::Unknowns;
use crate::frequency_domain::force_responses::{
    ForceResponses, RecordColumns, pulse_covariances, remove, transient_bases,
};
use crate::frequency_domain::{Whitened, orthonormal};
use crate::pulse_covariance::PulseCovariance;

/// Weighted residual and sensitivities at some values of the parameters.
pub(super) struct Linearised {
    /// Residual e without the component that the transients explain.
    pub(super) residual: DVector<f64>,
    /// Orthonormal basis Q of the sensitivities without the components that the transients explain.
    pub(super) basis: DMatrix<f64>,
    /// Change of every parameter per unit of each basis column, parameters × columns.
    pub(super) root: DMatrix<f64>,
    /// Range of the residuals of each open record, and an orthonormal basis of its transient.
    pub(super) transients: Vec<RecordColumns<DMatrix<f64>>>,
    /// Covariance of the errors of pulses; the most likely errors are subtracted from the residual.
    pulses: Vec<RecordColumns<PulseCovariance>>,
    /// Factor of QᵀV⁻¹Q with the covariance V of lines and pulses; `None` without pulses.
    information: Option<Cholesky<f64, Dyn>>,
    /// Coefficients Qᵀe.
    coefficients: DVector<f64>,
}

impl Linearised {
    /// Linearises a fit of `data`; `closed` are the same data without their transients. `None` if a
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
        let exact_forces = data.force_variance().iter().all(|variance| *variance == 0.0);
        let without_pulses = !data.pulse_errors().is_empty() && exact_forces;
        let responses = if data.transient().ncols() > 0 || without_pulses {
            Some(ForceResponses::new(data, unknowns, entries, noise)?)
        } else {
            None
        };
        let transients = match &responses {
            Some(responses) => transient_bases(data, responses)?,
            None => Vec::new(),
        };
        for (rows, transient) in &transients {
            let mut part = residual.rows_mut(rows.start, rows.len());
            part -= transient * transient.tr_mul(&part);
        }
        remove(&transients, &mut sensitivity);
        let (basis, root) = orthonormal(sensitivity)?;
        let coefficients = basis.tr_mul(&residual);
        let (pulses, information) = (Vec::new(), None);
        let mut linear =
            Self { residual, basis, root, transients, pulses, information, coefficients };
        if let Some(responses) = responses.as_ref().filter(|_| without_pulses) {
            let level = linear.cost() / linear.free();
            linear.pulses = pulse_covariances(data, responses, &linear.transients, level)?;
            let weighted = linear.weighted(linear.basis.clone());
            linear.information = Some(linear.products_with_basis(&weighted).cholesky()?);
        }
        Some(linear)
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

    /// Subtracts from the residual the component that a step of the parameters explains, and sets
    /// this step to zero.
    pub(super) fn finish_step(&mut self) {
        self.residual -= &self.basis * &self.coefficients;
        self.coefficients.fill(0.0);
    }

    /// Replaces the independent unknowns by the free entries of M, C and K; `tangent` is the
    /// derivative of the entries with respect to the independent unknowns.
    pub(super) fn relate(&mut self, tangent: &DMatrix<f64>) {
        self.root = tangent * &self.root;
    }

    /// Returns the columns `part` (D_p Q: the basis Q restricted to one part of the data) without
    /// the components that the parameters and the transients of all data explain.
    pub(super) fn unexplained(&self, mut part: DMatrix<f64>) -> DMatrix<f64> {
        let explained = self.products_with_basis(&part);
        part.gemm(-1.0, &self.basis, &explained, 1.0);
        remove(&self.transients, &mut part);
        part
    }

    /// Returns the covariance of the products of columns with the residual, in units of the noise.
    /// The most likely errors of pulses are subtracted from the residual. The covariance of this
    /// residual is therefore V⁻¹ − V⁻¹Q(QᵀV⁻¹Q)⁻¹QᵀV⁻¹, where V is the covariance of lines and
    /// pulses.
    pub(super) fn covariance_of_products(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.pulses.is_empty() {
            return transposed_product(columns.as_view(), columns.as_view());
        }
        let weighted = self.weighted(columns.clone());
        let information = self.products_with_basis(&weighted);
        transposed_product(columns.as_view(), weighted.as_view())
            - information.tr_mul(&self.effect_of(columns))
    }

    /// Returns the change of the coefficients of the basis columns if the residual changes by each
    /// of the given `columns`: (QᵀV⁻¹Q)⁻¹QᵀV⁻¹ times these columns.
    pub(super) fn effect_of(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.information {
            Some(information) => {
                information.solve(&self.products_with_basis(&self.weighted(columns.clone())))
            }
            None => self.products_with_basis(columns),
        }
    }

    /// Returns Qᵀ times columns over all residuals.
    fn products_with_basis(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        transposed_product(self.basis.as_view(), columns.as_view())
    }

    /// Returns whether errors of pulses were subtracted from the residual.
    pub(super) fn is_without_pulses(&self) -> bool {
        !self.pulses.is_empty()
    }

    /// Returns V⁻¹ times columns over all residuals, with the covariance V of lines and pulses.
    fn weighted(&self, mut columns: DMatrix<f64>) -> DMatrix<f64> {
        for (rows, pulses) in &self.pulses {
            let mut part = columns.rows(rows.start, rows.len()).into_owned();
            pulses.whiten(&mut [&mut part]);
            columns.rows_mut(rows.start, rows.len()).copy_from(&part);
        }
        columns
    }

    /// Number of residuals minus the number of parameters, transient loads, and amplitudes of
    /// pulses.
    pub(super) fn free(&self) -> f64 {
        let transients: usize = self.transients.iter().map(|(_, columns)| columns.ncols()).sum();
        let amplitudes: f64 = self.pulses.iter().map(|(_, pulses)| pulses.determined()).sum();
        self.residual.len() as f64 - (self.basis.ncols() + transients) as f64 - amplitudes
    }
}
