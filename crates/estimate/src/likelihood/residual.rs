//! Residual of line data for a model, in units of the noise, and its Jacobian.

use std::f64::consts::SQRT_2;
use std::ops::Range;

use mechid_numerics::time_limit;
use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::limits::KEPT_RESPONSES;
use super::response_model::{LineResponse, ResponseModel};
use super::search::{LeastSquaresProblem, Linearisation};
use super::transient::{self, LineColumns, RecordUnknowns, TransientBasis};
use super::weights::{WeightedLine, Weights};
use crate::limits::{LINES_AT_ONCE, PASS_OPERATIONS};
use crate::pulse_covariance::PulseCovariance;

/// Normal prior of a parameter, as one row of the residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PriorRow {
    pub(super) parameter: usize,
    pub(super) mean: f64,
    pub(super) deviation: f64,
}

/// Weighted errors e = y − G u − G_own − A τ of every line, with the inputs u and the outputs y.
/// G_own is the response to loads of the model, and A τ is the transient. The real and imaginary
/// parts of √2·L⁻¹e with L Lᴴ = E[e eᴴ] have unit variance and no correlation.
///
/// With noisy inputs the covariance S_yy − S_yu Gᴴ − G S_uy + G S_uu Gᴴ depends on the parameters;
/// the sum of squares is the likelihood after the true inputs and outputs of each line have been
/// eliminated. The derivative is taken at the most likely input û. Because û minimises the sum of
/// squares, Jᵀr is half the gradient of this sum, and JᵀJ is the Fisher information. The transient
/// τ of each open record is eliminated, too: residual and derivative are projected onto the
/// orthogonal complement of the columns A. Errors of pulses are common to all lines of a record:
/// their amplitudes are unknowns of unit variance, and each amplitude has one row.
///
/// Row 2(p·line + output) is a real part, the next row the imaginary part. These rows are followed
/// by the amplitudes of the errors of pulses, and these by the priors.
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

/// Errors of the outputs at every line.
pub(super) struct LineErrors {
    /// Errors y − G u − G_own − A τ, lines × p, without the effects of the errors of pulses.
    pub(super) errors: DMatrix<Complex<f64>>,
    /// Receptance G of each line.
    pub(super) receptances: Vec<DMatrix<Complex<f64>>>,
    /// Number of amplitudes of pulses that the lines determine. Each amplitude counts as the
    /// fraction of its information that comes from the lines.
    pub(super) determined_amplitudes: f64,
}

/// Lines that are computed together: a block of rows of the residual of one record. The last block
/// of a record with pulses has no lines; it has the rows of the amplitudes of the pulses.
pub(super) struct Block<L> {
    /// Index of the first row of this block in the residual.
    pub(super) first_row: usize,
    /// Index, in the data, of the first line of this block.
    pub(super) first: usize,
    /// Responses of the lines with their weights.
    pub(super) lines: Vec<(L, WeightedLine)>,
    /// Rows of the residual that belong to this block, as one column.
    residual: DMatrix<f64>,
    /// Weighted columns of the transient; empty after the basis of the transient has been computed.
    columns: DMatrix<f64>,
    /// Weighted effects of the amplitudes of pulses; empty after the covariance of the pulse errors
    /// has been computed.
    effects: DMatrix<f64>,
}

/// Residual of the lines of one record.
pub(super) struct RecordResidual<'a, L> {
    pub(super) blocks: Vec<Block<L>>,
    /// Weighted columns of the transient of an open record, and its unknowns.
    pub(super) transient: Option<(TransientBasis, DVector<f64>)>,
    /// Covariance of the errors of pulses.
    pub(super) pulses: Option<PulseCovariance>,
    unknowns: RecordUnknowns<'a>,
}

/// Values of the linear unknowns of a record.
struct Fitted<'a> {
    unknowns: &'a RecordUnknowns<'a>,
    /// Unknowns of the transient.
    transient: Option<&'a DVector<f64>>,
    /// Amplitudes of the errors of pulses, one column.
    amplitudes: Option<&'a DMatrix<f64>>,
}

