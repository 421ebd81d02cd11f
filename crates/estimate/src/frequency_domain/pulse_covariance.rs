//! Covariance by the noise of forces that act for a few samples only, whose lines err together.

use std::ops::Range;

use mechid_spectra::transient::powers;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};

use super::Whitened;
use super::output_error_fit::{entries, parts};
use crate::Unknowns;
use crate::limits::MAX_SENSITIVITIES;

/// Matrix that the noise of pulses adds to the inverse of the Fisher information, which takes the lines to err one by
/// one; `None` without such noise and for large fits.
///
/// The estimate errs by (JᵀJ)⁻¹ Jᵀ r, with sensitivities J less what the loads of the ends explain, and the weighted
/// response r to each sample of a pulse in turn.
///
/// # Source
/// White (1980), Econometrica 48, 817–838, for the covariance of a weighted fit whose errors have another one.
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
    let mut sensitivity = Whitened::of(&closed, unknowns, &values, covariance)?.sensitivity;
    // Weighted responses to a force on each degree of freedom, 1 N on every line.
    let of_force: Vec<DVector<f64>> = (0..n)
        .map(|dof| {
            Some(
                Whitened::residual_of(&data.of_force(dof), unknowns, &values, covariance)?.residual,
            )
        })
        .collect::<Option<_>>()?;
    let turned = |rows: &Range<usize>, dof: usize, amplitude: &dyn Fn(usize) -> Complex<f64>| {
        let mut turned = DVector::zeros(2 * n * rows.len());
        for row in rows.clone() {
            let factor = amplitude(row);
            for channel in 0..n {
                let from = 2 * (n * row + channel);
                let response = Complex::new(of_force[dof][from], of_force[dof][from + 1]) * factor;
                let to = 2 * (n * (row - rows.start) + channel);
                (turned[to], turned[to + 1]) = (response.re, response.im);
            }
        }
        turned
    };
    for record in 0..data.transient().ncols() / 2 {
        let rows = data.open_record(record)?.rows;
        let loads: Vec<DVector<f64>> = (0..2 * 3 * n)
            .map(|load| {
                let (column, power, dof) = (2 * record + load / (3 * n), (load / n) % 3, load % n);
                turned(&rows, dof, &|row| {
                    data.transient()[(row, column)] * powers(data.omega()[row])[power]
                })
            })
            .collect();
        let scaled = loads.iter().map(|load| load / load.norm().max(f64::MIN_POSITIVE));
        let q = DMatrix::from_columns(&scaled.collect::<Vec<_>>()).qr().q();
        let mut part = sensitivity.rows_mut(2 * n * rows.start, 2 * n * rows.len());
        let explained = q.tr_mul(&part);
        part -= q * explained;
    }
    let lengths: Vec<f64> = sensitivity.column_iter().map(|column| column.norm()).collect();
    for (mut column, length) in sensitivity.column_iter_mut().zip(&lengths) {
        if *length > 0.0 {
            column.unscale_mut(*length);
        }
    }
    let (q, r) = sensitivity.qr().unpack();
    let mut root = DMatrix::identity(count, count);
    r.solve_upper_triangular_mut(&mut root).then_some(())?;
    root.row_iter_mut().zip(&lengths).for_each(|(mut row, length)| row.unscale_mut(*length));
    let mut excess = DMatrix::<f64>::zeros(count, count);
    for pulse in data.pulses() {
        let part = q.rows(2 * n * pulse.rows.start, 2 * n * pulse.rows.len());
        let power = pulse.deviation * pulse.deviation;
        for sample in pulse.samples.clone() {
            let impulse = |row: usize| pulse.impulse(sample, data.omega()[row]);
            let effect = part.tr_mul(&turned(&pulse.rows, pulse.channel, &impulse));
            excess.ger(power, &effect, &effect, 1.0);
        }
        for row in pulse.rows.clone() {
            let one = row..row + 1;
            let part = q.rows(2 * n * row, 2 * n);
            let variance = 0.5 * data.force_variance()[(row, pulse.channel)];
            for phase in [Complex::new(1.0, 0.0), Complex::new(0.0, 1.0)] {
                let effect = part.tr_mul(&turned(&one, pulse.channel, &|_| phase));
                excess.ger(-variance, &effect, &effect, 1.0);
            }
        }
    }
    Some(&root * excess * root.transpose())
}
