//! Some modes of a sparse system, by Arnoldi's iteration with shift and invert.

use mechid_model::{EIGENVALUE_ROUNDING, Matrix, Mode, RealSchur, SparseSystem};
use nalgebra::{Complex, ComplexField as _, DMatrix, DVector};
use nalgebra_sparse::coo::CooMatrix;
use nalgebra_sparse::csc::CscMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::IntegrateError;
use crate::sparse::{GeneralLu, NotFactored, SparseLu, combination};
use crate::stability::krylov::{eigenvector, scattered_number};

/// The modes of a sparse system that [`sparse_modes`] looks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSearch {
    /// Modes of the lowest natural frequencies |λ|.
    Lowest,
    /// Modes whose eigenvalues λ lie nearest to iω, with a positive ω in rad/s.
    NearOmega(f64),
}

/// A mode of a sparse system, and how well it meets the equation.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMode {
    /// The mode.
    pub mode: Mode,
    /// ‖(λ²M + λC + K) φ‖ / (|λ|²‖M‖ + |λ|‖C‖ + ‖K‖)‖φ‖ in the norm of the largest entry (pure number).
    pub residual: f64,
    /// `true` for a motion without restoring force: the eigenvalue is zero to rounding.
    pub is_rigid_body: bool,
}

/// Number of vectors that the iteration starts from: modes that share an eigenvalue, such as those of a
/// symmetric rotor in its two planes, are found up to this number.
const START_VECTORS: usize = 4;

/// Steps by which the lowest natural frequency is guessed.
const LOWEST_STEPS: usize = 3;

/// Largest part of itself by which an eigenvalue of the inverted operator may miss its equation.
const CONVERGED: f64 = 1e-8;

/// Eigenvalues of the inverted operator below this part of the largest count as zero.
const NEGLIGIBLE: f64 = 1e-14;

/// Largest part of a shift that is imaginary of one that is taken as real.
const NEARLY_REAL: f64 = 1e-6;

/// Difference of two such eigenvalues, relative to their modulus, that rounding makes of one.
const TWINS: f64 = 1e-9;

/// Number of modes looked at beyond those wanted: the order of the operator's eigenvalues is not quite
/// that of the search.
const SPARE_MODES: usize = 8;

/// Largest residual of a mode that is returned.
const RESIDUAL: f64 = 1e-12;

/// Largest number of shifts: modes that lie close together and far from the shift of one are found from
/// another among them.
const SHIFTS: usize = 8;

/// Part of an eigenvalue by which a shift misses the one it was moved to: the matrix is not to be singular.
const OFFSET: f64 = 1e-6;

/// Difference of two converged eigenvalues, relative to their modulus, that makes one of those found from two
/// shifts.
const SAME: f64 = 3e-8;

/// Largest residual of a mode that a shift is moved to: others need not be near any.
const ROUGH: f64 = 1e-2;

