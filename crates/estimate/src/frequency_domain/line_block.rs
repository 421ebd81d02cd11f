//! Blocks of lines with the columns that act on them, for an orthogonal decomposition of many
//! columns that are zero on most lines.

use std::ops::Range;

use mechid_numerics::triangular::TriangularFactor;
use nalgebra::DMatrix;

use crate::limits::GRAM_LINES;

/// Lines whose products are computed together, and the columns that are nonzero on at least one of
/// them. The transient of a record has nonzero columns on the lines of this record only.
pub(super) struct LineBlock {
    pub(super) lines: Range<usize>,
    /// Columns of the layout, in rising order.
    pub(super) columns: Vec<usize>,
}

impl LineBlock {
    /// Returns all blocks of regressors, columns of the layout × 2 lines.
    pub(super) fn all(regressors: &DMatrix<f64>) -> Vec<Self> {
        let lines = regressors.ncols() / 2;
        let block = |start: usize| {
            let range = start..lines.min(start + GRAM_LINES);
            let both = [range.start, lines + range.start];
            let parts = both.map(|first| regressors.columns(first, range.len()));
            let is_used = |column: &usize| {
                parts.iter().any(|part| part.row(*column).iter().any(|value| *value != 0.0))
            };
            Self { columns: (0..regressors.nrows()).filter(is_used).collect(), lines: range }
        };
        (0..lines).step_by(GRAM_LINES).map(block).collect()
    }

    /// Adds the columns that the triangular factor `r` couples to the columns of the block, so that
    /// new rows of the block change no other columns.
    pub(super) fn close(&mut self, r: &DMatrix<f64>) {
        let mut used = vec![false; r.ncols()];
        self.columns.iter().for_each(|column| used[*column] = true);
        for row in 0..r.nrows() {
            if used[row] {
                let coupled = (row + 1..r.ncols()).filter(|column| r[(row, *column)] != 0.0);
                coupled.for_each(|column| used[column] = true);
            }
        }
        self.columns = (0..r.ncols()).filter(|column| used[*column]).collect();
    }

    /// Returns the part of a triangular factor that belongs to the columns of the block.
    pub(super) fn triangle(&self, r: &DMatrix<f64>) -> DMatrix<f64> {
        r.select_rows(&self.columns).select_columns(&self.columns)
    }

    /// Rotates rows with the columns of the block into a triangular factor; `None` if a value is
    /// not finite.
    pub(super) fn push(&self, r: &mut DMatrix<f64>, rows: &DMatrix<f64>) -> Option<()> {
        let mut factor = TriangularFactor::new(self.columns.len());
        let finite = factor.push(&[self.triangle(r).as_view()]) && factor.push(&[rows.as_view()]);
        finite.then_some(())?;
        for (part, &column) in factor.r().column_iter().zip(&self.columns) {
            for (value, &row) in part.iter().zip(&self.columns) {
                r[(row, column)] = *value;
            }
        }
        Some(())
    }
}
