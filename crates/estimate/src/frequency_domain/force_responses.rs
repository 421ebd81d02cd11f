//! Weighted responses to forces, to the loads of transients, and to the errors of pulses.

use std::ops::Range;

use mechid_numerics::products::transposed_product;
use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::transient::powers;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};

use super::whitened::WeightedLines;
use crate::Unknowns;
use crate::pulse_covariance::PulseCovariance;

/// For each degree of freedom, the weighted responses on all lines to a force of 1 N at this degree
/// of freedom.
pub(super) struct ForceResponses(Vec<DVector<f64>>);

impl ForceResponses {
    pub(super) fn new(
        data: &FrequencyData,
        unknowns: &Unknowns,
        values: &DVector<f64>,
        noise: &NoiseSpectrum,
    ) -> Option<Self> {
        let covariance = |row: usize| noise.covariance(row);
        let weighted = WeightedLines::new(data, unknowns, values, covariance)?;
        let to_force = |dof: usize| {
            let force = data.unit_force_data(dof);
            weighted.residual(force.force(), force.displacement())
        };
        (0..data.dof()).map(to_force).collect::<Option<_>>().map(Self)
    }

    /// Returns the weighted response on the lines `rows` to a force on degree of freedom `dof`;
    /// `amplitude` gives the amplitude of the force on each line.
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

/// Indices of the residuals of one record among all residuals, and data of this record, such as a
/// matrix with one row for each of these residuals.
pub(super) type RecordColumns<T> = (Range<usize>, T);

/// Returns orthonormal bases of the responses to the transient loads of every open record.
pub(super) fn transient_bases(
    data: &FrequencyData,
    responses: &ForceResponses,
) -> Option<Vec<RecordColumns<DMatrix<f64>>>> {
    let records = 0..data.transient().ncols() / 2;
    records.map(|record| transient_basis(data, record, responses)).collect()
}

fn transient_basis(
    data: &FrequencyData,
    record: usize,
    responses: &ForceResponses,
) -> Option<RecordColumns<DMatrix<f64>>> {
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

/// Subtracts from `columns` (one row per residual) the components that the transients explain.
pub(super) fn remove(transients: &[RecordColumns<DMatrix<f64>>], columns: &mut DMatrix<f64>) {
    for (rows, transient) in transients {
        let mut part = columns.rows_mut(rows.start, rows.len());
        let explained = transposed_product(transient.as_view(), part.as_view());
        part.gemm(-1.0, transient, &explained, 1.0);
    }
}

/// Returns, for every record with pulses, the covariance of the residuals divided by `level`. The
/// residuals have errors that are independent from line to line, with the power `level`, and the
/// effects of the pulse errors. The component that the transients explain is removed from these
/// effects. `None` if an effect is not finite.
pub(super) fn pulse_covariances(
    data: &FrequencyData,
    responses: &ForceResponses,
    transients: &[RecordColumns<DMatrix<f64>>],
    level: f64,
) -> Option<Vec<RecordColumns<PulseCovariance>>> {
    let n = data.dof();
    let of_record = |pulses: &[PulseErrors]| {
        let rows = pulses[0].rows();
        let count = pulses.iter().map(PulseErrors::count).sum();
        let mut effects = DMatrix::zeros(2 * n * rows.len(), count);
        let mut first = 0;
        for pulse in pulses {
            let patterns: Vec<_> = rows.clone().map(|row| pulse.at(data.omega()[row])).collect();
            let mut of_pulse = effects.columns_mut(first, pulse.count());
            for (pattern, mut effect) in of_pulse.column_iter_mut().enumerate() {
                let amplitude = |row: usize| patterns[row - rows.start][pattern];
                effect.copy_from(&responses.to(&rows, pulse.input(), &amplitude));
            }
            first += pulse.count();
        }
        // The measured force contains its error, so the residual contains the response to the error
        // with the opposite sign.
        effects /= -level.sqrt();
        let range = 2 * n * rows.start..2 * n * rows.end;
        let is_common = |rows: &Range<usize>| rows.start < range.end && range.start < rows.end;
        for (rows, transient) in transients.iter().filter(|(rows, _)| is_common(rows)) {
            (*rows == range).then_some(())?;
            let explained = transposed_product(transient.as_view(), effects.as_view());
            effects.gemm(-1.0, transient, &explained, 1.0);
        }
        Some((range, PulseCovariance::new(vec![effects])?))
    };
    data.pulse_errors().chunk_by(|one, next| one.rows() == next.rows()).map(of_record).collect()
}