/// Residual at one set of parameters, and the data for its derivative.
pub(super) struct Evaluation<'a, L> {
    /// Responses of the lines; `None` if there are too many to store. In this case they are
    /// computed again for the derivative.
    pub(super) records: Option<Vec<RecordResidual<'a, L>>>,
    /// Residual of all records, then of the amplitudes of pulses and of the priors.
    pub(super) residual: DVector<f64>,
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

    /// Number of amplitudes of the errors of all pulses.
    pub(super) fn amplitudes(&self) -> usize {
        self.data.pulse_errors().iter().map(PulseErrors::count).sum()
    }

    /// Index of the first row of the amplitudes of the record that begins at line `first`.
    fn amplitude_rows(&self, first: usize) -> usize {
        let before = self.data.pulse_errors().iter().filter(|pulse| pulse.rows().start < first);
        self.len() + before.map(PulseErrors::count).sum::<usize>()
    }

    /// Returns the residual of a record at `parameters`, without the priors.
    fn record(
        &self,
        parameters: &[f64],
        rows: &Range<usize>,
        kind: Transient,
    ) -> Option<RecordResidual<'a, M::Line<'a>>> {
        let transient = transient::len(kind, self.outputs(), self.model.dimensions().states);
        let unknowns = RecordUnknowns::new(self.data, rows, transient);
        let firsts: Vec<usize> = rows.clone().step_by(LINES_AT_ONCE).collect();
        let block = |first: usize| {
            let lines = first..rows.end.min(first + LINES_AT_ONCE);
            self.block(parameters, lines, &unknowns)
        };
        let blocks: Option<Vec<_>> = firsts.into_par_iter().map(block).collect();
        let mut blocks = blocks?;
        let mut pulses = None;
        if unknowns.amplitudes > 0 && !blocks.is_empty() {
            let effects = blocks.iter_mut().map(|block| std::mem::take(&mut block.effects));
            let covariance = PulseCovariance::new(effects.collect())?;
            let residuals = blocks.iter_mut().map(|block| &mut block.residual);
            let residual = covariance.whiten(&mut residuals.collect::<Vec<_>>());
            let columns = blocks.iter_mut().map(|block| &mut block.columns);
            let columns = covariance.whiten(&mut columns.collect::<Vec<_>>());
            let (first_row, first) = (self.amplitude_rows(rows.start), rows.end);
            let (lines, effects) = (Vec::new(), DMatrix::zeros(0, 0));
            blocks.push(Block { first_row, first, lines, residual, columns, effects });
            pulses = Some(covariance);
        }
        let mut transient = None;
        if unknowns.transient > 0 && !blocks.is_empty() {
            let columns: Vec<_> =
                blocks.iter_mut().map(|block| std::mem::take(&mut block.columns)).collect();
            columns.iter().flatten().all(|value| value.is_finite()).then_some(())?;
            let factors = columns.into_par_iter().map(DMatrix::qr).collect();
            let basis = TransientBasis::new(factors)?;
            let residuals = blocks.iter_mut().map(|block| &mut block.residual);
            let components = basis.remove_from(&mut residuals.collect::<Vec<_>>());
            let fitted = basis.unknowns(&components)?;
            transient = Some((basis, fitted));
        }
        let finite = |block: &Block<_>| block.residual.iter().all(|value| value.is_finite());
        let record = RecordResidual { blocks, transient, pulses, unknowns };
        record.blocks.iter().all(finite).then_some(record)
    }

    /// Returns the residual of some lines of a record; it still contains the effects of the linear
    /// unknowns of the record.
    fn block(
        &self,
        parameters: &[f64],
        rows: Range<usize>,
        unknowns: &RecordUnknowns<'_>,
    ) -> Option<Block<M::Line<'a>>> {
        let (p, first) = (self.outputs(), rows.start);
        let mut residual = DMatrix::zeros(2 * p * rows.len(), 1);
        let mut columns = DMatrix::zeros(residual.len(), unknowns.transient);
        let mut effects = DMatrix::zeros(residual.len(), unknowns.amplitudes);
        let mut lines = Vec::with_capacity(rows.len());
        for row in rows.clone() {
            let (line, weighted, white) = self.whitened(parameters, row)?;
            let part = 2 * p * (row - first)..2 * p * (row - first + 1);
            write_real(white.iter().copied(), &mut residual.as_mut_slice()[part.clone()]);
            if unknowns.transient + unknowns.amplitudes > 0 {
                let of_line = weighted_columns(&line, &weighted.lower, unknowns)?;
                let omega = self.data.omega()[row];
                if unknowns.transient > 0 {
                    of_line.for_each_of_transient(omega, unknowns, |at, column| {
                        let mut to = columns.column_mut(at);
                        write_real(column, &mut to.as_mut_slice()[part.clone()]);
                    });
                }
                of_line.for_each_of_pulses(omega, unknowns, |at, effect| {
                    let mut to = effects.column_mut(at);
                    write_real(effect, &mut to.as_mut_slice()[part.clone()]);
                });
            }
            lines.push((line, weighted));
        }
        Some(Block { first_row: 2 * p * first, first, lines, residual, columns, effects })
    }

    /// Returns the response at a line, the weights of the line, and L⁻¹e before the transient is
    /// subtracted from e.
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
        let of_model = self.model.covariance(row, &line, &input);
        let weighted = self.weights.line(row, line.receptance(), of_model)?;
        let exists = weighted.lower.solve_lower_triangular_mut(&mut white);
        exists.then_some((line, weighted, white))
    }

    /// Returns the Jacobian of the residual of one record, as blocks of rows with the index of
    /// their first row.
    fn derivative(
        &self,
        parameters: &[f64],
        record: RecordResidual<'a, M::Line<'a>>,
    ) -> Option<Vec<(usize, DMatrix<f64>)>> {
        let RecordResidual { mut blocks, transient, pulses, unknowns } = record;
        let amplitudes = pulses.as_ref().and_then(|_| blocks.pop());
        let mut firsts: Vec<usize> = blocks.iter().map(|block| block.first_row).collect();
        let fitted = Fitted {
            unknowns: &unknowns,
            transient: transient.as_ref().map(|(_, values)| values),
            amplitudes: amplitudes.as_ref().map(|block| &block.residual),
        };
        let derivative = |block| self.block_derivative(parameters, block, &fitted);
        let jacobian: Option<Vec<_>> = blocks.into_par_iter().map(derivative).collect();
        let mut jacobian = jacobian?;
        if let Some((pulses, block)) = pulses.as_ref().zip(amplitudes.as_ref()) {
            let of_amplitudes = pulses.whiten(&mut jacobian.iter_mut().collect::<Vec<_>>());
            jacobian.push(of_amplitudes);
            firsts.push(block.first_row);
        }
        if let Some((basis, _)) = &transient {
            basis.remove_from(&mut jacobian.iter_mut().collect::<Vec<_>>());
        }
        let finite = |block: &DMatrix<f64>| block.iter().all(|value| value.is_finite());
        jacobian.iter().all(finite).then(|| firsts.into_iter().zip(jacobian).collect())
    }

    /// Returns the Jacobian of some lines, given the values of the linear unknowns.
    fn block_derivative(
        &self,
        parameters: &[f64],
        block: Block<M::Line<'a>>,
        fitted: &Fitted<'_>,
    ) -> Option<DMatrix<f64>> {
        let (p, dimensions) = (self.outputs(), self.model.dimensions());
        let mut jacobian = DMatrix::zeros(block.residual.len(), dimensions.parameters);
        let mut sensitivity = DMatrix::zeros(p, dimensions.parameters);
        for (at, (line, weighted)) in block.lines.iter().enumerate() {
            let (row, omega) = (block.first + at, self.data.omega()[block.first + at]);
            let part = 2 * p * at..2 * p * (at + 1);
            let input = self.data.inputs().row(row).transpose();
            let mut likely = weighted.likely_input(input, &block.white(at, p));
            if let Some(amplitudes) = fitted.amplitudes {
                fitted.unknowns.correct(omega, amplitudes, &mut likely);
            }
            let loads = fitted.transient.map_or_else(
                || DVector::zeros(0),
                |values| fitted.unknowns.state_loads(omega, dimensions.states, values),
            );
            line.sensitivity(parameters, &likely, &loads, &mut sensitivity);
            weighted.lower.solve_lower_triangular_mut(&mut sensitivity).then_some(())?;
            for (column, mut to) in sensitivity.column_iter().zip(jacobian.column_iter_mut()) {
                write_real(column.iter().copied(), &mut to.as_mut_slice()[part.clone()]);
            }
        }
        jacobian.neg_mut();
        Some(jacobian)
    }

    /// Calls `visit` with the residual of each record. This residual contains the responses of the
    /// lines, the factors L of the covariance of each line, and the linear unknowns of the record.
    /// `None` if a response does not exist or a visit fails.
    pub(super) fn for_each_record(
        &self,
        parameters: &[f64],
        mut visit: impl FnMut(&RecordResidual<'a, M::Line<'a>>) -> Option<()>,
    ) -> Option<()> {
        for (rows, kind) in self.data.records() {
            visit(&self.record(parameters, rows, *kind)?)?;
        }
        Some(())
    }

    /// Returns the columns X, over all rows of the lines, that describe the effect of the errors of
    /// pulses: the covariance of the residual is the identity minus X Xᵀ. `None` if the response
    /// does not exist.
    pub(super) fn explained_by_pulses(&self, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(self.len(), self.amplitudes());
        let mut first = 0;
        self.for_each_record(parameters, |record| {
            let Some(pulses) = &record.pulses else { return Some(()) };
            let count = record.unknowns.amplitudes;
            for (block, part) in record.blocks.iter().zip(pulses.explained_columns()?) {
                let at = (block.first_row, first);
                columns.view_mut(at, (part.nrows(), count)).copy_from(&part);
            }
            first += count;
            Some(())
        })?;
        Some(columns)
    }

    /// Returns the residual of each prior.
    fn prior_rows(&self, parameters: &[f64]) -> Vec<f64> {
        let row = |prior: &PriorRow| (parameters[prior.parameter] - prior.mean) / prior.deviation;
        self.priors.iter().map(row).collect()
    }

    /// Returns residual and Jacobian at `parameters`; `None` if the response does not exist.
    pub(super) fn linearise(&self, parameters: &[f64]) -> Option<Linearisation> {
        self.linearised(parameters, self.evaluate(parameters)?)
    }

    /// Returns errors and receptances of every line at `parameters`; `None` if the response does
    /// not exist.
    pub(super) fn errors(&self, parameters: &[f64]) -> Option<LineErrors> {
        let p = self.outputs();
        let mut errors = DMatrix::zeros(self.data.len(), p);
        let mut receptances = Vec::with_capacity(self.data.len());
        let mut determined_amplitudes = 0.0;
        self.for_each_record(parameters, |record| {
            determined_amplitudes +=
                record.pulses.as_ref().map_or(0.0, PulseCovariance::determined);
            for block in &record.blocks {
                for (at, (line, weighted)) in block.lines.iter().enumerate() {
                    let error = &weighted.lower * block.white(at, p);
                    errors.row_mut(block.first + at).copy_from(&error.transpose());
                    receptances.push(line.receptance().clone());
                }
            }
            Some(())
        })?;
        Some(LineErrors { errors, receptances, determined_amplitudes })
    }
}

