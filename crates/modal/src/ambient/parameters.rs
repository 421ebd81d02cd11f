//! Parameters of the spectral matrix of the outputs, and their indices in one vector.

use nalgebra::{Complex, DMatrix, DVector};

/// Kernel of a mode; the kernels differ in the response of the output to a constant force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Static deflection, 1/(s − λ): for displacements and for velocities.
    Static,
    /// Kernel with a static deflection, for a record without an anti-aliasing filter: frequencies
    /// above half the sampling rate fold into the band.
    Sampled,
    /// No static deflection, s/(λ(s − λ)): for accelerations and for velocities.
    Vanishing,
}

/// Time axis of the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    /// Length, in s.
    pub duration: f64,
    /// Time between two samples, in s.
    pub sample_interval: f64,
}

/// Indices of the parameters: ln ω and ln ζ of each mode, the real and imaginary parts of each
/// shape, the factors of the correlation of the modal forces, and the noise of each sensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub modes: usize,
    pub outputs: usize,
    pub noise_terms: usize,
    /// Pairs (later, earlier) of modes, whose forces may be correlated.
    pub pairs: Vec<(usize, usize)>,
}

impl Layout {
    pub fn new(modes: usize, outputs: usize, noise_terms: usize) -> Self {
        let pairs = (0..modes).flat_map(|r| (0..r).map(move |s| (r, s))).collect();
        Self { modes, outputs, noise_terms, pairs }
    }

    pub fn len(&self) -> usize {
        self.noise(0, 0) + self.noise_terms * self.outputs
    }

    pub fn frequency(&self, mode: usize) -> usize {
        mode
    }

    pub fn damping(&self, mode: usize) -> usize {
        self.modes + mode
    }

    /// Returns the index of the first real part of a shape; its imaginary parts follow the real
    /// parts.
    pub fn shape(&self, mode: usize) -> usize {
        2 * self.modes + 2 * self.outputs * mode
    }

    pub fn correlation(&self, pair: usize) -> usize {
        self.shape(self.modes) + pair
    }

    pub fn noise(&self, term: usize, output: usize) -> usize {
        self.correlation(self.pairs.len()) + term * self.outputs + output
    }
}

/// Values of the parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parameters {
    pub kernel: Kernel,
    pub layout: Layout,
    pub values: DVector<f64>,
}

impl Parameters {
    pub fn omega(&self, mode: usize) -> f64 {
        self.values[self.layout.frequency(mode)].exp()
    }

    pub fn zeta(&self, mode: usize) -> f64 {
        self.values[self.layout.damping(mode)].exp().min(0.99)
    }

    pub fn pole(&self, mode: usize) -> Complex<f64> {
        let (omega, zeta) = (self.omega(mode), self.zeta(mode));
        Complex::new(-zeta * omega, omega * (1.0 - zeta * zeta).sqrt())
    }

    pub fn poles(&self) -> Vec<Complex<f64>> {
        (0..self.layout.modes).map(|mode| self.pole(mode)).collect()
    }

    /// Returns ∂λ/∂ ln ω and ∂λ/∂ ln ζ.
    pub fn pole_derivatives(&self, mode: usize) -> [Complex<f64>; 2] {
        let (omega, zeta) = (self.omega(mode), self.zeta(mode));
        let along = -zeta * zeta / (1.0 - zeta * zeta).sqrt();
        [self.pole(mode), Complex::new(-zeta, along) * omega]
    }

    pub fn shape(&self, mode: usize) -> DVector<Complex<f64>> {
        let (first, p) = (self.layout.shape(mode), self.layout.outputs);
        DVector::from_fn(p, |i, _| Complex::new(self.values[first + i], self.values[first + p + i]))
    }

    pub fn set_shape(&mut self, mode: usize, shape: &DVector<Complex<f64>>) {
        let (first, p) = (self.layout.shape(mode), self.layout.outputs);
        for (i, z) in shape.iter().enumerate() {
            self.values[first + i] = z.re;
            self.values[first + p + i] = z.im;
        }
    }

    /// Returns the factor of the correlation before its rows are normalised.
    pub fn raw_factor(&self) -> DMatrix<f64> {
        let mut factor = DMatrix::identity(self.layout.modes, self.layout.modes);
        for (index, &(r, s)) in self.layout.pairs.iter().enumerate() {
            factor[(r, s)] = self.values[self.layout.correlation(index)];
        }
        factor
    }

    /// Returns the factor C with rows of unit length: the modal forces have the correlation C Cᵀ.
    pub fn factor(&self) -> DMatrix<f64> {
        let mut factor = self.raw_factor();
        for mut row in factor.row_iter_mut() {
            row.unscale_mut(row.norm());
        }
        factor
    }

