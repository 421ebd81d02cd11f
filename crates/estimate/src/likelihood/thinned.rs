//! Selection of one line out of every n lines of the data, for the first steps of a search.

use mechid_spectra::LineData;
use mechid_spectra::thinning::thinned_rows;
use nalgebra::{Complex, DMatrix, DVector};

use super::limits::SEARCH_NUMBERS;
use super::residual::Residual;
use super::response_model::{Dimensions, ResponseModel};
use super::transient;

/// A model on selected lines.
pub(super) struct Thinned<'a, M> {
    model: &'a M,
    pub(super) rows: Vec<usize>,
    omega: Vec<f64>,
}

impl<'a, M: ResponseModel> Thinned<'a, M> {
    /// Takes one of every n lines of each record, so that about [`SEARCH_NUMBERS`] real numbers per
    /// unknown remain. It takes all lines if the data have fewer numbers.
    pub(super) fn new(residual: &Residual<'a, M>) -> Self {
        let Residual { model, data, .. } = residual;
        let dimensions = model.dimensions();
        let unknowns = dimensions.parameters + residual.transient_unknowns();
        let every = residual.len() / (SEARCH_NUMBERS * unknowns.max(1));
        let mut rows = Vec::new();
        for (range, kind) in data.records() {
            // Each record keeps enough lines for its own transient.
            let of_transient = transient::len(*kind, dimensions.outputs, dimensions.states);
            let least = (SEARCH_NUMBERS * of_transient).div_ceil(2 * dimensions.outputs.max(1));
            let every = every.min(range.len() / least.max(1)).max(1);
            rows.extend(thinned_rows(range.len(), every).into_iter().map(|row| range.start + row));
        }
        let omega = rows.iter().map(|row| data.omega()[*row]).collect();
        Self { model, rows, omega }
    }

    /// Returns the data of the selected lines without the errors of pulses, because the first steps
    /// ignore these errors.
    pub(super) fn lines(&self, data: &LineData) -> Option<LineData> {
        data.rows(&self.rows).map(LineData::without_pulse_noise)
    }
}

impl<M: ResponseModel> ResponseModel for Thinned<'_, M> {
    type Line<'l>
        = M::Line<'l>
    where
        Self: 'l;

    fn dimensions(&self) -> Dimensions {
        self.model.dimensions()
    }

    fn omega(&self) -> &[f64] {
        &self.omega
    }

    fn at(&self, parameters: &[f64], row: usize) -> Option<Self::Line<'_>> {
        self.model.at(parameters, self.rows[row])
    }

    fn covariance<'l>(
        &'l self,
        row: usize,
        line: &Self::Line<'l>,
        input: &DVector<Complex<f64>>,
    ) -> Option<DMatrix<Complex<f64>>> {
        self.model.covariance(self.rows[row], line, input)
    }
}
