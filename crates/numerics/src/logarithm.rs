//! Principal logarithm of a real matrix, its integral, and the derivatives of both.
//!
//! A linear system with sampling interval Δt has the transition x⁺ = Φ x + Γ f, with the matrix
//! exponential
//!
//! ```text
//! ┌ Φ  Γ ┐       ┌ AΔt  BΔt ┐
//! └ 0  I ┘ = exp └  0    0  ┘
//! ```
//!
//! if the force f is constant between samples. The logarithm of the left side therefore gives A and
//! B at once, also if A is singular (rigid-body modes), and the derivative of the logarithm
//! converts the covariance of Φ and Γ to that of A and B.

use nalgebra::DMatrix;

use crate::RealSchur;
use crate::error::{NumericsError, check_finite, check_size};
use crate::quasi_triangular::{root_derivative, shifted_root};

/// Largest ‖X‖₁ for which the \[7/7\] Padé approximant of log(I + X) is exact to double precision.
///
/// # Source
/// Higham, *Functions of Matrices* (2008), table 11.1 (θ₇).
const PADE_REACH: f64 = 0.264;

/// Nodes and weights of the Gauss–Legendre quadrature on [−1, 1] with seven points.
const GAUSS_LEGENDRE: [(f64, f64); 7] = [
    (-0.949_107_912_342_758_5, 0.129_484_966_168_869_7),
    (-0.741_531_185_599_394_4, 0.279_705_391_489_276_7),
    (-0.405_845_151_377_397_2, 0.381_830_050_505_118_9),
    (0.0, 0.417_959_183_673_469_4),
    (0.405_845_151_377_397_2, 0.381_830_050_505_118_9),
    (0.741_531_185_599_394_4, 0.279_705_391_489_276_7),
    (0.949_107_912_342_758_5, 0.129_484_966_168_869_7),
];

/// Returns the principal logarithm of a square matrix of pure numbers: exp(log A) = A with the
/// imaginary parts of all eigenvalues of log A within ±π.
///
/// The function takes square roots of the real Schur form until the matrix is close to I, then uses
/// a Padé approximant. All steps work with the difference between the matrix and I, so that the
/// logarithm of a matrix close to I is accurate relative to this difference.
///
/// ```
/// use mechid_numerics::logarithm::logarithm;
/// use nalgebra::dmatrix;
///
/// // A quarter turn: its logarithm is the generator of rotations times π/2.
/// let log = logarithm(&dmatrix![0.0, -1.0; 1.0, 0.0])?;
/// assert!((log[(1, 0)] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// # Ok::<(), mechid_numerics::NumericsError>(())
/// ```
///
/// # Errors
/// [`NumericsError::NoLogarithm`] if an eigenvalue is real and not positive, or if a pair of
/// eigenvalues is real and not positive up to rounding, [`NumericsError::Size`] if `a` is not
/// square, [`NumericsError::NotFinite`], [`NumericsError::Eigenvalues`].
///
/// # Source
/// Higham, *Functions of Matrices* (2008), chapter 11 (inverse scaling and squaring, algorithm
/// 11.9; partial fractions of the Padé approximants).
pub fn logarithm(a: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
    check_size("columns of a square matrix", a.nrows(), a.ncols())?;
    check_finite("matrix", a.as_view())?;
    let size = a.nrows();
    let none = DMatrix::zeros(size, 0);
    Ok(Generator::new(&(a - DMatrix::identity(size, size)), &none)?.value)
}

/// Logarithm \[AΔt BΔt\] of the transition \[Φ, Γ\], prepared for derivatives.
#[derive(Debug, Clone)]
pub struct Generator {
    /// \[AΔt BΔt\]: states × (states + inputs), dimensionless.
    pub value: DMatrix<f64>,
    /// Schur vectors of Φ.
    q: DMatrix<f64>,
    blocks: Vec<(usize, usize)>,
    /// Square roots (I + U)^(1/2^l) − I for l = 1, 2, …, with U the Schur form of \[Φ − I, Γ; 0,
    /// 0\].
    roots: Vec<DMatrix<f64>>,
    /// Last of the `roots`, or U itself if `roots` is empty.
    x: DMatrix<f64>,
    /// Factor that scaled Γ to the magnitude of Φ − I.
    input_scale: f64,
}

