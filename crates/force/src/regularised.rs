//! Force from few or noisy channels: the part of the force that the system transmits weakly is
//! reduced.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::DMatrix;
use statrs::function::erf::erfc;

use crate::components::{Components, Operator};
use crate::error::ForceError;
use crate::evidence::Posterior;
use crate::identified::IdentifiedForce;
use crate::limits;
use crate::measurement::{Measurement, Start};
use crate::noise::{Noise, channel_sizes};
use crate::open_operator::OpenOperator;
use crate::period_operator::PeriodOperator;
use crate::rule::{Filter, choose, factor};
use crate::unexplained::Residual;

/// Unknowns of a force: its lines in a whole period, or its samples in an open record.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ForceUnknowns {
    /// Every spectral line below Nyquist; the record is one whole period in steady state.
    EveryLine,
    /// Spectral lines of the force only; the record is one whole period in steady state.
    Lines(Vec<usize>),
    /// Every sample of an open record; the force is linear between the samples.
    Samples(Start),
}

/// A regularised force and its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct RegularisedForce {
    /// The force, with its standard error.
    pub force: IdentifiedForce,
    /// λ, in the unit of a scaled channel per N; `None` for [`Filter::Shrinkage`], which has none.
    pub parameter: Option<f64>,
    /// Effective number of real unknowns of the filter, a pure number that is rarely an integer.
    pub unknowns: f64,
    /// Standard deviation of the noise in each channel, in the channel's unit: stated, or estimated
    /// by maximum likelihood.
    pub noise_std: Vec<f64>,
    /// Frequency, in Hz, below which the noise of the channels exceeds a force as strong as the
    /// identified one; `None` if the channels show such a force at no frequency.
    pub seen_from_hz: Option<f64>,
}

/// Identifies the force that explains the measured channels without amplifying their noise.
///
/// Solves y = H F + noise in singular vectors, with channels divided by their noise level (or, if
/// it is unknown, by their size). A period separates into its lines; an open record is one dense
/// problem with a force linear between samples.
///
/// Given the measurement, the force is within 1.96 standard errors of the estimate with a
/// probability of 95 %. The standard error includes transmitted noise, the damped part of the
/// force, and the uncertainty of the sizes of force and noise. A noise level that is stated or
/// measured separately ([`Noise::PerChannel`], [`Noise::OutsideLines`]) counts as known. For a
/// given λ ([`Rule::Given`](crate::Rule::Given)) the standard error belongs to a force of variance
/// (noise/λ)² in every component; for truncation it covers only the noise.
///
/// For a structure on springs, accelerations and velocities do not show a constant force. Without a
/// measured displacement, the force is therefore restricted to frequencies above
/// [`RegularisedForce::seen_from_hz`] ([`IdentifiedForce::band_hz`]), unless the measurement has
/// its own band ([`Measurement::in_band`]).
///
/// Cost: a period takes one small SVD per line; an open record of N samples and p forces takes
/// O((Np)³) once and (Np)² memory, so it is limited to [`OPEN_UNKNOWNS`](crate::OPEN_UNKNOWNS)
/// unknowns. Longer open records are for [`kalman`](crate::kalman()), whose cost is linear in their
/// length.
///
/// # Errors
/// The errors of [`frequency_domain`](crate::frequency_domain()); [`ForceError::TooLarge`] for an
/// open record beyond the limit; [`ForceError::Unstable`] if the free response of an unstable
/// system grows by more than 10⁶ over the record (a period needs no stability);
/// [`ForceError::Silent`] if no force reaches any channel, or if all channels are zero;
/// [`ForceError::EmptyBand`].
///
/// # Source
/// Tikhonov & Arsenin (1977); Hansen (1998), Rank-Deficient and Discrete Ill-Posed Problems.
pub fn regularised(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    unknowns: &ForceUnknowns,
    filter: Filter,
    noise: &Noise,
) -> Result<RegularisedForce, ForceError> {
    measured.check(system.dof(), forced)?;
    filter.check()?;
    let lines = match unknowns {
        ForceUnknowns::EveryLine => (0..measured.sampling().len().div_ceil(2)).collect(),
        ForceUnknowns::Lines(lines) => lines.clone(),
        ForceUnknowns::Samples(_) => Vec::new(),
    };
    let level = noise.resolve(measured, &Spectrum::from_record(measured.record()), &lines)?;
    let scale = level.clone().unwrap_or_else(|| channel_sizes(measured.record()));
    let level = level.as_deref();
    let (solution, whole) = if let ForceUnknowns::Samples(start) = unknowns {
        let mut operator = OpenOperator::new(system, measured, forced, *start, &scale)?;
        solve(&mut operator, system, measured, forced, filter, &scale, level.is_some())?
    } else {
        let mut operator = PeriodOperator::new(system, measured, forced, &lines, &scale)?;
        solve(&mut operator, system, measured, forced, filter, &scale, level.is_some())?
    };
    let residual = measured.exceeds(forced).then(|| match unknowns {
        ForceUnknowns::Samples(start) => {
            Residual::from_open_record(system, measured, forced, &whole, *start, &scale, level)
        }
        _ => Residual::from_lines(
            system,
            measured,
            forced,
            &Spectrum::from_record(&whole),
            &lines,
            level,
        ),
    });
    let force = solution.force.with_residual(residual.transpose()?);
    Ok(RegularisedForce { force, ..solution })
}

