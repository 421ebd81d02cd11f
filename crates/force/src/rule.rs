//! Choice of the regularisation parameter.

use crate::components::{Components, Fit};
use crate::error::ForceError;
use crate::evidence::Posterior;
use crate::limits;

/// Rule for the regularisation parameter λ.
///
/// λ is in the unit of a singular value: scaled channel per newton. Tikhonov damps the components
/// of the force that the system transmits more weakly than λ; truncation removes them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Rule {
    /// The λ whose force is nearest to the posterior mean of the force.
    ///
    /// This mean needs the variances of force and noise, the colour of the force, the number of the
    /// strongest components that may carry a force, and the share of these components that does
    /// carry a force. All these values are those of maximum likelihood. This is the recommended
    /// rule, and the only rule here that minimises the error of the force instead of the error of
    /// the response. The book (`studies/force.md`) compares it with the other rules.
    Likelihood,
    /// Generalised cross-validation: least residual²/(data − unknowns)².
    ///
    /// This rule minimises the error of the response, not of the force: if the force has few lines,
    /// λ is too small.
    ///
    /// # Source
    /// Golub, Heath & Wahba (1979).
    Gcv,
    /// The corner of an L-curve: the logarithm of ‖force‖² over the logarithm of ‖residual‖²/(data
    /// − unknowns). The corner is searched for only where this residual variance is at most twice
    /// that of the noise.
    ///
    /// Textbooks use ‖residual‖ instead, which is zero if there are as many unknowns as data; the
    /// corner of that curve is then at λ = 0. Where the residual is far above the noise, the curve
    /// has other corners, at which only the resonance is fitted.
    ///
    /// # Source
    /// Hansen & O'Leary (1993) for the curve and its curvature; both changes are ours.
    LCurve,
    /// Given λ, in the unit of a scaled channel per N.
    Given(f64),
}

/// Filter factors of the components.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Filter {
    /// Tikhonov's f̂ = s y/(s² + λ²), which minimises ‖y − H f‖² + λ²‖f‖².
    Tikhonov(Rule),
    /// Truncation: components with s ≥ λ are unchanged, the others are zero.
    TruncatedSvd(Rule),
    /// The posterior mean of the force, with a factor for each component, as in
    /// [`Rule::Likelihood`]: lines that the force drives are kept almost unchanged, all other lines
    /// are suppressed.
    Shrinkage,
}

impl Filter {
    /// Returns λ, if it is given.
    pub(crate) fn given(self) -> Option<f64> {
        match self {
            Filter::Tikhonov(Rule::Given(lambda)) | Filter::TruncatedSvd(Rule::Given(lambda)) => {
                Some(lambda)
            }
            _ => None,
        }
    }

    /// Returns an error for an impossible λ.
    pub(crate) fn check(self) -> Result<(), ForceError> {
        match self {
            Filter::Tikhonov(Rule::Given(value)) | Filter::TruncatedSvd(Rule::Given(value))
                if !(value > 0.0 && value.is_finite()) =>
            {
                Err(ForceError::NotPositive { what: "regularisation parameter", value })
            }
            _ => Ok(()),
        }
    }
}

/// Returns the λ of a rule; `None` for [`Filter::Shrinkage`], which has no λ.
pub(crate) fn choose(
    filter: Filter,
    components: &Components,
    posterior: &Posterior,
) -> Option<f64> {
    let (rule, candidates) = match filter {
        Filter::Tikhonov(rule) => (rule, grid(components.singular[0])),
        Filter::TruncatedSvd(rule) => (rule, thresholds(components)),
        Filter::Shrinkage => return None,
    };
    let factor = |i: usize, lambda: f64| factor(filter, components, i, lambda);
    let fits = || -> Vec<Fit> {
        candidates.iter().map(|lambda| components.fit(|i| factor(i, *lambda))).collect()
    };
    let best = match rule {
        Rule::Given(lambda) => return Some(lambda),
        Rule::Likelihood => {
            let mean: Vec<f64> = (0..components.singular.len())
                .map(|i| posterior.best_factor(components, i))
                .collect();
            least(candidates.iter().map(|lambda| {
                let loss = components.fit(|i| (factor(i, *lambda) - mean[i]).abs());
                loss.size
            }))
        }
        Rule::Gcv => least_gcv(filter, components, &fits()),
        Rule::LCurve => corner(filter, components, &fits()),
    };
    Some(candidates[best])
}