impl Generator {
    /// Computes \[AΔt BΔt\] from `difference` = Φ − I (states × states) and `input` = Γ (states ×
    /// inputs), both pure numbers.
    ///
    /// # Errors
    /// [`NumericsError::NoLogarithm`], [`NumericsError::Eigenvalues`].
    ///
    /// # Source
    /// As [`logarithm`].
    pub fn new(difference: &DMatrix<f64>, input: &DMatrix<f64>) -> Result<Self, NumericsError> {
        let (states, inputs) = input.shape();
        let RealSchur { q, t, mut blocks } = RealSchur::new(difference.clone())
            .map_err(|_| NumericsError::Eigenvalues { size: states })?;
        blocks.iter().try_for_each(|block| check_block(&t, *block))?;
        blocks.extend((states..states + inputs).map(|at| (at, 1)));
        let input_scale = match (one_norm(difference), one_norm(input)) {
            (numerator, denominator) if numerator > 0.0 && denominator > 0.0 => {
                numerator / denominator
            }
            _ => 1.0,
        };
        let mut x = DMatrix::zeros(states + inputs, states + inputs);
        x.view_mut((0, 0), (states, states)).copy_from(&t);
        x.view_mut((0, states), (states, inputs)).copy_from(&(q.tr_mul(input) * input_scale));
        let mut roots = Vec::new();
        while one_norm(&x) > PADE_REACH {
            x = shifted_root(&x, &blocks);
            roots.push(x.clone());
        }
        let pade = pade(&x)?;
        let mut generator = Self { value: DMatrix::zeros(0, 0), q, blocks, roots, x, input_scale };
        generator.value = generator.back(pade);
        Ok(generator)
    }

    /// Returns the change of \[AΔt BΔt\] when \[Φ − I, Γ\] changes by `change` (states × (states +
    /// inputs)), dimensionless.
    ///
    /// # Errors
    /// [`NumericsError::Eigenvalues`].
    ///
    /// # Source
    /// Al-Mohy, Higham & Relton (2013), SIAM J. Sci. Comput. 35, C394–C410.
    pub fn derivative(&self, change: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
        let (states, all) = (self.q.nrows(), self.x.nrows());
        let mut e = DMatrix::zeros(all, all);
        let turned = self.q.tr_mul(change);
        e.view_mut((0, 0), (states, states)).copy_from(&(turned.columns(0, states) * &self.q));
        e.view_mut((0, states), (states, all - states))
            .copy_from(&(turned.columns(states, all - states) * self.input_scale));
        for root in &self.roots {
            e = root_derivative(root, &self.blocks, &e);
        }
        Ok(self.back(pade_derivative(&self.x, &e)?))
    }

    /// Reverses the square roots, the Schur form and the scaling of the inputs.
    fn back(&self, logarithm: DMatrix<f64>) -> DMatrix<f64> {
        let (states, all) = (self.q.nrows(), self.x.nrows());
        let powers = 2f64.powi(self.roots.len() as i32);
        let mut value = &self.q * logarithm.rows(0, states) * powers;
        let rotated = value.columns(0, states) * self.q.transpose();
        value.columns_mut(0, states).copy_from(&rotated);
        value.columns_mut(states, all - states).unscale_mut(self.input_scale);
        value
    }
}

/// Returns an error if an eigenvalue 1 + λ of a diagonal block of Φ − I is on (−∞, 0].
fn check_block(t: &DMatrix<f64>, (start, width): (usize, usize)) -> Result<(), NumericsError> {
    let smallest = if width == 1 {
        Some(1.0 + t[(start, start)])
    } else {
        let (a, b) = (t[(start, start)], t[(start, start + 1)]);
        let (c, d) = (t[(start + 1, start)], t[(start + 1, start + 1)]);
        let (half_trace, half_gap) = (0.5 * (a + d), 0.5 * (a - d));
        let discriminant = half_gap * half_gap + b * c;
        (discriminant >= 0.0).then(|| 1.0 + half_trace - discriminant.sqrt())
    };
    let scale = 1.0 + one_norm(t);
    match smallest {
        Some(eigenvalue) if eigenvalue <= f64::EPSILON * scale => {
            Err(NumericsError::NoLogarithm { eigenvalue })
        }
        _ => Ok(()),
    }
}

