//! The p-norm of a multisine over a period as a function of its phases.

use std::sync::Arc;

use nalgebra::{Complex, DMatrix, DVector};

use crate::multisine::Multisine;
use crate::phases::gcd;
use crate::transform;
use crate::transform::{ComplexToReal, RealToComplex};

/// P-norm of multisines with given lines and given amplitudes, which are scaled to unit RMS.
pub(super) struct PNorm {
    lines: Vec<usize>,
    amplitudes: Vec<f64>,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl PNorm {
    /// Creates the norm over a grid of at least `oversampling` samples per Nyquist interval.
    pub(super) fn new(multisine: &Multisine, oversampling: usize) -> Self {
        // Lines 10, 20, 30 have the waveform of lines 1, 2, 3.
        let common = multisine.lines().iter().fold(0, |d, n| gcd(d, *n));
        let lines: Vec<usize> = multisine.lines().iter().map(|n| n / common).collect();
        let rms = multisine.rms();
        let amplitudes = multisine.amplitudes().iter().map(|a| a / rms).collect();
        let last = lines[lines.len() - 1];
        let len = (2 * (last + 1) * oversampling).next_power_of_two();
        let (forward, inverse) = (transform::forward(len), transform::inverse(len));
        Self { lines, amplitudes, forward, inverse }
    }

    /// Returns the samples of one period on the grid.
    pub(super) fn signal(&self, phases: &[f64]) -> Vec<f64> {
        let terms = self.amplitudes.iter().zip(phases);
        self.synthesise(terms.map(|(a, phase)| Complex::from_polar(*a, *phase)))
    }

    /// Returns Re Σ z_n exp(i n θ_k) at each grid point θ_k, from one z per line.
    fn synthesise(&self, values: impl Iterator<Item = Complex<f64>>) -> Vec<f64> {
        let (mut input, mut output) =
            (self.inverse.make_input_vec(), self.inverse.make_output_vec());
        for (n, z) in self.lines.iter().zip(values) {
            input[*n] = z * 0.5;
        }
        self.inverse.process(&mut input, &mut output).expect("buffers come from the plan");
        output
    }

    /// Returns Σ y_k exp(+i n θ_k) for n = 0, 1, 2, …, from one sample y per grid point θ_k.
    fn transform(&self, mut samples: Vec<f64>) -> Vec<Complex<f64>> {
        let mut output = self.forward.make_output_vec();
        self.forward.process(&mut samples, &mut output).expect("buffers come from the plan");
        output.iter_mut().for_each(|z| *z = z.conj());
        output
    }

    /// Computes the first derivatives g and the second derivatives H of (1/p) Σ_k (x_k / s)^p with
    /// respect to the phases φ_n; s is the present peak.
    ///
    /// The signal has the derivatives x'_n = −A_n sin(nθ + φ_n) and x''_n = −A_n cos(nθ + φ_n) with
    /// respect to φ_n, and no mixed second derivatives. Hence:
    ///
    /// ```text
    /// g_n  = Σ_k (x/s)^(p−1) x'_n / s
    /// H_nm = (p−1) Σ_k (x/s)^(p−2) x'_n x'_m / s² + δ_nm Σ_k (x/s)^(p−1) x''_n / s
    /// ```
    ///
    /// The sums over k are Fourier sums of (x/s)^(p−1) and (x/s)^(p−2).
    pub(super) fn derivatives(&self, phases: &[f64], signal: &[f64], p: i32) -> Derivatives<'_> {
        let s = peak(signal);
        let weight: Vec<f64> = signal.iter().map(|x| (x / s).powi(p - 2)).collect();
        let pull = weight.iter().zip(signal).map(|(w, x)| w * x / s).collect();
        let pull = self.transform(pull);
        let turned: Vec<Complex<f64>> = (self.amplitudes.iter().zip(phases))
            .map(|(a, phase)| Complex::from_polar(a / s, *phase))
            .collect();
        let pulled: Vec<Complex<f64>> =
            turned.iter().zip(&self.lines).map(|(z, n)| z * pull[*n]).collect();
        Derivatives {
            norm: self,
            gradient: DVector::from_iterator(pulled.len(), pulled.iter().map(|z| -z.im)),
            own: pulled.iter().map(|z| -z.re).collect(),
            turned,
            weight,
            factor: f64::from(p - 1),
        }
    }
}

/// Gradient and Hessian at one point; the Hessian is formed or applied on demand.
pub(super) struct Derivatives<'a> {
    norm: &'a PNorm,
    pub(super) gradient: DVector<f64>,
    /// Diagonal entries of the second term of the Hessian; this term has no other entries.
    own: Vec<f64>,
    /// Complex amplitude (A_n / s) exp(i φ_n) of each line, relative to the peak s.
    turned: Vec<Complex<f64>>,
    /// (x/s)^(p−2).
    weight: Vec<f64>,
    /// p − 1.
    factor: f64,
}

