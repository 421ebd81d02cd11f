//! The subspace that the iteration spans, and the modes in it.

use mechid_model::{Matrix, Mode, SparseSystem};
use mechid_numerics::RealSchur;
use mechid_numerics::krylov::eigenvector::eigenvector;
use mechid_numerics::krylov::start_vector::numbered_start_vector;
use nalgebra::{Complex, DMatrix, DVector};

use crate::error::IntegrateError;
use crate::limits;
use crate::modes::inverse::{Inverse, largest_row};
use crate::modes::{Candidate, SparseMode};

/// An orthonormal basis of the vectors computed so far, and the operator in this basis.
pub(super) struct Space {
    basis: Vec<DVector<f64>>,
    /// Column j: products of the basis vectors with the image of basis vector j under the operator.
    columns: Vec<Vec<f64>>,
    /// Number of basis vectors to which the operator was applied.
    pub(super) products: usize,
    /// Number of pseudo-random vectors that were created for the basis.
    added: usize,
}

impl Space {
    pub(super) fn new(len: usize) -> Self {
        let mut space = Self { basis: vec![], columns: vec![], products: 0, added: 0 };
        (0..limits::START_VECTORS.min(len)).for_each(|_| space.add(len));
        space
    }

    /// Adds a pseudo-random vector, if the space is not complete.
    fn add(&mut self, len: usize) {
        while self.basis.len() < len && self.added < 10 * len {
            let mut vector = numbered_start_vector(len, self.added);
            self.added += 1;
            let before = vector.norm();
            self.orthogonalise(&mut vector);
            let norm = vector.norm();
            if norm > 1e-8 * before {
                self.basis.push(vector / norm);
                return;
            }
        }
    }

    /// Subtracts the projections of `vector` on the basis vectors from `vector`, and returns their
    /// coefficients.
    fn orthogonalise(&self, vector: &mut DVector<f64>) -> Vec<f64> {
        let mut parts = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            for (q, sum) in self.basis.iter().zip(&mut parts) {
                let part = q.dot(vector);
                vector.axpy(-part, q, 1.0);
                *sum += part;
            }
        }
        parts
    }

    /// Applies the operator to the next vector of the basis.
    pub(super) fn grow(&mut self, inverse: &mut Inverse<'_>) {
        let mut image = inverse.apply(&self.basis[self.products]);
        let before = image.norm();
        let mut parts = self.orthogonalise(&mut image);
        let norm = image.norm();
        let len = image.len();
        if norm > 1e-13 * before && self.basis.len() < len {
            parts.push(norm);
            self.basis.push(image / norm);
        }
        self.columns.push(parts);
        self.products += 1;
        if self.products == self.basis.len() {
            self.add(len);
        }
    }

    /// Returns approximate modes and, for each, whether it has converged.
    pub(super) fn modes(
        &self,
        system: &SparseSystem,
        inverse: &mut Inverse<'_>,
        count: usize,
    ) -> Result<Vec<Candidate>, IntegrateError> {
        let m = self.products;
        let overflow = || IntegrateError::ModesOverflow { vectors: m };
        let entry = |i: usize, j: usize| self.columns[j].get(i).copied().unwrap_or(0.0);
        let square = DMatrix::from_fn(m, m, entry);
        if square.iter().any(|v| !v.is_finite()) {
            return Err(overflow());
        }
        let remainder = DMatrix::from_fn(self.basis.len() - m, m, |i, j| entry(m + i, j));
        // The last entry of column j belongs to the vector that the image of basis vector j added
        // to the basis. Entries more than `below` rows below the diagonal are therefore zero.
        let below = self.columns.iter().enumerate().map(|(j, column)| column.len() - 1 - j);
        let below = below.max().unwrap_or(0);
        let mut modes: Vec<Candidate> = Vec::new();
        let mut known: Vec<(Complex<f64>, DVector<Complex<f64>>)> = Vec::new();
        for theta in largest_eigenvalues(&square, count.saturating_add(limits::SPARE_MODES))? {
            let coordinates =
                next_eigenvector(&square, below, theta, &known).ok_or_else(overflow)?;
            let missed = (remainder.map(Complex::from) * &coordinates).norm() / theta.norm();
            modes.extend(self.candidate(system, inverse, theta, &coordinates, missed));
            known.push((theta, coordinates));
        }
        Ok(modes)
    }

    /// Returns the mode for an eigenvalue of the operator and the eigenvector in the basis;
    /// `missed` is the relative residual of this eigenvector in the space.
    fn candidate(
        &self,
        system: &SparseSystem,
        inverse: &mut Inverse<'_>,
        theta: Complex<f64>,
        coordinates: &DVector<Complex<f64>>,
        missed: f64,
    ) -> Option<Candidate> {
        let n = system.dof();
        let mut z = DVector::<Complex<f64>>::zeros(2 * n);
        for (q, y) in self.basis.iter().zip(coordinates) {
            z.zip_apply(q, |z: &mut Complex<f64>, q| *z += y * q);
        }
        let mut shape = z.rows(0, n).into_owned();
        let about = shape.dotc(&z.rows(n, n)) * inverse.scale / shape.norm_squared();
        let mut value = inverse.eigenvalue(theta, about);
        let mut residual = residual_of(system, value, &shape);
        if missed <= limits::RITZ_RESIDUAL && residual > limits::MODE_RESIDUAL {
            // The rounding errors of the basis are relative to the largest eigenvalue of the
            // operator. One more product with the operator reduces the errors in the directions of
            // its smaller eigenvalues.
            let [re, im] = [z.map(|z| z.re), z.map(|z| z.im)].map(|part| inverse.apply(&part));
            shape = re.rows(0, n).zip_map(&im.rows(0, n), Complex::new);
            value -= newton_step(system, value, &shape);
            residual = residual_of(system, value, &shape);
        }
        let mode = SparseMode::new(Mode::new(value, &shape)?, system);
        let converged = missed <= limits::RITZ_RESIDUAL && residual <= limits::MODE_RESIDUAL;
        Some(Candidate { mode, converged })
    }
}

