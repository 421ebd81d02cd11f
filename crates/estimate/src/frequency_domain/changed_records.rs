//! Open records whose channels are changed, such as by a delay of the force or a high-pass filter.

use std::borrow::Cow;

use mechid_numerics::gauss_newton::{Minimum, minimise};
use mechid_spectra::{FrequencyData, NoiseSpectrum, Pooling};
use nalgebra::DVector;

use super::OutputErrorFit;
use super::initial_estimates::InitialEstimates;
use super::misfit::Misfit;
use super::multi_start::{GlobalMinimum, search, thinned};
use super::output_error_fit::{plausible, spare};
use super::pulse_fit::PulseFit;
use super::unknown_noise::{white_noise_at, with_unknown_noise};
use crate::limits::{COLOURED_ROUNDS, DELAY_STEPS};
use crate::{EstimateError, Unknowns};

/// Maximum likelihood for the lines of open records with changed channels, such as a delayed force;
/// the transients and the errors of pulses are estimated again for each change.
#[derive(Debug, Clone)]
pub struct ChangedRecords<'a> {
    unknowns: &'a Unknowns,
    /// Noise estimated from the residual of the unchanged records.
    noise: NoiseSpectrum,
    /// Number of real equations minus the number of unknowns.
    spare: usize,
    /// Estimate for the last change of the data; it is the initial estimate for the next change.
    theta: DVector<f64>,
    /// Amplitudes of the pulse errors, estimated for the last change of the data; empty if the data
    /// have no pulse errors.
    amplitudes: Vec<f64>,
}

impl<'a> ChangedRecords<'a> {
    /// Takes the initial estimate from a `fit` to the unchanged `data`; `None` if the fit has no
    /// transient.
    pub fn from_fit(
        data: &FrequencyData,
        unknowns: &'a Unknowns,
        fit: &OutputErrorFit,
    ) -> Option<Self> {
        fit.ends.as_ref()?;
        let theta = fit.theta(unknowns);
        let amplitudes = fit.pulse_amplitudes.clone();
        let exact = corrected(data, &amplitudes)?;
        let noise = white_noise_at(exact.as_ref(), unknowns, &theta).ok()?;
        Some(Self { unknowns, noise, spare: spare(data, unknowns), theta, amplitudes })
    }

    /// Returns a selection of the lines of `data`, and a copy of this estimate for the selected
    /// lines. `None` if the data have few lines.
    pub fn on_fewer_lines(&self, data: &FrequencyData) -> Option<(FrequencyData, Self)> {
        let (data, noise) = thinned(data, self.unknowns, &self.noise)?;
        let spare = spare(&data, self.unknowns);
        Some((data, Self { noise, spare, ..self.clone() }))
    }

    /// Uses the last estimate of `fewer`, the same problem on fewer lines, as the initial estimate.
    pub fn start_at(&mut self, fewer: Self) {
        self.theta = fewer.theta;
    }

    /// Number of real equations minus the number of unknowns.
    pub fn spare(&self) -> usize {
        self.spare
    }

    /// Estimates the parameters of `changed` data, from all initial estimates.
    pub fn search(&mut self, changed: &FrequencyData) -> Option<()> {
        let changed = corrected(changed, &self.amplitudes)?;
        let mut misfit = Misfit::new(&changed, self.unknowns, &self.noise).ok()?;
        let spare = self.spare as f64;
        let fewer = thinned(&changed, self.unknowns, &self.noise);
        let starts = InitialEstimates::new(&changed, self.unknowns, &self.noise);
        let thin = fewer.as_ref().map(|(data, noise)| Misfit::new(data, self.unknowns, noise));
        let mut thin = thin.transpose().ok()?;
        let plausible = plausible(None, spare, spare);
        let global = search(&mut misfit, thin.as_mut(), &starts, plausible).ok()?;
        self.theta = global.minimum.parameters;
        Some(())
    }

    /// Returns the sum of squares (a pure number) of `changed` data, minimised from the last
    /// estimate.
    pub fn cost(&mut self, changed: &FrequencyData) -> Option<f64> {
        let of_lines = self.minimise(changed)?;
        if self.amplitudes.is_empty() {
            return Some(of_lines);
        }
        let (noise, before) = ((&self.noise, 1.0), &self.amplitudes);
        self.amplitudes =
            PulseFit::new(changed, self.unknowns, &self.theta, noise, before)?.amplitudes;
        let of_pulses: f64 = self.amplitudes.iter().map(|amplitude| amplitude.powi(2)).sum();
        Some(self.minimise(changed)? + of_pulses)
    }

    /// Estimates the parameters of `changed` data and the levels of white noise in alternation.
    /// Returns the mean over the channels of the logarithms of the residual power, which is in the
    /// squared unit of the measured quantity.
    ///
    /// # Source
    /// As [`output_error`].
    ///
    /// [`output_error`]: super::output_error()
    pub fn log_residual_power(&mut self, changed: &FrequencyData) -> Option<f64> {
        for _ in 0..COLOURED_ROUNDS {
            self.minimise(changed)?;
            let changed = corrected(changed, &self.amplitudes)?;
            self.noise = white_noise_at(changed.as_ref(), self.unknowns, &self.theta).ok()?;
        }
        let (noise, omega) = (self.noise.covariance(0), changed.omega()[0]);
        let per_displacement = changed.measured().per_displacement(omega).norm_sqr();
        let level = |channel: usize| (noise[(channel, channel)].re * per_displacement).ln();
        Some((0..changed.dof()).map(level).sum::<f64>() / changed.dof() as f64)
    }

    /// Estimates the parameters of `changed` data and, from their residual, the noise, as
    /// [`output_error`] does for data without stated noise. The last estimate is the only initial
    /// estimate.
    ///
    /// # Errors
    /// As [`output_error`].
    ///
    /// # Source
    /// As [`output_error`].
    ///
    /// [`output_error`]: super::output_error()
    pub fn fit(&self, changed: &FrequencyData) -> Result<OutputErrorFit, EstimateError> {
        let minimum = Minimum {
            parameters: self.theta.clone(),
            cost: f64::INFINITY,
            steps: 0,
            converged: true,
        };
        let from = GlobalMinimum { minimum, searches: 1, agreeing: 1 };
        with_unknown_noise(changed, self.unknowns, None, Some(from), Pooling::Automatic)
    }

    fn minimise(&mut self, changed: &FrequencyData) -> Option<f64> {
        let changed = corrected(changed, &self.amplitudes)?;
        let mut misfit = Misfit::new(&changed, self.unknowns, &self.noise).ok()?;
        let minimum = minimise(&mut misfit, self.theta.clone(), DELAY_STEPS)?;
        self.theta = minimum.parameters;
        Some(minimum.cost)
    }
}

/// Returns the data minus the pulse errors that have these amplitudes.
fn corrected<'a>(data: &'a FrequencyData, amplitudes: &[f64]) -> Option<Cow<'a, FrequencyData>> {
    if amplitudes.is_empty() {
        return Some(Cow::Borrowed(data));
    }
    data.without_pulse_errors(amplitudes).ok().map(Cow::Owned)
}
