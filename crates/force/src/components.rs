//! The least-squares problem in its singular vectors, with one component per unknown.

use nalgebra::DMatrix;

use crate::error::ForceError;

/// Components of the unknown force, in descending order of the singular value s_i: y_i = s_i f_i +
/// noise.
///
/// A component of a complex line represents two real unknowns and has the weight 2; white noise of
/// variance σ² then has the mean energy weight·σ² in this component.
pub(crate) struct Components {
    /// Singular values s_i, in descending order; the last ones may be zero.
    pub singular: Vec<f64>,
    /// Energy |y_i|² of each component.
    pub energy: Vec<f64>,
    /// Number of real unknowns per component, 1 or 2.
    pub weight: Vec<f64>,
    /// Rate of change of the force of each component, positive, in any unit.
    pub frequency: Vec<f64>,
    /// Lowest frequency in each component, in Hz.
    pub lowest_hz: Vec<f64>,
    /// Energy of the part of the measurement that no force can cause.
    pub outside_energy: f64,
    /// Number of real data in the part of the measurement that no force can cause.
    pub outside_weight: f64,
}

/// A measurement in its singular vectors, and the transformation back to the force.
pub(crate) trait Operator {
    fn components(&self) -> &Components;
    /// Returns samples × forces from the components with the filter factors φ_i: f̂_i = φ_i y_i /
    /// s_i.
    fn force(&self, factors: &[f64]) -> Result<DMatrix<f64>, ForceError>;
    /// Restricts every component to a band of frequencies in Hz.
    fn keep(&mut self, band_hz: [f64; 2]) -> Result<(), ForceError>;
    /// Returns the variance, samples × forces, from the variances of the components per real
    /// unknown.
    fn variance(&self, components: &[f64]) -> DMatrix<f64>;
}

/// Effect of filter factors on a measurement.
pub(crate) struct Fit {
    /// Residual energy ‖y − H f̂‖².
    pub residual: f64,
    /// Energy of the force, ‖f̂‖².
    pub size: f64,
    /// Effective number of real unknowns, Σ φ_i.
    pub unknowns: f64,
}

impl Fit {
    /// Returns the residual variance per remaining real datum: the noise variance if the fit is
    /// correct.
    pub fn noise(&self, components: &Components) -> f64 {
        self.residual / (components.data() - self.unknowns).max(f64::MIN_POSITIVE)
    }
}

impl Components {
    /// Returns the total number of real data.
    pub fn data(&self) -> f64 {
        self.weight.iter().sum::<f64>() + self.outside_weight
    }

    /// Returns the number of components that can carry a force: the components whose s_i exceeds
    /// the rounding error of the largest s_i.
    pub fn transmitted(&self) -> usize {
        let floor = 1e-14 * self.singular[0];
        self.singular.partition_point(|s| *s > floor)
    }

    /// Returns the lowest frequency, in Hz, of the components for which `shows` is true.
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

    /// Returns Tikhonov's filter factor s²/(s² + λ²) of a component.
    pub fn tikhonov(&self, i: usize, lambda: f64) -> f64 {
        let square = self.singular[i].powi(2);
        square / (square + lambda * lambda)
    }

    /// Returns the factor of truncation: 1 for components at least as strong as `lambda`, 0 for
    /// others.
    pub fn truncated(&self, i: usize, lambda: f64) -> f64 {
        if self.singular[i] >= lambda { 1.0 } else { 0.0 }
    }
}
