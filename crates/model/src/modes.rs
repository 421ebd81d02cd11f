//! Eigenvalues and complex mode shapes of a system with any damping.

use mechid_numerics::RealSchur;
use mechid_signal::message;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector};

use crate::limits;
use crate::{ModelError, SecondOrderSystem};

/// Maximum ratio of the modulus of an eigenvalue to the largest modulus, for which the eigenvalue
/// may be a double zero (rigid-body mode) with rounding errors: about √ε (pure number).
pub const EIGENVALUE_ROUNDING: f64 = 1e-7;

/// Mode x(t) = φ exp(λt): an eigenvalue λ and its shape φ.
///
/// # Source
/// Meirovitch (1975); Dissertation, Appendix E.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    eigenvalue: Complex<f64>,
    shape: DVector<Complex<f64>>,
}

impl Mode {
    /// Creates a mode from λ (rad/s) and any multiple of its shape, one entry per degree of
    /// freedom; of a conjugate pair, either eigenvalue can be given. `None` if a number is not
    /// finite or the shape is zero.
    pub fn new(eigenvalue: Complex<f64>, shape: &DVector<Complex<f64>>) -> Option<Self> {
        let largest = largest_entry(shape);
        let finite = |z: &Complex<f64>| z.re.is_finite() && z.im.is_finite();
        let sound = finite(&eigenvalue) && largest.norm() > 0.0;
        let shape = shape / largest;
        let (eigenvalue, shape) = if eigenvalue.im < 0.0 {
            (eigenvalue.conj(), shape.conjugate())
        } else {
            (eigenvalue, shape)
        };
        (sound && shape.iter().all(finite)).then_some(Self { eigenvalue, shape })
    }

    /// Eigenvalue λ, in rad/s, with Im λ ≥ 0; the conjugate eigenvalue belongs to the conjugate
    /// shape.
    pub fn eigenvalue(&self) -> Complex<f64> {
        self.eigenvalue
    }

    /// Mode shape φ, one entry per degree of freedom, dimensionless, scaled so that its largest
    /// entry is 1.
    pub fn shape(&self) -> &DVector<Complex<f64>> {
        &self.shape
    }

    /// Natural frequency |λ|, in rad/s.
    pub fn natural_frequency(&self) -> f64 {
        self.eigenvalue.norm()
    }

    /// Damped frequency Im λ, in rad/s; 0 for a mode that does not oscillate.
    pub fn damped_frequency(&self) -> f64 {
        self.eigenvalue.im
    }

    /// Damped frequency Im λ / 2π, in Hz.
    pub fn damped_frequency_hz(&self) -> f64 {
        self.eigenvalue.im / std::f64::consts::TAU
    }

    /// Damping ratio −Re λ / |λ|: negative if unstable, ±1 for a real eigenvalue, 0 for a zero
    /// eigenvalue.
    pub fn damping_ratio(&self) -> f64 {
        match self.natural_frequency() {
            0.0 => 0.0,
            modulus => -self.eigenvalue.re / modulus,
        }
    }

    /// Returns whether the eigenvalue has an imaginary part.
    pub fn oscillates(&self) -> bool {
        self.eigenvalue.im > 0.0
    }
}

fn largest_entry(shape: &DVector<Complex<f64>>) -> Complex<f64> {
    shape.iter().fold(Complex::from(0.0), |largest: Complex<f64>, z| {
        if z.norm_sqr() > largest.norm_sqr() { *z } else { largest }
    })
}

/// Free response that grows as exp(λt), with Re λ > 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instability {
    eigenvalue: Complex<f64>,
}

impl Instability {
    /// Eigenvalue λ, in rad/s, with Im λ ≥ 0.
    pub fn eigenvalue(&self) -> Complex<f64> {
        self.eigenvalue
    }

    /// Growth rate Re λ, in 1/s.
    pub fn growth_rate(&self) -> f64 {
        self.eigenvalue.re
    }

    /// Frequency Im λ / 2π, in Hz; 0 for a growth without oscillation.
    pub fn frequency_hz(&self) -> f64 {
        self.eigenvalue.im / std::f64::consts::TAU
    }