/// Returns `count` modes of a system, those searched for that come first; fewer if it has no more.
///
/// ```
/// use mechid_integrate::{ModeSearch, sparse_modes};
/// use mechid_model::{SparseSystem, band};
///
/// // A chain of 10,000 masses between walls: ω = 2 √(k/m) sin(π / 2(n + 1)).
/// let n = 10_000;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// let chain = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[]), stiffness)?;
/// let found = sparse_modes(&chain, ModeSearch::Lowest, 2)?;
/// let omega = 60.0 * (std::f64::consts::PI / (2.0 * (n + 1) as f64)).sin();
/// assert!((found[0].mode.natural_frequency() / omega - 1.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The matrix K + σC + σ²M is factored with σ = 0 or a small negative number where K is singular, or σ = iω;
/// a subspace grows until the modes are exact to rounding, to 20 vectors for each and 100 at most. Where they
/// lie too close together for that, such as above the floor that springs to ground give a spectrum, σ moves
/// to the first of them and the search begins again, from eight shifts at most.
/// Modes of one eigenvalue are found up to four.
///
/// # Errors
/// [`IntegrateError::SearchFrequency`] for an ω that is not positive and finite, [`IntegrateError::SingularShift`]
/// if the matrix is singular, [`IntegrateError::FactorsTooLarge`], [`IntegrateError::ModesNotConverged`].
///
/// # Source
/// Bai, Demmel, Dongarra, Ruhe and van der Vorst, *Templates for the Solution of Algebraic Eigenvalue
/// Problems* (2000), sections 3.3 and 9.2; Parlett and Saad (1987), Linear Algebra Appl. 88/89, 575–595, for
/// complex shifts in real arithmetic; Ruhe (1979), Math. Comp. 33, 680–687, for several start vectors.
pub fn sparse_modes(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let len = 2 * system.dof();
    if count == 0 {
        return Ok(Vec::new());
    }
    let mut inverse = Inverse::of(system, search)?;
    let most = len.min(20 * count + 200);
    let (mut known, mut best) = (Vec::new(), 0);
    for shift in 0..SHIFTS {
        let mut space = Space::of(len);
        let mut target = len.min(2 * count + 20);
        let (found, reach, usable) = loop {
            while space.products < target {
                space.grow(&mut inverse);
            }
            let own = space.modes(system, &inverse, count)?;
            let reach = Reach::of(&own, inverse.shift);
            let exhausted = shift > 0 && own.iter().all(|found| found.converged);
            let found = joined(own, &known, search);
            // All modes of a system that has no more.
            let complete = space.products == len;
            let usable = found.iter().take(count).filter(|found| found.converged).count();
            let enough = usable == count
                && (shift == 0 || complete || reach.covers(&found[..count], search));
            if enough || (complete && usable == found.len()) {
                let found = found.into_iter().take(count);
                return Ok(found.map(|found| found.mode).collect());
            }
            best = best.max(usable);
            // A space that has found next to nothing halfway is better begun again elsewhere, and so is one
            // that has found all it looks at, too far away.
            let stalled = most < len && 2 * target >= most && 4 * usable < count;
            if target == most || stalled || exhausted {
                break (found, reach, usable);
            }
            target = most.min(target + (target / 4).max(10));
        };
        let Some(next) = next_shift(&found, &reach, search, usable == count) else { break };
        // Complex factors need twice the memory: without them the search ends here.
        let Ok(moved) = Inverse::near(system, next) else { break };
        inverse = moved;
        known = found.into_iter().filter(|found| found.converged).collect();
    }
    Err(IntegrateError::ModesNotConverged { wanted: count, found: best, vectors: most })
}

impl ModeSearch {
    /// What the search puts eigenvalues in order by.
    fn distance(self, value: Complex<f64>) -> f64 {
        match self {
            Self::Lowest => value.norm(),
            Self::NearOmega(omega) => (value - Complex::new(0.0, omega)).norm(),
        }
    }
}

/// How far about a shift all modes have converged.
struct Reach {
    shift: Complex<f64>,
    /// Distance from the shift (rad/s).
    radius: f64,
}

impl Reach {
    fn of(found: &[Found], shift: Complex<f64>) -> Self {
        let mut distances: Vec<(f64, bool)> =
            found.iter().map(|f| ((f.value() - shift).norm(), f.converged)).collect();
        distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        let converged = distances.iter().take_while(|(_, converged)| *converged);
        Self { shift, radius: converged.last().map_or(0.0, |(distance, _)| *distance) }
    }

    /// The first of the modes within it: those beyond were found from another shift.
    fn first(&self, modes: &[Found]) -> Option<Complex<f64>> {
        let within = |value: &Complex<f64>| (value - self.shift).norm() <= self.radius;
        modes.iter().map(Found::value).find(within)
    }

    /// Returns whether the first of the modes in the order of the search can be told from the edge of what
    /// has converged, beyond which others may come before them.
    fn covers(&self, modes: &[Found], search: ModeSearch) -> bool {
        let (Some(first), Some(last)) = (self.first(modes), modes.last()) else { return true };
        let last = last.value();
        let gap = (first - self.shift).norm();
        match search {
            ModeSearch::Lowest => {
                search.distance(first) >= search.distance(self.shift) || gap <= 0.5 * self.radius
            }
            // On the other side of the first there may be as many as on that of the last.
            ModeSearch::NearOmega(_) => {
                gap + (last - first).norm() <= self.radius * (1.0 + SAME) + gap * SAME
            }
        }
    }
}

