//! Residual of line data for a model, in units of the noise, and its Jacobian.

use std::f64::consts::SQRT_2;
use std::ops::Range;

use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::response_model::{LineResponse, ResponseModel};
use super::search::LeastSquaresProblem;
use super::transient::{self, Eliminated};
use super::weights::{WeightedLine, Weights};
use crate::limits::LINES_AT_ONCE;

/// Normal prior of a parameter, as one row of the residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PriorRow {
    pub(super) parameter: usize,
    pub(super) mean: f64,
    pub(super) deviation: f64,
}

/// Weighted errors e = y − G u − G_own − A τ of every line, with the inputs u and the outputs y;
/// G_own is the response to loads of the model, and A τ is the transient: the real and imaginary
/// parts of √2·L⁻¹e with L Lᴴ = E[e eᴴ] have unit variance and no correlation.
///
/// With noisy inputs the covariance S_yy − S_yu Gᴴ − G S_uy + G S_uu Gᴴ depends on the parameters;
/// the sum of squares is the likelihood after the true inputs and outputs of each line have been
/// eliminated. The derivative is taken at the most likely input û. Because û is a minimum, Jᵀr is
/// half the gradient of the sum of squares, and JᵀJ is the Fisher information. The transient τ of
/// each open record is eliminated, too: residual and derivative are projected onto the orthogonal
/// complement of its columns A.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapter 9 (errors in variables) and section 6.3 (transients); Kaufman (1975), BIT 15, 49–57
/// (derivative of a projected residual).
pub(super) struct Residual<'a, M> {
    pub(super) model: &'a M,
    pub(super) data: &'a LineData,
    pub(super) weights: &'a Weights,
    pub(super) priors: &'a [PriorRow],
}

/// Residual and Jacobian at one set of parameters.
pub(super) struct Linearisation {
    /// Residual √2·L⁻¹e: row 2(p·line + output) is a real part, the next row the imaginary part;
    /// then the priors.
    pub(super) residual: DVector<f64>,
    /// Derivative of the residual, one column per parameter.
    pub(super) jacobian: DMatrix<f64>,
}

/// Errors of the outputs at every line.
pub(super) struct LineErrors {
    /// Errors y − G u − G_own − A τ, lines × p.
    pub(super) errors: DMatrix<Complex<f64>>,
    /// Receptance G of each line.
    pub(super) receptances: Vec<DMatrix<Complex<f64>>>,
}

/// Responses and weights of the lines of one record.
pub(super) struct RecordLines<'r, L> {
    pub(super) lines: &'r [(L, WeightedLine)],
    /// Orthonormal basis of the weighted columns of the transient of an open record.
    pub(super) basis: Option<&'r DMatrix<f64>>,
}

/// Residual of the lines of one record.
struct RecordResidual<L> {
    lines: Vec<(L, WeightedLine)>,
    residual: DVector<f64>,
    eliminated: Option<Eliminated>,
    reference: f64,
}

impl<'a, M: ResponseModel> Residual<'a, M> {
    fn outputs(&self) -> usize {
        self.data.outputs().ncols()
    }

    /// Number of real and imaginary parts of all lines.
    pub(super) fn len(&self) -> usize {
        2 * self.outputs() * self.data.len()
    }

    /// Number of unknowns of all transients.
    pub(super) fn transient_unknowns(&self) -> usize {
        let states = self.model.dimensions().states;
        let records = self.data.records().iter();
        records.map(|(_, kind)| transient::len(*kind, self.outputs(), states)).sum()
    }

