//! Products of matrices with many more rows than columns.

use nalgebra::{DMatrix, DMatrixView};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::lanes::{dot, dots};
use crate::limits::{PRODUCT_ROWS, WEIGHTED_ROWS};

/// Returns AᵀB (columns of A × columns of B, in the product of their units), for two matrices with
/// the same number of rows.
///
/// The `tr_mul` of nalgebra computes one dot product per entry. This function transposes and
/// multiplies blocks of rows on all threads. The products of the blocks are added in the order of
/// the rows, so the result does not depend on the number of threads.
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

/// Returns AᵀWA (columns × columns, in the squared unit of A times the unit of W) of a tall matrix
/// A and the diagonal of W.
///
/// # Panics
/// Panics if there is not one weight for every row.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 1.3 (block matrices).
///
/// ```
/// use mechid_numerics::products::weighted_gram;
/// use nalgebra::dmatrix;
///
/// let a = dmatrix![1.0, 2.0; 3.0, 4.0];
/// assert_eq!(weighted_gram(a.as_view(), &[1.0, 10.0]), dmatrix![91.0, 122.0; 122.0, 164.0]);
/// ```
pub fn weighted_gram(a: DMatrixView<'_, f64>, weights: &[f64]) -> DMatrix<f64> {
    assert_eq!(a.nrows(), weights.len(), "one weight for every row");
    let mut gram = DMatrix::zeros(a.ncols(), a.ncols());
    Arch::new().dispatch(BlockedGram { a, weights, gram: &mut gram });
    gram.fill_upper_triangle_with_lower_triangle();
    gram
}

/// Arguments of [`weighted_gram`], which `pulp` compiles for each width of vector registers.
struct BlockedGram<'a> {
    a: DMatrixView<'a, f64>,
    weights: &'a [f64],
    gram: &'a mut DMatrix<f64>,
}

impl WithSimd for BlockedGram<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { a, weights, gram } = self;
        let columns = a.ncols();
        let mut weighted = [0.0; WEIGHTED_ROWS];
        for (block, weights) in weights.chunks(WEIGHTED_ROWS).enumerate() {
            let (first, len) = (block * WEIGHTED_ROWS, weights.len());
            let part = |column: usize| &a.column(column).data.into_slice()[first..first + len];
            for column in 0..columns {
                for ((to, a), weight) in weighted.iter_mut().zip(part(column)).zip(weights) {
                    *to = a * weight;
                }
                // Four products are computed at a time, so that each weighted entry is read only
                // once for four products.
                let mut row = column;
                while row + 4 <= columns {
                    let others = [part(row), part(row + 1), part(row + 2), part(row + 3)];
                    for (at, product) in dots(&weighted[..len], others).into_iter().enumerate() {
                        gram[(row + at, column)] += product;
                    }
                    row += 4;
                }
                for row in row..columns {
                    gram[(row, column)] += dot(&weighted[..len], part(row));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weighted_products_of_several_blocks_are_the_dot_products() {
        let number = |at: usize| ((at * 7919 + 13) % 101) as f64 / 50.0 - 1.0;
        let rows = 3 * WEIGHTED_ROWS + 17;
        let weights: Vec<f64> = (0..rows).map(|row| number(5 * row + 1)).collect();
        for columns in [4, 9] {
            let a = DMatrix::from_fn(rows, columns, |row, column| number(3 * row + column));
            let gram = weighted_gram(a.as_view(), &weights);
            let expected = a.tr_mul(&(DMatrix::from_diagonal(&weights.clone().into()) * &a));
            assert!((gram - expected).norm() < 1e-13 * a.norm_squared());
            let none = DMatrix::zeros(0, columns);
            let gram = weighted_gram(none.as_view(), &[]);
            assert_eq!(gram, DMatrix::zeros(columns, columns));
        }
    }

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
