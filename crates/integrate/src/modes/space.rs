//! The subspace that the iteration spans, and the modes in it.

use mechid_model::{Matrix, Mode, SparseSystem};
use mechid_numerics::RealSchur;
use nalgebra::{Complex, DMatrix, DVector};

use super::inverse::{Inverse, largest_row};
use super::{Found, SparseMode};
use crate::IntegrateError;
use crate::stability::krylov::{eigenvector, scattered_number};

/// Number of vectors that the iteration starts from: modes that share an eigenvalue, such as those of a
/// symmetric rotor in its two planes, are found up to this number.
const START_VECTORS: usize = 4;

/// Largest part of itself by which an eigenvalue of the inverted operator may miss its equation.
const CONVERGED: f64 = 1e-8;

/// Eigenvalues of the inverted operator below this part of the largest count as zero.
const NEGLIGIBLE: f64 = 1e-14;

/// Difference of two such eigenvalues, relative to their modulus, that rounding makes of one.
const TWINS: f64 = 1e-9;

/// Number of modes looked at beyond those wanted: the order of the operator's eigenvalues is not quite
/// that of the search.
const SPARE_MODES: usize = 8;

/// Largest residual of a mode that is returned.
const RESIDUAL: f64 = 1e-12;

/// An orthonormal basis of the vectors reached so far, and the operator in it.
pub(super) struct Space {
    basis: Vec<DVector<f64>>,
    /// Column j: products of the operator's j-th image with the basis.
    columns: Vec<Vec<f64>>,
    /// Number of images.
    pub(super) products: usize,
    /// Number of vectors without structure that were added.
    added: usize,
}

impl Space {
    pub(super) fn of(len: usize) -> Self {
        let mut space = Self { basis: vec![], columns: vec![], products: 0, added: 0 };
        (0..START_VECTORS.min(len)).for_each(|_| space.add(len));
        space
    }

    /// Adds a vector without structure, if there is a direction left.
    fn add(&mut self, len: usize) {
        while self.basis.len() < len && self.added < 10 * len {
            let mut vector = scattered_number(len, self.added);
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

    /// Takes the parts along the basis out of `vector`; returns them.
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

    /// Approximate modes, each with whether it has converged.
    pub(super) fn modes(
        &self,
        system: &SparseSystem,
        inverse: &mut Inverse<'_>,
        count: usize,
    ) -> Result<Vec<Found>, IntegrateError> {
        let (m, n) = (self.products, system.dof());
        let overflow = || IntegrateError::ModesOverflow { vectors: m };
        let entry = |i: usize, j: usize| self.columns[j].get(i).copied().unwrap_or(0.0);
        let square = DMatrix::from_fn(m, m, entry);
        if square.iter().any(|v| !v.is_finite()) {
            return Err(overflow());
        }
        let rest = DMatrix::from_fn(self.basis.len() - m, m, |i, j| entry(m + i, j));
        // Column j ends with the vector that its image added.
        let below = self.columns.iter().enumerate().map(|(j, column)| column.len() - 1 - j);
        let below = below.max().unwrap_or(0);
        let mut thetas = RealSchur::new(square.clone())?.eigenvalues();
        thetas.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        let largest = thetas.first().map_or(0.0, |theta| theta.norm());
        // Of zero θ the eigenvalue is infinite; a conjugate pair has one mode. The largest come first.
        thetas.retain(|theta| theta.im >= 0.0 && theta.norm() > NEGLIGIBLE * largest);
        thetas.truncate(count.saturating_add(SPARE_MODES));
        let mut found: Vec<Found> = Vec::new();
        let mut known: Vec<(Complex<f64>, DVector<Complex<f64>>)> = Vec::new();
        for theta in thetas {
            let twins = || known.iter().filter(|(t, _)| (t - theta).norm() <= TWINS * theta.norm());
            let number = twins().count();
            let Some(mut coordinates) = eigenvector(&square, below, theta, number) else {
                return Err(overflow());
            };
            // Those of one eigenvalue may be any vectors of their space: independent ones, if it has them.
            let mut apart = coordinates.clone();
            for (_, twin) in twins() {
                let part = twin.dotc(&apart);
                apart.axpy(-part, twin, Complex::from(1.0));
            }
            if number > 0 && apart.norm() > 1e-6 {
                coordinates = apart.normalize();
            }
            known.push((theta, coordinates.clone()));
            let missed = (rest.map(Complex::from) * &coordinates).norm() / theta.norm();
            let mut z = DVector::<Complex<f64>>::zeros(2 * n);
            for (q, y) in self.basis.iter().zip(&coordinates) {
                z.zip_apply(q, |z: &mut Complex<f64>, q| *z += y * q);
            }
            let mut shape = z.rows(0, n).into_owned();
            let about = shape.dotc(&z.rows(n, n)) * inverse.scale / shape.norm_squared();
            let mut value = inverse.eigenvalue(theta, about);
            let mut residual = residual_of(system, value, &shape);
            if missed <= CONVERGED && residual > RESIDUAL {
                // Rounding of the space is of the size of its largest θ; one more product leaves the less of
                // it in the directions of smaller θ.
                let [re, im] = [z.map(|z| z.re), z.map(|z| z.im)].map(|part| inverse.apply(&part));
                shape = re.rows(0, n).zip_map(&im.rows(0, n), Complex::new);
                value -= newton_step(system, value, &shape);
                residual = residual_of(system, value, &shape);
            }
            let Some(mode) = Mode::new(value, &shape) else { continue };
            let mode = SparseMode::of(mode, system);
            found.push(Found { mode, converged: missed <= CONVERGED && residual <= RESIDUAL });
        }
        Ok(found)
    }
}

/// ‖(λ²M + λC + K) φ‖ relative to the size of its terms.
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

/// φᴴQφ / φᴴQ′φ of Q(λ) = λ²M + λC + K, by which λ misses the one that suits φ best; zero where the latter
/// vanishes.
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