fn solve(
    operator: &mut impl Operator,
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    filter: Filter,
    scale: &[f64],
    noise_known: bool,
) -> Result<(RegularisedForce, Record), ForceError> {
    let choice = Choice::new(operator.components(), filter, noise_known)?;
    let whole = operator.force(&choice.factors)?;
    let band_hz = measured.band_hz().or_else(|| measured.shown(choice.lowest_hz));
    if let Some(band_hz) = band_hz {
        operator.keep(band_hz)?;
    }
    let spread = |part: DMatrix<f64>| {
        let mut channels = DMatrix::zeros(part.nrows(), system.dof());
        for (column, dof) in part.column_iter().zip(forced) {
            channels.set_column(*dof, &column);
        }
        Record::new(measured.sampling(), channels)
    };
    let filtered = operator.force(&choice.factors)?;
    let mut error = operator.variance(&choice.variance).map(f64::sqrt);
    let apart = operator.force(&choice.mean)? - &filtered;
    error.zip_apply(&apart, |error, apart| *error = half_width(apart, *error) / TWO_SIDED);
    let force =
        IdentifiedForce::from_record(spread(filtered)?).with_standard_error(Some(spread(error)?));
    let force = match band_hz {
        Some(band_hz) => force.with_band(band_hz),
        None => force,
    };
    let noise_std = scale.iter().map(|s| s * choice.noise.sqrt()).collect();
    let Choice { parameter, unknowns, lowest_hz: seen_from_hz, .. } = choice;
    let solution = RegularisedForce { force, parameter, unknowns, noise_std, seen_from_hz };
    Ok((solution, spread(whole)?))
}

/// Filter factors that a rule chooses, and the posterior of the force that they approximate.
struct Choice {
    parameter: Option<f64>,
    factors: Vec<f64>,
    /// Factors of the posterior mean.
    mean: Vec<f64>,
    /// Posterior variance of each component, per real unknown.
    variance: Vec<f64>,
    /// Noise variance, relative to the channel scales.
    noise: f64,
    /// Effective number of real unknowns.
    unknowns: f64,
    /// Frequency below which noise hides the force, in Hz; `None` if noise hides every component.
    lowest_hz: Option<f64>,
}

impl Choice {
    fn new(components: &Components, filter: Filter, noise_known: bool) -> Result<Self, ForceError> {
        if components.singular.first().is_none_or(|s| *s == 0.0)
            || components.energy.iter().all(|energy| *energy == 0.0)
        {
            return Err(ForceError::Silent);
        }
        let Some(lambda) = filter.given() else {
            return Self::from_posterior(components, filter, noise_known);
        };
        let count = components.singular.len();
        let factors: Vec<f64> = (0..count).map(|i| factor(filter, components, i, lambda)).collect();
        let fit = components.fit(|i| factors[i]);
        let noise = if noise_known { 1.0 } else { fit.noise(components) };
        // A given λ is a prior: a force of variance σ²/λ² in every component.
        let variance = |i: usize| match factors[i] {
            0.0 => 0.0,
            1.0 => noise / components.singular[i].powi(2),
            _ => noise / (components.singular[i].powi(2) + lambda * lambda),
        };
        Ok(Self {
            parameter: Some(lambda),
            mean: factors.clone(),
            variance: (0..count).map(variance).collect(),
            noise,
            unknowns: fit.unknowns,
            lowest_hz: components.lowest_hz(|i| components.singular[i] >= lambda),
            factors,
        })
    }