/// The modes found from this shift and, of those known from others, which it has not found again, in the order
/// of the search.
fn joined(own: Vec<Found>, known: &[Found], search: ModeSearch) -> Vec<Found> {
    let same = |one: &Found, other: &Found| {
        let gap = (one.value() - other.value()).norm();
        gap <= SAME * other.value().norm() || (one.mode.is_rigid_body && other.mode.is_rigid_body)
    };
    let again = |other: &&Found| own.iter().any(|one| one.converged && same(one, other));
    let others: Vec<Found> = known.iter().filter(|other| !again(other)).cloned().collect();
    let mut found = own;
    found.extend(others);
    found.sort_by(|a, b| search.distance(a.value()).total_cmp(&search.distance(b.value())));
    found
}

/// The next shift after one from which the modes wanted have not all converged, or `all_converged` do not
/// reach far enough.
fn next_shift(
    found: &[Found],
    reach: &Reach,
    search: ModeSearch,
    all_converged: bool,
) -> Option<Complex<f64>> {
    if !all_converged {
        let open = || found.iter().filter(|found| !found.converged && !found.mode.is_rigid_body);
        let rough = open().find(|found| found.mode.residual <= ROUGH);
        return rough.or_else(|| open().next()).map(|found| found.value() * (1.0 - OFFSET));
    }
    let first = reach.first(found)?;
    match search {
        // The floor may lie well beyond it.
        ModeSearch::Lowest => Some(first + (first - reach.shift) * 3.0),
        ModeSearch::NearOmega(_) => Some(first * (1.0 - OFFSET)),
    }
}

/// x ↦ Re (A − σB)⁻¹B x for the first-order form A z = λ B z of the equation of motion, z = [φ; λφ / s].
struct Inverse<'a> {
    system: &'a SparseSystem,
    shift: Complex<f64>,
    /// s, a frequency (rad/s) of the modes searched for: both halves of their z are then of one size.
    scale: f64,
    factors: Factors,
}

/// Factors of Q = K + σC + σ²M.
enum Factors {
    Real(SparseLu),
    Complex(Box<GeneralLu<Complex<f64>>>),
}

impl<'a> Inverse<'a> {
    fn of(system: &'a SparseSystem, search: ModeSearch) -> Result<Self, IntegrateError> {
        match search {
            ModeSearch::Lowest => {
                Self::real(system, 0.0).or_else(|error: IntegrateError| {
                    if !matches!(error, IntegrateError::SingularShift { .. }) {
                        return Err(error);
                    }
                    // A machine that is free to drift.
                    let omega = match fastest(system) {
                        0.0 => 1.0,
                        omega => omega,
                    };
                    Self::real(system, -1e-3 * omega)
                })
            }
            ModeSearch::NearOmega(omega) if omega > 0.0 && omega.is_finite() => {
                Self::complex(system, Complex::new(0.0, omega))
            }
            ModeSearch::NearOmega(omega) => Err(IntegrateError::SearchFrequency { omega }),
        }
    }

    /// With a shift anywhere.
    fn near(system: &'a SparseSystem, shift: Complex<f64>) -> Result<Self, IntegrateError> {
        if shift.im.abs() > NEARLY_REAL * shift.norm() {
            Self::complex(system, shift)
        } else {
            Self::real(system, shift.re)
        }
    }

    fn real(system: &'a SparseSystem, shift: f64) -> Result<Self, IntegrateError> {
        let (matrix, sizes) = real_part(system, shift.into());
        let factors = SparseLu::new(&matrix, &sizes, system.factor_limit())
            .map_err(|error| singular(system, shift.into(), error))?;
        let factors = Factors::Real(factors);
        let mut inverse = Self { system, shift: shift.into(), scale: shift.abs(), factors };
        if shift == 0.0 {
            inverse.scale = inverse.lowest();
        }
        Ok(inverse)
    }

    fn complex(system: &'a SparseSystem, shift: Complex<f64>) -> Result<Self, IntegrateError> {
        let (matrix, sizes) = dynamic_stiffness(system, shift);
        let factors = GeneralLu::new(matrix, &sizes, system.factor_limit())
            .map_err(|error| singular(system, shift, error))?;
        let factors = Factors::Complex(Box::new(factors));
        Ok(Self { system, shift, scale: shift.norm(), factors })
    }

