//! Normal equations of a Jacobian whose rows are Kronecker products, in coordinates with a small
//! condition number.

use std::rc::Rc;

use mechid_model::Matrix;
use mechid_numerics::cholesky::Cholesky;
use mechid_numerics::kronecker;
use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_numerics::triangular::TriangularFactor;
use mechid_spectra::transient;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::line_block::{BlockFactors, LineBlock};
use crate::Unknowns;
use crate::limits::{GRAM_DEPENDENT, GRAM_LANCZOS, GRAM_RIDGE};

/// Indices of the unknowns in the equations of motion.
#[derive(Debug)]
pub(super) struct Layout {
    dof: usize,
    unknowns: usize,
    /// Columns of the transients, each zero outside its record; then columns of [M C K] that are
    /// unknown in at least one equation.
    columns: Vec<(Matrix, usize)>,
    equations: Vec<Equation>,
}

/// One equation of motion that has unknowns.
#[derive(Debug)]
struct Equation {
    row: usize,
    /// Indices of the unknowns of this equation among all unknowns.
    unknown_indices: Vec<usize>,
    /// Indices, in [`Layout::columns`], of the columns for the unknowns of this equation.
    columns: Vec<usize>,
}

/// Coordinates u = T θ, equation by equation. In these coordinates the regressors are orthonormal;
/// the scale gives the Gram matrix a unit diagonal. For related entries these are coordinates of
/// the independent unknowns.
pub(super) struct Coordinates {
    /// Number of columns of the layout.
    columns: usize,
    blocks: Vec<Block>,
    scale: DVector<f64>,
    related: Option<Related>,
}

/// Scaled factors Qᵀ and R of T S = Q R, for independent unknowns p of related entries, dθ = S dp.
struct Related {
    transposed: DMatrix<f64>,
    triangle: DMatrix<f64>,
}

struct Block {
    row: usize,
    unknown_indices: Vec<usize>,
    /// Orthonormal basis of the columns for the unknowns of this equation; `None` if the equation
    /// has all columns.
    basis: Option<Rc<DMatrix<f64>>>,
    /// Upper triangular matrix T of the coordinates T θ of this equation.
    triangle: Rc<DMatrix<f64>>,
}

/// Normal equations JᵀJ v = −Jᵀr for a step v.
pub(super) struct NormalEquations {
    /// Gram matrix JᵀJ, scaled to a unit diagonal.
    pub gram: DMatrix<f64>,
    /// Jᵀr.
    pub gradient: DVector<f64>,
    pub coordinates: Coordinates,
}

impl Layout {
    pub(super) fn new(unknowns: &Unknowns, columns_of_ends: usize) -> Self {
        let (n, free) = (unknowns.dof(), unknowns.free());
        let ends: Vec<(Matrix, usize)> = (0..columns_of_ends)
            .flat_map(|column| Matrix::ALL.map(|matrix| (matrix, n + column)))
            .collect();
        let mut columns: Vec<_> = free.iter().map(|p| (p.matrix(), p.column())).collect();
        columns.extend(&ends);
        columns.sort_unstable_by_key(|(matrix, column)| (*column < n, *matrix as usize, *column));
        columns.dedup();
        let equation = |row: usize| {
            let of_row = free.iter().enumerate().filter(move |(_, p)| p.row() == row);
            let index = |column: &(Matrix, usize)| {
                columns.iter().position(|c| c == column).expect("a column of some equation")
            };
            let of_row = of_row.map(|(at, p)| (at, index(&(p.matrix(), p.column()))));
            let of_ends = ends.iter().map(|column| {
                let at = transient::index(n, column.1 - n, column.0, row);
                (free.len() + at, index(column))
            });
            let mut both: Vec<(usize, usize)> = of_row.chain(of_ends).collect();
            // The unknowns are sorted in the order of `columns`, so that an equation with all
            // columns needs no selection of columns.
            both.sort_unstable_by_key(|(_, column)| *column);
            let (unknown_indices, columns) = both.into_iter().unzip();
            Equation { row, unknown_indices, columns }
        };
        let equations: Vec<Equation> =
            (0..n).map(equation).filter(|e| !e.unknown_indices.is_empty()).collect();
        Self { dof: n, unknowns: free.len() + n * ends.len(), columns, equations }
    }