fn one_norm(a: &DMatrix<f64>) -> f64 {
    a.column_iter().map(|column| column.lp_norm(1)).fold(0.0, f64::max)
}

/// Returns nodes and weights on [0, 1] for log(1 + x) = ∫₀¹ x/(1 + t x) dt.
fn nodes() -> impl Iterator<Item = (f64, f64)> {
    GAUSS_LEGENDRE.into_iter().map(|(node, weight)| (0.5 * (1.0 + node), 0.5 * weight))
}

/// Returns log(I + X) ≈ Σ w (I + t X)⁻¹ X, which is the \[7/7\] Padé approximant.
fn pade(x: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
    let mut sum = DMatrix::zeros(x.nrows(), x.ncols());
    for (node, weight) in nodes() {
        sum += solve(&shifted(x, node), x)? * weight;
    }
    Ok(sum)
}

/// Returns Σ w (I + t X)⁻¹ E (I + t X)⁻¹, the change of `pade(x)` if X changes by E.
fn pade_derivative(x: &DMatrix<f64>, e: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
    let mut sum = DMatrix::zeros(x.nrows(), x.ncols());
    for (node, weight) in nodes() {
        let factor = shifted(x, node);
        let left_solution = solve(&factor, e)?;
        sum += solve(&factor.transpose(), &left_solution.transpose())?.transpose() * weight;
    }
    Ok(sum)
}

fn shifted(x: &DMatrix<f64>, node: f64) -> DMatrix<f64> {
    DMatrix::identity(x.nrows(), x.ncols()) + x * node
}

fn solve(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
    // I + t X with ‖X‖ ≤ 0.264 is never singular, so only an X that is not finite fails here.
    a.clone().lu().solve(b).ok_or(NumericsError::Eigenvalues { size: a.nrows() })
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    /// The derivative must equal difference quotients, for states with complex, real and unit
    /// eigenvalues (a free body) and for two inputs.
    #[test]
    fn the_derivative_is_that_of_the_logarithm() {
        let free = dmatrix![1.0, 0.3; 0.0, 1.0] - DMatrix::identity(2, 2);
        let film = dmatrix![
            -0.3, 0.5, 0.1, 0.0; -0.7, -0.4, 0.2, 0.1; 0.0, 0.1, -0.2, 0.9; 0.1, 0.0, -0.3, -0.6
        ];
        for (difference, tolerance) in [(free, 1e-8), (film, 1e-8)] {
            let states = difference.nrows();
            let input = DMatrix::from_fn(states, 2, |i, j| 1e-4 * (1 + i + 2 * j) as f64);
            let generator = Generator::new(&difference, &input).unwrap();
            for row in 0..states {
                for column in 0..states + 2 {
                    let mut change = DMatrix::zeros(states, states + 2);
                    change[(row, column)] = 1.0;
                    let step = 1e-6;
                    let moved = |sign: f64| {
                        let shifted = &difference + change.columns(0, states) * (sign * step);
                        let input = &input + change.columns(states, 2) * (sign * step);
                        Generator::new(&shifted, &input).unwrap().value
                    };
                    let quotient = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                    let derivative = generator.derivative(&change).unwrap();
                    // The rounding error divided by the step is 1e-10; the conditioning of the
                    // eigenvalues multiplies this error.
                    assert!((derivative - quotient).abs().max() < tolerance, "{row} {column}");
                }
            }
        }
    }

    /// For one state and a held force, Φ and Γ have closed forms; `Generator::new` must return the
    /// original A and B.
    #[test]
    fn the_inputs_are_integrated() {
        let (a, b) = (-0.8f64, 3.0);
        let input = dmatrix![(a.exp_m1()) / a * b];
        let generator = Generator::new(&dmatrix![a.exp_m1()], &input).unwrap();
        assert!((&generator.value - dmatrix![a, b]).abs().max() < 1e-15);
        let none = Generator::new(&dmatrix![0.0], &dmatrix![2.0]).unwrap();
        assert!((none.value - dmatrix![0.0, 2.0]).abs().max() < 1e-15);
    }
}
