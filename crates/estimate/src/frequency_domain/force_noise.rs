//! Noise of the forces from the residual of a fit.

use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_spectra::FrequencyData;
use mechid_spectra::noise::level::{ResponseNoise, motion_level};
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::OutputErrorFit;
use super::misfit::Misfit;
use super::unknown_noise::{Weighted, leverage};
use crate::Unknowns;
use crate::limits::{FORCE_NOISE_LEVEL, NOISE_KEPT};

/// Returns the most likely ratio (pure number, at least 0) of the variance of the noise of the
/// forces to the variance that the `data` state, from the residual of a `fit` to these data. Any
/// sinusoids must already be subtracted from `data`. `None` if the residual does not show a ratio
/// significantly below 1.
///
/// The variance of the residual of each response is that of its own noise, whose spectrum is known
/// up to a factor, plus the ratio times the variance that the noise of the forces causes. The
/// response with the strongest evidence decides.
///
/// # Source
/// Likelihood ratio, with one ratio on the boundary of its range: Self & Liang (1987), JASA 82,
/// 605–610; the power of each residual is divided by the share of the noise power that remains in
/// it after the fit of the parameters (1 minus the leverage).
pub fn force_noise_factor(
    data: &FrequencyData,
    unknowns: &Unknowns,
    fit: &OutputErrorFit,
) -> Option<f64> {
    let residual = Residual::of_fit(data, unknowns, fit)?;
    let channel_test = |channel: usize| {
        let pair = |row: usize| {
            let (power, by_force) = residual.pair(row, channel);
            let response_noise = fit.spectrum.covariance(row)[(channel, channel)].re;
            (power / response_noise, by_force / response_noise)
        };
        let pairs: Vec<(f64, f64)> = (0..data.len()).map(pair).collect();
        let stated =
            ResponseNoise { white: motion_level(pairs.iter().copied()).powi(2), relative: 1.0 };
        let likely = ResponseNoise::most_likely(&pairs);
        let deviance = 2.0 * (stated.cost(&pairs) - likely.cost(&pairs));
        (likely.relative < 1.0 && deviance > 0.0).then_some((deviance, likely.relative))
    };
    let tested = (0..data.dof()).filter_map(channel_test);
    let (deviance, ratio) = tested.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let p_value = 0.5 * data.dof() as f64 * ChiSquared::new(1.0).ok()?.sf(deviance);
    (p_value <= FORCE_NOISE_LEVEL).then_some(ratio)
}

/// Returns the most likely ratio (pure number) of the variance of the noise of the forces to the
/// variance that the `data` state, from the residual of a `fit` to the same data with exact forces.
/// Any sinusoids must already be subtracted from `data`. `None` if the residual shows no noise of
/// the forces.
///
/// The variance of the residual of each response is that of white noise of the response plus the
/// ratio times the variance that the noise of the forces causes. This must explain the residuals
/// better than the noise spectrum of the fit.
///
/// # Source
/// Schwarz (1978), Annals of Statistics 6, 461–464, for the choice; the powers of the residual as
/// for [`force_noise_factor`].
pub fn force_noise_of_residual(
    data: &FrequencyData,
    unknowns: &Unknowns,
    fit: &OutputErrorFit,
) -> Option<f64> {
    let residual = Residual::of_fit(data, unknowns, fit)?;
    let penalty = 0.5 * (data.len() as f64).ln();
    let scale = |row: usize| data.measured().per_displacement(data.omega()[row]).norm_sqr();
    let scales: Vec<f64> = (0..data.len()).map(scale).collect();
    let pairs_of = |channel: usize| -> Vec<(f64, f64)> {
        let pair = |(row, scale): (usize, &f64)| {
            let (power, by_force) = residual.pair(row, channel);
            (scale * power, scale * by_force)
        };
        scales.iter().enumerate().map(pair).collect()
    };
    let channels: Vec<Vec<(f64, f64)>> = (0..data.dof()).map(pairs_of).collect();
    // The level of each channel is the most likely one for a given ratio.
    let with_ratio = |ratio: f64| -> f64 {
        let cost = |pairs: &Vec<(f64, f64)>| {
            let known = pairs.iter().map(|(power, by_force)| (*power, ratio * by_force));
            let white = motion_level(known).powi(2);
            ResponseNoise { white, relative: ratio }.cost(pairs) + penalty
        };
        channels.iter().map(cost).sum::<f64>() + penalty
    };
    let parameters: f64 = fit.noise.iter().map(|model| model.parameters(data.len())).sum();
    let of_spectrum = |(channel, pairs): (usize, &Vec<(f64, f64)>)| {
        let variance =
            |row: usize| scales[row] * fit.spectrum.covariance(row)[(channel, channel)].re;
        let pairs: Vec<(f64, f64)> =
            pairs.iter().enumerate().map(|(row, (power, _))| (*power, variance(row))).collect();
        let level = pairs.iter().map(|(power, variance)| power / variance).sum::<f64>();
        let spectrum = ResponseNoise { white: 0.0, relative: level / pairs.len() as f64 };
        spectrum.cost(&pairs) + penalty * parameters
    };
    let of_spectrum: f64 = channels.iter().enumerate().map(of_spectrum).sum();
    let ratios = channels.iter().map(|pairs| ResponseNoise::most_likely(pairs).relative);
    let costs = ratios.filter(|ratio| *ratio > 0.0).map(|ratio| (with_ratio(ratio), ratio));
    let (cost, ratio) = costs.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (cost < of_spectrum).then_some(ratio)
}

/// Residual of a fit to data that state noise of the forces.
struct Residual {
    /// X − G F, rows × n, in m.
    errors: DMatrix<Complex<f64>>,
    /// Variance of the displacement due to the noise of the forces, rows × n, in m².
    by_force: DMatrix<f64>,
    /// Fraction of the noise that the parameters fit, rows × n; `None` for large fits, where it is
    /// small.
    leverage: Option<DMatrix<f64>>,
}

impl Residual {
    /// `None` if the data state no noise of the forces, or if the residual does not exist.
    fn of_fit(data: &FrequencyData, unknowns: &Unknowns, fit: &OutputErrorFit) -> Option<Self> {
        if data.force_variance().iter().all(|variance| *variance == 0.0) {
            return None;
        }
        let mut misfit = Misfit::new(data, unknowns, &fit.spectrum).ok()?;
        misfit.try_at(&fit.theta(unknowns))?;
        misfit.accept();
        let weighted = Weighted { fit: fit.minimum(unknowns), noise: fit.spectrum.clone() };
        Some(Self {
            errors: misfit.errors(),
            by_force: misfit.variance_by_force(),
            leverage: leverage(data, unknowns, &weighted),
        })
    }

    /// Returns, for a row and a channel, the residual power, corrected for the part that the
    /// parameters fit, and the variance due to the noise of the forces, in m².
    fn pair(&self, row: usize, channel: usize) -> (f64, f64) {
        let at = (row, channel);
        let share = self.leverage.as_ref().map_or(1.0, |h| (1.0 - h[at]).max(NOISE_KEPT));
        (self.errors[at].norm_sqr() / share, self.by_force[at])
    }
}
