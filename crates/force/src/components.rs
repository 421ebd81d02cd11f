//! The least-squares problem in its singular vectors: one number per unknown.

use nalgebra::DMatrix;

use crate::error::ForceError;

/// Unknowns, in descending order of the singular value: y_i = s_i f_i + noise.
///
/// A component of a complex line represents two real unknowns and has weight 2, so that white noise
/// of variance σ² has mean energy weight·σ² in it.
pub(crate) struct Components {
    /// s_i, in descending order, the last ones possibly zero.
    pub singular: Vec<f64>,
    /// |y_i|².
    pub energy: Vec<f64>,
    /// Real unknowns per component, 1 or 2.
    pub weight: Vec<f64>,
    /// Rate of change of the force of each component, positive, in any unit.
    pub frequency: Vec<f64>,
    /// Lowest frequency in it, in Hz.
    pub lowest_hz: Vec<f64>,
    /// Energy of the measurement outside the space of the forces.
    pub outside_energy: f64,
    /// Number of real data in the measurement.
    pub outside_weight: f64,
}

/// A measurement in its singular vectors, and the transformation back to the force.
pub(crate) trait Operator {
    fn components(&self) -> &Components;
    /// Returns samples × forces from the components times these factors (f̂_i = φ_i y_i / s_i).
    fn force(&self, factors: &[f64]) -> Result<DMatrix<f64>, ForceError>;
    /// Keeps the part of every component in a band of frequencies in Hz.
    fn keep(&mut self, band_hz: [f64; 2]) -> Result<(), ForceError>;
    /// Returns the variance, samples × forces, from the variances of the components per real
    /// unknown.
    fn variance(&self, components: &[f64]) -> DMatrix<f64>;
}

/// Effect of filter factors on this measurement.
pub(crate) struct Fit {
    /// Energy not explained, ‖y − H f̂‖².
    pub residual: f64,
    /// ‖f̂‖².
    pub size: f64,
    /// Σ φ_i: the effective number of real unknowns.
    pub unknowns: f64,
}

impl Fit {
    /// Returns the residual variance per remaining real datum: the noise level if the fit is right.
    pub fn noise(&self, components: &Components) -> f64 {
        self.residual / (components.data() - self.unknowns).max(f64::MIN_POSITIVE)
    }
}

impl Components {
    /// Real data in all.
    pub fn data(&self) -> f64 {
        self.weight.iter().sum::<f64>() + self.outside_weight
    }

    /// Returns the components that can carry a force: s_i above rounding of the largest.
    pub fn transmitted(&self) -> usize {
        let floor = 1e-14 * self.singular[0];
        self.singular.partition_point(|s| *s > floor)
    }

    /// Lowest frequency, in Hz, of the components that show a force.
    pub fn lowest_hz(&self, shows: impl Fn(usize) -> bool) -> Option<f64> {
        let shown = (0..self.singular.len()).filter(|i| shows(*i));
        shown.map(|i| self.lowest_hz[i]).min_by(f64::total_cmp)
    }

    /// Returns residual, size and unknowns for filter factors φ_i (f̂_i = φ_i y_i / s_i).
    pub fn fit(&self, factor: impl Fn(usize) -> f64) -> Fit {
        let mut fit = Fit { residual: self.outside_energy, size: 0.0, unknowns: 0.0 };
        for (i, (energy, s)) in self.energy.iter().zip(&self.singular).enumerate() {
            let phi = factor(i);
            fit.residual += (1.0 - phi).powi(2) * energy;
            if phi > 0.0 {
                fit.size += (phi / s).powi(2) * energy;
            }
            fit.unknowns += phi * self.weight[i];
        }
        fit
    }

    /// Tikhonov's factor s²/(s² + λ²).
    pub fn tikhonov(&self, i: usize, lambda: f64) -> f64 {
        let square = self.singular[i].powi(2);
        square / (square + lambda * lambda)
    }

    /// 1 for the components at least as strong as `lambda`, 0 for the others.
    pub fn truncated(&self, i: usize, lambda: f64) -> f64 {
        if self.singular[i] >= lambda { 1.0 } else { 0.0 }
    }
}
