//! Force from few or noisy channels: the weakly transmitted part of it is damped.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::DMatrix;
use statrs::function::erf::erfc;

use crate::components::Operator;
use crate::evidence::Posterior;
use crate::noise::channel_sizes;
use crate::open_operator::OpenOperator;
use crate::period_operator::PeriodOperator;
use crate::rule::{choose, factor};
use crate::unexplained::Rest;
use crate::{Filter, ForceError, IdentifiedForce, Measurement, Noise, Start};

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
    /// Every sample, the force linear between them; the record is open.
    Samples(Start),
}

/// A regularised force and how it was chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct RegularisedForce {
    /// The force, with its standard error.
    pub force: IdentifiedForce,
    /// λ, in the unit of a scaled channel per N; `None` for [`Filter::Shrinkage`], which has none.
    pub parameter: Option<f64>,
    /// Effective number of real unknowns that pass the filter, a pure number and rarely a whole one.
    pub unknowns: f64,
    /// Standard deviation of the noise in each channel, in the channel's unit: as stated, or as the
    /// measurement makes it likely.
    pub noise_std: Vec<f64>,
    /// Frequency, in Hz, below which the channels show less of a force as strong as this one than
    /// noise; `None` where they show it at no frequency.
    pub seen_from_hz: Option<f64>,
}

/// The force that explains the measured channels without amplifying their noise.
///
/// Solves y = H F + noise in singular vectors, channels divided by their noise level (or, where
/// it is not stated, by their size). A period falls apart into its lines; an open record is one
/// dense problem, the force linear between samples.
///
/// The standard error is such that 1.96 of it to either side hold the force with a probability of
/// 95 % given the measurement: noise let through, force held back, and all that the measurement does
/// not tell of the sizes of force and noise. A noise level that is stated or measured apart
/// ([`Noise::PerChannel`], [`Noise::OutsideLines`]) counts as known. Of a given λ ([`Rule::Given`](crate::Rule::Given))
/// it is that of a force of variance (noise/λ)² in every component, and of truncation that of the
/// noise: there nothing else is asked of the measurement.
///
/// Channels without a displacement do not show a constant force. The force is then that above
/// [`RegularisedForce::seen_from_hz`] ([`IdentifiedForce::band_hz`]), unless the measurement asks
/// for a band of its own ([`Measurement::in_band`]).
///
/// Cost: a period takes one small SVD per line; an open record of N samples and p forces takes
/// O((Np)³) once and (Np)² memory, so it is limited to [`OPEN_UNKNOWNS`](crate::OPEN_UNKNOWNS) unknowns. Longer open
/// records are for [`kalman`](crate::kalman()), linear in their length.
///
/// # Errors
/// As [`frequency_domain`](crate::frequency_domain()); [`ForceError::TooLarge`] for an open record
/// beyond the limit; [`ForceError::Unstable`] for one over which the free response of an unstable
/// machine grows by more than 10⁶ (a period asks for no stability); [`ForceError::Silent`] where no
/// force reaches any channel, or all are zero; [`ForceError::EmptyBand`].
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
    let level = noise.resolve(measured, &Spectrum::of(measured.record()), &lines)?;
    let scale = level.clone().unwrap_or_else(|| channel_sizes(measured.record()));
    let level = level.as_deref();
    let (solution, whole) = if let ForceUnknowns::Samples(start) = unknowns {
        let mut operator = OpenOperator::new(system, measured, forced, *start, &scale)?;
        solve(&mut operator, system, measured, forced, filter, &scale, level.is_some())?
    } else {
        let mut operator = PeriodOperator::new(system, measured, forced, &lines, &scale)?;
        solve(&mut operator, system, measured, forced, filter, &scale, level.is_some())?
    };
    let rest = measured.exceeds(forced).then(|| match unknowns {
        ForceUnknowns::Samples(start) => {
            Rest::of_open(system, measured, forced, &whole, *start, &scale, level)
        }
        _ => Rest::of_lines(system, measured, forced, &Spectrum::of(&whole), &lines, level),
    });
    let force = solution.force.with_rest(rest.transpose()?);
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
    let components = operator.components();
    if components.singular.first().is_none_or(|s| *s == 0.0)
        || components.energy.iter().all(|energy| *energy == 0.0)
    {
        return Err(ForceError::Silent);
    }
    let count = components.singular.len();
    let given = filter.given();
    let posterior = match given {
        Some(_) => None,
        None => Some(Posterior::of(components, noise_known)?),
    };
    let parameter = given.or_else(|| choose(filter, components, posterior.as_ref()?));
    let factors: Vec<f64> = (0..count)
        .map(|i| match (parameter, &posterior) {
            (Some(lambda), _) => factor(filter, components, i, lambda),
            (None, Some(posterior)) => posterior.best_factor(components, i),
            (None, None) => 0.0,
        })
        .collect();
    let fit = components.fit(|i| factors[i]);
    let noise = match &posterior {
        Some(posterior) => posterior.noise(),
        None if noise_known => 1.0,
        None => fit.noise(components),
    };
    // A given λ is a prior of its own: a force of variance σ²/λ² in every component.
    let lambda = given.unwrap_or(0.0);
    let mean: Vec<f64> = (0..count)
        .map(|i| posterior.as_ref().map_or(factors[i], |posterior| posterior.factor(components, i)))
        .collect();
    let variance: Vec<f64> = (0..count)
        .map(|i| match &posterior {
            Some(posterior) => posterior.variance(components, i),
            None if factors[i] == 0.0 => 0.0,
            None if factors[i] == 1.0 => noise / components.singular[i].powi(2),
            None => noise / (components.singular[i].powi(2) + lambda * lambda),
        })
        .collect();
    let seen_from_hz = match &posterior {
        Some(posterior) => posterior.seen_from_hz(components),
        None => components.lowest_hz(|i| components.singular[i] >= lambda),
    };
    let unknowns = fit.unknowns;
    let whole = operator.force(&factors)?;
    let band_hz = measured.band_hz().or_else(|| measured.shown(seen_from_hz));
    if let Some(band_hz) = band_hz {
        operator.keep(band_hz)?;
    }

    let spread = |part: DMatrix<f64>| {
        let mut all = DMatrix::zeros(part.nrows(), system.dof());
        for (column, dof) in part.column_iter().zip(forced) {
            all.set_column(*dof, &column);
        }
        Record::new(measured.sampling(), all)
    };
    let found = operator.force(&factors)?;
    let mut error = operator.variance(&variance).map(f64::sqrt);
    let apart = operator.force(&mean)? - &found;
    error.zip_apply(&apart, |error, apart| *error = half_width(apart, *error) / TWO_SIDED);
    let force = IdentifiedForce::of(spread(found)?).with_standard_error(Some(spread(error)?));
    let force = match band_hz {
        Some(band_hz) => force.with_band(band_hz),
        None => force,
    };
    let noise_std = scale.iter().map(|s| s * noise.sqrt()).collect();
    let found = RegularisedForce { force, parameter, unknowns, noise_std, seen_from_hz };
    Ok((found, spread(whole)?))
}