impl<L> RecordResidual<'_, L> {
    /// Removes the component that the transient of this record explains from columns over all rows
    /// of the residual.
    pub(super) fn remove_transient(&self, columns: &mut DMatrix<f64>) {
        let Some((basis, _)) = &self.transient else { return };
        let rows = |block: &Block<L>| columns.rows(block.first_row, block.residual.len()).into();
        let mut parts: Vec<DMatrix<f64>> = self.blocks.iter().map(rows).collect();
        basis.remove_from(&mut parts.iter_mut().collect::<Vec<_>>());
        for (block, part) in self.blocks.iter().zip(&parts) {
            columns.rows_mut(block.first_row, part.nrows()).copy_from(part);
        }
    }
}

impl<L> Block<L> {
    /// Returns L⁻¹e of a line of the block, with p entries.
    pub(super) fn white(&self, at: usize, p: usize) -> DVector<Complex<f64>> {
        let pairs = self.residual.as_slice()[2 * p * at..2 * p * (at + 1)].chunks_exact(2);
        let white = pairs.map(|pair| Complex::new(pair[0], pair[1]) / SQRT_2);
        DVector::from_iterator(p, white)
    }
}

impl<M: ResponseModel> Residual<'_, M> {
    /// Counts the operations of one pass over all rows, with this number of products of states and
    /// outputs for each row.
    fn spend(&self, products: usize) {
        let size = self.model.dimensions();
        let of_states = (size.states * (size.states + size.outputs)) as f64;
        let of_row = PASS_OPERATIONS + 10.0 * of_states * (size.states + products) as f64;
        time_limit::spend(self.data.len() as f64 * of_row);
    }
}