    pub(super) fn columns(&self) -> &[(Matrix, usize)] {
        &self.columns
    }

    /// Returns the normal equations and makes the regressors orthonormal. `None` if the regressors
    /// are linearly dependent, or if values overflow.
    ///
    /// With H = WᴴW, the entry for the unknown in column a of equation i and the unknown in column
    /// b of equation j is 2 Re Σ φ̄_a φ_b H_ij. This sum is the product of a matrix of pairs (a, b)
    /// and a matrix of pairs (i, j); it needs 1/dof of the operations that the rows of J would
    /// need. The condition number of the Gram matrix is the square of that of J. This square is
    /// harmless here, because the regressors are orthonormal over the lines with the weights ‖W_l‖;
    /// rounding of the Gram matrix slows the search but does not change the minimum, where Jᵀr = 0.
    /// With a `tangent` S (entries and transient loads × unknowns), the equations are those of the
    /// independent unknowns.
    ///
    /// # Source
    /// Van Loan (2000), J. Computational and Applied Mathematics 123, 85–100 (least squares with
    /// Kronecker products).
    pub(super) fn normal_equations(
        &self,
        factors: &mut [BlockFactors],
        tangent: Option<&DMatrix<f64>>,
    ) -> Option<NormalEquations> {
        let triangle = self.orthonormalise(factors, tangent.is_some())?;
        let mut coordinates = Coordinates {
            columns: self.columns.len(),
            blocks: self.blocks(triangle),
            scale: DVector::from_element(self.unknowns, 1.0),
            related: None,
        };
        let mut gram = self.gram(&self.products(factors), &coordinates);
        for at in 0..self.unknowns {
            let length = gram[(at, at)].sqrt();
            coordinates.scale[at] = if length > 0.0 { length } else { 1.0 };
        }
        for (mut column, scale) in gram.column_iter_mut().zip(coordinates.scale.iter()) {
            column.component_div_assign(&coordinates.scale);
            column.unscale_mut(*scale);
        }
        if let Some(tangent) = tangent {
            gram = coordinates.relate(tangent, &gram)?;
        }
        let gradient = coordinates.project(factors.iter().map(|block| (block, &block.residuals)));
        let finite = gram.iter().chain(gradient.iter()).all(|v| v.is_finite());
        finite.then_some(NormalEquations { gram, gradient, coordinates })
    }

    /// Returns the triangular factor R of the regressors φ, with each line weighted by the
    /// Frobenius norm of its W, and replaces φ by R⁻ᵀφ. For `related` entries the regressors may be
    /// linearly dependent, as at a degree of freedom without force: the relations still determine
    /// the entries.
    ///
    /// # Source
    /// Demmel, Grigori, Hoemmen & Langou (2012), SIAM J. Sci. Comput. 34, A206–A239 (QR of tall
    /// matrices).
    fn orthonormalise(&self, factors: &mut [BlockFactors], related: bool) -> Option<DMatrix<f64>> {
        let of_blocks: Vec<Option<DMatrix<f64>>> =
            factors.par_iter().map(|block| block.triangle(self.dof)).collect();
        let mut r = DMatrix::zeros(self.columns.len(), self.columns.len());
        // The rows have the same order for any number of threads.
        for (BlockFactors { block, .. }, triangle) in factors.iter().zip(of_blocks) {
            block.push(&mut r, &triangle?)?;
        }
        if related {
            for at in 0..self.columns.len() {
                let row = LineBlock { lines: 0..0, columns: vec![at] };
                let ridge = GRAM_RIDGE * r.column(at).norm();
                row.push(&mut r, &DMatrix::from_element(1, 1, ridge))?;
            }
        }
        let independent = |at: usize| r[(at, at)].abs() > GRAM_DEPENDENT * r.column(at).norm();
        if !(0..self.columns.len()).all(independent) {
            return None;
        }
        let replaced: Option<Vec<()>> =
            factors.par_iter_mut().map(|block| block.orthonormalise(&r)).collect();
        replaced.map(|_| r)
    }

