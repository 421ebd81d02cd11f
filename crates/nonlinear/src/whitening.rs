//! White noise on the samples of force and response, and the filter that makes a residual white.
//!
//! Noise u on the force changes the response; the change is that of the motion linearised about the
//! simulated response. Noise e on the response is added. With the state s of the linearised motion,
//!
//! ```text
//! y = C s + H u + e,    s⁺ = Φ s + G u,    s = 0 at the first sample,
//! ```
//!
//! because the initial state is a parameter of the fit. The innovations of a Kalman filter divided
//! by their standard deviations are white, and their sum of squares is the likelihood of the
//! residual. If the noise is white, a fit that minimises this sum of squares has the smallest
//! variance.
//!
//! # Source
//! Ljung, *System Identification*, 2nd ed. (1999), sections 4.3 and 7.2 (innovations and
//! prediction errors); Anderson & Moore, *Optimal Filtering* (1979), section 5.5 (noise that acts
//! on state and output).

use mechid_numerics::nelder_mead;
use nalgebra::{DMatrix, DVector, Dyn, Matrix, RawStorage};

use super::propagation::Propagation;
use crate::limits::{NOISE_ROUNDS, NOISE_SETTLED, NOISE_SPAN, NOISE_STEP};

/// Motion linearised about the simulated response of one record, from sample to sample.
pub(super) struct NoisePath(Vec<NoiseStep>);

/// Matrices of a [`NoisePath`] at one sample.
struct NoiseStep {
    /// Matrix Φ from the state to the state at the next sample, 2n × 2n.
    state: DMatrix<f64>,
    /// Matrix G from the force noise to the state at the next sample, 2n × n.
    input: DMatrix<f64>,
    /// Matrix C from the state to the response, n × 2n.
    output: DMatrix<f64>,
    /// Matrix H from the force noise to the response at the same sample, n × n.
    direct: DMatrix<f64>,
}

/// Filter that makes the residual of one record white.
pub(super) struct Filter {
    /// Gains of the Kalman filter at all samples, side by side, 2n × n each.
    gains: DMatrix<f64>,
    /// Inverses of the triangular factors of the covariances of the innovations: n × n for each
    /// sample, all samples side by side.
    inverses: DMatrix<f64>,
    /// Sum over the samples of the logarithm of the determinant of the innovation covariance.
    log_determinant: f64,
}

/// Variances of the noise on each channel of response and force, in the squares of their units.
#[derive(Debug, Clone)]
pub(super) struct NoiseVariances {
    pub(super) response: DVector<f64>,
    pub(super) force: DVector<f64>,
}

impl NoisePath {
    pub(super) fn new(motion: &Propagation<'_>) -> Self {
        let (half, feedthrough) = (motion.half_sample_input(), motion.direct());
        let step = |sample: usize| {
            let (state, output) = (motion.transition(sample).clone(), motion.output(sample));
            let (input, direct) = (&state * &half * 2.0, &output * &half + &feedthrough);
            NoiseStep { state, input, output, direct }
        };
        Self((0..motion.len()).map(step).collect())
    }

    /// Returns the number of channels.
    fn channels(&self) -> usize {
        self.0.first().map_or(0, |step| step.direct.nrows())
    }

