//! The Kalman filter and fixed-interval smoother, one scalar measurement at a time.
//!
//! The channels of a sample are processed one after the other, and the smoother uses backward sums
//! r and N; both avoid matrix inverses. The loops do not allocate. The estimates are those of the
//! Rauch-Tung-Striebel smoother.
//!
//! # Source
//! Durbin & Koopman (2012), Time Series Analysis by State Space Methods, sections 4.4 and 6.4.

use crate::limits;

/// State space a(k+1) = T a(k) + noise of covariance Q, y_c(k) = Z_c a(k) + noise of variance R.
///
/// Square matrices are stored row by row.
pub(crate) struct StateSpace {
    pub states: usize,
    pub channels: usize,
    pub transition: Vec<f64>,
    pub process: Vec<f64>,
    pub output: Vec<f64>,
    /// Variance R of the measurement noise.
    pub noise_variance: f64,
    /// Mean and covariance of the state at the first sample, before its measurement.
    pub start_mean: Vec<f64>,
    pub start: Vec<f64>,
}

/// Data for the backward pass: one block per sample, allocated once. Covariances and gains are
/// stored only for the samples before they converge.
pub(crate) struct Passage {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    /// Product P Zᵀ of each scalar measurement, with the covariance P.
    gain: Vec<f64>,
    /// Innovation and its variance.
    innovation: Vec<(f64, f64)>,
    /// Last sample with its own covariance and gains. At later samples these values have converged,
    /// so they are not stored.
    last: usize,
}

impl Passage {
    /// Returns the innovations with their variances, channels of a sample side by side.
    pub fn innovations(&self) -> &[(f64, f64)] {
        &self.innovation
    }

    /// Returns the variance of each state before the measurement of sample k.
    pub fn variances(&self, k: usize, states: usize) -> impl Iterator<Item = f64> + '_ {
        let block = &self.covariance[k.min(self.last) * states * states..][..states * states];
        block.iter().step_by(states + 1).copied()
    }
}

/// Prediction errors of a model: each sample is predicted from the earlier samples.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Innovations {
    /// Sum of the logarithms of the variances of the innovations.
    pub log_variance: f64,
    /// Sum of the squared innovations divided by their variances.
    pub energy: f64,
}

impl Innovations {
    /// Returns the log-likelihood, without constants.
    pub fn log_likelihood(self) -> f64 {
        -0.5 * (self.log_variance + self.energy)
    }
}

struct Filter {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    /// Product P Zᵀ of each channel, and the variance of its innovation, at the last sample.
    gain: Vec<f64>,
    variance: Vec<f64>,
    /// `true` once covariance, gains and variances no longer change from sample to sample.
    settled: bool,
    tolerance: f64,
    /// Variances of the states before the measurements of the last sample.
    before: Vec<f64>,
    moved: Vec<f64>,
    product: Vec<f64>,
    innovations: Innovations,
}

impl StateSpace {
    /// Returns the prediction error of the samples (channels of a sample side by side).
    pub fn innovations(&self, samples: &[f64]) -> Innovations {
        let mut filter = Filter::new(self, limits::CONVERGED_LIKELIHOOD);
        for sample in samples.chunks_exact(self.channels) {
            for (c, y) in sample.iter().enumerate() {
                filter.measure(self, c, *y);
            }
            filter.advance(self);
        }
        filter.innovations
    }

    /// Runs the forward pass and stores the data of the smoother.
    pub fn filter(&self, samples: &[f64]) -> Passage {
        let (m, len) = (self.states, samples.len() / self.channels);
        let mut passage = Passage {
            mean: Vec::with_capacity(len * m),
            covariance: Vec::new(),
            gain: Vec::new(),
            innovation: Vec::with_capacity(samples.len()),
            last: 0,
        };
        let mut filter = Filter::new(self, limits::CONVERGED_COVARIANCE);
        for (k, sample) in samples.chunks_exact(self.channels).enumerate() {
            passage.mean.extend_from_slice(&filter.mean);
            if !filter.settled {
                passage.last = k;
                passage.covariance.extend_from_slice(&filter.covariance);
            }
            let fresh = !filter.settled;
            for (c, y) in sample.iter().enumerate() {
                passage.innovation.push(filter.measure(self, c, *y));
            }
            if fresh {
                passage.gain.extend_from_slice(&filter.gain);
            }
            filter.advance(self);
        }
        passage
    }