    /// Returns the residual of a record at `parameters`, without the priors.
    fn record(
        &self,
        parameters: &[f64],
        rows: &Range<usize>,
        kind: Transient,
    ) -> Option<RecordResidual<M::Line<'a>>> {
        let (p, states) = (self.outputs(), self.model.dimensions().states);
        let unknowns = transient::len(kind, p, states);
        let reference = transient::reference(self.data, rows.clone());
        let mut residual = DVector::zeros(2 * p * rows.len());
        let mut columns = DMatrix::zeros(if unknowns > 0 { residual.len() } else { 0 }, unknowns);
        let of_rows = rows.clone().into_par_iter().with_min_len(LINES_AT_ONCE);
        let whitened: Option<Vec<_>> = of_rows.map(|row| self.whitened(parameters, row)).collect();
        let mut lines = Vec::with_capacity(rows.len());
        for (at, (line, weighted, white)) in whitened?.into_iter().enumerate() {
            let part = 2 * p * at..2 * p * (at + 1);
            write_real(white.iter(), &mut residual.as_mut_slice()[part.clone()]);
            if unknowns > 0 {
                let omega = self.data.omega()[rows.start + at];
                let mut of_line = transient::columns(omega, reference, p, line.state_response());
                weighted.lower.solve_lower_triangular_mut(&mut of_line).then_some(())?;
                for (column, mut to) in of_line.column_iter().zip(columns.column_iter_mut()) {
                    write_real(column.iter(), &mut to.as_mut_slice()[part.clone()]);
                }
            }
            lines.push((line, weighted));
        }
        let mut eliminated = None;
        if unknowns > 0 {
            let fitted = Eliminated::new(columns, &residual)?;
            residual -= &fitted.basis * fitted.basis.tr_mul(&residual);
            eliminated = Some(fitted);
        }
        residual.iter().all(|value| value.is_finite()).then_some(RecordResidual {
            lines,
            residual,
            eliminated,
            reference,
        })
    }

    /// Returns the response at a line, its weights, and L⁻¹e without a transient.
    fn whitened(
        &self,
        parameters: &[f64],
        row: usize,
    ) -> Option<(M::Line<'a>, WeightedLine, DVector<Complex<f64>>)> {
        let line = self.model.at(parameters, row)?;
        let input = self.data.inputs().row(row).transpose();
        let mut white = self.data.outputs().row(row).transpose() - line.receptance() * &input;
        if let Some(own) = line.own_response() {
            white -= own;
        }
        let weighted = self.weights.line(row, line.receptance(), |covariance| {
            self.model.add_covariance(row, &line, &input, covariance);
        })?;
        let exists = weighted.lower.solve_lower_triangular_mut(&mut white);
        exists.then_some((line, weighted, white))
    }

    /// Returns the Jacobian of the residual of one record.
    fn derivative(
        &self,
        parameters: &[f64],
        rows: &Range<usize>,
        record: &RecordResidual<M::Line<'a>>,
    ) -> Option<DMatrix<f64>> {
        let (p, dimensions) = (self.outputs(), self.model.dimensions());
        let mut jacobian = DMatrix::zeros(record.residual.len(), dimensions.parameters);
        let mut sensitivity = DMatrix::zeros(p, dimensions.parameters);
        for (at, (line, weighted)) in record.lines.iter().enumerate() {
            let row = rows.start + at;
            let part = 2 * p * at..2 * p * (at + 1);
            let pairs = record.residual.as_slice()[part.clone()].chunks_exact(2);
            let white = pairs.map(|pair| Complex::new(pair[0], pair[1]) / SQRT_2);
            let white = DVector::from_iterator(p, white);
            let input = self.data.inputs().row(row).transpose();
            let likely = weighted.likely_input(input, &white);
            let states = match &record.eliminated {
                Some(fitted) if dimensions.states > 0 => transient::state_loads(
                    self.data.omega()[row],
                    record.reference,
                    dimensions.states,
                    &fitted.unknowns,
                ),
                _ => DVector::zeros(0),
            };
            line.sensitivity(parameters, &likely, &states, &mut sensitivity);
            weighted.lower.solve_lower_triangular_mut(&mut sensitivity).then_some(())?;
            for (column, mut to) in sensitivity.column_iter().zip(jacobian.column_iter_mut()) {
                write_real(column.iter(), &mut to.as_mut_slice()[part.clone()]);
            }
        }
        jacobian.neg_mut();
        if let Some(fitted) = &record.eliminated {
            jacobian -= &fitted.basis * fitted.basis.tr_mul(&jacobian);
        }
        jacobian.iter().all(|value| value.is_finite()).then_some(jacobian)
    }

    /// Visits the lines of each record with their responses and the factors L of their covariance,
    /// and the basis of the transient of an open record; `None` if a response does not exist or a
    /// visit fails.
    pub(super) fn for_each_record(
        &self,
        parameters: &[f64],
        mut visit: impl FnMut(&Range<usize>, RecordLines<'_, M::Line<'a>>) -> Option<()>,
    ) -> Option<()> {
        for (rows, kind) in self.data.records() {
            let record = self.record(parameters, rows, *kind)?;
            let basis = record.eliminated.as_ref().map(|fitted| &fitted.basis);
            visit(rows, RecordLines { lines: &record.lines, basis })?;
        }
        Some(())
    }

    /// Rows of the priors.
    fn prior_rows(&self, parameters: &[f64]) -> Vec<f64> {
        let row = |prior: &PriorRow| (parameters[prior.parameter] - prior.mean) / prior.deviation;
        self.priors.iter().map(row).collect()
    }

    /// Returns residual and Jacobian at `parameters`; `None` if the response does not exist.
    pub(super) fn linearise(&self, parameters: &[f64]) -> Option<Linearisation> {
        let (size, count) = (self.len() + self.priors.len(), parameters.len());
        let mut residual = DVector::zeros(size);
        let mut jacobian = DMatrix::zeros(size, count);
        let p = self.outputs();
        for (rows, kind) in self.data.records() {
            let record = self.record(parameters, rows, *kind)?;
            let first = 2 * p * rows.start;
            residual.rows_mut(first, record.residual.len()).copy_from(&record.residual);
            let derivative = self.derivative(parameters, rows, &record)?;
            jacobian.rows_mut(first, derivative.nrows()).copy_from(&derivative);
        }
        for (at, value) in self.prior_rows(parameters).into_iter().enumerate() {
            residual[self.len() + at] = value;
            let prior = self.priors[at];
            jacobian[(self.len() + at, prior.parameter)] = prior.deviation.recip();
        }
        Some(Linearisation { residual, jacobian })
    }

    /// Returns errors and receptances of every line at `parameters`; `None` if the response does
    /// not exist.
    pub(super) fn errors(&self, parameters: &[f64]) -> Option<LineErrors> {
        let p = self.outputs();
        let mut errors = DMatrix::zeros(self.data.len(), p);
        let mut receptances = Vec::with_capacity(self.data.len());
        for (rows, kind) in self.data.records() {
            let record = self.record(parameters, rows, *kind)?;
            for (at, (line, weighted)) in record.lines.iter().enumerate() {
                let pairs =
                    record.residual.as_slice()[2 * p * at..2 * p * (at + 1)].chunks_exact(2);
                let white = pairs.map(|pair| Complex::new(pair[0], pair[1]) / SQRT_2);
                let error = &weighted.lower * DVector::from_iterator(p, white);
                errors.row_mut(rows.start + at).copy_from(&error.transpose());
                receptances.push(line.receptance().clone());
            }
        }
        Some(LineErrors { errors, receptances })
    }
}