impl<'a, M: ResponseModel> LeastSquaresProblem for Residual<'a, M> {
    type Evaluation = Evaluation<'a, M::Line<'a>>;

    fn evaluate(&self, parameters: &[f64]) -> Option<Self::Evaluation> {
        self.spend(1);
        let first_prior = self.len() + self.amplitudes();
        let mut residual = DVector::zeros(first_prior + self.priors.len());
        let size = self.model.dimensions();
        let responses = self.data.len() * size.states * (size.outputs + size.parameters);
        let mut records = (responses <= KEPT_RESPONSES).then(Vec::new);
        for (rows, kind) in self.data.records() {
            let record = self.record(parameters, rows, *kind)?;
            for block in &record.blocks {
                let rows = block.residual.len();
                residual.rows_mut(block.first_row, rows).copy_from(&block.residual);
            }
            if let Some(records) = &mut records {
                records.push(record);
            }
        }
        let priors = DVector::from_vec(self.prior_rows(parameters));
        residual.rows_mut(first_prior, priors.len()).copy_from(&priors);
        Some(Evaluation { records, residual })
    }

    fn residual<'e>(&self, evaluation: &'e Self::Evaluation) -> &'e DVector<f64> {
        &evaluation.residual
    }

    fn linearised(
        &self,
        parameters: &[f64],
        evaluation: Self::Evaluation,
    ) -> Option<Linearisation> {
        self.spend(parameters.len());
        let Evaluation { records, residual } = evaluation;
        let mut jacobian = DMatrix::zeros(residual.len(), parameters.len());
        let mut records = records.map(Vec::into_iter);
        for (rows, kind) in self.data.records() {
            let record = match &mut records {
                Some(records) => records.next(),
                None => self.record(parameters, rows, *kind),
            }?;
            for (first, block) in self.derivative(parameters, record)? {
                jacobian.rows_mut(first, block.nrows()).copy_from(&block);
            }
        }
        for (at, prior) in self.priors.iter().enumerate() {
            let row = self.len() + self.amplitudes() + at;
            jacobian[(row, prior.parameter)] = prior.deviation.recip();
        }
        Some(Linearisation { residual, jacobian })
    }
}

