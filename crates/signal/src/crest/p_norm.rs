//! The p-norm of a multisine over a period as a function of its phases.

use std::sync::Arc;

use nalgebra::{Complex, DMatrix, DVector};
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

use crate::Multisine;
use crate::phases::gcd;

/// Samples per Nyquist interval the norm is taken on: between them a sine at the highest line
/// rises by 1 − cos(π/64), 0.1 %, at most.
const OVERSAMPLING: usize = 32;

/// The norm for given lines and amplitudes.
pub(super) struct PNorm {
    lines: Vec<usize>,
    amplitudes: Vec<f64>,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl PNorm {
    pub(super) fn new(multisine: &Multisine) -> Self {
        // The waveform of lines 10, 20, 30 is the one of lines 1, 2, 3.
        let common = multisine.lines().iter().fold(0, |d, n| gcd(d, *n));
        let lines: Vec<usize> = multisine.lines().iter().map(|n| n / common).collect();
        let rms = multisine.rms();
        let amplitudes = multisine.amplitudes().iter().map(|a| a / rms).collect();
        let last = lines[lines.len() - 1];
        let len = (2 * (last + 1) * OVERSAMPLING).next_power_of_two();
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(len), planner.plan_fft_inverse(len));
        Self { lines, amplitudes, forward, inverse }
    }

    /// The period on the fine grid, for unit RMS.
    pub(super) fn signal(&self, phases: &[f64]) -> Vec<f64> {
        let (mut input, mut output) =
            (self.inverse.make_input_vec(), self.inverse.make_output_vec());
        for ((n, a), phase) in self.lines.iter().zip(&self.amplitudes).zip(phases) {
            input[*n] = Complex::from_polar(0.5 * a, *phase);
        }
        self.inverse.process(&mut input, &mut output).expect("buffers come from the plan");
        output
    }

    /// Σ y_k exp(+i 2π n k / len) for n = 0 … len/2.
    fn transform(&self, mut samples: Vec<f64>) -> Vec<Complex<f64>> {
        let mut output = self.forward.make_output_vec();
        self.forward.process(&mut samples, &mut output).expect("buffers come from the plan");
        output.iter_mut().for_each(|z| *z = z.conj());
        output
    }

    /// Mean of the diagonal of the first term of the Hessian, per p − 1: with Σ A²/2 = 1 and
    /// sin² taken as ½, it is Σ_k (x/s)^(p−2) / s² over the number of lines.
    pub(super) fn mean_curvature(&self, signal: &[f64], p: i32) -> f64 {
        let s = peak(signal);
        let weight: f64 = signal.iter().map(|x| (x / s).powi(p - 2)).sum();
        weight / (s * s * self.lines.len() as f64)
    }

    /// Hessian and gradient of (1/p) Σ_k (x_k / s)^p, s being the present peak.
    ///
    /// With x'_n = −A_n sin(nθ + φ_n) the derivative by φ_n, x''_n = −A_n cos(nθ + φ_n) and no
    /// mixed second derivatives:
    ///
    /// ```text
    /// g_n  = Σ_k (x/s)^(p−1) x'_n / s
    /// H_nm = (p−1) Σ_k (x/s)^(p−2) x'_n x'_m / s² + δ_nm Σ_k (x/s)^(p−1) x''_n / s
    /// ```
    ///
    /// The sums over k are Fourier sums of the two powers of x, since
    /// 2 sin a sin b = cos(a − b) − cos(a + b): two transforms give all of them.
    pub(super) fn derivatives(
        &self,
        phases: &[f64],
        signal: &[f64],
        p: i32,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let s = peak(signal);
        let weight: Vec<f64> = signal.iter().map(|x| (x / s).powi(p - 2)).collect();
        let pull = weight.iter().zip(signal).map(|(w, x)| w * x / s).collect();
        let (weight, pull) = (self.transform(weight), self.transform(pull));

        let n = self.lines.len();
        let turned: Vec<Complex<f64>> = (self.amplitudes.iter().zip(phases))
            .map(|(a, phase)| Complex::from_polar(a / s, *phase))
            .collect();
        let mut hessian = DMatrix::zeros(n, n);
        let mut gradient = DVector::zeros(n);
        for (j, (zj, lj)) in turned.iter().zip(&self.lines).enumerate() {
            for (i, (zi, li)) in turned.iter().zip(&self.lines).enumerate().skip(j) {
                // Only the lower triangle is read by the Cholesky factorisation.
                let difference = zi * zj.conj() * weight[li - lj];
                let sum = zi * zj * weight[li + lj];
                hessian[(i, j)] = 0.5 * f64::from(p - 1) * (difference.re - sum.re);
            }
            let z = zj * pull[*lj];
            gradient[j] = -z.im;
            hessian[(j, j)] -= z.re;
        }
        (hessian, gradient)
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
    use crate::Phases;

    /// (1/p) Σ (x/s)^p with s held fixed, the function `derivatives` differentiates.
    fn objective(norm: &PNorm, phases: &[f64], p: i32, s: f64) -> f64 {
        norm.signal(phases).iter().map(|x| (x / s).powi(p)).sum::<f64>() / f64::from(p)
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let lines = vec![1, 2, 5, 6];
        let amplitudes = vec![1.0, 0.5, 2.0, 1.5];
        let m = Multisine::new(lines, amplitudes, Phases::Random { seed: 3 }).unwrap();
        let (norm, p, h) = (PNorm::new(&m), 8, 1e-4);
        let signal = norm.signal(m.phases());
        let s = peak(&signal);
        let (hessian, gradient) = norm.derivatives(m.phases(), &signal, p);
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
            for j in 0..=i {
                let mixed = at(i, h, j, h) - at(i, h, j, -h) - at(i, -h, j, h) + at(i, -h, j, -h);
                let curvature = mixed / (4.0 * h * h);
                assert!((curvature - hessian[(i, j)]).abs() < tolerance, "Hessian {i} {j}");
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