    fn blocks(&self, triangle: DMatrix<f64>) -> Vec<Block> {
        let whole = Rc::new(triangle);
        let mut blocks: Vec<Block> = Vec::new();
        for (at, equation) in self.equations.iter().enumerate() {
            let same = self.equations[..at].iter().position(|e| e.columns == equation.columns);
            let (basis, triangle) = match same {
                Some(same) => (blocks[same].basis.clone(), blocks[same].triangle.clone()),
                None if equation.columns.len() == self.columns.len() => (None, whole.clone()),
                None => {
                    let (q, r) = whole.select_columns(&equation.columns).qr().unpack();
                    (Some(Rc::new(q)), Rc::new(r))
                }
            };
            let (row, unknown_indices) = (equation.row, equation.unknown_indices.clone());
            blocks.push(Block { row, unknown_indices, basis, triangle });
        }
        blocks
    }

    /// Returns the sums 2 Re Σ φ̄_a φ_b H_ij, one row for each pair a ≤ b and one column for each
    /// of the dof² pairs (i, j).
    fn products(&self, factors: &[BlockFactors]) -> DMatrix<f64> {
        let product = |of: &BlockFactors| {
            kronecker::gram(of.regressors.as_view(), of.weights.as_view(), self.dof)
        };
        // The terms of the sum are added in the same order for any number of threads.
        let parts: Vec<DMatrix<f64>> = factors.par_iter().map(product).collect();
        let pair = |a: usize, b: usize| b * (b + 1) / 2 + a;
        let count = self.columns.len();
        let mut sums = DMatrix::zeros(pair(0, count), self.dof * self.dof);
        for (BlockFactors { block, .. }, part) in factors.iter().zip(parts) {
            let columns = block.columns.iter().enumerate();
            let pairs =
                columns.flat_map(|(at, &b)| block.columns[..=at].iter().map(move |&a| pair(a, b)));
            for (place, row) in pairs.zip(part.row_iter()) {
                let mut to = sums.row_mut(place);
                to += row;
            }
        }
        sums
    }

    fn gram(&self, products: &DMatrix<f64>, coordinates: &Coordinates) -> DMatrix<f64> {
        let q = self.columns.len();
        let mut gram = DMatrix::zeros(self.unknowns, self.unknowns);
        let mut part = DMatrix::zeros(q, q);
        let mut column = 0;
        for right in &coordinates.blocks {
            let mut row = 0;
            for left in &coordinates.blocks {
                let upper = products.column(left.row + self.dof * right.row);
                let lower = products.column(right.row + self.dof * left.row);
                let mut pair = 0;
                for b in 0..q {
                    for a in 0..=b {
                        part[(a, b)] = upper[pair];
                        part[(b, a)] = lower[pair];
                        pair += 1;
                    }
                }
                let (rows, columns) = (left.unknown_indices.len(), right.unknown_indices.len());
                let mut to = gram.view_mut((row, column), (rows, columns));
                match (&left.basis, &right.basis) {
                    (None, None) => to.copy_from(&part),
                    (None, Some(right)) => to.copy_from(&(&part * &**right)),
                    (Some(left), None) => to.copy_from(&left.tr_mul(&part)),
                    (Some(left), Some(right)) => to.copy_from(&left.tr_mul(&(&part * &**right))),
                }
                row += rows;
            }
            column += right.unknown_indices.len();
        }
        gram
    }
}

impl NormalEquations {
    /// Returns (JᵀJ)⁻¹ of the unknowns, and the condition number of J with columns of unit length.
    ///
    /// `None` if JᵀJ is singular to rounding.
    pub(super) fn covariance(&self) -> Option<(DMatrix<f64>, f64)> {
        let inverse = Cholesky::new(&self.gram, 0.0)?.inverse_of_lower();
        // The covariance is R Rᵀ with R = T⁻¹D⁻¹L⁻ᵀ. L is the Cholesky factor of the Gram matrix,
        // and D T θ are the coordinates of the unknowns θ.
        let roots = self.coordinates.unknowns_of_columns(&inverse.transpose());
        let covariance = &roots * roots.transpose();
        let lengths = self.coordinates.lengths(&self.gram);
        let gram = |x: &DVector<f64>| {
            let inner = &self.gram * self.coordinates.transform(&x.component_div(&lengths));
            self.coordinates.transposed(&inner).component_div(&lengths)
        };
        let inverse =
            |x: &DVector<f64>| (&covariance * x.component_mul(&lengths)).component_mul(&lengths);
        let largest = |of: &dyn Fn(&DVector<f64>) -> DVector<f64>| largest(lengths.len(), of);
        let condition = (largest(&gram) * largest(&inverse)).sqrt();
        covariance.iter().all(|v| v.is_finite()).then_some((covariance, condition.max(1.0)))
    }
}