    /// Roughly the lowest natural frequency (rad/s) without damping, by steps of x ← K⁻¹M x.
    fn lowest(&mut self) -> f64 {
        let n = self.system.dof();
        let Factors::Real(factors) = &mut self.factors else { return 1.0 };
        let mut x = scattered_number(n, 0);
        let mut growth = 1.0;
        for _ in 0..LOWEST_STEPS {
            let mut next = vec![0.0; n];
            subtract(self.system.matrix(Matrix::Mass), x.as_slice(), 1.0, &mut next);
            factors.solve(&mut next);
            let next = DVector::from_vec(next);
            growth = next.norm();
            if !(growth > 0.0 && growth.is_finite()) {
                return 1.0;
            }
            x = next / growth;
        }
        growth.sqrt().recip()
    }

    /// With Q y = −(M v + (C + σM) x), w = x + σ y: the real parts of y and w, v and w in units of s.
    fn apply(&mut self, z: &DVector<f64>) -> DVector<f64> {
        let n = self.system.dof();
        let (x, v) = z.as_slice().split_at(n);
        let mut right = vec![0.0; n];
        subtract(self.system.matrix(Matrix::Mass), v, self.scale, &mut right);
        subtract(self.system.matrix(Matrix::Damping), x, 1.0, &mut right);
        subtract(self.system.matrix(Matrix::Mass), x, self.shift.re, &mut right);
        let mut image = DVector::zeros(2 * n);
        match &mut self.factors {
            Factors::Real(factors) => {
                factors.solve(&mut right);
                for (i, y) in right.iter().enumerate() {
                    (image[i], image[n + i]) = (*y, (x[i] + self.shift.re * y) / self.scale);
                }
            }
            Factors::Complex(factors) => {
                let mut imaginary = vec![0.0; n];
                subtract(self.system.matrix(Matrix::Mass), x, self.shift.im, &mut imaginary);
                let parts = right.iter().zip(&imaginary);
                let mut y: Vec<_> = parts.map(|(re, im)| Complex::new(*re, *im)).collect();
                factors.solve(&mut y);
                for (i, y) in y.iter().enumerate() {
                    (image[i], image[n + i]) = (y.re, (x[i] + (self.shift * y).re) / self.scale);
                }
            }
        }
        image
    }

    /// The eigenvalue of the system that belongs to `theta` of the operator: of two the nearer one to
    /// `about`.
    fn eigenvalue(&self, theta: Complex<f64>, about: Complex<f64>) -> Complex<f64> {
        let omega = self.shift.im;
        if omega == 0.0 {
            return self.shift + theta.inv();
        }
        // θ = μ / (μ² + ω²), with λ = μ + Re σ and ω = Im σ.
        let root = (Complex::from(1.0) - theta * theta * (4.0 * omega * omega)).sqrt();
        let pair = [1.0, -1.0].map(|sign| (root * sign + 1.0) / (theta * 2.0) + self.shift.re);
        if (pair[0] - about).norm() < (pair[1] - about).norm() { pair[0] } else { pair[1] }
    }
}

fn singular(system: &SparseSystem, shift: Complex<f64>, error: NotFactored) -> IntegrateError {
    let dof = system.dof();
    error.or_singular(dof, |smallest| IntegrateError::SingularShift {
        omega: shift.im,
        smallest,
        dof,
    })
}

/// y ← y − scale · A x.
fn subtract(matrix: &CsrMatrix<f64>, x: &[f64], scale: f64, y: &mut [f64]) {
    if scale == 0.0 {
        return;
    }
    for (y, row) in y.iter_mut().zip(matrix.row_iter()) {
        let sum: f64 = row.col_indices().iter().zip(row.values()).map(|(j, a)| a * x[*j]).sum();
        *y -= scale * sum;
    }
}