pub(crate) fn factor(filter: Filter, components: &Components, i: usize, lambda: f64) -> f64 {
    match filter {
        Filter::TruncatedSvd(_) => components.truncated(i, lambda),
        _ => components.tikhonov(i, lambda),
    }
}

/// Returns values of λ from the largest singular value down, equidistant in the logarithm.
fn grid(largest: f64) -> Vec<f64> {
    (0..=limits::LAMBDAS_PER_DECADE * limits::LAMBDA_DECADES)
        .map(|step| largest * 10f64.powf(-(step as f64) / limits::LAMBDAS_PER_DECADE as f64))
        .collect()
}

/// Returns one threshold per distinct singular value above rounding: the geometric mean of this
/// singular value and the next one. If the singular value itself were the threshold, the smallest
/// change of the system could exclude its component.
fn thresholds(components: &Components) -> Vec<f64> {
    let transmitted = components.transmitted();
    let mut values = components.singular[..transmitted].to_vec();
    values.dedup();
    let below = components.singular.get(transmitted).copied().unwrap_or(0.0);
    let next = values[1..].iter().copied().chain([below]);
    values.iter().zip(next).map(|(s, next)| (s * next.max(1e-3 * s)).sqrt()).collect()
}

/// Returns the candidate with the least residual²/(data − unknowns)²; candidates with too few
/// remaining data (data − unknowns) do not count.
fn least_gcv(filter: Filter, components: &Components, fits: &[Fit]) -> usize {
    let share = if matches!(filter, Filter::TruncatedSvd(_)) {
        limits::TRUNCATION_RESIDUAL
    } else {
        limits::TIKHONOV_RESIDUAL
    };
    least(fits.iter().map(|fit| {
        let freedom = components.data() - fit.unknowns;
        if freedom < share * components.data() {
            f64::INFINITY
        } else {
            fit.residual / (freedom * freedom)
        }
    }))
}

/// Returns the index of the most regularised candidate whose cost equals the minimum up to
/// rounding; this is the first such candidate.
///
/// If the cost is flat towards λ = 0, only rounding would decide between the candidates.
fn least(costs: impl Iterator<Item = f64>) -> usize {
    let costs: Vec<f64> = costs.collect();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    costs.iter().position(|cost| *cost <= least * (1.0 + limits::EQUAL_COSTS)).unwrap_or(0)
}

/// Returns the point of largest curvature of the L-curve, near the noise level that GCV estimates.
fn corner(filter: Filter, components: &Components, fits: &[Fit]) -> usize {
    let reference = least_gcv(filter, components, fits);
    let limit = limits::CORNER_NOISE_RATIO * fits[reference].noise(components);
    let points: Vec<(f64, f64)> =
        fits.iter().map(|fit| (fit.noise(components).ln(), fit.size.ln())).collect();
    let near = |i: usize| fits[i].noise(components) <= limit;
    let curved = (1..points.len().saturating_sub(1))
        .filter(|i| near(*i))
        .map(|i| (i, curvature([points[i - 1], points[i], points[i + 1]])))
        .filter(|(_, curvature)| curvature.is_finite());
    curved.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(reference, |(i, _)| i)
}

/// Returns the curvature through three points, from the circle through them (4·area over the
/// product of the three sides). It is positive where the curve bends like an L: as λ falls, the
/// curve goes first to the left, then up. If λ has no effect, there is no corner, only rounding.
fn curvature(p: [(f64, f64); 3]) -> f64 {
    let side = |a: usize, b: usize| (p[b].0 - p[a].0).hypot(p[b].1 - p[a].1);
    if side(0, 1).min(side(1, 2)) < limits::LAMBDA_EFFECT {
        return f64::NEG_INFINITY;
    }
    let cross = (p[1].0 - p[0].0) * (p[2].1 - p[1].1) - (p[1].1 - p[0].1) * (p[2].0 - p[1].0);
    -2.0 * cross / (side(0, 1) * side(1, 2) * side(0, 2))
}