/// Returns the largest eigenvalue of a symmetric positive definite matrix, given by its product
/// with a vector.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.1 (Lanczos), with full
/// reorthogonalisation.
fn largest(size: usize, product: &dyn Fn(&DVector<f64>) -> DVector<f64>) -> f64 {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let mut projected = DMatrix::zeros(GRAM_LANCZOS.min(size), GRAM_LANCZOS.min(size));
    // The iteration begins with an arbitrary vector that is not orthogonal to the eigenvectors.
    let mut next = DVector::from_fn(size, |at, _| 1.0 + (0.7 * (at * at) as f64).sin());
    for at in 0..projected.nrows() {
        let norm = next.norm();
        if at > 0 {
            if norm <= f64::EPSILON * projected[(at - 1, at - 1)] {
                projected = projected.view((0, 0), (at, at)).into_owned();
                break;
            }
            (projected[(at, at - 1)], projected[(at - 1, at)]) = (norm, norm);
        }
        next.unscale_mut(norm);
        let direction = next.clone();
        next = product(&direction);
        projected[(at, at)] = direction.dot(&next);
        basis.push(direction);
        for _ in 0..2 {
            for vector in &basis {
                let along = vector.dot(&next);
                next.axpy(-along, vector, 1.0);
            }
        }
    }
    hermitian_eigen(projected)
        .map_or(f64::INFINITY, |decomposition| decomposition.eigenvalues.max())
}

