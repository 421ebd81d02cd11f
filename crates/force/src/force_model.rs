//! The force as a stationary process: a band from 0 up to a corner frequency.

use std::f64::consts::TAU;

use mechid_numerics::linear_algebra::exponential;
use nalgebra::DMatrix;

use crate::error::ForceError;
use crate::limits;

/// Prior spectrum of the forces in the Kalman smoother.
///
/// ```text
///                 τ² g / ω_c
/// S(ω) = ───────────────────── ,   τ² = ∫ S dω/2π
///         1 + (ω/ω_c)^(2 order)
/// ```
///
/// A force of order 1 returns to zero like an Ornstein–Uhlenbeck process; over times that are short
/// compared with 1/ω_c it is a random walk. With a higher order, the spectrum falls more steeply
/// above the corner. No force model drifts: without information in the measurement, the force is 0
/// ± τ.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceModel {
    /// Order of the low-pass, 1 to [`ForceModel::MOST`].
    pub order: usize,
    /// Corner frequency ω_c/2π, in Hz, the same for all forces.
    pub corner_hz: f64,
    /// RMS value τ of each force over all frequencies, in N, one per forced degree of freedom.
    pub rms: Vec<f64>,
}

impl ForceModel {
    /// Highest order: the upper edge of its band is the sharpest that 256 samples can resolve.
    pub const MOST: usize = 16;

    pub(crate) fn check(&self, forces: usize) -> Result<(), ForceError> {
        if !(1..=Self::MOST).contains(&self.order) {
            return Err(ForceError::ModelOrder { order: self.order, most: Self::MOST });
        }
        if self.rms.len() != forces {
            return Err(ForceError::ModelCount { models: self.rms.len(), forces });
        }
        let named = self.rms.iter().map(|value| ("RMS value of a force", *value));
        match named
            .chain([("corner frequency", self.corner_hz)])
            .find(|(_, value)| !(*value > 0.0 && value.is_finite()))
        {
            Some((what, value)) => Err(ForceError::NotPositive { what, value }),
            None => Ok(()),
        }
    }

    /// Returns the two-sided spectral density S of force `f` at ω, in N²·s/rad, scaled such that ∫
    /// S dω/2π = τ².
    pub(crate) fn density(&self, f: usize, omega: f64, process: &LowPass) -> f64 {
        let corner = TAU * self.corner_hz;
        let fall = (omega / corner).powi(2 * self.order as i32);
        self.rms[f].powi(2) * process.intensity / (corner * (1.0 + fall))
    }
}

/// A Butterworth low-pass of unit variance driven by white noise, in the time unit 1/ω_c.
pub(crate) struct LowPass {
    /// Rate matrix of u̇ = rate·u + (white noise on the last state); the force is u₀.
    pub rate: DMatrix<f64>,
    /// Intensity of the white noise that drives the last state.
    pub intensity: f64,
    /// Stationary covariance of u; the variance of u₀ is 1.
    pub covariance: DMatrix<f64>,
}

impl LowPass {
    /// Creates the low-pass as a chain of sections of second order and, for an odd order, one
    /// section of first order.
    ///
    /// # Source
    /// Butterworth (1930): poles at equal angles on a circle.
    pub fn new(order: usize) -> Result<Self, ForceError> {
        let mut rate = DMatrix::zeros(order, order);
        let mut at = 0;
        if order % 2 == 1 {
            rate[(0, 0)] = -1.0;
            at = 1;
        }
        for section in 1..=order / 2 {
            let angle = std::f64::consts::PI * (2 * section - 1) as f64 / (2 * order) as f64;
            rate[(at, at + 1)] = 1.0;
            rate[(at + 1, at)] = -1.0;
            rate[(at + 1, at + 1)] = -2.0 * angle.sin();
            at += 2;
        }
        // Each section is driven by the first state of the next.
        let firsts =
            (0..order).filter(|i| if order % 2 == 1 { *i == 0 || i % 2 == 1 } else { i % 2 == 0 });
        for first in firsts.skip(1) {
            rate[(first - 1, first)] = 1.0;
        }
        let mut noise = DMatrix::zeros(order, order);
        noise[(order - 1, order - 1)] = 1.0;
        let covariance =
            step_noise(&(&rate * limits::DECAY_TIME), &[noise * limits::DECAY_TIME])?.remove(0);
        let intensity = covariance[(0, 0)].recip();
        Ok(Self { rate, intensity, covariance: covariance * intensity })
    }
}

/// Returns the covariance, due to white noise, of the state of u̇ = A u + noise after a unit of
/// time: a series gives the covariance after a short step, and the step is doubled until it is one
/// unit of time. Each doubling adds a positive semidefinite matrix, so the variances lose no digits
/// by cancellation.
///
/// # Source
/// Van Loan (1978) for the integral; doubling as in Higham (2008), *Functions of Matrices*, 10.3.
pub(crate) fn step_noise(
    rate: &DMatrix<f64>,
    noises: &[DMatrix<f64>],
) -> Result<Vec<DMatrix<f64>>, ForceError> {
    let norm = rate.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max);
    let doublings =
        if norm > limits::SUBSTEP { (norm / limits::SUBSTEP).log2().ceil() as i32 } else { 0 };
    let short = 0.5f64.powi(doublings);
    let a = rate * short;
    let mut sums: Vec<DMatrix<f64>> = Vec::with_capacity(noises.len());
    for noise in noises {
        let mut term = noise * short;
        let mut sum = term.clone();
        for k in 1..limits::SERIES_TERMS {
            let product = &a * &term;
            term = (&product + product.transpose()) / (k + 1) as f64;
            sum += &term;
        }
        sums.push(sum);
    }
    let mut transition = exponential(&a)?;
    for _ in 0..doublings {
        for sum in &mut sums {
            *sum += &transition * &*sum * transition.transpose();
        }
        transition = &transition * &transition;
    }
    Ok(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A low-pass of every order has unit variance: the closed form of ∫ dω / (1 + ω^2p) gives the
    /// intensity of its noise, and its covariance satisfies the covariance equation.
    #[test]
    fn low_passes_have_unit_variance_and_their_spectrum() {
        for order in 1..=ForceModel::MOST {
            let process = LowPass::new(order).unwrap();
            let half = std::f64::consts::PI / (2.0 * order as f64);
            // τ² = g/π ∫₀^∞ dω/(1 + ω^2p) = g/π · half/sin(half).
            let expected = std::f64::consts::PI * half.sin() / half;
            assert!((process.intensity / expected - 1.0).abs() < 1e-11, "order {order}");
            let mut rest = &process.rate * &process.covariance;
            rest += rest.transpose();
            rest[(order - 1, order - 1)] += process.intensity;
            assert!(rest.amax() < 1e-11, "order {order}: {rest}");
        }
    }

    #[test]
    fn noise_over_a_step_is_that_of_a_random_walk_and_of_its_integral() {
        // With u̇₀ = u₁ and u̇₁ = noise, the covariance after one unit of time is [1/3, 1/2; 1/2,
        // 1].
        let rate = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let noise = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 1.0]);
        let found = step_noise(&rate, &[noise]).unwrap().remove(0);
        let expected = DMatrix::from_row_slice(2, 2, &[1.0 / 3.0, 0.5, 0.5, 1.0]);
        assert!((found - expected).amax() < 1e-15);
    }
}
