//! Noise of the forces from the residual of a fit.

use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_spectra::FrequencyData;
use mechid_spectra::noise::level::{ResponseNoise, motion_level};
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
    if data.force_variance().iter().all(|variance| *variance == 0.0) {
        return None;
    }
    let mut misfit = Misfit::new(data, unknowns, &fit.spectrum).ok()?;
    misfit.try_at(&fit.theta(unknowns))?;
    misfit.accept();
    let (errors, by_force) = (misfit.errors(), misfit.variance_by_force());
    let weighted = Weighted { fit: fit.minimum(unknowns), noise: fit.spectrum.clone() };
    let leverage = leverage(data, unknowns, &weighted);
    let channel_test = |channel: usize| {
        let pair = |row: usize| {
            let response_noise = fit.spectrum.covariance(row)[(channel, channel)].re;
            let residual_share =
                leverage.as_ref().map_or(1.0, |h| (1.0 - h[(row, channel)]).max(NOISE_KEPT));
            (
                errors[(row, channel)].norm_sqr() / (response_noise * residual_share),
                by_force[(row, channel)] / response_noise,
            )
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