impl Coordinates {
    /// Changes from entries to the independent unknowns and returns the Gram matrix of these
    /// unknowns, with unit diagonal. `None` if unknowns are dependent to rounding.
    fn relate(&mut self, tangent: &DMatrix<f64>, gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let mut moved = DMatrix::zeros(self.scale.len(), tangent.ncols());
        for (mut to, column) in moved.column_iter_mut().zip(tangent.column_iter()) {
            to.copy_from(&self.transform(&column.into_owned()));
        }
        let count = moved.ncols();
        let mut factor = TriangularFactor::new(count);
        if !factor.push(&[moved.as_view()]) {
            return None;
        }
        let mut triangle = factor.r().clone();
        let independent =
            |at: usize| triangle[(at, at)].abs() > GRAM_DEPENDENT * triangle.column(at).norm();
        if !(0..count).all(independent) {
            return None;
        }
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(count, count))?;
        let columns = moved * inverse;
        // An explicit transpose is faster: the `tr_mul` of nalgebra computes dot products.
        let mut transposed = columns.transpose();
        let mut gram = &transposed * (gram * columns);
        let scale = gram.diagonal().map(f64::sqrt);
        if !scale.iter().all(|length| *length > 0.0 && length.is_finite()) {
            return None;
        }
        for (at, length) in scale.iter().enumerate() {
            gram.row_mut(at).unscale_mut(*length);
            gram.column_mut(at).unscale_mut(*length);
            transposed.row_mut(at).unscale_mut(*length);
            triangle.row_mut(at).scale_mut(*length);
        }
        self.related = Some(Related { transposed, triangle });
        Some(gram)
    }

    /// Returns 2 Re Σ φ̄ y for every unknown. This is Jᵀr for values r with W_lᴴ r = y on each
    /// line. `weighted` has y for each block, 2·lines × dof, real parts first.
    pub(super) fn project<'b>(
        &self,
        weighted: impl Iterator<Item = (&'b BlockFactors, &'b DMatrix<f64>)>,
    ) -> DVector<f64> {
        let mut products = DMatrix::zeros(self.columns, 0);
        for (of, weighted) in weighted {
            if products.ncols() == 0 {
                products = DMatrix::zeros(self.columns, weighted.ncols());
            }
            let product = of.regressors.tr_mul(weighted) * 2.0;
            for (&column, row) in of.block.columns.iter().zip(product.row_iter()) {
                let mut to = products.row_mut(column);
                to += row;
            }
        }
        let mut projected = DVector::zeros(self.scale.len());
        for (block, start) in self.starts() {
            let column = products.column(block.row);
            let mut to = projected.rows_mut(start, block.unknown_indices.len());
            match &block.basis {
                None => to.copy_from(&column),
                Some(basis) => to.copy_from(&basis.tr_mul(&column)),
            }
        }
        projected.component_div_assign(&self.scale);
        match &self.related {
            None => projected,
            Some(related) => &related.transposed * projected,
        }
    }

    /// Returns the unknowns θ at coordinates v.
    pub(super) fn unknowns(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        let columns = DMatrix::from_column_slice(coordinates.len(), 1, coordinates.as_slice());
        self.unknowns_of_columns(&columns).column(0).into_owned()
    }

    /// Returns the unknowns θ at the coordinates v in each column.
    fn unknowns_of_columns(&self, coordinates: &DMatrix<f64>) -> DMatrix<f64> {
        if let Some(Related { triangle, .. }) = &self.related {
            let mut unknowns = coordinates.clone();
            let solved = triangle.solve_upper_triangular_mut(&mut unknowns);
            debug_assert!(solved, "independent unknowns");
            return unknowns;
        }
        let mut unknowns = coordinates.clone();
        for (block, start) in self.starts() {
            let len = block.unknown_indices.len();
            let mut block_rows = coordinates.rows(start, len).into_owned();
            for (mut row, scale) in
                block_rows.row_iter_mut().zip(self.scale.rows(start, len).iter())
            {
                row.unscale_mut(*scale);
            }
            let solved = block.triangle.solve_upper_triangular_mut(&mut block_rows);
            debug_assert!(solved, "independent regressors");
            for (at, row) in block.unknown_indices.iter().zip(block_rows.row_iter()) {
                unknowns.row_mut(*at).copy_from(&row);
            }
        }
        unknowns
    }

    /// Returns the coordinates v of unknowns θ.
    pub(super) fn transform(&self, unknowns: &DVector<f64>) -> DVector<f64> {
        if let Some(Related { triangle, .. }) = &self.related {
            return triangle * unknowns;
        }
        let mut coordinates = DVector::zeros(self.scale.len());
        for (block, start) in self.starts() {
            let values = block.unknown_indices.iter().map(|at| unknowns[*at]);
            let values = DVector::from_iterator(block.unknown_indices.len(), values);
            coordinates.rows_mut(start, values.len()).copy_from(&(&*block.triangle * values));
        }
        coordinates.component_mul_assign(&self.scale);
        coordinates
    }

    /// Applies the transpose of the map from unknowns to coordinates.
    fn transposed(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        if let Some(Related { triangle, .. }) = &self.related {
            return triangle.tr_mul(coordinates);
        }
        let mut unknowns = DVector::zeros(self.scale.len());
        let scaled = coordinates.component_mul(&self.scale);
        for (block, start) in self.starts() {
            let values = block.triangle.tr_mul(&scaled.rows(start, block.unknown_indices.len()));
            block
                .unknown_indices
                .iter()
                .zip(values.iter())
                .for_each(|(at, value)| unknowns[*at] = *value);
        }
        unknowns
    }

    /// Returns the lengths of the columns of J for the unknowns, from the Gram matrix of the
    /// coordinates.
    fn lengths(&self, gram: &DMatrix<f64>) -> DVector<f64> {
        if let Some(Related { triangle, .. }) = &self.related {
            let inner = gram * triangle;
            let squared = triangle.column_iter().zip(inner.column_iter()).map(|(t, g)| t.dot(&g));
            return DVector::from_iterator(triangle.ncols(), squared.map(f64::sqrt));
        }
        let mut lengths = DVector::zeros(self.scale.len());
        for (block, start) in self.starts() {
            let len = block.unknown_indices.len();
            let mut root = (*block.triangle).clone();
            for (mut row, scale) in root.row_iter_mut().zip(self.scale.rows(start, len).iter()) {
                row.scale_mut(*scale);
            }
            let inner = gram.view((start, start), (len, len)) * &root;
            for (at, place) in block.unknown_indices.iter().enumerate() {
                lengths[*place] = root.column(at).dot(&inner.column(at)).sqrt();
            }
        }
        lengths
    }

    fn starts(&self) -> impl Iterator<Item = (&Block, usize)> {
        self.blocks.iter().scan(0, |next, block| {
            let start = *next;
            *next += block.unknown_indices.len();
            Some((block, start))
        })
    }
}