impl Derivatives<'_> {
    /// Returns the mean of the diagonal entries of the first term of the Hessian. The factors sin²
    /// in these entries are replaced by their mean, ½.
    pub(super) fn mean_curvature(&self) -> f64 {
        let power: f64 = self.turned.iter().map(|z| 0.5 * z.norm_sqr()).sum();
        self.factor * power * self.weight.iter().sum::<f64>() / self.turned.len() as f64
    }

    /// Returns the lower triangle of the Hessian, the part that a Cholesky factorisation reads.
    ///
    /// Since 2 sin a sin b = cos(a − b) − cos(a + b), one transform of the weight gives all
    /// entries.
    pub(super) fn hessian(&self) -> DMatrix<f64> {
        let weight = self.norm.transform(self.weight.clone());
        let lines = &self.norm.lines;
        let mut hessian = DMatrix::zeros(lines.len(), lines.len());
        for (j, zj) in self.turned.iter().enumerate() {
            for (i, zi) in self.turned.iter().enumerate().skip(j) {
                let difference = zi * zj.conj() * weight[lines[i] - lines[j]];
                let sum = zi * zj * weight[lines[i] + lines[j]];
                hessian[(i, j)] = 0.5 * self.factor * (difference.re - sum.re);
            }
            hessian[(j, j)] += self.own[j];
        }
        hessian
    }

    /// Returns the Hessian times a vector, by two transforms.
    pub(super) fn apply(&self, v: &DVector<f64>) -> DVector<f64> {
        // −A sin(nθ + φ) is the real part of i A exp(i (nθ + φ)).
        let terms = self.turned.iter().zip(v).map(|(z, v)| z * Complex::new(0.0, *v));
        let mut along = self.norm.synthesise(terms);
        along.iter_mut().zip(&self.weight).for_each(|(y, w)| *y *= w);
        let sums = self.norm.transform(along);
        let terms = self.turned.iter().zip(&self.norm.lines).zip(v.iter().zip(&self.own));
        DVector::from_iterator(
            v.len(),
            terms.map(|((z, n), (v, own))| -self.factor * (z * sums[*n]).im + own * v),
        )
    }
}

/// (mean |x|^p)^(1/p) for an even p, without overflow.
pub(super) fn norm(signal: &[f64], p: i32) -> f64 {
    let s = peak(signal);
    let mean = signal.iter().map(|x| (x / s).powi(p)).sum::<f64>() / signal.len() as f64;
    s * mean.powf(1.0 / f64::from(p))
}

fn peak(signal: &[f64]) -> f64 {
    signal.iter().fold(0.0_f64, |m, v| m.max(v.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phases::Phases;

    /// (1/p) Σ (x/s)^p with s held fixed, the function that `derivatives` differentiates.
    fn objective(norm: &PNorm, phases: &[f64], p: i32, s: f64) -> f64 {
        norm.signal(phases).iter().map(|x| (x / s).powi(p)).sum::<f64>() / f64::from(p)
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let lines = vec![1, 2, 5, 6];
        let amplitudes = vec![1.0, 0.5, 2.0, 1.5];
        let m = Multisine::new(lines, amplitudes, Phases::Random { seed: 3 }).unwrap();
        let (norm, p, h) = (PNorm::new(&m, 32), 8, 1e-4);
        let signal = norm.signal(m.phases());
        let s = peak(&signal);
        let derivatives = norm.derivatives(m.phases(), &signal, p);
        let (hessian, gradient) = (derivatives.hessian(), &derivatives.gradient);
        let at = |i: usize, a: f64, j: usize, b: f64| {
            let mut phases = m.phases().to_vec();
            phases[i] += a;
            phases[j] += b;
            objective(&norm, &phases, p, s)
        };
        // Central differences err by h² times a higher derivative and by ε f / h².
        let tolerance = 1e-5 * hessian.amax();
        for i in 0..4 {
            let slope = (at(i, h, i, 0.0) - at(i, -h, i, 0.0)) / (2.0 * h);
            assert!((slope - gradient[i]).abs() < tolerance, "gradient {i}");
            let column = derivatives.apply(&DVector::from_fn(4, |k, _| f64::from(k == i)));
            for j in 0..=i {
                let mixed = at(i, h, j, h) - at(i, h, j, -h) - at(i, -h, j, h) + at(i, -h, j, -h);
                let curvature = mixed / (4.0 * h * h);
                assert!((curvature - hessian[(i, j)]).abs() < tolerance, "Hessian {i} {j}");
                assert!((curvature - column[j]).abs() < tolerance, "applied {i} {j}");
            }
        }
    }

    #[test]
    fn norms_by_hand() {
        assert_eq!(norm(&[3.0, -3.0], 16), 3.0);
        // (2^1024 + 0)/2 would overflow unscaled.
        assert!((norm(&[2.0, 0.0], 1024) - 2.0 * 0.5f64.powf(1.0 / 1024.0)).abs() < 1e-15);
    }
}
