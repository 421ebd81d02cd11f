//! Whittle's likelihood of the lines of a band: cost and gradient.

use nalgebra::{Cholesky, Complex, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use mechid_numerics::time_limit;

use super::limits::{ENTRY_OPERATIONS, LINE_OPERATIONS, MODE_OPERATIONS, PRODUCT_OPERATIONS};
use super::lines::PooledLines;
use super::parameters::{Kernel, Parameters, Span};
use super::spectrum::{Coefficients, Kernels};

/// Number of pooled lines per task: fixed, so that results do not depend on the number of cores.
pub(super) const TASK: usize = 64;

/// Returns the factor of a Hermitian matrix if it is positive definite.
///
/// nalgebra computes complex square roots of the pivots: for an indefinite matrix these roots are
/// imaginary, and there is no error.
pub(super) fn positive_factor(
    matrix: DMatrix<Complex<f64>>,
) -> Option<Cholesky<Complex<f64>, Dyn>> {
    let factor = Cholesky::new(matrix)?;
    let sound = |z: Complex<f64>| z.re > 0.0 && z.re.is_finite() && z.im.abs() < 1e-6 * z.re;
    factor.l_dirty().diagonal().iter().all(|z| sound(*z)).then_some(factor)
}

/// Returns the noise variance of each sensor for values `terms` of the polynomials.
pub(super) fn noise(parameters: &Parameters, terms: &[f64]) -> Vec<f64> {
    (0..parameters.layout.outputs).map(|i| parameters.log_noise(i, terms).exp()).collect()
}

/// Counts the operations of one pass over a number of lines, with this number of products of
/// matrices of all channels for each line.
pub(super) fn spend(parameters: &Parameters, lines: usize, products: usize) {
    let (channels, modes) = (parameters.layout.outputs as f64, parameters.layout.modes as f64);
    let of_products = channels * channels * (channels * products as f64 + modes);
    let of_line = LINE_OPERATIONS + MODE_OPERATIONS * modes + PRODUCT_OPERATIONS * of_products;
    time_limit::spend(lines as f64 * of_line);
}

/// Counts the operations of the Fisher information of these lines.
pub(super) fn spend_on_information(parameters: &Parameters, lines: &[PooledLines]) {
    spend(parameters, lines.len(), 3);
    let entries = parameters.layout.len() as f64;
    time_limit::spend(lines.len() as f64 * ENTRY_OPERATIONS * entries * entries);
}

/// Returns −log L, Σ (ln det S + Yᴴ S⁻¹ Y) over the lines; infinite where S is not positive
/// definite.
///
/// # Source
/// Whittle (1953), Arkiv för Matematik 2, 423–434.
pub(super) fn cost(parameters: &Parameters, lines: &[PooledLines], span: Span) -> f64 {
    spend(parameters, lines.len(), 1);
    let coefficients = Coefficients::new(parameters);
    let one = |line: &PooledLines| {
        let kernels = coefficients.kernels(line.omega, span);
        let spectrum = coefficients.spectrum(&kernels, &noise(parameters, &line.terms));
        let Some(factor) = positive_factor(spectrum) else { return f64::INFINITY };
        let log_determinant = log_determinant(&factor);
        line.count * (log_determinant + factor.solve(&line.periodogram).trace().re)
    };
    let sums: Vec<f64> = lines.par_chunks(TASK).map(|chunk| chunk.iter().map(one).sum()).collect();
    let total: f64 = sums.iter().sum();
    if total.is_nan() { f64::INFINITY } else { total }
}

pub(super) fn log_determinant(factor: &Cholesky<Complex<f64>, Dyn>) -> f64 {
    2.0 * factor.l_dirty().diagonal().iter().map(|z| z.re.ln()).sum::<f64>()
}

/// Sums over the lines for the gradient, with Γ = S⁻¹ − S⁻¹ Ŝ S⁻¹, Ψ = ψ γᵀ, and the kernels k and
/// k̃ with their derivatives k′ and k̃′.
#[derive(Clone)]
struct GradientSums {
    /// Sum Σ k Γ + conj Σ k̃ Γ of each mode, for the derivatives with respect to its shape.
    shapes: Vec<DMatrix<Complex<f64>>>,
    /// Sum Σ k′ tr ΓΨ + conj Σ k̃′ tr ΓΨ* of each mode, for the derivatives with respect to its
    /// pole.
    poles: Vec<Complex<f64>>,
    /// Re Σ Γ.
    direct: DMatrix<f64>,
    /// Derivatives with respect to the noise, terms × outputs.
    noise: DMatrix<f64>,
}

impl GradientSums {
    fn zero(parameters: &Parameters) -> Self {
        let (m, p) = (parameters.layout.modes, parameters.layout.outputs);
        Self {
            shapes: vec![DMatrix::zeros(p, p); m],
            poles: vec![Complex::default(); m],
            direct: DMatrix::zeros(p, p),
            noise: DMatrix::zeros(parameters.layout.noise_terms, p),
        }
    }

    fn add(&mut self, other: &Self) {
        for (sum, part) in self.shapes.iter_mut().zip(&other.shapes) {
            *sum += part;
        }
        for (sum, part) in self.poles.iter_mut().zip(&other.poles) {
            *sum += part;
        }
        self.direct += &other.direct;
        self.noise += &other.noise;
    }

    fn add_line(
        &mut self,
        coefficients: &Coefficients,
        kernels: &Kernels,
        gamma: &DMatrix<Complex<f64>>,
        variances: &[f64],
        terms: &[f64],
    ) {
        let conjugate = gamma.conjugate();
        for (r, [value, mirrored]) in kernels.value.iter().enumerate() {
            self.shapes[r].zip_zip_apply(gamma, &conjugate, |sum, g, c| {
                *sum += value * g + mirrored.conj() * c;
            });
            let (psi, cov) = (coefficients.shapes.column(r), coefficients.covariances.column(r));
            // tr ΓΨ = γᵀΓψ.
            let (mut plain, mut mirror) = (Complex::default(), Complex::default());
            for (j, column) in gamma.column_iter().enumerate() {
                for (i, g) in column.iter().enumerate() {
                    plain += cov[i] * g * psi[j];
                    mirror += cov[i].conj() * g * psi[j].conj();
                }
            }
            let [slope, mirrored_slope] = kernels.derivative[r];
            self.poles[r] += slope * plain + (mirrored_slope * mirror).conj();
        }
        self.direct += gamma.map(|z| z.re);
        for (i, variance) in variances.iter().enumerate() {
            for (d, term) in terms.iter().enumerate() {
                self.noise[(d, i)] += gamma[(i, i)].re * variance * term;
            }
        }
    }
}

/// Returns the gradient of [`cost`]; `None` where S is not positive definite.
pub(super) fn gradient(
    parameters: &Parameters,
    lines: &[PooledLines],
    span: Span,
) -> Option<DVector<f64>> {
    spend(parameters, lines.len(), 3);
    let coefficients = Coefficients::new(parameters);
    let chunk = |chunk: &[PooledLines]| {
        let mut sums = GradientSums::zero(parameters);
        for line in chunk {
            let kernels = coefficients.kernels(line.omega, span);
            let variances = noise(parameters, &line.terms);
            let inverse = positive_factor(coefficients.spectrum(&kernels, &variances))?.inverse();
            // Γ = S⁻¹ − S⁻¹ Ŝ S⁻¹ of one line.
            let gamma = &inverse - &inverse * &line.periodogram * &inverse;
            let gamma = gamma * Complex::from(line.count);
            sums.add_line(&coefficients, &kernels, &gamma, &variances, &line.terms);
        }
        Some(sums)
    };
    let parts: Option<Vec<GradientSums>> = lines.par_chunks(TASK).map(chunk).collect();
    let mut sums = GradientSums::zero(parameters);
    for part in parts? {
        sums.add(&part);
    }
    Some(chained(parameters, &coefficients, &sums))
}

/// Returns the gradient with respect to the parameters from the sums over the lines.
fn chained(parameters: &Parameters, c: &Coefficients, sums: &GradientSums) -> DVector<f64> {
    let layout = &parameters.layout;
    let (m, p) = (layout.modes, layout.outputs);
    let mut shape_slopes = DMatrix::<Complex<f64>>::zeros(p, m);
    let mut pole_slopes = sums.poles.clone();
    let mut correlation_slopes = DMatrix::zeros(m, m);
    let weights: Vec<_> = (0..m).map(|r| &sums.shapes[r] * c.shapes.column(r)).collect();
    for s in 0..m {
        let shape_slope = sums.shapes[s].tr_mul(&c.covariances.column(s));
        shape_slopes.set_column(s, &shape_slope);
    }
    for r in 0..m {
        for s in 0..m {
            let (q, [g, mirrored]) = (c.correlation[(r, s)], c.transfer(r, s));
            let along = weights[r].dot(&c.shapes.column(s));
            let across = weights[r].dot(&c.shapes.column(s).conjugate());
            for i in 0..p {
                let weight = weights[r][i];
                shape_slopes[(i, s)] += (g * weight + (mirrored * weight).conj()) * q;
            }
            correlation_slopes[(r, s)] += 2.0 * (along * g + across * mirrored).re;
            let square = |z: Complex<f64>| (z * z).inv();
            let near = square(c.poles[r] + c.poles[s]);
            let far = square(c.poles[r] + c.poles[s].conj());
            pole_slopes[r] += (along * near + across * far) * q;
            let (mut direct, mut conjugated) = (near, far);
            if c.kernel == Kernel::Vanishing {
                direct -= square(c.poles[s]);
                conjugated -= square(c.poles[s].conj());
            }
            pole_slopes[s] += (along * direct + (across * conjugated).conj()) * q;
        }
    }
    if c.kernel == Kernel::Vanishing {
        let direct = &sums.direct * &c.direct;
        correlation_slopes += c.direct.tr_mul(&direct);
        add_direct(c, &(direct * &c.correlation * 2.0), &mut shape_slopes, &mut pole_slopes);
    }
    let mut gradient = DVector::zeros(layout.len());
    for r in 0..m {
        let [by_frequency, by_damping] = parameters.pole_derivatives(r);
        gradient[layout.frequency(r)] = 2.0 * (pole_slopes[r] * by_frequency).re;
        gradient[layout.damping(r)] = 2.0 * (pole_slopes[r] * by_damping).re;
        for i in 0..p {
            gradient[layout.shape(r) + i] = 2.0 * shape_slopes[(i, r)].re;
            gradient[layout.shape(r) + p + i] = -2.0 * shape_slopes[(i, r)].im;
        }
    }
    add_correlations(parameters, &correlation_slopes, &mut gradient);
    for d in 0..layout.noise_terms {
        for i in 0..p {
            gradient[layout.noise(d, i)] = sums.noise[(d, i)];
        }
    }
    gradient
}

/// Adds the derivatives of D Q Dᵀ, weighted by `direct` (outputs × modes), with respect to shapes
/// and poles.
fn add_direct(
    c: &Coefficients,
    direct: &DMatrix<f64>,
    shape_slopes: &mut DMatrix<Complex<f64>>,
    pole_slopes: &mut [Complex<f64>],
) {
    for (s, pole) in c.poles.iter().enumerate() {
        for i in 0..direct.nrows() {
            shape_slopes[(i, s)] += pole.inv() * direct[(i, s)];
            pole_slopes[s] -= c.shapes[(i, s)] * direct[(i, s)] / (pole * pole);
        }
    }
}

/// Adds the gradient of the entries of C below the diagonal, by the chain rule from Q = C Cᵀ with
/// rows of unit length.
fn add_correlations(parameters: &Parameters, slopes: &DMatrix<f64>, gradient: &mut DVector<f64>) {
    let (raw, factor) = (parameters.raw_factor(), parameters.factor());
    let by_factor = (slopes + slopes.transpose()) * &factor;
    for (index, &(r, s)) in parameters.layout.pairs.iter().enumerate() {
        let along = by_factor.row(r).dot(&factor.row(r));
        let slope = (by_factor[(r, s)] - along * factor[(r, s)]) / raw.row(r).norm();
        gradient[parameters.layout.correlation(index)] = slope;
    }
}