    /// Returns the filter for these variances; `None` if a covariance is singular or not finite.
    pub(super) fn filter(&self, variances: &NoiseVariances) -> Option<Filter> {
        let (n, samples) = (self.channels(), self.0.len());
        let mut filter = Filter {
            gains: DMatrix::zeros(2 * n, n * samples),
            inverses: DMatrix::zeros(n, n * samples),
            log_determinant: 0.0,
        };
        let zeros = DMatrix::zeros;
        let (mut buffer, mut cross) = (zeros(2 * n, n), zeros(2 * n, n));
        let (mut scaled_input, mut scaled_direct) = (zeros(2 * n, n), zeros(n, n));
        let (mut covariance, mut gain) = (zeros(n, n), zeros(2 * n, n));
        let (mut state_covariance, mut next) = (zeros(2 * n, 2 * n), zeros(2 * n, 2 * n));
        for (sample, NoiseStep { state, input, output, direct }) in self.0.iter().enumerate() {
            // `scaled_input` and `scaled_direct` are G and H; each column is multiplied by the
            // standard deviation of the noise on its force.
            scaled_input.copy_from(input);
            scaled_direct.copy_from(direct);
            for (force, variance) in variances.force.iter().enumerate() {
                scaled_input.column_mut(force).scale_mut(variance.sqrt());
                scaled_direct.column_mut(force).scale_mut(variance.sqrt());
            }
            buffer.fill(0.0);
            add_product(&mut buffer, 1.0, &state_covariance, output);
            covariance.gemm(1.0, output, &buffer, 0.0);
            add_product(&mut covariance, 1.0, &scaled_direct, &scaled_direct);
            for (channel, variance) in variances.response.iter().enumerate() {
                covariance[(channel, channel)] += variance;
            }
            let factor = covariance.cholesky()?;
            let mut inverse = filter.inverses.columns_mut(sample * n, n);
            inverse.fill_with_identity();
            factor.l_dirty().solve_lower_triangular_mut(&mut inverse);
            filter.log_determinant -= 2.0 * inverse.diagonal().map(f64::ln).sum();
            covariance = factor.unpack_dirty();
            cross.gemm(1.0, state, &buffer, 0.0);
            add_product(&mut cross, 1.0, &scaled_input, &scaled_direct);
            // K = (cross L⁻ᵀ) L⁻¹.
            let inverse = filter.inverses.columns(sample * n, n);
            buffer.fill(0.0);
            add_product(&mut buffer, 1.0, &cross, &inverse);
            gain.gemm(1.0, &buffer, &inverse, 0.0);
            filter.gains.columns_mut(sample * n, n).copy_from(&gain);
            next.gemm(1.0, state, &state_covariance, 0.0);
            state_covariance.fill(0.0);
            add_product(&mut state_covariance, 1.0, &next, state);
            add_product(&mut state_covariance, 1.0, &scaled_input, &scaled_input);
            add_product(&mut state_covariance, -1.0, &buffer, &buffer);
        }
        filter.log_determinant.is_finite().then_some(filter)
    }

    /// Returns the mean square of each channel of the response to noise of unit variance on one
    /// force.
    fn mean_square(&self, force: usize) -> DVector<f64> {
        let n = self.channels();
        let mut state_covariance = DMatrix::zeros(2 * n, 2 * n);
        let mut sum = DVector::zeros(n);
        for NoiseStep { state, input, output, direct } in &self.0 {
            sum += (output * &state_covariance * output.transpose()).diagonal();
            sum += direct.column(force).component_mul(&direct.column(force));
            let push = input.column(force);
            state_covariance =
                state * state_covariance * state.transpose() + push * push.transpose();
        }
        sum / self.0.len().max(1) as f64
    }

    /// Whitens a residual or its derivatives (samples × n) in place.
    pub(super) fn whiten(&self, filter: &Filter, values: &mut DMatrix<f64>) {
        let n = values.ncols();
        let (mut state, mut next) = (DVector::zeros(2 * n), DVector::zeros(2 * n));
        let (mut innovation, mut white) = (DVector::zeros(n), DVector::zeros(n));
        for (sample, step) in self.0.iter().enumerate() {
            let gain = filter.gains.columns(sample * n, n);
            let inverse = filter.inverses.columns(sample * n, n);
            for channel in 0..n {
                innovation[channel] = values[(sample, channel)];
            }
            innovation.gemv(-1.0, &step.output, &state, 1.0);
            white.gemv(1.0, &inverse, &innovation, 0.0);
            next.gemv(1.0, &step.state, &state, 0.0);
            next.gemv(1.0, &gain, &innovation, 1.0);
            std::mem::swap(&mut state, &mut next);
            for channel in 0..n {
                values[(sample, channel)] = white[channel];
            }
        }
    }
}

/// Adds `factor` A Bᵀ to a matrix, without an allocation.
fn add_product(
    to: &mut DMatrix<f64>,
    factor: f64,
    a: &DMatrix<f64>,
    b: &Matrix<f64, Dyn, Dyn, impl RawStorage<f64, Dyn, Dyn>>,
) {
    for (a, b) in a.column_iter().zip(b.column_iter()) {
        to.ger(factor, &a, &b, 1.0);
    }
}