    /// Time in which the amplitude doubles, ln 2 / Re λ, in s.
    pub fn doubling_time(&self) -> f64 {
        std::f64::consts::LN_2 / self.eigenvalue.re
    }
}

impl std::fmt::Display for Instability {
    /// Writes `pole 0.1 ± 6.28i rad/s: the free response at 1 Hz grows at 0.1 1/s and doubles every
    /// 6.93 s`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = |value: f64| format!("{}", message::number(rounded(value)));
        write!(f, "pole {}", number(self.eigenvalue.re))?;
        if self.eigenvalue.im > 0.0 {
            write!(f, " ± {}i", number(self.eigenvalue.im))?;
        }
        f.write_str(" rad/s: the free response ")?;
        if self.eigenvalue.im > 0.0 {
            write!(f, "at {} Hz ", number(self.frequency_hz()))?;
        }
        write!(
            f,
            "grows at {} 1/s and doubles every {} s",
            number(self.growth_rate()),
            number(self.doubling_time())
        )
    }
}

/// Rounds a positive number to four significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

impl SecondOrderSystem {
    /// Returns A of the first-order form ż = A z + [0; M⁻¹] F with z = [x; ẋ], 2n×2n.
    ///
    /// ```text
    /// A = ┌    0        I   ┐
    ///     └ −M⁻¹K    −M⁻¹C  ┘
    /// ```
    ///
    /// # Source
    /// Dissertation eqs. (4.5.8) and (4.5.26); there the order of the states is x, ẋ, y, ẏ.
    pub fn state_matrix(&self) -> DMatrix<f64> {
        let n = self.dof();
        let mass = self.mass().clone().lu();
        let solve = |b: &DMatrix<f64>| mass.solve(b).expect("the constructor checked M");
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        a.view_mut((0, n), (n, n)).fill_with_identity();
        a.view_mut((n, 0), (n, n)).copy_from(&-solve(self.stiffness()));
        a.view_mut((n, n), (n, n)).copy_from(&-solve(self.damping()));
        a
    }

    /// Computes all 2n eigenvalues (rad/s), sorted by modulus; in a conjugate pair the one with Im
    /// λ > 0 comes first.
    ///
    /// # Errors
    /// [`ModelError::ModesNotConverged`] if the QR iteration does not converge,
    /// [`ModelError::StateMatrixOverflow`] if M⁻¹K or M⁻¹C exceeds 1e150.
    pub fn eigenvalues(&self) -> Result<Vec<Complex<f64>>, ModelError> {
        Ok(self.decomposition()?.eigenvalues())
    }

    fn decomposition(&self) -> Result<Decomposition, ModelError> {
        let mut a = self.state_matrix();
        // Balancing squares the entries, and does not terminate if a square overflows.
        let largest = a.iter().map(|v| v.abs()).fold(0.0, f64::max);
        if largest > 1e150 || a.iter().any(|v| v.is_nan()) {
            return Err(ModelError::StateMatrixOverflow { largest });
        }
        // Displacements and velocities differ by a factor ω; the matrix is therefore balanced
        // before the QR iteration.
        let balance = balance_parlett_reinsch(&mut a);
        let schur =
            RealSchur::new(a).map_err(|_| ModelError::ModesNotConverged { dof: self.dof() })?;
        Ok(Decomposition { size: schur.t.norm(), balance, schur })
    }

    /// Returns the fastest growing free response; `None` if all free responses decay or keep their
    /// amplitude.
    ///
    /// A growth rate of at most [`EIGENVALUE_ROUNDING`] times the largest |λ| counts as rounding.
    ///
    /// # Errors
    /// As [`eigenvalues`](Self::eigenvalues).
    pub fn instability(&self) -> Result<Option<Instability>, ModelError> {
        let eigenvalues = self.eigenvalues()?;
        let largest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
        let fastest = eigenvalues.into_iter().max_by(|p, q| p.re.total_cmp(&q.re));
        let unstable = fastest.filter(|l| l.re > EIGENVALUE_ROUNDING * largest);
        // The search may return either eigenvalue of a conjugate pair; the result is the one with
        // Im λ ≥ 0.
        Ok(unstable.map(|l| Instability { eigenvalue: Complex::new(l.re, l.im.abs()) }))
    }

