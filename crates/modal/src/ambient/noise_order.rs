//! Number of noise polynomials of the sensors, chosen by Akaike's criterion.

use mechid_numerics::time_limit;

use super::information::information;
use super::likelihood::gradient;
use super::limits::{MOST_NOISE_TERMS, NOISE_TERMS_ADDED, POOLING};
use super::lines::BandLines;
use super::parameters::Parameters;
use super::search::{Effort, Fit, full_step, search_pooled};

/// Returns the fit with further polynomials of the noise of all sensors, added while Akaike's
/// criterion falls; `None` if it does not fall.
///
/// Noise that the polynomials cannot follow is attributed to the tails of the resonances and biases
/// the damping. Relative to the standard errors, this bias is larger for longer records.
///
/// # Source
/// Akaike (1974), IEEE Transactions on Automatic Control 19, 716–723.
pub(super) fn with_more_noise_terms(fit: &Fit, band: &BandLines) -> Option<Fit> {
    let mut best = extended(fit, band)?;
    while !time_limit::is_over() {
        let Some(next) = extended(&best, band) else { break };
        best = next;
    }
    Some(best)
}

/// Returns the fit with further noise polynomials if they reduce Akaike's criterion.
fn extended(fit: &Fit, band: &BandLines) -> Option<Fit> {
    let layout = &fit.parameters.layout;
    let terms = layout.noise_terms + NOISE_TERMS_ADDED;
    if terms > MOST_NOISE_TERMS {
        return None;
    }
    let needed = 2.0 * (NOISE_TERMS_ADDED * layout.outputs) as f64;
    let start = fit.parameters.with_noise_terms(terms);
    if expected_gain(&start, band)? < needed {
        return None;
    }
    let next = search_pooled(start, band, Effort::FULL)?;
    let gain = 2.0 * (fit.cost - next.cost);
    (gain > needed).then_some(next)
}

/// Returns the increase of 2 ln L from `start` to the maximum if ln L is quadratic (score
/// statistic).
fn expected_gain(start: &Parameters, band: &BandLines) -> Option<f64> {
    let lines = band.pooled(&start.poles(), POOLING, start.layout.noise_terms);
    let information = information(start, &lines, band.span)?;
    let slope = gradient(start, &lines, band.span)?;
    Some(-full_step(&information, &slope)?.dot(&slope))
}
