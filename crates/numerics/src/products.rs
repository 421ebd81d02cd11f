//! Products of matrices with many more rows than columns.

use nalgebra::{DMatrix, DMatrixView};
use rayon::prelude::*;

use crate::limits::PRODUCT_ROWS;

/// Returns AᵀB (columns of A × columns of B, in the product of their units), for two matrices with
/// the same number of rows.
///
/// The `tr_mul` of nalgebra computes one dot product per entry; here blocks of rows are transposed
/// and multiplied on all threads. They are added in the order of the rows, so the result does not
/// depend on the number of threads.
///
/// # Panics
/// Panics if the numbers of rows differ.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 1.3 (block matrices).
///
/// ```
/// use mechid_numerics::products::transposed_product;
/// use nalgebra::dmatrix;
///
/// let a = dmatrix![1.0, 2.0; 3.0, 4.0; 5.0, 6.0];
/// assert_eq!(transposed_product(a.as_view(), a.as_view()), dmatrix![35.0, 44.0; 44.0, 56.0]);
/// ```
pub fn transposed_product(a: DMatrixView<'_, f64>, b: DMatrixView<'_, f64>) -> DMatrix<f64> {
    assert_eq!(a.nrows(), b.nrows(), "the matrices have the same number of rows");
    let block = |first: usize| {
        let rows = PRODUCT_ROWS.min(a.nrows() - first);
        a.rows(first, rows).transpose() * b.rows(first, rows)
    };
    let firsts: Vec<usize> = (0..a.nrows()).step_by(PRODUCT_ROWS).collect();
    let products: Vec<DMatrix<f64>> = firsts.into_par_iter().map(block).collect();
    let zero = DMatrix::zeros(a.ncols(), b.ncols());
    products.into_iter().fold(zero, |sum, product| sum + product)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_several_blocks_are_the_dot_products() {
        let number = |at: usize| ((at * 7919 + 13) % 101) as f64 / 50.0 - 1.0;
        let rows = 2 * PRODUCT_ROWS + 17;
        let a = DMatrix::from_fn(rows, 3, |row, column| number(3 * row + column));
        let b = DMatrix::from_fn(rows, 5, |row, column| number(11 * row + 7 * column));
        let product = transposed_product(a.as_view(), b.as_view());
        assert!((product - a.tr_mul(&b)).norm() < 1e-12 * a.norm() * b.norm());
        let none = DMatrix::zeros(0, 3);
        assert_eq!(transposed_product(none.as_view(), none.as_view()), DMatrix::zeros(3, 3));
    }
}