    /// Computes the modes in ascending order of natural frequency: one for each conjugate pair, one
    /// for each real eigenvalue.
    ///
    /// A system of n degrees of freedom has n modes if all of them oscillate, otherwise up to 2n.
    /// If a repeated eigenvalue has enough independent shapes, the shapes are made orthogonal and
    /// then scaled. If it has fewer shapes (a defective eigenvalue, as in critical damping), a
    /// shape is repeated. Rounding splits a defective pair by about √ε: a rigid-body mode has |λ|
    /// of about 1e-7 rad/s instead of 0.
    ///
    /// The shapes come from the same Schur form as the eigenvalues, at a cost of O(n²) each; if
    /// only frequencies and damping are needed, [`eigenvalues`](Self::eigenvalues) is a little
    /// faster.
    ///
    /// # Errors
    /// As [`eigenvalues`](Self::eigenvalues).
    ///
    /// # Source
    /// Meirovitch (1975), the state form of a damped system; Dissertation, Appendix E. Golub & Van
    /// Loan, *Matrix Computations*, 4th ed. (2013), section 7.6.1, for inverse iteration.
    pub fn modes(&self) -> Result<Vec<Mode>, ModelError> {
        let decomposition = self.decomposition()?;
        let mut modes: Vec<Mode> = Vec::with_capacity(self.dof());
        for eigenvalue in decomposition.eigenvalues().into_iter().filter(|l| l.im >= 0.0) {
            let near = |m: &&Mode| {
                (m.eigenvalue - eigenvalue).norm()
                    <= limits::MULTIPLE_EIGENVALUE * eigenvalue.norm()
            };
            let twins: Vec<&Mode> = modes.iter().filter(near).collect();
            let shape = decomposition.shape(eigenvalue, twins.len());
            let mut apart = shape.clone();
            // A second pass of Gram–Schmidt over the same shapes removes the rounding errors of the
            // first pass.
            for twin in twins.iter().chain(&twins) {
                let along = twin.shape.dotc(&apart) / Complex::from(twin.shape.norm_squared());
                apart.axpy(-along, &twin.shape, Complex::from(1.0));
            }
            let independent = apart.norm() > limits::INDEPENDENT_SHAPE * shape.norm();
            let shape = if independent { apart } else { shape };
            let shape = &shape / largest_entry(&shape);
            modes.push(Mode { eigenvalue, shape });
        }
        Ok(modes)
    }
}

/// Decomposition B⁻¹A B = Q T Qᵀ of the state matrix A, with diagonal B.
struct Decomposition {
    /// Diagonal of B.
    balance: DVector<f64>,
    schur: RealSchur,
    /// Norm of T.
    size: f64,
}

impl Decomposition {
    /// Returns the eigenvalues, sorted by modulus; in a conjugate pair the one with Im λ > 0 comes
    /// first.
    fn eigenvalues(&self) -> Vec<Complex<f64>> {
        let mut eigenvalues = self.schur.eigenvalues();
        eigenvalues.sort_by(|p, q| {
            p.norm().total_cmp(&q.norm()).then(p.re.total_cmp(&q.re)).then(q.im.total_cmp(&p.im))
        });
        eigenvalues
    }

    /// Returns a shape φ for the eigenvalue λ, with arbitrary scale, by inverse iteration; for a
    /// repeated eigenvalue each `copy` gives another shape.
    fn shape(&self, eigenvalue: Complex<f64>, copy: usize) -> DVector<Complex<f64>> {
        let len = self.balance.len();
        let shift = eigenvalue
            + limits::INVERSE_ITERATION_SHIFT * f64::EPSILON * (len as f64).sqrt() * self.size;
        let mut state = start_vector(len, copy);
        for _ in 0..limits::INVERSE_ITERATION_STEPS {
            self.solve(shift, &mut state);
            state /= Complex::from(state.norm());
        }
        let mut balanced = DVector::zeros(len);
        for (q, y) in self.schur.q.column_iter().zip(&state) {
            balanced.zip_apply(&q, |z: &mut Complex<f64>, q| *z += y * q);
        }
        // Inverse iteration gives the state [φ; λφ]. The half with the larger norm is kept, because
        // it has more correct digits.
        let n = len / 2;
        let first = if balanced.rows(0, n).norm() < balanced.rows(n, n).norm() { n } else { 0 };
        let half = balanced.rows(first, n).zip_map(&self.balance.rows(first, n), |z, b| z * b);
        &half / Complex::from(half.camax())
    }

