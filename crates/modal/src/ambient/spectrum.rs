//! Expected periodogram of the outputs of modes that are driven by white, unmeasured forces.
//!
//! The outputs are y = Σ_r H_r w_r + n with H_r(s) = Σ ψ g(s, λ) over the pair (ψ, λ), (ψ*, λ*);
//! the forces w on the modes are white with correlation Q, the noise n of each sensor is smooth.
//! The covariance function is Σ ψ γᵀ exp(λτ) for τ > 0 with γ_r = Σ_s Q_rs H_s(−λ_r), and the
//! expected periodogram over a record of length T follows exactly:
//!
//! ```text
//! S(ω) = A + Aᴴ + D Q Dᵀ + N,   A = Σ_λ k(ω, λ) ψ γᵀ,
//! k = 1/(jω − λ) − (1 − exp λT)/(T (jω − λ)²)
//! ```
//!
//! The second term of k is the leakage of the open record; D is the value of H at high frequency.
//! For a record without an anti-aliasing filter, Δ coth((jω − λ)Δ) and Δ/sinh((jω − λ)Δ) replace
//! 1/(jω − λ), where Δ is half the time between two samples. These functions are sums over all
//! frequencies that fold onto ω.

use nalgebra::{Complex, DMatrix};

use super::parameters::{Kernel, Parameters, Span};

/// Coefficients of the spectral matrix that do not depend on the line.
#[derive(Debug, Clone)]
pub(super) struct Coefficients {
    pub poles: Vec<Complex<f64>>,
    /// Shapes ψ, outputs × modes.
    pub shapes: DMatrix<Complex<f64>>,
    /// Vectors γ of the covariance function, outputs × modes.
    pub covariances: DMatrix<Complex<f64>>,
    /// Correlation Q of the forces on the modes, modes × modes.
    pub correlation: DMatrix<f64>,
    /// Values D of the transfer functions at high frequency, outputs × modes.
    pub direct: DMatrix<f64>,
    /// Spectral matrix D Q Dᵀ of the direct response.
    pub direct_power: DMatrix<f64>,
    pub kernel: Kernel,
}

/// Values of k and ∂k/∂λ at one line for (λ, λ*) of each mode.
pub(super) struct Kernels {
    pub value: Vec<[Complex<f64>; 2]>,
    pub derivative: Vec<[Complex<f64>; 2]>,
}

impl Coefficients {
    pub fn new(parameters: &Parameters) -> Self {
        let (modes, outputs) = (parameters.layout.modes, parameters.layout.outputs);
        let poles = parameters.poles();
        let columns: Vec<_> = (0..modes).map(|mode| parameters.shape(mode)).collect();
        let shapes = column_matrix(outputs, &columns);
        let factor = parameters.factor();
        let correlation = &factor * factor.transpose();
        let kernel = parameters.kernel;
        let direct = match kernel {
            Kernel::Static | Kernel::Sampled => DMatrix::zeros(outputs, modes),
            Kernel::Vanishing => {
                DMatrix::from_fn(outputs, modes, |i, r| 2.0 * (shapes[(i, r)] / poles[r]).re)
            }
        };
        let direct_power = &direct * &correlation * direct.transpose();
        let covariances = DMatrix::zeros(outputs, modes);
        let mut new =
            Self { poles, shapes, covariances, correlation, direct, direct_power, kernel };
        for r in 0..modes {
            for s in 0..modes {
                let [g, mirrored] = new.transfer(r, s);
                let q = new.correlation[(r, s)];
                for i in 0..outputs {
                    let shape = new.shapes[(i, s)];
                    new.covariances[(i, r)] += (shape * g + shape.conj() * mirrored) * q;
                }
            }
        }
        new
    }