    /// Returns the logarithm of the noise variance of a sensor at one frequency; `terms` are the
    /// values of the Chebyshev polynomials there.
    pub fn log_noise(&self, output: usize, terms: &[f64]) -> f64 {
        let value = |(d, t): (usize, &f64)| t * self.values[self.layout.noise(d, output)];
        terms.iter().enumerate().map(value).sum()
    }

    /// Returns the parameters of the modes `order`, in this order.
    pub fn reordered(&self, order: &[usize]) -> Self {
        let layout = Layout::new(order.len(), self.layout.outputs, self.layout.noise_terms);
        let mut result = Self { kernel: self.kernel, values: DVector::zeros(layout.len()), layout };
        let correlation = self.factor() * self.factor().transpose();
        let chosen =
            DMatrix::from_fn(order.len(), order.len(), |i, j| correlation[(order[i], order[j])]);
        let lower = chosen.cholesky().map(|factor| factor.l());
        for (to, &from) in order.iter().enumerate() {
            result.values[to] = self.values[self.layout.frequency(from)];
            result.values[order.len() + to] = self.values[self.layout.damping(from)];
            result.set_shape(to, &self.shape(from));
        }
        for (index, &(r, s)) in result.layout.pairs.iter().enumerate() {
            // Rows are normalised again; the diagonal of the raw factor is 1.
            let value = lower.as_ref().map_or(0.0, |l| l[(r, s)] / l[(r, r)]);
            result.values[result.layout.correlation(index)] = value;
        }
        result.copy_noise(self);
        result
    }

    /// Returns the parameters with one more mode at the end, whose force is independent of the
    /// forces of the other modes.
    pub fn with_mode(&self, pole: Complex<f64>, shape: &DVector<Complex<f64>>) -> Self {
        let modes = self.layout.modes;
        let layout = Layout::new(modes + 1, self.layout.outputs, self.layout.noise_terms);
        let mut result = Self { kernel: self.kernel, values: DVector::zeros(layout.len()), layout };
        for mode in 0..modes {
            result.values[mode] = self.values[self.layout.frequency(mode)];
            result.values[modes + 1 + mode] = self.values[self.layout.damping(mode)];
            result.set_shape(mode, &self.shape(mode));
        }
        result.values[modes] = pole.norm().ln();
        result.values[2 * modes + 1] = (-pole.re / pole.norm()).ln();
        result.set_shape(modes, shape);
        for (index, pair) in result.layout.pairs.iter().enumerate() {
            let before = self.layout.pairs.iter().position(|old| old == pair);
            let value = before.map_or(0.0, |old| self.values[self.layout.correlation(old)]);
            result.values[result.layout.correlation(index)] = value;
        }
        result.copy_noise(self);
        result
    }

    /// Returns the parameters with `terms` polynomials of the noise; the coefficients of new
    /// polynomials are zero.
    pub fn with_noise_terms(&self, terms: usize) -> Self {
        let layout = Layout::new(self.layout.modes, self.layout.outputs, terms);
        let values = self.values.clone().resize_vertically(layout.len(), 0.0);
        Self { kernel: self.kernel, layout, values }
    }

    /// Returns the parameters with noise of the same variance at all lines.
    pub fn with_constant_noise(&self, variances: &[f64]) -> Self {
        let mut result = self.clone();
        let noise = self.layout.noise(0, 0)..self.layout.noise(self.layout.noise_terms, 0);
        result.values.as_mut_slice()[noise].fill(0.0);
        for (output, variance) in variances.iter().enumerate() {
            result.values[self.layout.noise(0, output)] = variance.ln();
        }
        result
    }

    /// Returns the parameters for outputs in the units `to` instead of the present units `from`.
    pub fn with_units(&self, from: &[f64], to: &[f64]) -> Self {
        let mut result = self.clone();
        for (output, (from, to)) in from.iter().zip(to).enumerate() {
            let ratio = from / to;
            for mode in 0..self.layout.modes {
                let index = self.layout.shape(mode) + output;
                result.values[index] *= ratio;
                result.values[index + self.layout.outputs] *= ratio;
            }
            result.values[self.layout.noise(0, output)] += 2.0 * ratio.ln();
        }
        result
    }

    fn copy_noise(&mut self, from: &Self) {
        let (first, old) = (self.layout.noise(0, 0), from.layout.noise(0, 0));
        for i in 0..self.layout.noise_terms * self.layout.outputs {
            self.values[first + i] = from.values[old + i];
        }
    }
}
