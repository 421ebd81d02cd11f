//! Calls of the dense kernels on column-major slices.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::householder;
use faer::linalg::matmul::triangular::BlockStructure;
use faer::linalg::qr::no_pivoting::factor as qr;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Conj, MatMut, MatRef, Par};
use nalgebra::{Complex, DMatrix};

use crate::limits::DEPENDENT_COLUMN;

/// Replaces the first `factored` columns of a matrix by their triangular factor R, and multiplies
/// the other columns by Qᵀ; the reflectors remain below the triangle.
pub(crate) fn triangularise(columns: &mut [f64], rows: usize, factored: usize) {
    let size = rows.min(factored);
    if size == 0 {
        return;
    }
    let (factor, remainder) = columns.split_at_mut(rows * factored);
    let remaining = remainder.len() / rows;
    let block = qr::recommended_block_size::<f64>(rows, factored);
    let scratch =
        qr::qr_in_place_scratch::<f64>(rows, factored, block, Par::Seq, Default::default()).or(
            householder::apply_block_householder_sequence_transpose_on_the_left_in_place_scratch::<
                f64,
            >(rows, block, remaining),
        );
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    let mut factor = MatMut::from_column_major_slice_mut(factor, rows, factored);
    let mut reflectors = vec![0.0; block * size];
    let mut reflectors = MatMut::from_column_major_slice_mut(&mut reflectors, block, size);
    qr::qr_in_place(factor.rb_mut(), reflectors.rb_mut(), Par::Seq, stack, Default::default());
    householder::apply_block_householder_sequence_transpose_on_the_left_in_place_with_conj(
        factor.rb(),
        reflectors.rb(),
        Conj::No,
        MatMut::from_column_major_slice_mut(remainder, rows, remaining),
        Par::Seq,
        stack,
    );
}

/// Returns AᵀB of column-major matrices with `rows` rows.
pub(crate) fn transposed_product(a: &[f64], b: &[f64], rows: usize) -> Vec<f64> {
    let (from, to) = (a.len() / rows, b.len() / rows);
    let mut product = vec![0.0; from * to];
    if from * to > 0 {
        faer::linalg::matmul::matmul(
            MatMut::from_column_major_slice_mut(&mut product, from, to),
            Accum::Replace,
            MatRef::from_column_major_slice(a, rows, from).transpose(),
            MatRef::from_column_major_slice(b, rows, to),
            1.0,
            Par::Seq,
        );
    }
    product
}

/// Returns AB of complex matrices.
pub(crate) fn product(
    a: &DMatrix<Complex<f64>>,
    b: &DMatrix<Complex<f64>>,
) -> DMatrix<Complex<f64>> {
    let (rows, inner, columns) = (a.nrows(), a.ncols(), b.ncols());
    let mut product = DMatrix::zeros(rows, columns);
    faer::linalg::matmul::matmul(
        MatMut::from_column_major_slice_mut(product.as_mut_slice(), rows, columns),
        Accum::Replace,
        MatRef::from_column_major_slice(a.as_slice(), rows, inner),
        MatRef::from_column_major_slice(b.as_slice(), inner, columns),
        Complex::new(1.0, 0.0),
        Par::Seq,
    );
    product
}

/// Writes the lower triangle of AᵀA into `product`, column-major.
pub(crate) fn gram(a: &[f64], rows: usize, product: &mut [f64]) {
    let count = a.len() / rows;
    if count == 0 {
        return;
    }
    let a = MatRef::from_column_major_slice(a, rows, count);
    faer::linalg::matmul::triangular::matmul(
        MatMut::from_column_major_slice_mut(product, count, count),
        BlockStructure::TriangularLower,
        Accum::Replace,
        a.transpose(),
        BlockStructure::Rectangular,
        a,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

/// Adds `factor` times AB to `sum`; A has `rows` rows and `inner` columns.
pub(crate) fn add_product(
    sum: &mut [f64],
    a: &[f64],
    b: &[f64],
    rows: usize,
    inner: usize,
    factor: f64,
) {
    let count = b.len() / inner.max(1);
    if rows * inner * count == 0 {
        return;
    }
    faer::linalg::matmul::matmul(
        MatMut::from_column_major_slice_mut(sum, rows, count),
        Accum::Add,
        MatRef::from_column_major_slice(a, rows, inner),
        MatRef::from_column_major_slice(b, inner, count),
        factor,
        Par::Seq,
    );
}

/// Upper triangular factor R of a least-squares problem; a linearly dependent column has an
/// infinite diagonal entry.
#[derive(Debug, Clone, Default)]
pub(crate) struct Triangle {
    pub(crate) size: usize,
    /// Entries, column-major.
    pub(crate) entries: Vec<f64>,
}

impl Triangle {
    /// Takes the upper triangle of the first `size` rows of `columns`.
    pub(crate) fn new(columns: &[f64], rows: usize, size: usize) -> Self {
        let mut entries = vec![0.0; size * size];
        for (column, to) in entries.chunks_exact_mut(size.max(1)).enumerate() {
            let count = (column + 1).min(rows);
            to[..count].copy_from_slice(&columns[column * rows..column * rows + count]);
        }
        let mut triangle = Self { size, entries };
        triangle.exclude_dependent_columns();
        triangle
    }

    fn exclude_dependent_columns(&mut self) {
        let size = self.size;
        for column in 0..size {
            let entries = &self.entries[column * size..(column + 1) * size];
            let length = entries.iter().map(|r| r * r).sum::<f64>().sqrt();
            if entries[column].abs() <= DEPENDENT_COLUMN * length {
                self.entries[column * size..(column + 1) * size].fill(0.0);
                (column..size).for_each(|right| self.entries[right * size + column] = 0.0);
                self.entries[column * size + column] = f64::INFINITY;
            }
        }
    }

    /// Solves R x = b for each column of `b`.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        let size = self.size;
        for x in b.chunks_exact_mut(size.max(1)) {
            for column in (0..size).rev() {
                let entries = &self.entries[column * size..(column + 1) * size];
                x[column] /= entries[column];
                let value = x[column];
                x[..column].iter_mut().zip(entries).for_each(|(x, r)| *x -= value * r);
            }
        }
    }

    /// Solves Rᵀ x = b for each column of `b`.
    pub(crate) fn solve_transposed(&self, b: &mut [f64]) {
        let size = self.size;
        for x in b.chunks_exact_mut(size.max(1)) {
            for column in 0..size {
                let entries = &self.entries[column * size..(column + 1) * size];
                let sum: f64 = entries[..column].iter().zip(&x[..column]).map(|(r, x)| r * x).sum();
                x[column] = (x[column] - sum) / entries[column];
            }
        }
    }
}