    /// Computes y ← (T − σI)⁻¹ y.
    fn solve(&self, shift: Complex<f64>, y: &mut DVector<Complex<f64>>) {
        let t = &self.schur.t;
        let smallest = f64::EPSILON * self.size.max(f64::MIN_POSITIVE);
        let pivot =
            |value: Complex<f64>| if value.norm() < smallest { smallest.into() } else { value };
        for &(at, width) in self.schur.blocks.iter().rev() {
            let shifted = t[(at, at)] - shift;
            if width == 1 {
                y[at] /= pivot(shifted);
            } else {
                let mut rows = [
                    [shifted, t[(at, at + 1)].into(), y[at]],
                    [t[(at + 1, at)].into(), t[(at + 1, at + 1)] - shift, y[at + 1]],
                ];
                // Elimination is used here because Cramer's rule would lose the direction of a
                // nearly singular block.
                if rows[0][0].norm() < rows[1][0].norm() {
                    rows.swap(0, 1);
                }
                let [[a, b, p], [c, d, q]] = rows;
                let factor = c / pivot(a);
                let second = (q - factor * p) / pivot(d - factor * b);
                (y[at], y[at + 1]) = ((p - b * second) / pivot(a), second);
            }
            for column in at..at + width {
                let part = y[column];
                let above = t.column(column);
                for (y, t) in y.as_mut_slice()[..at].iter_mut().zip(above.iter()) {
                    *y -= part * *t;
                }
            }
        }
    }
}

