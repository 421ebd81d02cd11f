//! Krylov spaces of operators that are known by their products alone: systems of equations solved and the
//! largest eigenvalues found in them.

use mechid_model::ModelError;
use mechid_numerics::RealSchur;
use mechid_numerics::linear_algebra::singular_values;
use nalgebra::{Complex, DMatrix, DVector};

use crate::stability::krylov::eigenvector;

/// An orthonormal basis V of the space of b, Φ b, Φ² b …, and Φ in it: Φ V = V H + (what leads out of it).
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
pub(crate) struct Arnoldi {
    basis: Vec<DVector<f64>>,
    /// H with one row more, that of the next vector; zeros where nothing was computed yet.
    hessenberg: DMatrix<f64>,
    size: usize,
}

impl Arnoldi {
    /// The space of `start` alone, of which no product is known; it can have `most` dimensions.
    pub(crate) fn new(start: DVector<f64>, most: usize) -> Self {
        let hessenberg = DMatrix::zeros(most + 1, most);
        Self { basis: vec![start.normalize()], hessenberg, size: 0 }
    }

    /// Number of products that are known.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Takes one product more, `apply` writing Φ v into its second argument; returns whether another one
    /// can follow.
    pub(crate) fn extend<E>(
        &mut self,
        apply: impl FnOnce(&[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<bool, E> {
        let j = self.size;
        let mut next = DVector::zeros(self.basis[j].len());
        apply(self.basis[j].as_slice(), next.as_mut_slice())?;
        let before = next.norm();
        for _ in 0..2 {
            for (i, q) in self.basis.iter().enumerate() {
                let part = q.dot(&next);
                next.axpy(-part, q, 1.0);
                self.hessenberg[(i, j)] += part;
            }
        }
        let norm = next.norm();
        self.size = j + 1;
        let leads_out = norm > 1e-14 * before;
        if leads_out {
            self.hessenberg[(j + 1, j)] = norm;
            self.basis.push(next / norm);
        }
        Ok(leads_out && self.size < self.hessenberg.ncols())
    }

    /// H, square; `None` if its numbers overflow.
    pub(crate) fn square(&self) -> Option<DMatrix<f64>> {
        let finite = self.hessenberg.iter().all(|value| value.is_finite());
        finite.then(|| self.hessenberg.view((0, 0), (self.size, self.size)).into_owned())
    }

    /// V y for coordinates y of any kind of number.
    pub(crate) fn combined<T: nalgebra::ComplexField<RealField = f64>>(
        &self,
        coordinates: &[T],
    ) -> DVector<T> {
        let mut vector = DVector::zeros(self.basis[0].len());
        for (q, y) in self.basis.iter().zip(coordinates) {
            vector.zip_apply(q, |v: &mut T, q| *v += y.clone() * T::from_real(q));
        }
        vector
    }

    /// The eigenvalue of H of largest modulus with its vector; `None` if numbers overflow.
    pub(crate) fn dominant(&self) -> Option<Dominant> {
        let square = self.square()?;
        let values = RealSchur::new(square.clone()).ok()?.eigenvalues();
        let value = values.into_iter().max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
        let coordinates = eigenvector(&square, 1, value, 0)?;
        let leads_out = self.hessenberg[(self.size, self.size - 1)];
        Some(Dominant {
            value,
            residual: leads_out * coordinates[self.size - 1].norm(),
            vector: self.combined(coordinates.as_slice()),
        })
    }
}

/// An approximate eigenvalue of largest modulus.
#[derive(Debug, Clone)]
pub(crate) struct Dominant {
    pub(crate) value: Complex<f64>,
    /// ‖Φ u − μ u‖.
    pub(crate) residual: f64,
    /// Its vector u, of norm 1.
    pub(crate) vector: DVector<Complex<f64>>,
}

/// Solution of (I − Φ) y = b, as far as a search in a Krylov space finds it.
pub(crate) struct Solution {
    /// y.
    pub(crate) vector: DVector<f64>,
    /// ‖b − (I − Φ) y‖ / ‖b‖.
    pub(crate) residual: f64,
    /// Number of products with Φ.
    pub(crate) products: usize,
    /// Smallest singular value of I − Φ in the space, over the largest.
    pub(crate) reciprocal_condition: f64,
}

/// Solves (I − Φ) y = b to a relative residual of `tolerance` in a space of `most` dimensions at most (GMRES);
/// `apply` writes Φ v into its second argument.
///
/// # Source
/// Saad & Schultz, "GMRES: a generalized minimal residual algorithm", *SIAM J. Sci. Stat. Comput.* 7 (1986).
pub(crate) fn solve<E: From<ModelError>>(
    right: &DVector<f64>,
    tolerance: f64,
    most: usize,
    mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<(), E>,
) -> Result<Solution, E> {
    let norm = right.norm();
    let most = most.min(right.len());
    let nothing = DVector::zeros(right.len());
    if norm == 0.0 {
        return Ok(Solution {
            vector: nothing,
            residual: 0.0,
            products: 0,
            reciprocal_condition: 1.0,
        });
    }
    let mut space = Arnoldi::new(right.clone(), most);
    // I − H, one row more than columns, is made a triangle by rotations of neighbouring rows.
    let mut triangle = DMatrix::<f64>::zeros(most, most);
    let mut rotations: Vec<[f64; 2]> = Vec::with_capacity(most);
    let mut rotated = vec![norm];
    loop {
        let j = space.size();
        let more = space.extend(&mut apply)?;
        let entry = |i: usize| f64::from(u8::from(i == j)) - space.hessenberg[(i, j)];
        let mut column: Vec<f64> = (0..j + 2).map(entry).collect();
        for (i, [cos, sin]) in rotations.iter().enumerate() {
            let [upper, lower] = [column[i], column[i + 1]];
            column[i] = cos * upper + sin * lower;
            column[i + 1] = cos * lower - sin * upper;
        }
        let length = column[j].hypot(column[j + 1]);
        let [cos, sin] = match length > 0.0 {
            true => [column[j] / length, column[j + 1] / length],
            false => [1.0, 0.0],
        };
        column[j] = length;
        triangle.view_mut((0, j), (j + 1, 1)).copy_from_slice(&column[..=j]);
        rotations.push([cos, sin]);
        rotated.push(-sin * rotated[j]);
        rotated[j] *= cos;
        let residual = rotated[j + 1].abs() / norm;
        if more && residual > tolerance {
            continue;
        }
        let products = j + 1;
        let triangle = triangle.view((0, 0), (products, products));
        let sizes = singular_values(triangle.into_owned()).map_err(ModelError::from)?;
        let right = DVector::from_column_slice(&rotated[..products]);
        let solved = triangle.solve_upper_triangular(&right);
        let found = solved.filter(|y| y.iter().all(|value| value.is_finite()));
        let reciprocal_condition = match &found {
            Some(_) => sizes.min() / sizes.max(),
            None => 0.0,
        };
        let residual = if found.is_some() { residual } else { 1.0 };
        let vector = found.map_or(nothing, |y| space.combined(y.as_slice()));
        return Ok(Solution { vector, residual, products, reciprocal_condition });
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    /// A matrix with eigenvalues within the unit circle, most of them near zero.
    fn contraction(len: usize) -> DMatrix<f64> {
        let number = |i: usize, j: usize| ((7 * i * i + 5 * j + 3) as f64).sin();
        let turned = DMatrix::from_fn(len, len, number).qr().q();
        let factors = DVector::from_fn(len, |i, _| 0.95 * 0.8f64.powi(i as i32));
        &turned * DMatrix::from_diagonal(&factors) * turned.transpose()
    }

    /// Judge: LU factors of the whole matrix.
    #[test]
    fn equations_are_solved_in_few_products() {
        let (matrix, len) = (contraction(80), 80);
        let right = DVector::from_fn(len, |i, _| (i as f64 * 1.3).cos());
        let apply = |v: &[f64], product: &mut [f64]| {
            (&matrix * DVector::from_column_slice(v))
                .iter()
                .zip(product)
                .for_each(|(p, out)| *out = *p);
            Ok::<_, ModelError>(())
        };
        let found = solve(&right, 1e-12, 60, apply).unwrap();
        let exact = (DMatrix::identity(len, len) - &matrix).lu().solve(&right).unwrap();
        assert!((found.vector - &exact).norm() < 1e-10 * exact.norm());
        assert!(found.products < 50, "{}", found.products);
        assert!(found.residual <= 1e-12 && found.reciprocal_condition > 0.01);
        // Too small a space leaves what it says it leaves.
        let found = solve(&right, 1e-12, 5, apply).unwrap();
        let left = &right - (DMatrix::identity(len, len) - &matrix) * found.vector;
        assert!((left.norm() / right.norm() - found.residual).abs() < 1e-12);
        assert!(found.residual > 1e-6);
    }

    #[test]
    fn what_is_singular_shows_a_reciprocal_condition_of_zero() {
        let apply = |v: &[f64], product: &mut [f64]| {
            product.copy_from_slice(v);
            Ok::<_, ModelError>(())
        };
        let found = solve(&DVector::from_element(5, 1.0), 1e-12, 5, apply).unwrap();
        assert_eq!((found.reciprocal_condition, found.residual), (0.0, 1.0));
    }

    #[test]
    fn the_residual_of_the_largest_eigenvalue_tells_its_error() {
        let matrix = contraction(80);
        let mut space = Arnoldi::new(DVector::from_fn(80, |i, _| (i as f64).cos()), 40);
        let mut before = f64::INFINITY;
        for size in [4, 8, 16, 32] {
            while space.size() < size {
                let Ok(_) = space.extend(|v, product| {
                    let found = &matrix * DVector::from_column_slice(v);
                    product.copy_from_slice(found.as_slice());
                    Ok::<_, Infallible>(())
                });
            }
            let Dominant { value, residual, .. } = space.dominant().unwrap();
            // Of a symmetric matrix the error is no larger than the residual.
            assert!((value - 0.95).norm() <= residual + 1e-13, "{size}: {residual:e}");
            assert!(residual < before, "{size}: {residual:e}");
            before = residual;
        }
        assert!(before < 1e-4, "{before:e}");
    }
}