    fn from_posterior(
        components: &Components,
        filter: Filter,
        noise_known: bool,
    ) -> Result<Self, ForceError> {
        let posterior = Posterior::from_components(components, noise_known)?;
        let parameter = choose(filter, components, &posterior);
        let count = components.singular.len();
        let factors: Vec<f64> = (0..count)
            .map(|i| match parameter {
                Some(lambda) => factor(filter, components, i, lambda),
                None => posterior.best_factor(components, i),
            })
            .collect();
        Ok(Self {
            parameter,
            mean: (0..count).map(|i| posterior.factor(components, i)).collect(),
            variance: (0..count).map(|i| posterior.variance(components, i)).collect(),
            noise: posterior.noise(),
            unknowns: components.fit(|i| factors[i]).unknowns,
            lowest_hz: posterior.lowest_hz(components),
            factors,
        })
    }
}

/// Half width of the two-sided interval of a normal variable with probability [`CONFIDENCE`], in
/// standard deviations.
const TWO_SIDED: f64 = 1.959_963_984_540_054;
/// Limit of the one-sided interval of a normal variable with probability [`CONFIDENCE`], in
/// standard deviations.
const ONE_SIDED: f64 = 1.644_853_626_951_472;
const CONFIDENCE: f64 = 0.95;
/// Returns half the width of the interval about 0 that contains a normal variable of this mean and
/// standard deviation with probability [`CONFIDENCE`].
fn half_width(mean: f64, deviation: f64) -> f64 {
    let mean = mean.abs();
    if deviation <= 1e-9 * mean {
        return mean;
    }
    if mean == 0.0 {
        return TWO_SIDED * deviation;
    }
    let below = |x: f64| 0.5 * erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
    let offset = mean / deviation;
    let missing = |width: f64| below(width - offset) - below(-width - offset) - CONFIDENCE;
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let (mut low, mut high) = (offset.max(TWO_SIDED - offset), offset + TWO_SIDED);
    let mut width = offset + ONE_SIDED;
    for _ in 0..limits::HALF_WIDTH_STEPS {
        let missing = missing(width);
        *(if missing < 0.0 { &mut low } else { &mut high }) = width;
        let next = width - missing / (density(width - offset) + density(width + offset));
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        let change = next - width;
        width = next;
        if change.abs() <= limits::HALF_WIDTH_CHANGE {
            break;
        }
    }
    width * deviation
}

#[cfg(test)]
mod tests {
    use super::{erfc, half_width};

    #[test]
    fn intervals_about_another_place_than_the_mean_hold_as_much() {
        // Without an offset, the half width is 1.96 (two tails); with a large offset it is 1.645
        // (one tail). The values between them are from a table of the normal distribution.
        assert!((half_width(0.0, 2.0) / 2.0 - 1.959964).abs() < 1e-6);
        assert!((half_width(-30.0, 2.0) - 30.0 - 2.0 * 1.644854).abs() < 1e-5);
        // P(|N(1, 1)| < 2.7) = Φ(1.7) − Φ(−3.7) = 0.955435 − 0.000108.
        let width = half_width(1.0, 1.0);
        assert!((2.6..2.7).contains(&width), "{width}");
        assert_eq!(half_width(3.0, 0.0), 3.0);
        // The interval contains 95 % of the probability for any ratio of mean to standard deviation
        // (`offset`).
        let below = |x: f64| 0.5 * erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
        for step in 0..=400 {
            let offset = 0.02 * f64::from(step);
            let width = half_width(offset, 1.0);
            let held = below(width - offset) - below(-width - offset);
            // The accuracy of the complementary error function limits the tolerance.
            assert!((held - 0.95).abs() < 1e-11, "{offset}: {held}");
        }
    }
}
