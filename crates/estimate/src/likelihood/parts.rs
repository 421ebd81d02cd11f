//! Agreement of the parts of line data about the parameters of a fit.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::covariance::Information;
use super::limits::{MISFIT_SIGNIFICANCE, ROUNDING_RESIDUAL};
use super::residual::Residual;
use super::response_model::ResponseModel;
use super::search::Minimum;
use crate::frequency_domain::{Level, Part, PartDifference, ScoreComparison, Scores};
use crate::limits::{MAX_SENSITIVITIES, PARTS};

/// Comparison of the parts of the data: their largest difference, and their scatter.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedParts {
    /// Probability that noise alone makes the parts differ as much.
    pub p_value: f64,
    /// The part that differs most from the others: a record or a band of lines.
    pub part: Part,
    /// Index of the parameter in which it does.
    pub parameter: usize,
    /// Value by the part, in the unit of the parameter.
    pub by_part: f64,
    /// Value by the other parts, in the unit of the parameter.
    pub by_others: f64,
    /// Standard error of the difference by the noise alone, in the unit of the parameter.
    pub standard_error: f64,
    /// Ratio of standard errors from the scatter of the parts to those from the noise.
    pub scatter: f64,
    /// Number of independent differences behind that factor.
    pub degrees_of_freedom: usize,
}

impl ComparedParts {
    /// Returns whether the parts differ by more than their noise.
    pub(super) fn disagree(&self) -> bool {
        self.p_value < MISFIT_SIGNIFICANCE
    }
}

/// Fit at its minimum, linearised for the comparison of its parts.
struct Linear<'a> {
    residual: DVector<f64>,
    /// Orthonormal columns that the parameters explain.
    basis: DMatrix<f64>,
    root: DMatrix<f64>,
    values: DVector<f64>,
    /// Rows of each open record, and orthonormal columns that its transient explains of them.
    transients: Vec<(Range<usize>, DMatrix<f64>)>,
    /// Residuals of a line.
    of_line: usize,
    omega: &'a [f64],
}

/// Compares records and bands of lines, with one error rate for both; `None` for large fits, for
/// data without noise, and if no split is possible.
///
/// # Source
/// That of [`PartsOfFit::compare`](crate::frequency_domain::PartsOfFit::compare).
pub(super) fn compare<M: ResponseModel>(
    residual: &Residual<'_, M>,
    minimum: &Minimum,
    information: &Information,
    level: &Level,
) -> Option<ComparedParts> {
    let records: Vec<Range<usize>> = residual.data.records().iter().map(|r| r.0.clone()).collect();
    let size = residual.len() * information.rank * PARTS.max(records.len());
    if size > MAX_SENSITIVITIES || information.rank == 0 {
        return None;
    }
    let linear = Linear::new(residual, minimum, information)?;
    let named = |rows: Vec<Vec<usize>>| rows.into_iter().map(|rows| (linear.band(&rows), rows));
    let mut splits: Vec<Vec<(Part, Vec<usize>)>> = vec![named(linear.bands()).collect()];
    let of_record = |(index, rows): (usize, Range<usize>)| (Part::Rows { index }, rows.collect());
    splits.push(records.into_iter().enumerate().map(of_record).collect());
    splits.retain(|parts| parts.len() > 1);
    let count = splits.len() as f64;
    let mut worst: Option<(f64, Part, PartDifference, ScoreComparison)> = None;
    let mut scatter: Option<(f64, usize)> = None;
    for parts in splits {
        let Some(found) = linear.scores(&parts).compare(level) else { continue };
        let p_value = (count * found.p_value).min(1.0);
        let of_split = (found.error_scale, found.degrees_of_freedom);
        if p_value < MISFIT_SIGNIFICANCE && scatter.is_none_or(|(scale, _)| scale < of_split.0) {
            scatter = Some(of_split);
        }
        let Some(largest) = found.largest else { continue };
        if worst.as_ref().is_none_or(|(p, ..)| p_value < *p) {
            worst = Some((p_value, parts[largest.part].0, largest, found));
        }
    }
    let (p_value, part, largest, found) = worst?;
    let (scatter, degrees_of_freedom) =
        scatter.unwrap_or((found.error_scale, found.degrees_of_freedom));
    Some(ComparedParts {
        p_value,
        part,
        parameter: information.free[largest.parameter],
        by_part: largest.by_part,
        by_others: largest.by_others,
        standard_error: largest.standard_error,
        scatter,
        degrees_of_freedom,
    })
}