/// Returns the responses of a line to the linear unknowns of its record, weighted by L⁻¹.
fn weighted_columns(
    line: &impl LineResponse,
    lower: &DMatrix<Complex<f64>>,
    unknowns: &RecordUnknowns<'_>,
) -> Option<LineColumns> {
    let mut states = line.state_response().filter(|_| unknowns.transient > 0).cloned();
    if let Some(states) = &mut states {
        lower.solve_lower_triangular_mut(states).then_some(())?;
    }
    let mut outputs = DMatrix::identity(lower.nrows(), lower.nrows());
    lower.solve_lower_triangular_mut(&mut outputs).then_some(())?;
    let inputs = (unknowns.amplitudes > 0).then(|| &outputs * line.receptance());
    Some(LineColumns { states, outputs, inputs })
}

/// Returns √2 times the real and imaginary parts of complex rows, each pair of rows together.
pub(super) fn real_rows(white: &DMatrix<Complex<f64>>) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(2 * white.nrows(), white.ncols());
    for (column, mut to) in white.column_iter().zip(rows.column_iter_mut()) {
        write_real(column.iter().copied(), to.as_mut_slice());
    }
    rows
}

fn write_real(white: impl Iterator<Item = Complex<f64>>, part: &mut [f64]) {
    for (z, pair) in white.zip(part.chunks_exact_mut(2)) {
        pair[0] = SQRT_2 * z.re;
        pair[1] = SQRT_2 * z.im;
    }
}
