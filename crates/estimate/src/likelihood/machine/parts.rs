//! Comparison of the parameters of a machine from parts of its data, without a fit to each part.

use std::ops::Range;

use mechid_numerics::products::transposed_product;
use nalgebra::{DMatrix, DVector};

use super::MachineModel;
use crate::frequency_domain::{Level, Part, PartsComparison, Scores, equal_bands, orthonormal};
use crate::likelihood::fit::Fit;
use crate::likelihood::limits::{COMPARED_RECORDS, KNOWN_FREEDOM};
use crate::likelihood::search::Linearisation;
use crate::limits::{MAX_PARTS, PARTS};

/// A fit, linearised at its minimum.
struct Linearised<'a> {
    fit: &'a Fit<'a, MachineModel>,
    /// Residual of lines, amplitudes of pulses and priors.
    residual: &'a DVector<f64>,
    /// Columns X over the rows of all lines: the fit of the errors of pulses reduces the covariance
    /// of the residual by X Xᵀ.
    pulses: &'a DMatrix<f64>,
    /// Orthonormal basis Q of the sensitivities to the parameters that are not at a bound.
    basis: DMatrix<f64>,
    /// Change of each parameter that is not at a bound, per unit of each basis column.
    root: DMatrix<f64>,
    values: DVector<f64>,
    names: Vec<String>,
}

/// Compares bands of lines with equal information and, if there are several records, the records.
/// `names` are the names of the parameters. The list is empty for large fits, undetermined
/// parameters, and too few residuals.
///
/// The score of part p is Qᵀ D_p e, where e is the residual and D_p selects the rows of the part.
/// The covariance of the scores follows from the covariance of e, which is the identity without the
/// components that parameters, transients and errors of pulses explain.
///
/// # Source
/// As [`PartsOfFit::compare`](crate::frequency_domain::PartsOfFit::compare).
pub(super) fn compared_parts(
    fit: &Fit<'_, MachineModel>,
    linearised: &Linearisation,
    pulses: &DMatrix<f64>,
    names: &[String],
) -> Vec<PartsComparison> {
    let free = &fit.information.free;
    let Linearisation { residual, jacobian } = linearised;
    if fit.information.rank < free.len() || residual.len() * free.len() * PARTS > MAX_PARTS {
        return Vec::new();
    }
    let Some((basis, root)) = orthonormal(-jacobian.select_columns(free)) else {
        return Vec::new();
    };
    let values = free.iter().map(|at| fit.minimum.parameters[*at]);
    let linearised = Linearised {
        fit,
        residual,
        pulses,
        basis,
        root,
        values: DVector::from_iterator(free.len(), values),
        names: free.iter().map(|at| names[*at].clone()).collect(),
    };
    let width = 2 * fit.data.outputs().ncols();
    let leverage = |row: usize| linearised.basis.rows(width * row, width).norm_squared();
    let of_row = |row: usize| row..row + 1;
    let bands = equal_bands(fit.data.omega(), leverage).into_iter();
    let bands = bands.map(|(part, rows)| (part, rows.into_iter().map(of_row).collect()));
    let records = fit.data.records().iter().enumerate();
    let records = records.map(|(index, (rows, _))| (Part::Rows { index }, vec![rows.clone()]));
    let splits: [Vec<(Part, Vec<Range<usize>>)>; 2] = [bands.collect(), records.collect()];
    let several = splits.iter().filter(|parts| (2..=COMPARED_RECORDS).contains(&parts.len()));
    several.filter_map(|parts| linearised.compared(parts)).collect()
}

impl Linearised<'_> {
    /// Compares the scores of the parts of the data; each part has its ranges of lines.
    fn compared(&self, parts: &[(Part, Vec<Range<usize>>)]) -> Option<PartsComparison> {
        let (count, rows) = (self.basis.ncols(), self.basis.nrows());
        let width = 2 * self.fit.data.outputs().ncols();
        let mut selected = DMatrix::zeros(rows, count * parts.len());
        for (at, (_, lines)) in parts.iter().enumerate() {
            for lines in lines {
                let (first, len) = (width * lines.start, width * lines.len());
                let from = self.basis.rows(first, len);
                selected.view_mut((first, at * count), (len, count)).copy_from(&from);
            }
        }
        let explained = transposed_product(self.basis.as_view(), selected.as_view());
        let of_pulses = self.pulses.tr_mul(&selected.rows(0, self.pulses.nrows()));
        let mut unexplained = selected;
        unexplained.gemm(-1.0, &self.basis, &explained, 1.0);
        let parameters = &self.fit.minimum.parameters;
        self.fit.residual().for_each_record(parameters, |record| {
            record.remove_transient(&mut unexplained);
            Some(())
        })?;
        let covariance = transposed_product(unexplained.as_view(), unexplained.as_view())
            - of_pulses.tr_mul(&of_pulses);
        let effect = |at: usize| explained.columns(at * count, count).into_owned();
        let scores = Scores {
            root: &self.root,
            values: &self.values,
            effects: (0..parts.len()).map(effect).collect(),
            scores: unexplained.tr_mul(self.residual),
            covariance,
        };
        let named: Vec<Part> = parts.iter().map(|(part, _)| *part).collect();
        scores.compare(&self.level(), &named, &self.names)
    }

    /// Returns the source of the variance of the residual: the stated noise or the residual.
    fn level(&self) -> Level {
        let inflation = self.fit.information.inflation;
        if self.fit.misfit_ratio.is_some() {
            let degrees_of_freedom = self.fit.degrees_of_freedom.min(KNOWN_FREEDOM);
            return Level::Known { inflation, degrees_of_freedom };
        }
        let unknowns = self.basis.ncols() + self.fit.residual().transient_unknowns();
        let free = self.residual.len() as f64 - unknowns as f64;
        Level::Residual { inflation, cost: self.residual.norm_squared(), free }
    }
}