/// Standard errors to either side that hold a normal variable with probability [`CONFIDENCE`].
const TWO_SIDED: f64 = 1.959_963_984_540_054;
/// The same to one side alone.
const ONE_SIDED: f64 = 1.644_853_626_951_472;
const CONFIDENCE: f64 = 0.95;
/// Steps of the search for a half width: halvings of an interval of one standard error would leave no digit of it, and
/// Newton's steps are far fewer.
const STEPS: usize = 50;
/// Change of a half width, in standard deviations, that ends the search.
const SETTLED: f64 = 1e-12;

/// Half the width of the interval about 0 that holds a normal variable of this mean and standard
/// deviation with probability [`CONFIDENCE`].
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
    for _ in 0..STEPS {
        let missing = missing(width);
        *(if missing < 0.0 { &mut low } else { &mut high }) = width;
        let next = width - missing / (density(width - offset) + density(width + offset));
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        let change = next - width;
        width = next;
        if change.abs() <= SETTLED {
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
        // No offset: 1.96; a large one: one tail, 1.645; between them a table of the normal law.
        assert!((half_width(0.0, 2.0) / 2.0 - 1.959964).abs() < 1e-6);
        assert!((half_width(-30.0, 2.0) - 30.0 - 2.0 * 1.644854).abs() < 1e-5);
        // P(|N(1, 1)| < 2.7) = Φ(1.7) − Φ(−3.7) = 0.955435 − 0.000108.
        let width = half_width(1.0, 1.0);
        assert!((2.6..2.7).contains(&width), "{width}");
        assert_eq!(half_width(3.0, 0.0), 3.0);
        // Wherever the interval stands, it holds 95 %.
        let below = |x: f64| 0.5 * erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
        for step in 0..=400 {
            let offset = 0.02 * f64::from(step);
            let width = half_width(offset, 1.0);
            let held = below(width - offset) - below(-width - offset);
            // The complementary error function has no more digits.
            assert!((held - 0.95).abs() < 1e-11, "{offset}: {held}");
        }
    }
}