impl<'a> Linear<'a> {
    fn new<M: ResponseModel>(
        residual: &Residual<'a, M>,
        minimum: &Minimum,
        information: &Information,
    ) -> Option<Self> {
        let errors = residual.errors(&minimum.parameters)?.errors;
        let outputs = residual.data.outputs();
        let is_rounding =
            |at: usize| errors.column(at).norm() <= ROUNDING_RESIDUAL * outputs.column(at).norm();
        if (0..outputs.ncols()).any(is_rounding) {
            return None;
        }
        let linear = residual.linearise(&minimum.parameters)?;
        let mut root = information.directions.columns(0, information.rank).into_owned();
        for (mut column, value) in root.column_iter_mut().zip(information.singular_values.iter()) {
            column.unscale_mut(*value);
        }
        for (mut row, scale) in root.row_iter_mut().zip(information.scale.iter()) {
            row.unscale_mut(*scale);
        }
        let basis = linear.jacobian.select_columns(&information.free) * &root;
        let explained = basis.tr_mul(&linear.residual);
        let values = information.free.iter().map(|at| minimum.parameters[*at]);
        Some(Self {
            residual: linear.residual - &basis * explained,
            values: DVector::from_iterator(information.free.len(), values),
            basis,
            root,
            transients: residual.transient_bases(&minimum.parameters)?,
            of_line: 2 * outputs.ncols(),
            omega: residual.data.omega(),
        })
    }

    /// Rows of the data by rising frequency, in bands with as much information each.
    fn bands(&self) -> Vec<Vec<usize>> {
        let mut rows: Vec<usize> = (0..self.omega.len()).collect();
        rows.sort_by(|a, b| self.omega[*a].total_cmp(&self.omega[*b]));
        let leverage =
            |row: usize| self.basis.rows(self.of_line * row, self.of_line).norm_squared();
        let all: f64 = rows.iter().map(|row| leverage(*row)).sum();
        let mut bands: Vec<Vec<usize>> = vec![Vec::new()];
        let (mut sum, mut last) = (0.0, f64::NAN);
        for row in rows {
            // Rows of one frequency stay together.
            let is_next = sum >= all * bands.len() as f64 / PARTS as f64 && bands.len() < PARTS;
            if is_next && self.omega[row] > last {
                bands.push(Vec::new());
            }
            if let Some(band) = bands.last_mut() {
                band.push(row);
            }
            sum += leverage(row);
            last = self.omega[row];
        }
        bands
    }

    fn band(&self, rows: &[usize]) -> Part {
        let hz = |row: Option<&usize>| row.map_or(0.0, |row| self.omega[*row] / TAU);
        Part::Band { first_hz: hz(rows.first()), last_hz: hz(rows.last()) }
    }

    fn scores(&self, parts: &[(Part, Vec<usize>)]) -> Scores<'_> {
        let count = self.basis.ncols();
        let mut all = DMatrix::zeros(self.residual.len(), count * parts.len());
        let mut cuts = Vec::with_capacity(parts.len());
        for (at, (_, rows)) in parts.iter().enumerate() {
            let mut part = DMatrix::zeros(self.basis.nrows(), count);
            for row in rows {
                let from = self.basis.rows(self.of_line * row, self.of_line);
                part.rows_mut(self.of_line * row, self.of_line).copy_from(&from);
            }
            let explained = self.basis.tr_mul(&part);
            let mut unexplained = &part - &self.basis * explained;
            for (rows, transient) in &self.transients {
                let mut of_record = unexplained.rows_mut(rows.start, rows.len());
                let explained = transient.tr_mul(&of_record);
                of_record -= transient * explained;
            }
            all.columns_mut(at * count, count).copy_from(&unexplained);
            cuts.push(part);
        }
        Scores {
            basis: &self.basis,
            root: &self.root,
            values: &self.values,
            parts: cuts,
            scores: all.tr_mul(&self.residual),
            covariance: all.tr_mul(&all),
        }
    }
}