/// The real part of K + σC + σ²M, and the sizes of the sums' terms row by row.
fn real_part(system: &SparseSystem, shift: Complex<f64>) -> (CsrMatrix<f64>, Vec<f64>) {
    combination(&[
        (1.0, system.matrix(Matrix::Stiffness)),
        (shift.re, system.matrix(Matrix::Damping)),
        ((shift * shift).re, system.matrix(Matrix::Mass)),
    ])
}

/// K + σC + σ²M, and the sizes of the sums' terms row by row.
fn dynamic_stiffness(
    system: &SparseSystem,
    shift: Complex<f64>,
) -> (CscMatrix<Complex<f64>>, Vec<f64>) {
    let (real, sizes) = real_part(system, shift);
    let (imaginary, more) = combination(&[
        (shift.im, system.matrix(Matrix::Damping)),
        ((shift * shift).im, system.matrix(Matrix::Mass)),
    ]);
    let n = system.dof();
    let mut sum = CooMatrix::new(n, n);
    real.triplet_iter().for_each(|(i, j, v)| sum.push(i, j, Complex::new(*v, 0.0)));
    imaginary.triplet_iter().for_each(|(i, j, v)| sum.push(i, j, Complex::new(0.0, *v)));
    (CscMatrix::from(&sum), sizes.iter().zip(&more).map(|(a, b)| a + b).collect())
}

/// √(‖K‖ / ‖M‖) (rad/s), the size of the highest natural frequency.
fn fastest(system: &SparseSystem) -> f64 {
    let [mass, stiffness] =
        [Matrix::Mass, Matrix::Stiffness].map(|which| largest_row(system.matrix(which)));
    (stiffness / mass).sqrt()
}

/// Largest sum of moduli of a row.
fn largest_row(matrix: &CsrMatrix<f64>) -> f64 {
    let sums = matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum());
    sums.fold(0.0, f64::max)
}

/// An orthonormal basis of the vectors reached so far, and the operator in it.
struct Space {
    basis: Vec<DVector<f64>>,
    /// Column j: products of the operator's j-th image with the basis.
    columns: Vec<Vec<f64>>,
    /// Number of images.
    products: usize,
    /// Number of vectors without structure that were added.
    added: usize,
}

impl Space {
    fn of(len: usize) -> Self {
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
    fn grow(&mut self, inverse: &mut Inverse<'_>) {
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
    fn modes(
        &self,
        system: &SparseSystem,
        inverse: &Inverse<'_>,
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
        let mut thetas = RealSchur::new(square.clone())?.eigenvalues();
        thetas.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        let largest = thetas.first().map_or(0.0, |theta| theta.norm());
        // Of zero θ the eigenvalue is infinite; a conjugate pair has one mode. The largest come first.
        thetas.retain(|theta| theta.im >= 0.0 && theta.norm() > NEGLIGIBLE * largest);
        thetas.truncate(count + SPARE_MODES);
        let mut found: Vec<Found> = Vec::new();
        let mut known: Vec<(Complex<f64>, DVector<Complex<f64>>)> = Vec::new();
        for theta in thetas {
            let twins = || known.iter().filter(|(t, _)| (t - theta).norm() <= TWINS * theta.norm());
            let number = twins().count();
            let Some(mut coordinates) = eigenvector(&square, theta, number) else {
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
            let shape = z.rows(0, n).into_owned();
            let about = shape.dotc(&z.rows(n, n)) * inverse.scale / shape.norm_squared();
            let value = inverse.eigenvalue(theta, about);
            let Some(mode) = Mode::new(value, &shape) else { continue };
            let residual = residual(system, value, &shape);
            let is_rigid_body = value.norm() <= EIGENVALUE_ROUNDING * fastest(system);
            let mode = SparseMode { mode, residual, is_rigid_body };
            found.push(Found { mode, converged: missed <= CONVERGED && residual <= RESIDUAL });
        }
        Ok(found)
    }
}

#[derive(Clone)]
struct Found {
    mode: SparseMode,
    converged: bool,
}

impl Found {
    fn value(&self) -> Complex<f64> {
        self.mode.mode.eigenvalue()
    }
}

/// ‖(λ²M + λC + K) φ‖ relative to the size of its terms.
fn residual(system: &SparseSystem, value: Complex<f64>, shape: &DVector<Complex<f64>>) -> f64 {
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