/// Returns up to `most` eigenvalues of the operator in the space, the largest first. A conjugate
/// pair counts once. Eigenvalues θ ≈ 0 are omitted, because they belong to infinite eigenvalues of
/// the system.
fn largest_eigenvalues(
    square: &DMatrix<f64>,
    most: usize,
) -> Result<Vec<Complex<f64>>, IntegrateError> {
    let mut thetas = RealSchur::new(square.clone())?.eigenvalues();
    thetas.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
    let largest = thetas.first().map_or(0.0, |theta| theta.norm());
    thetas
        .retain(|theta| theta.im >= 0.0 && theta.norm() > limits::NEGLIGIBLE_EIGENVALUE * largest);
    thetas.truncate(most);
    Ok(thetas)
}

/// Returns an eigenvector for `theta`. For a multiple eigenvalue, the vector is independent of the
/// `known` eigenvectors, if such a vector exists; `None` if numbers overflow.
fn next_eigenvector(
    square: &DMatrix<f64>,
    below: usize,
    theta: Complex<f64>,
    known: &[(Complex<f64>, DVector<Complex<f64>>)],
) -> Option<DVector<Complex<f64>>> {
    let same =
        |other: Complex<f64>| (other - theta).norm() <= limits::MULTIPLE_EIGENVALUE * theta.norm();
    let twins = || known.iter().filter(|(other, _)| same(*other));
    let number = twins().count();
    let coordinates = eigenvector(square, below, theta, number)?;
    let mut apart = coordinates.clone();
    for (_, twin) in twins() {
        let part = twin.dotc(&apart);
        apart.axpy(-part, twin, Complex::from(1.0));
    }
    let is_independent = number > 0 && apart.norm() > limits::INDEPENDENT_EIGENVECTOR;
    Some(if is_independent { apart.normalize() } else { coordinates })
}

/// Returns ‖(λ²M + λC + K) φ‖ relative to the size of its terms.
pub(super) fn residual_of(
    system: &SparseSystem,
    value: Complex<f64>,
    shape: &DVector<Complex<f64>>,
) -> f64 {
    let mut sum = DVector::<Complex<f64>>::zeros(shape.len());
    let mut size = 0.0;
    let factors = [value * value, value, Complex::from(1.0)];
    for (which, factor) in Matrix::ALL.into_iter().zip(factors) {
        let matrix = system.matrix(which);
        size += factor.norm() * largest_row(matrix);
        for (i, j, entry) in matrix.triplet_iter() {
            sum[i] += factor * shape[j] * *entry;
        }
    }
    sum.camax() / (size * shape.camax())
}

/// Returns φᴴQφ / φᴴQ′φ with Q(λ) = λ²M + λC + K, the Newton step of λ for the shape φ; zero if the
/// denominator vanishes.
fn newton_step(
    system: &SparseSystem,
    value: Complex<f64>,
    shape: &DVector<Complex<f64>>,
) -> Complex<f64> {
    let [m, c, k] = Matrix::ALL.map(|which| {
        let entries = system.matrix(which).triplet_iter();
        entries.map(|(i, j, entry)| shape[i].conj() * shape[j] * *entry).sum::<Complex<f64>>()
    });
    let step = (value * (value * m + c) + k) / (value * m * 2.0 + c);
    if step.re.is_finite() && step.im.is_finite() { step } else { Complex::ZERO }
}