/// Returns the most likely variances of white noise on response and force for the residual of a
/// record (samples × n); `None` if no covariance is regular.
///
/// The search varies the logarithms of the ratios of the variances; the common factor of the
/// variances follows from the residual. Only the forces in `driven` have noise.
pub(super) fn most_likely(
    path: &NoisePath,
    residual: &DMatrix<f64>,
    driven: &[bool],
) -> Option<NoiseVariances> {
    let (n, samples) = (driven.len(), residual.nrows());
    let count = residual.len() as f64;
    let square = |dof: usize| residual.column(dof).norm_squared();
    let levels = DVector::from_fn(n, |dof, _| square(dof) / samples as f64);
    if levels.iter().any(|level| *level <= 0.0 || !level.is_finite()) {
        return None;
    }
    // For each force, this is the noise variance that alone explains the residual of one channel.
    // The channel is the one on which noise of this force has the largest effect relative to the
    // residual.
    let of_force = DVector::from_fn(n, |force, _| {
        let effect = path.mean_square(force).component_div(&levels).max();
        if driven[force] && effect > 0.0 && effect.is_finite() { 1.0 / effect } else { 0.0 }
    });
    let noisy: Vec<usize> = (0..n).filter(|force| of_force[*force] > 0.0).collect();
    let variances = |ratios: &[f64]| {
        let limited = |at: usize| ratios[at].clamp(-NOISE_SPAN, NOISE_SPAN).exp();
        let mut variances = NoiseVariances { response: levels.clone(), force: DVector::zeros(n) };
        for dof in 1..n {
            variances.response[dof] *= limited(dof - 1);
        }
        for (at, force) in noisy.iter().enumerate() {
            variances.force[*force] = of_force[*force] * limited(n - 1 + at);
        }
        variances
    };
    // The function returns the common factor and minus twice the logarithm of the likelihood.
    let judged = |variances: &NoiseVariances| -> Option<(f64, f64)> {
        let filter = path.filter(variances)?;
        let mut white = residual.clone();
        path.whiten(&filter, &mut white);
        let factor = white.norm_squared() / count;
        Some((factor, filter.log_determinant + count * factor.ln()))
    };
    let cost = |ratios: &[f64]| judged(&variances(ratios)).map_or(f64::INFINITY, |(_, cost)| cost);
    let start = vec![0.0; n - 1 + noisy.len()];
    let ratios = if start.is_empty() {
        start
    } else {
        nelder_mead::minimise(cost, &start, NOISE_STEP, NOISE_SETTLED, NOISE_ROUNDS)
    };
    let mut variances = variances(&ratios);
    let (factor, _) = judged(&variances)?;
    variances.response *= factor;
    variances.force *= factor;
    Some(variances)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The covariance of the residual is computed sample by sample. After the filter this
    /// covariance is the unit matrix, and the determinant that the filter reports is correct.
    #[test]
    fn the_filter_makes_the_covariance_one() {
        let (n, samples) = (2, 9);
        let number = |i: usize, j: usize| ((7 * i + 5 * j + 1) as f64).sin();
        let step = |at: usize| NoiseStep {
            state: DMatrix::from_fn(2 * n, 2 * n, |i, j| 0.4 * number(i + at, j)),
            input: DMatrix::from_fn(2 * n, n, |i, j| number(i, j + at)),
            output: DMatrix::from_fn(n, 2 * n, |i, j| number(i + 2 * at, j + 3)),
            direct: DMatrix::from_fn(n, n, |i, j| 0.3 * number(i + 1, j + at)),
        };
        let path = NoisePath((0..samples).map(step).collect());
        let variances = NoiseVariances {
            response: DVector::from_vec(vec![0.3, 0.7]),
            force: DVector::from_vec(vec![1.1, 0.4]),
        };
        let filter = path.filter(&variances).unwrap();
        // Each column of this matrix is the response to one unit of one force sample; the samples
        // of a channel are adjacent.
        let mut carried = DMatrix::zeros(n * samples, n * samples);
        for at in 0..samples {
            for force in 0..n {
                let mut state = DVector::zeros(2 * n);
                for (sample, step) in path.0.iter().enumerate().skip(at) {
                    let mut output = &step.output * &state;
                    state = &step.state * state;
                    if sample == at {
                        output += step.direct.column(force);
                        state += step.input.column(force);
                    }
                    for channel in 0..n {
                        carried[(channel * samples + sample, force * samples + at)] =
                            output[channel];
                    }
                }
            }
        }
        let spread = |variances: &DVector<f64>| {
            DMatrix::from_diagonal(&DVector::from_fn(n * samples, |i, _| variances[i / samples]))
        };
        let covariance =
            &carried * spread(&variances.force) * carried.transpose() + spread(&variances.response);
        let factor = covariance.cholesky().unwrap().l();
        let mut white = factor.clone();
        for mut column in white.column_iter_mut() {
            let mut values = DMatrix::from_column_slice(samples, n, column.as_slice());
            path.whiten(&filter, &mut values);
            column.copy_from_slice(values.as_slice());
        }
        let unit = &white * white.transpose();
        assert!((unit - DMatrix::identity(n * samples, n * samples)).amax() < 1e-10);
        let log_determinant = 2.0 * factor.diagonal().map(f64::ln).sum();
        assert!((filter.log_determinant - log_determinant).abs() < 1e-10);
    }
}
