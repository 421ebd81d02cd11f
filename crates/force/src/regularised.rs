//! Force from few or noisy channels: the weakly transmitted part of it is damped.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::DMatrix;

use crate::components::Components;
use crate::evidence::Evidence;
use crate::frequency_domain::sizes;
use crate::open_operator::OpenOperator;
use crate::period_operator::PeriodOperator;
use crate::rule::{choose, factor};
use crate::unexplained::Rest;
use crate::{Filter, ForceError, IdentifiedForce, Measurement, Noise};

/// What the measured record is.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Extent {
    /// One whole period in steady state; a force on every line below Nyquist is possible.
    Period,
    /// One whole period in steady state; the force is on these lines only.
    PeriodLines(Vec<usize>),
    /// A record that simply ends.
    Open(Start),
}

/// What the machine does at the first sample of an open record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Start {
    /// Neither displaced nor moving.
    FromRest,
    /// Already in motion, nobody knows how: displacement and velocity are sought with the force.
    InMotion,
}

/// A regularised force and how it was chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct RegularisedForce {
    /// The force, with its standard error.
    pub force: IdentifiedForce,
    /// λ, in the unit of a scaled channel per N; `None` for [`Filter::Shrinkage`], which has none.
    pub parameter: Option<f64>,
    /// How many real unknowns the filter lets through, a pure number and rarely a whole one.
    pub unknowns: f64,
    /// Noise level that the fit leaves over, one standard deviation per channel, in its unit.
    pub noise: Vec<f64>,
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
/// beyond the limit; [`ForceError::Silent`] where no force reaches any channel, or all are zero.
///
/// # Source
/// Tikhonov & Arsenin (1977); Hansen (1998), Rank-Deficient and Discrete Ill-Posed Problems.
pub fn regularised(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    extent: &Extent,
    filter: Filter,
    noise: &Noise,
) -> Result<RegularisedForce, ForceError> {
    measured.check(system.dof(), forced)?;
    filter.check()?;
    let lines = match extent {
        Extent::Period => (0..measured.sampling().len().div_ceil(2)).collect(),
        Extent::PeriodLines(lines) => lines.clone(),
        Extent::Open(_) => Vec::new(),
    };
    let level = noise.resolve(measured, &Spectrum::of(measured.record()), &lines)?;
    let scale = level.clone().unwrap_or_else(|| sizes(measured.record()));
    let level = level.as_deref();
    let found = if let Extent::Open(start) = extent {
        let operator = OpenOperator::new(system, measured, forced, *start, &scale)?;
        solve(&operator, system, measured, forced, filter, &scale)?
    } else {
        let operator = PeriodOperator::new(system, measured, forced, &lines, &scale)?;
        solve(&operator, system, measured, forced, filter, &scale)?
    };
    let force = found.force;
    let rest = measured.exceeds(forced).then(|| match extent {
        Extent::Open(start) => {
            let start = (*start, &scale[..]);
            Ok(Rest::of_open(system, measured, forced, force.record(), start, level))
        }
        _ => Rest::of_lines(system, measured, forced, force.spectrum(), &lines, level),
    });
    Ok(RegularisedForce { force: force.with_rest(rest.transpose()?), ..found })
}

/// The problem in its singular vectors.
pub(crate) trait Operator {
    fn components(&self) -> &Components;
    /// Samples × forces of the components times these factors (f̂_i = φ_i y_i / s_i).
    fn force(&self, factors: &[f64]) -> DMatrix<f64>;
    /// Samples × forces: variance, given that of each component per real unknown.
    fn variance(&self, components: &[f64]) -> DMatrix<f64>;
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
    let force = IdentifiedForce::of(spread(operator.force(&factors))?);
    let error = spread(operator.variance(&variance).map(f64::sqrt))?;
    Ok(RegularisedForce {
        force: force.with_standard_error(Some(error)),
        parameter,
        unknowns: fit.unknowns,
        noise: scale.iter().map(|s| s * noise.sqrt()).collect(),
    })
}
