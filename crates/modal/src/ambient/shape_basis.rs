//! Spectral matrix in the basis of the shapes, and its derivatives.
//!
//! The columns of V (outputs × 2 modes) are the real part and the imaginary part of each shape.
//! With the shape ψ_r = V_r e, e = (1, j)ᵀ, the spectral matrix of [`super::spectrum`] is
//!
//! ```text
//! S = V B Vᵀ + N,   B_rs = Q_rs b_rs,   b_rs = a_rs + a_srᴴ + d_r d_sᵀ
//! a_rs = k_r e u_rsᵀ + k̃_r e* u_rsᴴ,   u_rs = e g(−λ_r, λ_s) + e* g(−λ_r, λ_s*)
//! ```
//!
//! with blocks of 2 × 2 and D_r = V_r d_r. The derivatives with respect to the poles and to Q are
//! products of few columns, so that a trace of two of them needs no matrix of all outputs.

use nalgebra::{Complex, DMatrix, Matrix2, Vector2};

use super::parameters::{Kernel, Parameters};
use super::spectrum::{Coefficients, Kernels};

type Block = Matrix2<Complex<f64>>;

/// Derivative V_l W + Wᴴ V_lᵀ of S, where W = Σ β_s V_sᵀ.
#[derive(Debug, Clone)]
pub(super) struct Direction {
    /// Index of the parameter. A factor of the correlation has the index of its pair; the
    /// derivative is with respect to Q_rs of this pair.
    pub index: usize,
    /// Mode l.
    pub left: usize,
    /// Modes s and blocks β_s.
    pub right: Vec<(usize, Block)>,
}

/// Derivatives with respect to a parameter of one pole.
struct PoleDerivatives {
    /// ∂λ.
    pole: Complex<f64>,
    /// ∂u_rs for each mode s, where r is the mode of the pole.
    first: Vec<Vector2<Complex<f64>>>,
    /// ∂u_sr for each mode s; zero for s = r, because `first` contains the whole of ∂u_rr.
    second: Vec<Vector2<Complex<f64>>>,
    /// ∂d_r.
    direct: Vector2<f64>,
}

/// Parts of the blocks that do not depend on the line.
pub(super) struct ShapeBasis<'a> {
    parameters: &'a Parameters,
    coefficients: &'a Coefficients,
    /// Columns V, outputs × 2 modes.
    pub columns: DMatrix<Complex<f64>>,
    /// Vectors u_rs at index r · modes + s.
    u: Vec<Vector2<Complex<f64>>>,
    /// Vectors d_r.
    direct: Vec<Vector2<f64>>,
    /// Derivatives with respect to ln ω of each mode, and then ln ζ of each mode.
    poles: Vec<PoleDerivatives>,
}

impl<'a> ShapeBasis<'a> {
    pub fn new(parameters: &'a Parameters, coefficients: &'a Coefficients) -> Self {
        let (outputs, modes) = coefficients.shapes.shape();
        let columns = DMatrix::from_fn(outputs, 2 * modes, |i, column| {
            let z = coefficients.shapes[(i, column / 2)];
            Complex::from(if column % 2 == 0 { z.re } else { z.im })
        });
        let pairs = (0..modes * modes).map(|at| (at / modes, at % modes));
        let u = pairs.map(|(r, s)| conjugate_pair(coefficients.transfer(r, s))).collect();
        let has_direct = coefficients.kernel == Kernel::Vanishing;
        let direct = |z: Complex<f64>| if has_direct { parts_twice(z) } else { Vector2::zeros() };
        let of_pole = |at: usize| {
            let mode = at % modes;
            let step = parameters.pole_derivatives(mode)[at / modes];
            let pole = coefficients.poles[mode];
            PoleDerivatives {
                pole: step,
                first: (0..modes).map(|s| first_derivative(coefficients, mode, s, step)).collect(),
                second: (0..modes)
                    .map(|s| second_derivative(coefficients, mode, s, step))
                    .collect(),
                direct: direct(-step / (pole * pole)),
            }
        };
        Self {
            parameters,
            coefficients,
            columns,
            u,
            direct: coefficients.poles.iter().map(|pole| direct(pole.inv())).collect(),
            poles: (0..2 * modes).map(of_pole).collect(),
        }
    }

    /// Returns B at a line, 2 modes × 2 modes.
    pub fn matrix(&self, kernels: &Kernels) -> DMatrix<Complex<f64>> {
        let modes = self.direct.len();
        let mut matrix = DMatrix::zeros(2 * modes, 2 * modes);
        for r in 0..modes {
            for s in 0..=r {
                let block = self.block(kernels, r, s)
                    * Complex::from(self.coefficients.correlation[(r, s)]);
                matrix.fixed_view_mut::<2, 2>(2 * r, 2 * s).copy_from(&block);
                matrix.fixed_view_mut::<2, 2>(2 * s, 2 * r).copy_from(&block.adjoint());
            }
        }
        matrix
    }

