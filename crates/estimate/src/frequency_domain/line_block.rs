//! Blocks of lines for an orthogonal decomposition of many columns that are zero on most lines; a
//! block has only the columns that are nonzero on its lines.

use std::ops::Range;

use mechid_numerics::kronecker;
use mechid_numerics::triangular::TriangularFactor;
use nalgebra::{DMatrix, DVector};

use crate::limits::GRAM_LINES;

/// Lines whose products are computed together, and the columns that are nonzero on at least one of
/// these lines. The transient of a record has nonzero columns on the lines of this record only.
#[derive(Clone)]
pub(super) struct LineBlock {
    pub(super) lines: Range<usize>,
    /// Indices of the nonzero columns, in ascending order.
    pub(super) columns: Vec<usize>,
}

/// Factors of the rows √2 φ_l ⊗ W_l of a Jacobian, for the lines of a block.
pub(super) struct BlockFactors {
    pub(super) block: LineBlock,
    /// φ_l, 2·lines × columns of the block, real parts first.
    pub(super) regressors: DMatrix<f64>,
    /// W_lᴴW_l, lines × dof², in the layout of [`gram`](mechid_numerics::kronecker::gram()).
    pub(super) weights: DMatrix<f64>,
    /// W_lᴴr_l, 2·lines × dof, real parts first.
    pub(super) residuals: DMatrix<f64>,
}

impl LineBlock {
    /// Returns the blocks of all lines; `is_used` states whether a line (first argument) uses a
    /// column.
    pub(super) fn all(
        lines: usize,
        columns: usize,
        is_used: impl Fn(usize, usize) -> bool,
    ) -> Vec<Self> {
        let block = |start: usize| {
            let range = start..lines.min(start + GRAM_LINES);
            let on_any = |column: &usize| range.clone().any(|line| is_used(line, *column));
            Self { columns: (0..columns).filter(on_any).collect(), lines: range }
        };
        (0..lines).step_by(GRAM_LINES).map(block).collect()
    }

    /// Adds the columns that the triangular factor `r` couples to the columns of the block. After
    /// this, new rows of the block do not change the remaining columns.
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

    /// Converts rows over the columns of this block to rows over the columns of a `wider` block.
    fn widened(&self, wider: &Self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let mut widened = DMatrix::zeros(rows.nrows(), wider.columns.len());
        for (from, column) in rows.column_iter().zip(&self.columns) {
            let to = wider.columns.binary_search(column).expect("a column of the wider block");
            widened.column_mut(to).copy_from(&from);
        }
        widened
    }

    /// Adds `rows`, which have the columns of the block, to the triangular factor `r` by an
    /// orthogonal decomposition; `None` if a value is not finite.
    pub(super) fn push(&self, r: &mut DMatrix<f64>, rows: &DMatrix<f64>) -> Option<()> {
        let mut closed = self.clone();
        closed.close(r);
        let rows = self.widened(&closed, rows);
        let mut factor = TriangularFactor::new(closed.columns.len());
        let finite = factor.push(&[closed.triangle(r).as_view()]) && factor.push(&[rows.as_view()]);
        finite.then_some(())?;
        for (part, &column) in factor.r().column_iter().zip(&closed.columns) {
            for (value, &row) in part.iter().zip(&closed.columns) {
                r[(row, column)] = *value;
            }
        }
        Some(())
    }
}

impl BlockFactors {
    /// Returns the triangular factor of the regressors, each line weighted by the Frobenius norm of
    /// its W: columns × columns of the block. `None` if a value is not finite.
    pub(super) fn triangle(&self, dof: usize) -> Option<DMatrix<f64>> {
        let diagonal = (0..dof).map(|i| self.weights.column(kronecker::real_part(i, i)));
        let power = diagonal.fold(DVector::zeros(self.block.lines.len()), |sum, part| sum + part);
        let size = power.map(f64::sqrt);
        let mut rows = self.regressors.clone();
        for mut column in rows.column_iter_mut() {
            let (mut re, mut im) = column.rows_range_pair_mut(..size.len(), size.len()..);
            re.component_mul_assign(&size);
            im.component_mul_assign(&size);
        }
        let mut factor = TriangularFactor::new(rows.ncols());
        factor.push(&[rows.as_view()]).then(|| factor.r().clone())
    }

    /// Replaces the regressors φ by R⁻ᵀφ; `None` if the triangular factor R of all columns is
    /// singular.
    pub(super) fn orthonormalise(&mut self, r: &DMatrix<f64>) -> Option<()> {
        let mut closed = self.block.clone();
        closed.close(r);
        let count = closed.columns.len();
        let identity = DMatrix::identity(count, count);
        let inverse = closed.triangle(r).solve_upper_triangular(&identity)?;
        self.regressors = self.block.widened(&closed, &self.regressors) * inverse;
        self.block = closed;
        Some(())
    }
}