/// Returns pseudo-random entries between −1 and 1, the same in every run: the fractional parts of
/// multiples of the square root of an integer.
fn start_vector(len: usize, number: usize) -> DVector<Complex<f64>> {
    let step = ((number + 2) as f64 + 0.3).sqrt();
    let entry = |i: usize| 2.0 * (((i * i) as f64 + 1.0) * step).fract() - 1.0;
    DVector::from_fn(len, |i, _| Complex::from(entry(i)))
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;
    use mechid_numerics::linear_algebra::singular_values;

    fn system(m: DMatrix<f64>, c: DMatrix<f64>, k: DMatrix<f64>) -> SecondOrderSystem {
        SecondOrderSystem::new(m, c, k).unwrap()
    }

    /// ‖(λ²M + λC + K) φ‖ relative to the size of its terms.
    fn residual(s: &SecondOrderSystem, mode: &Mode) -> f64 {
        let l = mode.eigenvalue();
        let terms = [(s.mass(), l * l), (s.damping(), l), (s.stiffness(), Complex::from(1.0))];
        let size: f64 = terms.iter().map(|(a, z)| a.norm() * z.norm()).sum();
        let sum: DVector<Complex<f64>> =
            terms.iter().map(|(a, z)| a.map(|v| z * v) * mode.shape()).sum();
        sum.norm() / (size * mode.shape().norm())
    }

    #[test]
    fn state_matrix_by_hand() {
        let s = system(
            dmatrix![2.0, 0.0; 0.0, 4.0],
            dmatrix![1.0, 2.0; 3.0, 4.0],
            dmatrix![8.0, -2.0; 6.0, 12.0],
        );
        let expected = dmatrix![
            0.0, 0.0, 1.0, 0.0;
            0.0, 0.0, 0.0, 1.0;
            -4.0, 1.0, -0.5, -1.0;
            -1.5, -3.0, -0.75, -1.0
        ];
        assert_eq!(s.state_matrix(), expected);
    }

    #[test]
    fn undamped_chain_by_hand() {
        // Two equal masses, three equal springs: ω = 1 in phase, √3 in opposition.
        let s =
            system(DMatrix::identity(2, 2), DMatrix::zeros(2, 2), dmatrix![2.0, -1.0; -1.0, 2.0]);
        let modes = s.modes().unwrap();
        for (mode, (omega, ratio)) in modes.iter().zip([(1.0, 1.0), (3f64.sqrt(), -1.0)]) {
            assert!((mode.eigenvalue() - Complex::new(0.0, omega)).norm() < 1e-14);
            assert!(mode.damping_ratio().abs() < 1e-14);
            assert!((mode.shape()[1] / mode.shape()[0] - ratio).norm() < 1e-14);
            assert!(mode.oscillates());
        }
    }

    #[test]
    fn real_eigenvalues_are_modes_of_their_own() {
        // The equation s² + 5 s + 4 = 0 has the roots −1 and −4.
        let modes = system(dmatrix![1.0], dmatrix![5.0], dmatrix![4.0]).modes().unwrap();
        let found: Vec<f64> = modes.iter().map(|m| m.eigenvalue().re).collect();
        assert!((found[0] + 1.0).abs() < 1e-14 && (found[1] + 4.0).abs() < 1e-14, "{found:?}");
        assert!(modes.iter().all(|m| !m.oscillates() && m.damping_ratio() == 1.0));
    }

    #[test]
    fn a_repeated_eigenvalue_has_independent_shapes() {
        // A symmetric rotor: the same oscillator in both directions, mixed by a rotation.
        let (c, s) = (0.6, 0.8);
        let turn = dmatrix![c, -s, 0.0; s, c, 0.0; 0.0, 0.0, 1.0];
        let turned = |d: [f64; 3]| {
            &turn * DMatrix::from_diagonal(&DVector::from_row_slice(&d)) * turn.transpose()
        };
        let s = system(DMatrix::identity(3, 3), turned([0.2, 0.2, 0.3]), turned([4.0, 4.0, 9.0]));
        let modes = s.modes().unwrap();
        assert_eq!(modes.len(), 3);
        let twins = DMatrix::from_columns(&[modes[0].shape().clone(), modes[1].shape().clone()]);
        assert!(singular_values(twins).unwrap().min() > 0.5);
        assert!(modes.iter().all(|m| residual(&s, m) < 1e-13));
    }

    #[test]
    fn a_defective_eigenvalue_repeats_its_shape() {
        // Critical damping, s² + 4 s + 4: double root −2; rounding moves it by about √ε.
        let modes = system(dmatrix![1.0], dmatrix![4.0], dmatrix![4.0]).modes().unwrap();
        for mode in &modes {
            assert!((mode.eigenvalue() + 2.0).norm() < 1e-7, "{mode:?}");
            assert_eq!(mode.shape()[0], Complex::from(1.0));
        }
    }

    #[test]
    fn absurd_magnitudes_are_refused_not_looped_over() {
        for (m, k) in [(1e-300, 1e300), (1e-160, 1.0)] {
            let s = system(dmatrix![m], dmatrix![0.0], dmatrix![k]);
            let refused = s.modes();
            assert!(matches!(refused, Err(ModelError::StateMatrixOverflow { .. })), "{refused:?}");
        }
        assert!(system(dmatrix![1e-10], dmatrix![0.0], dmatrix![1e100]).modes().is_ok());
    }

    /// Reference: λ = −c/2m ± i√(k/m − c²/4m²) of one degree of freedom.
    #[test]
    fn the_growing_response_is_that_of_the_closed_form() {
        let found = system(dmatrix![2.0], dmatrix![-0.4], dmatrix![800.0]).instability().unwrap();
        let found = found.expect("negative damping");
        let omega = (400.0f64 - 0.01).sqrt();
        assert!((found.eigenvalue() - Complex::new(0.1, omega)).norm() < 1e-12);
        assert!((found.doubling_time() - 2f64.ln() / 0.1).abs() < 1e-9);
        assert_eq!(
            found.to_string(),
            "pole 0.1 ± 20i rad/s: the free response at 3.183 Hz grows at 0.1 1/s and doubles every \
             6.931 s"
        );
        // A negative stiffness: λ² = 4.
        let found = system(dmatrix![1.0], dmatrix![0.0], dmatrix![-4.0]).instability().unwrap();
        assert_eq!(found.unwrap().frequency_hz(), 0.0);
        assert!((found.unwrap().growth_rate() - 2.0).abs() < 1e-12);
        for stable in [
            system(dmatrix![1.0], dmatrix![0.0], dmatrix![4.0]),
            system(dmatrix![1.0], dmatrix![0.0], dmatrix![0.0]),
            system(
                DMatrix::identity(2, 2),
                DMatrix::zeros(2, 2),
                dmatrix![100.0, -100.0; -100.0, 100.0],
            ),
        ] {
            assert_eq!(stable.instability().unwrap(), None);
        }
    }

    #[test]
    fn a_free_body_has_zero_eigenvalues() {
        let s = system(dmatrix![1.0], dmatrix![0.0], dmatrix![0.0]);
        let modes = s.modes().unwrap();
        assert!(modes.iter().all(|m| m.natural_frequency() == 0.0 && m.damping_ratio() == 0.0));
    }

    #[test]
    fn many_equal_and_critically_damped_oscillators_have_their_eigenvalue() {
        // A product of reflections mixes the coordinates of the oscillators.
        for size in 10..=24 {
            let mut turn = DMatrix::identity(size, size);
            for m in 0..size {
                let normal =
                    DVector::from_fn(size, |i, _| ((i * (m + 2)) as f64).sin()).normalize();
                turn -= &turn * &normal * normal.transpose() * 2.0;
            }
            let stiffness = turn.transpose() * DMatrix::from_diagonal_element(size, size, 100.0);
            let stiffness = stiffness * &turn;
            let damping = DMatrix::from_diagonal_element(size, size, 20.0);
            let eigenvalues = system(DMatrix::identity(size, size), damping, stiffness)
                .eigenvalues()
                .unwrap_or_else(|e| panic!("{size}: {e}"));
            assert_eq!(eigenvalues.len(), 2 * size);
            // The eigenvalues are defective pairs, which rounding of ε splits by about √ε.
            assert!(eigenvalues.iter().all(|l| (l + 10.0).norm() < 1e-5), "{eigenvalues:?}");
        }
    }

    /// Reference: a chain between walls has the shapes sin(r π i / (n + 1)); in two planes without
    /// coupling, each shape belongs to two modes.
    #[test]
    fn two_equal_chains_have_the_shapes_of_the_closed_form() {
        let n = 20;
        let chain = DMatrix::from_fn(2 * n, 2 * n, |i, j| match i.abs_diff(j) {
            0 => 1800.0,
            2 => -900.0,
            _ => 0.0,
        });
        let s = system(DMatrix::identity(2 * n, 2 * n), &chain * 1e-4, chain);
        let modes = s.modes().unwrap();
        assert_eq!(modes.len(), 2 * n);
        for (at, pair) in modes.chunks(2).enumerate() {
            let angle = |i: usize| {
                ((at + 1) as f64 * std::f64::consts::PI * (i + 1) as f64 / (n + 1) as f64).sin()
            };
            let exact = DVector::from_fn(n, |i, _| angle(i)).normalize().map(Complex::from);
            let directions = pair.iter().map(|mode| {
                assert!(residual(&s, mode) < 1e-14, "{at}: {:e}", residual(&s, mode));
                let shape = mode.shape().normalize();
                let plane =
                    |first: usize| exact.dotc(&DVector::from_fn(n, |i, _| shape[2 * i + first]));
                let parts = [plane(0), plane(1)];
                let within = parts[0].norm_sqr() + parts[1].norm_sqr();
                assert!((within - 1.0).abs() < 1e-12, "{at}: {within}");
                parts
            });
            let [a, b] = <[_; 2]>::try_from(directions.collect::<Vec<_>>()).unwrap();
            let along = (a[0].conj() * b[0] + a[1].conj() * b[1]).norm();
            assert!(along < 1e-12, "{at}: {along:e}");
        }
    }
}