    /// Returns mean and variance of every state at every sample, given the whole record. The values
    /// are stored sample after sample and replace the results of the filter.
    pub fn smooth(&self, mut passage: Passage) -> (Vec<f64>, Vec<f64>) {
        let (m, channels) = (self.states, self.channels);
        let len = passage.mean.len() / m;
        let mut variance = vec![0.0; len * m];
        let (mut r, mut n) = (vec![0.0; m], vec![0.0; m * m]);
        let (mut vector, mut product) = (vec![0.0; m], vec![0.0; m * m]);
        for k in (0..len).rev() {
            let stored = k.min(passage.last);
            for c in (0..channels).rev() {
                let gain = &passage.gain[(stored * channels + c) * m..][..m];
                let (z, innovation) =
                    (&self.output[c * m..][..m], passage.innovation[k * channels + c]);
                back_over_measurement(&mut r, &mut n, &mut vector, z, gain, innovation);
            }
            let mean = &mut passage.mean[k * m..][..m];
            let p = &passage.covariance[stored * m * m..][..m * m];
            for i in 0..m {
                let row = &p[i * m..][..m];
                mean[i] += dot(row, &r);
                times(&n, row, &mut vector);
                variance[k * m + i] = (row[i] - dot(row, &vector)).max(0.0);
            }
            self.back_over_step(&mut r, &mut n, &mut vector, &mut product);
        }
        (passage.mean, variance)
    }

    /// Computes r ← Tᵀ r, N ← Tᵀ N T.
    fn back_over_step(
        &self,
        r: &mut [f64],
        n: &mut [f64],
        vector: &mut [f64],
        product: &mut [f64],
    ) {
        let m = self.states;
        vector.fill(0.0);
        for (row, weight) in self.transition.chunks_exact(m).zip(r.iter()) {
            vector.iter_mut().zip(row).for_each(|(v, t)| *v += t * weight);
        }
        r.copy_from_slice(vector);
        multiply(n, &self.transition, product, m);
        n.fill(0.0);
        for (row, t) in product.chunks_exact(m).zip(self.transition.chunks_exact(m)) {
            for (i, weight) in t.iter().enumerate() {
                n[i * m..][..m].iter_mut().zip(row).for_each(|(n, p)| *n += weight * p);
            }
        }
    }
}

impl Filter {
    fn new(space: &StateSpace, tolerance: f64) -> Self {
        let m = space.states;
        Self {
            mean: space.start_mean.clone(),
            covariance: space.start.clone(),
            gain: vec![0.0; m * space.channels],
            variance: vec![0.0; space.channels],
            settled: false,
            tolerance,
            before: vec![0.0; m],
            moved: vec![0.0; m],
            product: vec![0.0; m * m],
            innovations: Innovations::default(),
        }
    }

    /// Updates the state with one scalar measurement; returns the innovation and its variance.
    fn measure(&mut self, space: &StateSpace, channel: usize, y: f64) -> (f64, f64) {
        let m = space.states;
        let z = &space.output[channel * m..][..m];
        let gain = &mut self.gain[channel * m..][..m];
        if !self.settled {
            times(&self.covariance, z, gain);
            self.variance[channel] = dot(z, gain) + space.noise_variance;
        }
        let variance = self.variance[channel];
        let innovation = y - dot(z, &self.mean);
        let weight = innovation / variance;
        self.mean.iter_mut().zip(gain.iter()).for_each(|(a, g)| *a += g * weight);
        if !self.settled {
            for (row, g) in self.covariance.chunks_exact_mut(m).zip(gain.iter()) {
                let g = g / variance;
                row.iter_mut().zip(gain.iter()).for_each(|(p, h)| *p -= g * h);
            }
        }
        self.innovations.log_variance += variance.ln();
        self.innovations.energy += innovation * weight;
        (innovation, variance)
    }

    /// Advances to the next sample: a ← T a, P ← T P Tᵀ + Q.
    fn advance(&mut self, space: &StateSpace) {
        let (m, t) = (space.states, &space.transition);
        times(t, &self.mean, &mut self.moved);
        self.mean.copy_from_slice(&self.moved);
        if self.settled {
            return;
        }
        multiply(t, &self.covariance, &mut self.product, m);
        for (i, row) in self.product.chunks_exact(m).enumerate() {
            for j in i..m {
                let p = dot(row, &t[j * m..][..m]) + space.process[i * m + j];
                self.covariance[i * m + j] = p;
                self.covariance[j * m + i] = p;
            }
        }
        // The filter is steady once the predicted variances of this sample and of the one before
        // agree within the tolerance.
        self.settled = true;
        for (before, now) in self.before.iter_mut().zip(self.covariance.iter().step_by(m + 1)) {
            self.settled &= (now - *before).abs() <= self.tolerance * now.abs();
            *before = *now;
        }
    }
}

