//! Open records with a delayed force.

use mechid_numerics::gauss_newton::minimise;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::DVector;

use super::OutputErrorFit;
use super::initial_estimates::InitialEstimates;
use super::misfit::Misfit;
use super::multi_start::search;
use super::output_error_fit::{plausible, spare};
use super::unknown_noise::white_noise_at;
use crate::Unknowns;
use crate::limits::DELAY_STEPS;
use crate::relations::Relations;

/// Maximum likelihood for the lines of open records with a delayed force; each delay has its own
/// estimate of the transients.
pub struct DelayedOpenRecord<'a> {
    data: &'a FrequencyData,
    unknowns: &'a Unknowns,
    /// Noise estimated from the residual without a delay.
    noise: NoiseSpectrum,
    /// Estimate for the last delay, the initial estimate for the next one.
    theta: DVector<f64>,
}

impl<'a> DelayedOpenRecord<'a> {
    /// Starts at the result of a `fit` to the same data; `None` if the fit has no transient.
    pub fn from_fit(
        data: &'a FrequencyData,
        unknowns: &'a Unknowns,
        fit: &OutputErrorFit,
    ) -> Option<Self> {
        let entries: Vec<f64> = fit.estimate.parameters().map(|p| p.value).collect();
        let mut theta = match Relations::from_unknowns(unknowns) {
            None => entries,
            Some(relations) => relations.unknowns(&entries).as_slice().to_vec(),
        };
        theta.extend_from_slice(fit.ends.as_ref()?.loads());
        let theta = DVector::from_vec(theta);
        let noise = white_noise_at(data, unknowns, &theta).ok()?;
        Some(Self { data, unknowns, noise, theta })
    }

    /// Number of real equations minus the number of unknowns.
    pub fn spare(&self) -> usize {
        spare(self.data, self.unknowns)
    }

    /// Estimates the parameters with the force `delay` (s) later, from all initial estimates.
    pub fn search(&mut self, delay: f64) -> Option<()> {
        let late = self.data.with_later_force(delay);
        let mut misfit = Misfit::new(&late, self.unknowns, &self.noise).ok()?;
        let starts = InitialEstimates::new(&late, self.unknowns, &self.noise);
        let spare = self.spare() as f64;
        let global = search(&mut misfit, &starts, plausible(None, spare, spare)).ok()?;
        self.theta = global.minimum.parameters;
        Some(())
    }

    /// Returns the sum of squares with the force `delay` (s) later, minimised from the last
    /// estimate.
    pub fn cost(&mut self, delay: f64) -> Option<f64> {
        let late = self.data.with_later_force(delay);
        let mut misfit = Misfit::new(&late, self.unknowns, &self.noise).ok()?;
        let minimum = minimise(&mut misfit, self.theta.clone(), DELAY_STEPS)?;
        self.theta = minimum.parameters;
        Some(minimum.cost)
    }
}
