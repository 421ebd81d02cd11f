//! Force from few or noisy channels: the weakly transmitted part of it is damped.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::DMatrix;

use crate::components::Operator;
use crate::evidence::Evidence;
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
    /// Standard deviation of the noise in each channel, as the residual has it, in the channel's unit.
    pub noise_std: Vec<f64>,
}

/// The force that explains the measured channels without amplifying their noise.
///
/// Solves y = H F + noise in singular vectors, channels divided by their noise level (or, where
/// it is not stated, by their size). A period falls apart into its lines; an open record is one
/// dense problem, the force linear between samples.
///
/// The standard error of [`Filter::Tikhonov`] and [`Filter::Shrinkage`] counts the noise let
/// through and, on average over forces of the size found, the force held back; that of
/// [`Filter::TruncatedSvd`] counts the noise only.
///
/// Cost: a period takes one small SVD per line; an open record of N samples and p forces takes
/// O((Np)³) once and (Np)² memory, so it is limited to [`OPEN_UNKNOWNS`](crate::OPEN_UNKNOWNS) unknowns. Longer open
/// records are for [`kalman`](crate::kalman()), linear in their length.
///
/// # Errors
/// As [`frequency_domain`](crate::frequency_domain()); [`ForceError::TooLarge`] for an open record
/// beyond the limit; [`ForceError::Unstable`] for one over which the free response of an unstable
/// machine grows by more than 10⁶ (a period asks for no stability); [`ForceError::Silent`] where no force reaches any channel, or all are zero.
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
    let solution = if let ForceUnknowns::Samples(start) = unknowns {
        let operator = OpenOperator::new(system, measured, forced, *start, &scale)?;
        solve(&operator, system, measured, forced, filter, &scale)?
    } else {
        let operator = PeriodOperator::new(system, measured, forced, &lines, &scale)?;
        solve(&operator, system, measured, forced, filter, &scale)?
    };
    let force = solution.force;
    let rest = measured.exceeds(forced).then(|| match unknowns {
        ForceUnknowns::Samples(start) => {
            Rest::of_open(system, measured, forced, force.record(), *start, &scale, level)
        }
        _ => Rest::of_lines(system, measured, forced, force.spectrum(), &lines, level),
    });
    Ok(RegularisedForce { force: force.with_rest(rest.transpose()?), ..solution })
}

fn solve(
    operator: &impl Operator,
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    filter: Filter,
    scale: &[f64],
) -> Result<RegularisedForce, ForceError> {
    let components = operator.components();
    if components.singular.first().is_none_or(|s| *s == 0.0)
        || components.energy.iter().all(|energy| *energy == 0.0)
    {
        return Err(ForceError::Silent);
    }
    let parameter = choose(filter, components);
    let evidence = parameter.is_none().then(|| Evidence::of(components));
    let factors: Vec<f64> = (0..components.singular.len())
        .map(|i| match (parameter, &evidence) {
            (Some(lambda), _) => factor(filter, components, i, lambda),
            (None, Some(evidence)) => evidence.factor(components, i),
            (None, None) => 0.0,
        })
        .collect();
    let fit = components.fit(|i| factors[i]);
    let noise = evidence.map_or_else(|| fit.noise(components), |evidence| evidence.noise);
    let variance: Vec<f64> = (0..factors.len())
        .map(|i| match (filter, &evidence, parameter) {
            (_, Some(evidence), _) => evidence.variance(components, i),
            (Filter::Tikhonov(_), _, Some(lambda)) => {
                noise / (components.singular[i].powi(2) + lambda * lambda)
            }
            _ if factors[i] > 0.0 => noise / components.singular[i].powi(2),
            _ => 0.0,
        })
        .collect();

    let spread = |part: DMatrix<f64>| {
        let mut all = DMatrix::zeros(part.nrows(), system.dof());
        for (column, dof) in part.column_iter().zip(forced) {
            all.set_column(*dof, &column);
        }
        Record::new(measured.sampling(), all)
    };
    let force = IdentifiedForce::of(spread(operator.force(&factors)?)?);
    let error = spread(operator.variance(&variance).map(f64::sqrt))?;
    Ok(RegularisedForce {
        force: force.with_standard_error(Some(error)),
        parameter,
        unknowns: fit.unknowns,
        noise_std: scale.iter().map(|s| s * noise.sqrt()).collect(),
    })
}
