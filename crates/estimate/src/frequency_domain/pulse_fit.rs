//! Most likely errors of the pulses of the forces.

use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{DMatrix, DVector};

use super::force_responses::{
    ForceResponses, RecordColumns, pulse_covariances, remove, transient_bases,
};
use super::output_error_fit::{entries, parts};
use super::{Whitened, orthonormal};
use crate::Unknowns;
use crate::limits::MAX_PULSE_EFFECTS;
use crate::pulse_covariance::PulseCovariance;

/// Most likely errors of the pulses of the forces, which are common to all lines of a record.
pub(super) struct PulseFit {
    /// Amplitudes of the patterns of all pulse errors, in their order.
    pub(super) amplitudes: Vec<f64>,
    /// Inverse of the Fisher information about the independent unknowns of M, C and K, divided by
    /// the level of the noise.
    pub(super) covariance: DMatrix<f64>,
    /// Number of amplitudes that the lines determine. Each amplitude counts as the fraction of its
    /// information that comes from the lines.
    pub(super) determined: f64,
}

impl PulseFit {
    /// Returns whether the errors of pulses can be estimated together with the parameters: the data
    /// state such errors, no force has another kind of noise, and the fit is not too large.
    pub(super) fn is_possible(data: &FrequencyData, unknowns: &Unknowns) -> bool {
        let effects = |pulse: &PulseErrors| 2 * data.dof() * pulse.rows().len() * pulse.count();
        let total: usize = data.pulse_errors().iter().map(effects).sum();
        let sensitivities = 2 * data.dof() * data.len() * unknowns.independent();
        let is_noisy = |row: usize, force: usize| data.force_variance()[(row, force)] > 0.0;
        let has_pulse = |row: usize, force: usize| {
            let mut pulses = data.pulse_errors().iter();
            pulses.any(|pulse| pulse.input() == force && pulse.rows().contains(&row))
        };
        let mut noisy = (0..data.len())
            .flat_map(|row| (0..data.dof()).map(move |force| (row, force)))
            .filter(|(row, force)| is_noisy(*row, *force))
            .peekable();
        let is_any = noisy.peek().is_some();
        is_any
            && total > 0
            && total.max(sensitivities) <= MAX_PULSE_EFFECTS
            && noisy.all(|(row, force)| has_pulse(row, force))
    }

    /// Estimates the amplitudes together with a step of the parameters from `theta`; the noise of
    /// the responses is `noise` times the common factor `level`. The model is linearised at the
    /// amplitudes `before`. `None` if a response does not exist or the sensitivities are linearly
    /// dependent.
    ///
    /// The residual is r + P b − J Δθ: P are the effects of the amplitudes b, which have unit
    /// variance, and J are the sensitivities. The components that the transients explain are
    /// removed from r, P and J.
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), sections 2.1.4 (Woodbury) and 5.3
    /// (least squares by QR).
    pub(super) fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        theta: &DVector<f64>,
        (noise, level): (&NoiseSpectrum, f64),
        before: &[f64],
    ) -> Option<Self> {
        let corrected = data.without_pulse_errors(before).ok()?;
        let noise = noise.clone().with_force_variance(corrected.force_variance());
        let (independent, tau) = parts(data, theta);
        let values = entries(unknowns, independent);
        let covariance = |row: usize| noise.covariance(row).clone();
        let closed = corrected.without_transient(tau);
        let Whitened { residual, sensitivity } =
            Whitened::new(&closed, unknowns, &values, covariance)?;
        let count = sensitivity.ncols();
        let mut columns = sensitivity.insert_column(count, 0.0);
        columns.set_column(count, &residual);
        columns /= level.sqrt();
        let responses = ForceResponses::new(&corrected, unknowns, &values, &noise)?;
        let transients = transient_bases(data, &responses)?;
        remove(&transients, &mut columns);
        let pulses = pulse_covariances(data, &responses, &transients, level)?;
        let lines = columns.nrows();
        let extended = whitened(columns, &pulses, before);
        let residual = extended.column(count).into_owned();
        let sensitivity = extended.columns(0, count).into_owned();
        let of_amplitudes = sensitivity.rows(lines, before.len()).into_owned();
        let (basis, root) = orthonormal(sensitivity)?;
        let step = &root * basis.tr_mul(&residual);
        let amplitudes = of_amplitudes * step - residual.rows(lines, before.len());
        Some(Self {
            amplitudes: amplitudes.as_slice().to_vec(),
            covariance: &root * root.transpose() / level,
            determined: pulses.iter().map(|(_, pulses)| pulses.determined()).sum(),
        })
    }
}

/// Returns columns over all residuals, whitened by the covariance of the errors of pulses; the rows
/// of the amplitudes are below these columns. The last given column is a residual without the
/// effects of the amplitudes `before`; the returned residual contains these effects.
fn whitened(
    columns: DMatrix<f64>,
    pulses: &[RecordColumns<PulseCovariance>],
    before: &[f64],
) -> DMatrix<f64> {
    let (lines, residual) = (columns.nrows(), columns.ncols() - 1);
    let mut extended = columns.resize_vertically(lines + before.len(), 0.0);
    let mut first = 0;
    for (rows, pulses) in pulses {
        let effects = &pulses.effects[0];
        let next = first + effects.ncols();
        let subtracted = DVector::from_column_slice(&before[first..next]);
        let mut part = extended.rows(rows.start, rows.len()).into_owned();
        part.column_mut(residual).gemv(-1.0, effects, &subtracted, 1.0);
        let of_amplitudes = pulses.whiten(&mut [&mut part]);
        extended.rows_mut(rows.start, rows.len()).copy_from(&part);
        extended.rows_mut(lines + first, effects.ncols()).copy_from(&of_amplitudes);
        first = next;
    }
    extended
}