    /// Returns g(−λ_r, λ_s) and g(−λ_r, λ_s*).
    pub fn transfer(&self, r: usize, s: usize) -> [Complex<f64>; 2] {
        let one = |pole: Complex<f64>| {
            let proper = -(self.poles[r] + pole).inv();
            match self.kernel {
                Kernel::Static | Kernel::Sampled => proper,
                Kernel::Vanishing => proper + pole.inv(),
            }
        };
        [one(self.poles[s]), one(self.poles[s].conj())]
    }

    pub fn kernels(&self, omega: f64, span: Span) -> Kernels {
        let at = |pole: Complex<f64>| {
            let (inverse, square) = self.inverse(omega, pole, span);
            let decay = (pole * span.duration).exp();
            let lost = (Complex::from(1.0) - decay) / span.duration;
            let leakage = lost * square;
            let value = inverse - leakage;
            (value, square - leakage * inverse * 2.0 + decay * square)
        };
        let pairs = self.poles.iter().map(|pole| [at(*pole), at(pole.conj())]);
        let (value, derivative) = pairs.map(|[a, b]| ([a.0, b.0], [a.1, b.1])).unzip();
        Kernels { value, derivative }
    }

    /// Returns 1/(jω − λ) and minus its derivative with respect to jω, or the sums of both over the
    /// frequencies that fold onto ω.
    pub fn inverse(
        &self,
        omega: f64,
        pole: Complex<f64>,
        span: Span,
    ) -> (Complex<f64>, Complex<f64>) {
        let distance = Complex::new(0.0, omega) - pole;
        match self.kernel {
            Kernel::Static | Kernel::Vanishing => {
                let inverse = distance.inv();
                (inverse, inverse * inverse)
            }
            Kernel::Sampled => {
                let half = 0.5 * span.sample_interval;
                let sine = (distance * half).sinh().inv() * half;
                ((distance * half).cosh() * sine, sine * sine)
            }
        }
    }

    /// Returns the spectral matrix at a line for sensor noise of the variances `noise`.
    pub fn spectrum(&self, kernels: &Kernels, noise: &[f64]) -> DMatrix<Complex<f64>> {
        let outputs = self.shapes.nrows();
        let mut half = DMatrix::zeros(outputs, outputs);
        for (r, [value, mirrored]) in kernels.value.iter().enumerate() {
            add_pair(
                &mut half,
                self.shapes.column(r),
                self.covariances.column(r),
                *value,
                *mirrored,
            );
        }
        let mut spectrum = hermitian_sum(&half, &self.direct_power);
        for (i, variance) in noise.iter().enumerate() {
            spectrum[(i, i)] += Complex::from(*variance);
        }
        spectrum
    }
}

/// Adds k ψ γᵀ + k̃ ψ* γᴴ.
fn add_pair(
    half: &mut DMatrix<Complex<f64>>,
    shape: nalgebra::DVectorView<'_, Complex<f64>>,
    covariance: nalgebra::DVectorView<'_, Complex<f64>>,
    value: Complex<f64>,
    mirrored: Complex<f64>,
) {
    for (gamma, mut column) in covariance.iter().zip(half.column_iter_mut()) {
        let (first, second) = (value * gamma, mirrored * gamma.conj());
        for (entry, psi) in column.iter_mut().zip(shape.iter()) {
            *entry += first * psi + second * psi.conj();
        }
    }
}

/// Returns A + Aᴴ + B with a real symmetric matrix B.
pub(super) fn hermitian_sum(
    half: &DMatrix<Complex<f64>>,
    real: &DMatrix<f64>,
) -> DMatrix<Complex<f64>> {
    let (rows, columns) = half.shape();
    DMatrix::from_fn(rows, columns, |i, j| half[(i, j)] + half[(j, i)].conj() + real[(i, j)])
}

fn column_matrix(
    rows: usize,
    columns: &[nalgebra::DVector<Complex<f64>>],
) -> DMatrix<Complex<f64>> {
    if columns.is_empty() { DMatrix::zeros(rows, 0) } else { DMatrix::from_columns(columns) }
}