    /// Returns the derivatives with respect to the parameters of the poles and to Q at a line.
    pub fn directions(&self, kernels: &Kernels) -> Vec<Direction> {
        let layout = &self.parameters.layout;
        let modes = self.direct.len();
        let of_pole = |index: usize| {
            let mode = index % modes;
            let blocks = (0..modes).map(|s| {
                let correlation = Complex::from(self.coefficients.correlation[(mode, s)]);
                (s, self.pole_block(kernels, index, s) * correlation)
            });
            Direction { index, left: mode, right: blocks.collect() }
        };
        let of_pair = |(pair, (r, s)): (usize, &(usize, usize))| Direction {
            index: layout.correlation(pair),
            left: *r,
            right: vec![(*s, self.block(kernels, *r, *s))],
        };
        let pairs = layout.pairs.iter().enumerate().map(of_pair);
        (0..2 * modes).map(of_pole).chain(pairs).collect()
    }

    /// Returns b_rs.
    fn block(&self, kernels: &Kernels, r: usize, s: usize) -> Block {
        let modes = self.direct.len();
        half(kernels.value[r], &self.u[r * modes + s])
            + half(kernels.value[s], &self.u[s * modes + r]).adjoint()
            + (self.direct[r] * self.direct[s].transpose()).map(Complex::from)
    }

    /// Returns the block β_s, without Q_rs, of the derivative with respect to a parameter of the
    /// pole of mode r.
    fn pole_block(&self, kernels: &Kernels, index: usize, s: usize) -> Block {
        let modes = self.direct.len();
        let (r, change) = (index % modes, &self.poles[index]);
        let [value, mirrored] = kernels.derivative[r];
        let slopes = [value * change.pole, mirrored * change.pole.conj()];
        half(slopes, &self.u[r * modes + s])
            + half(kernels.value[r], &change.first[s])
            + half(kernels.value[s], &change.second[s]).adjoint()
            + (change.direct * self.direct[s].transpose()).map(Complex::from)
    }
}

/// Returns k e uᵀ + k̃ e* uᴴ.
fn half([value, mirrored]: [Complex<f64>; 2], u: &Vector2<Complex<f64>>) -> Block {
    let outer = Block::new(u.x, u.y, Complex::<f64>::i() * u.x, Complex::<f64>::i() * u.y);
    outer.map(|z| value * z + mirrored * z.conj())
}

/// Returns e g + e* g̃.
fn conjugate_pair([g, mirrored]: [Complex<f64>; 2]) -> Vector2<Complex<f64>> {
    Vector2::new(g + mirrored, Complex::<f64>::i() * (g - mirrored))
}

/// Returns the vector d with V_r d = 2 Re(z ψ_r).
fn parts_twice(z: Complex<f64>) -> Vector2<f64> {
    Vector2::new(2.0 * z.re, -2.0 * z.im)
}

/// Returns ∂u_rs for the change `step` of λ_r; for s = r both poles of g change.
fn first_derivative(
    coefficients: &Coefficients,
    r: usize,
    s: usize,
    step: Complex<f64>,
) -> Vector2<Complex<f64>> {
    let (pole, other) = (coefficients.poles[r], coefficients.poles[s]);
    let first = [step / square(pole + other), step / square(pole + other.conj())];
    let mut u = conjugate_pair(first);
    if s == r {
        u += conjugate_pair(changes_with_second_pole(coefficients, pole, pole, step));
    }
    u
}

/// Returns ∂u_sr for the change `step` of λ_r; zero for s = r.
fn second_derivative(
    coefficients: &Coefficients,
    r: usize,
    s: usize,
    step: Complex<f64>,
) -> Vector2<Complex<f64>> {
    let poles = &coefficients.poles;
    if s == r {
        Vector2::zeros()
    } else {
        conjugate_pair(changes_with_second_pole(coefficients, poles[s], poles[r], step))
    }
}

/// Returns the changes of g(−λ_s, λ) and g(−λ_s, λ*) for the change `step` of λ.
fn changes_with_second_pole(
    coefficients: &Coefficients,
    fixed: Complex<f64>,
    pole: Complex<f64>,
    step: Complex<f64>,
) -> [Complex<f64>; 2] {
    let change = |pole: Complex<f64>, step: Complex<f64>| {
        let proper = step / square(fixed + pole);
        match coefficients.kernel {
            Kernel::Static | Kernel::Sampled => proper,
            Kernel::Vanishing => proper - step / square(pole),
        }
    };
    [change(pole, step), change(pole.conj(), step.conj())]
}

fn square(z: Complex<f64>) -> Complex<f64> {
    z * z
}