impl<M: ResponseModel> LeastSquaresProblem for Residual<'_, M> {
    fn residual(&self, parameters: &[f64]) -> Option<DVector<f64>> {
        let mut residual = DVector::zeros(self.len() + self.priors.len());
        let p = self.outputs();
        for (rows, kind) in self.data.records() {
            let record = self.record(parameters, rows, *kind)?;
            let first = 2 * p * rows.start;
            residual.rows_mut(first, record.residual.len()).copy_from(&record.residual);
        }
        let priors = DVector::from_vec(self.prior_rows(parameters));
        residual.rows_mut(self.len(), priors.len()).copy_from(&priors);
        Some(residual)
    }

    fn linearise(&self, parameters: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let Linearisation { residual, jacobian } = Residual::linearise(self, parameters)?;
        Some((residual, jacobian))
    }
}

/// Returns √2 times the real and imaginary parts of complex rows, each pair of rows together.
pub(super) fn real_rows(white: &DMatrix<Complex<f64>>) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(2 * white.nrows(), white.ncols());
    for (column, mut to) in white.column_iter().zip(rows.column_iter_mut()) {
        write_real(column.iter(), to.as_mut_slice());
    }
    rows
}

fn write_real<'c>(white: impl Iterator<Item = &'c Complex<f64>>, part: &mut [f64]) {
    for (z, pair) in white.zip(part.chunks_exact_mut(2)) {
        pair[0] = SQRT_2 * z.re;
        pair[1] = SQRT_2 * z.im;
    }
}
