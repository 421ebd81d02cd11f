//! Arnoldi iteration.

use std::convert::Infallible;

use nalgebra::{Complex, DMatrix, DVector};

use crate::krylov::eigenvector::eigenvector;
use crate::real_schur::RealSchur;

/// Orthonormal basis V of the space of b, Φ b, Φ² b …, and the matrix H of Φ in this basis: Φ V = V
/// H + a remainder outside the space. Vectors and Φ are in any consistent unit.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
#[derive(Debug)]
pub struct Arnoldi {
    basis: Vec<DVector<f64>>,
    /// H with one more row, for the next vector; columns that are not computed yet are zero.
    pub(super) hessenberg: DMatrix<f64>,
    size: usize,
}

impl Arnoldi {
    /// Creates the space that contains only `start` (n entries), without products with Φ. The
    /// maximum dimension of the space is `most`.
    pub fn new(start: DVector<f64>, most: usize) -> Self {
        let hessenberg = DMatrix::zeros(most + 1, most);
        Self { basis: vec![start.normalize()], hessenberg, size: 0 }
    }

    /// Returns the number of products with Φ so far.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Adds one product with Φ; `apply` writes Φ v (n entries) into its second argument. Returns
    /// whether the space can grow further.
    ///
    /// # Errors
    /// The error of `apply`.
    ///
    /// # Panics
    /// If the space cannot grow.
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
    pub fn extend<E>(
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

    /// Returns the square part of H, size × size, in the unit of Φ; `None` if its numbers overflow.
    pub fn square(&self) -> Option<DMatrix<f64>> {
        let finite = self.hessenberg.iter().all(|value| value.is_finite());
        finite.then(|| self.hessenberg.view((0, 0), (self.size, self.size)).into_owned())
    }

    /// Returns V y (n entries) for real or complex coordinates y, at most one per vector of V.
    pub fn combined<T: nalgebra::ComplexField<RealField = f64>>(
        &self,
        coordinates: &[T],
    ) -> DVector<T> {
        let mut vector = DVector::zeros(self.basis[0].len());
        for (q, y) in self.basis.iter().zip(coordinates) {
            vector.zip_apply(q, |v: &mut T, q| *v += y.clone() * T::from_real(q));
        }
        vector
    }

    /// Returns the eigenvalue of H of largest modulus with its eigenvector, an approximation of the
    /// eigenpair of Φ; `None` without products or if numbers overflow.
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
    pub fn dominant(&self) -> Option<Dominant> {
        let square = self.square().filter(|square| !square.is_empty())?;
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

/// Approximation of the eigenvalue of largest modulus.
#[derive(Debug, Clone)]
pub struct Dominant {
    /// The eigenvalue μ, in the unit of Φ.
    pub value: Complex<f64>,
    /// Residual ‖Φ u − μ u‖, in the unit of Φ.
    pub residual: f64,
    /// Eigenvector u, n entries, pure numbers, of norm 1.
    pub vector: DVector<Complex<f64>>,
}

/// Returns the dominant eigenvalue of A after at most `steps` Arnoldi steps from `start` (n
/// entries); `apply` writes A x into its second argument. `None` if numbers overflow.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
pub fn dominant(
    start: DVector<f64>,
    steps: usize,
    mut apply: impl FnMut(&[f64], &mut [f64]),
) -> Option<Dominant> {
    let most = steps.min(start.len());
    let mut space = Arnoldi::new(start, most);
    loop {
        let Ok(more) = space.extend(|x, y| {
            apply(x, y);
            Ok::<_, Infallible>(())
        });
        if !more {
            break;
        }
    }
    space.dominant()
}