/// Computes r ← Zᵀ v/F + Lᵀ r and N ← ZᵀZ/F + Lᵀ N L, with L = I − g Z/F, the innovation v and its
/// variance F.
fn back_over_measurement(
    r: &mut [f64],
    n: &mut [f64],
    vector: &mut [f64],
    z: &[f64],
    gain: &[f64],
    (innovation, variance): (f64, f64),
) {
    let m = r.len();
    let weight = (innovation - dot(gain, r)) / variance;
    r.iter_mut().zip(z).for_each(|(r, z)| *r += z * weight);
    times(n, gain, vector);
    let square = (1.0 + dot(gain, vector) / variance) / variance;
    for i in 0..m {
        for j in 0..m {
            n[i * m + j] += square * z[i] * z[j] - (z[i] * vector[j] + vector[i] * z[j]) / variance;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Computes out ← A x.
fn times(a: &[f64], x: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(a.chunks_exact(x.len())) {
        *out = dot(row, x);
    }
}

/// Computes out ← A B, all m×m.
fn multiply(a: &[f64], b: &[f64], out: &mut [f64], m: usize) {
    for (row, out) in a.chunks_exact(m).zip(out.chunks_exact_mut(m)) {
        out.fill(0.0);
        for (a, b) in row.iter().zip(b.chunks_exact(m)) {
            out.iter_mut().zip(b).for_each(|(o, b)| *o += a * b);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::StateSpace;

    const M: usize = 3;
    const CHANNELS: usize = 2;
    /// Number of samples, enough for the variances to converge.
    const LEN: usize = 90;

    fn space() -> StateSpace {
        StateSpace {
            states: M,
            channels: CHANNELS,
            transition: vec![0.9, 0.3, 0.1, -0.4, 0.8, 0.5, 0.0, 0.0, 1.0],
            process: vec![0.02, 0.01, 0.03, 0.01, 0.05, 0.02, 0.03, 0.02, 0.3],
            output: vec![1.0, 0.0, 0.0, 0.2, 1.0, 0.7],
            noise_variance: 0.3,
            start_mean: vec![0.0; M],
            start: vec![0.5, 0.1, 0.0, 0.1, 0.7, 0.0, 0.0, 0.0, 4.0],
        }
    }

    fn samples() -> Vec<f64> {
        (0..LEN * CHANNELS).map(|i| (1.3 * i as f64).sin() + 0.1 * i as f64).collect()
    }

    /// Returns the reference for the smoother: the joint covariance of all states is conditioned on
    /// all samples at once.
    fn conditioned() -> (DVector<f64>, DVector<f64>, f64) {
        let s = space();
        let t = DMatrix::from_row_slice(M, M, &s.transition);
        let q = DMatrix::from_row_slice(M, M, &s.process);
        let mut prior = DMatrix::zeros(M * LEN, M * LEN);
        let mut diagonal = DMatrix::from_row_slice(M, M, &s.start);
        for k in 0..LEN {
            let mut block = diagonal.clone();
            for l in k..LEN {
                prior.view_mut((l * M, k * M), (M, M)).copy_from(&block);
                prior.view_mut((k * M, l * M), (M, M)).copy_from(&block.transpose());
                block = &t * block;
            }
            diagonal = &t * diagonal * t.transpose() + &q;
        }
        let z = DMatrix::from_row_slice(CHANNELS, M, &s.output);
        let out = DMatrix::<f64>::identity(LEN, LEN).kronecker(&z);
        let cross = &prior * out.transpose();
        let mut seen = &out * &cross;
        seen.iter_mut().step_by(LEN * CHANNELS + 1).for_each(|v| *v += s.noise_variance);
        let y = DVector::from_vec(samples());
        let lu = seen.lu();
        let weights = lu.solve(&y).unwrap();
        let likelihood = -0.5 * (lu.determinant().ln() + y.dot(&weights));
        let posterior = prior - &cross * lu.solve(&cross.transpose()).unwrap();
        (cross * weights, posterior.diagonal(), likelihood)
    }

    #[test]
    fn the_smoother_is_the_conditional_distribution_of_all_states() {
        let (mean, variance, likelihood) = conditioned();
        let passage = space().filter(&samples());
        assert!(passage.last + 1 < LEN, "{}", passage.last);
        let (smooth, spread) = space().smooth(passage);
        for i in 0..M * LEN {
            assert!((smooth[i] - mean[i]).abs() < 1e-10, "state {i}");
            assert!((spread[i] - variance[i]).abs() < 1e-10, "variance {i}");
        }
        let found = space().innovations(&samples()).log_likelihood();
        assert!((found - likelihood).abs() < 1e-6, "{found} {likelihood}");
    }
}
