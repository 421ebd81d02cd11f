//! Covariance due to the noise of forces that act for a few samples only: it correlates all lines.

use std::ops::Range;

use mechid_spectra::transient::powers;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};

use super::Whitened;
use super::output_error_fit::{entries, parts};
use crate::Unknowns;
use crate::limits::MAX_SENSITIVITIES;

/// Returns the matrix that the noise of pulses adds to the inverse of the Fisher information, which
/// assumes independent lines; `None` without such noise and for large fits.
///
/// The error of the estimate is the sum of (JᵀJ)⁻¹ Jᵀ r over the samples of a pulse, where r is the
/// weighted response to the noise of a sample and J are the sensitivities without their part that
/// the transients explain.
///
/// # Source
/// White (1980), Econometrica 48, 817–838, for the covariance of a weighted fit with errors of
/// another covariance.
pub(super) fn excess(
    data: &FrequencyData,
    unknowns: &Unknowns,
    theta: &DVector<f64>,
    noise: &NoiseSpectrum,
) -> Option<DMatrix<f64>> {
    let (n, count) = (data.dof(), unknowns.independent());
    if data.pulses().is_empty() || 2 * n * data.len() * count > MAX_SENSITIVITIES {
        return None;
    }
    let (independent, tau) = parts(data, theta);
    let values = entries(unknowns, independent);
    let covariance = |row: usize| noise.covariance(row).clone();
    let closed = data.without_transient(tau);
    let mut sensitivity = Whitened::new(&closed, unknowns, &values, covariance)?.sensitivity;
    let responses = ForceResponses::new(data, unknowns, &values, noise)?;
    for record in 0..data.transient().ncols() / 2 {
        let (rows, transient) = transient_basis(data, record, &responses)?;
        let mut part = sensitivity.rows_mut(rows.start, rows.len());
        let explained = transient.tr_mul(&part);
        part -= transient * explained;
    }
    let (q, root) = orthonormal(sensitivity)?;
    Some(&root * scatter(data, &responses, &q) * root.transpose())
}

/// Weighted responses to a force of 1 N on every line, one for each degree of freedom.
pub(super) struct ForceResponses(Vec<DVector<f64>>);

impl ForceResponses {
    pub(super) fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        noise: &NoiseSpectrum,
    ) -> Option<Self> {
        let covariance = |row: usize| noise.covariance(row).clone();
        let to_force = |dof: usize| {
            let force = data.unit_force_data(dof);
            let whitened = Whitened::residual_of(&force, unknowns, values, covariance)?;
            Some(whitened.residual)
        };
        (0..data.dof()).map(to_force).collect::<Option<_>>().map(Self)
    }

    /// Returns the weighted response of `rows` to a force of this amplitude on degree of freedom
    /// `dof`.
    fn to(
        &self,
        rows: &Range<usize>,
        dof: usize,
        amplitude: &dyn Fn(usize) -> Complex<f64>,
    ) -> DVector<f64> {
        let n = self.0.len();
        let mut response = DVector::zeros(2 * n * rows.len());
        for row in rows.clone() {
            let factor = amplitude(row);
            for channel in 0..n {
                let from = 2 * (n * row + channel);
                let z = Complex::new(self.0[dof][from], self.0[dof][from + 1]) * factor;
                let to = 2 * (n * (row - rows.start) + channel);
                (response[to], response[to + 1]) = (z.re, z.im);
            }
        }
        response
    }
}

/// Returns the range of the residuals of an open record, and an orthonormal basis of the responses
/// to its transient loads.
pub(super) fn transient_basis(
    data: &FrequencyData,
    record: usize,
    responses: &ForceResponses,
) -> Option<(Range<usize>, DMatrix<f64>)> {
    let n = data.dof();
    let rows = data.open_record(record)?.rows;
    let scaled = (0..2 * 3 * n).map(|load| {
        let (column, power, dof) = (2 * record + load / (3 * n), (load / n) % 3, load % n);
        let response = responses.to(&rows, dof, &|row| {
            data.transient()[(row, column)] * powers(data.omega()[row])[power]
        });
        let length = response.norm().max(f64::MIN_POSITIVE);
        response / length
    });
    let q = DMatrix::from_columns(&scaled.collect::<Vec<_>>()).qr().q();
    Some((2 * n * rows.start..2 * n * rows.end, q))
}

/// Returns Q and R⁻¹ of the sensitivities J = Q R; `None` if the columns of J are linearly
/// dependent.
pub(super) fn orthonormal(mut sensitivity: DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let lengths: Vec<f64> = sensitivity.column_iter().map(|column| column.norm()).collect();
    for (mut column, length) in sensitivity.column_iter_mut().zip(&lengths) {
        if *length > 0.0 {
            column.unscale_mut(*length);
        }
    }
    let (q, r) = sensitivity.qr().unpack();
    let mut root = DMatrix::identity(r.nrows(), r.ncols());
    r.solve_upper_triangular_mut(&mut root).then_some(())?;
    root.row_iter_mut().zip(&lengths).for_each(|(mut row, length)| row.unscale_mut(*length));
    Some((q, root))
}

/// Returns the covariance of Qᵀr by the noise of all pulses, minus the covariance for independent
/// lines.
pub(super) fn scatter(
    data: &FrequencyData,
    responses: &ForceResponses,
    q: &DMatrix<f64>,
) -> DMatrix<f64> {
    let (n, count) = (data.dof(), q.ncols());
    let mut excess = DMatrix::<f64>::zeros(count, count);
    for pulse in data.pulses() {
        let part = q.rows(2 * n * pulse.rows.start, 2 * n * pulse.rows.len());
        let power = pulse.deviation * pulse.deviation;
        for sample in pulse.samples.clone() {
            let impulse = |row: usize| pulse.impulse(sample, data.omega()[row]);
            let effect = part.tr_mul(&responses.to(&pulse.rows, pulse.channel, &impulse));
            excess.ger(power, &effect, &effect, 1.0);
        }
        for row in pulse.rows.clone() {
            let part = q.rows(2 * n * row, 2 * n);
            let variance = 0.5 * data.force_variance()[(row, pulse.channel)];
            for phase in [Complex::new(1.0, 0.0), Complex::new(0.0, 1.0)] {
                let one = row..row + 1;
                let effect = part.tr_mul(&responses.to(&one, pulse.channel, &|_| phase));
                excess.ger(-variance, &effect, &effect, 1.0);
            }
        }
    }
    excess
}
