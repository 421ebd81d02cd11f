//! Choosing how strongly to regularise.

use crate::ForceError;
use crate::components::{Components, Fit};
use crate::evidence::Posterior;

/// Rule for the regularisation parameter λ.
///
/// λ is in the unit of a singular value: scaled channel per newton. Tikhonov damps the components
/// of the force that the machine transmits more weakly than λ, truncation drops them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Rule {
    /// The λ whose force is nearest to the mean of the force given the measurement.
    ///
    /// That mean needs the variances of force and noise, the colour of the force, the share of
    /// components that are driven and how far down the singular values they reach; all are
    /// taken where the measurement is most likely. It is the rule to use: the only one here that looks at the error of the
    /// force and not at the fit of the response. The book (`choose/force.md`) compares the others.
    Likelihood,
    /// Generalised cross-validation: least residual²/(data − unknowns)².
    ///
    /// Aims at the response, not the force: it lets too much through when the driven lines are few.
    ///
    /// # Source
    /// Golub, Heath & Wahba (1979).
    Gcv,
    /// The corner of an L-curve, log of the residual per remaining datum against log ‖force‖,
    /// sought only where that residual is at most twice the noise (in variance).
    ///
    /// The textbook curve has ‖residual‖, which falls to nothing as the unknowns use up the data:
    /// with as many data as unknowns its corner is where nothing is damped. Far above the noise it
    /// has others, where the resonance is fitted and nothing else.
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
    /// f̂ = s y/(s² + λ²): least ‖y − H f‖² + λ²‖f‖².
    Tikhonov(Rule),
    /// The components with s ≥ λ as they are, the others zero.
    TruncatedSvd(Rule),
    /// The mean of the force given the measurement, each component with its own factor, as
    /// [`Rule::Likelihood`] finds it: driven lines are kept, silent ones suppressed.
    Shrinkage,
}

impl Filter {
    /// λ, if it is given.
    pub(crate) fn given(self) -> Option<f64> {
        match self {
            Filter::Tikhonov(Rule::Given(lambda)) | Filter::TruncatedSvd(Rule::Given(lambda)) => {
                Some(lambda)
            }
            _ => None,
        }
    }

    /// An error for a given λ that cannot be one.
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

/// λ runs over eight decades below the largest singular value, this many values per decade.
const PER_DECADE: usize = 25;
const DECADES: usize = 8;
/// The L-curve's corner is sought where the residual variance is at most this over the noise.
const NEAR_NOISE: f64 = 2.0;
/// Relative change of residual and force below which a step of λ counts as none.
const STANDING_STILL: f64 = 1e-3;
/// Truncation leaves at least this share of the data to judge by: where nearly all are used up,
/// a few that happen to be small would look like a perfect fit.
const LEFT_TO_JUDGE: f64 = 0.1;

/// Tikhonov's factors leave at least this share of the data: below it the residual of data
/// without noise sinks to rounding, and rounding would choose.
const LEFT_BY_TIKHONOV: f64 = 1e-4;

/// Costs that differ by less than this share of themselves are equal.
const TIE: f64 = 1e-6;

/// The λ that a rule chooses; infinity means that no force at all is nearest.
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

/// λ from the largest singular value down, evenly in its logarithm.
fn grid(largest: f64) -> Vec<f64> {
    (0..=PER_DECADE * DECADES)
        .map(|step| largest * 10f64.powf(-(step as f64) / PER_DECADE as f64))
        .collect()
}

/// One threshold per distinct singular value that is more than rounding, halfway (in its logarithm)
/// to the next: the least change of the machine would cut off a value that is its own threshold.
fn thresholds(components: &Components) -> Vec<f64> {
    let transmitted = components.transmitted();
    let mut values = components.singular[..transmitted].to_vec();
    values.dedup();
    let below = components.singular.get(transmitted).copied().unwrap_or(0.0);
    let next = values[1..].iter().copied().chain([below]);
    values.iter().zip(next).map(|(s, next)| (s * next.max(1e-3 * s)).sqrt()).collect()
}

/// Least residual²/left², where enough is left to judge by.
fn least_gcv(filter: Filter, components: &Components, fits: &[Fit]) -> usize {
    let share =
        if matches!(filter, Filter::TruncatedSvd(_)) { LEFT_TO_JUDGE } else { LEFT_BY_TIKHONOV };
    least(fits.iter().map(|fit| {
        let freedom = components.data() - fit.unknowns;
        if freedom < share * components.data() {
            f64::INFINITY
        } else {
            fit.residual / (freedom * freedom)
        }
    }))
}

/// The first candidate, the most regularised one, whose cost is the least but for rounding.
///
/// Where the cost levels out towards λ = 0 only rounding would tell the candidates apart.
fn least(costs: impl Iterator<Item = f64>) -> usize {
    let costs: Vec<f64> = costs.collect();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    costs.iter().position(|cost| *cost <= least * (1.0 + TIE)).unwrap_or(0)
}

/// The point of greatest curvature near the noise level, which is taken where GCV is least.
fn corner(filter: Filter, components: &Components, fits: &[Fit]) -> usize {
    let reference = least_gcv(filter, components, fits);
    let limit = NEAR_NOISE * fits[reference].noise(components);
    let points: Vec<(f64, f64)> =
        fits.iter().map(|fit| (fit.noise(components).ln(), fit.size.ln())).collect();
    let near = |i: usize| fits[i].noise(components) <= limit;
    let curved = (1..points.len().saturating_sub(1))
        .filter(|i| near(*i))
        .map(|i| (i, curvature([points[i - 1], points[i], points[i + 1]])))
        .filter(|(_, curvature)| curvature.is_finite());
    curved.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(reference, |(i, _)| i)
}

/// Curvature through three points, by the circle through them (4·area over the three sides),
/// positive where the L bends as an L does when λ falls: first left, then up. Where λ moves
/// nothing there is no corner, only rounding.
fn curvature(p: [(f64, f64); 3]) -> f64 {
    let side = |a: usize, b: usize| (p[b].0 - p[a].0).hypot(p[b].1 - p[a].1);
    if side(0, 1).min(side(1, 2)) < STANDING_STILL {
        return f64::NEG_INFINITY;
    }
    let cross = (p[1].0 - p[0].0) * (p[2].1 - p[1].1) - (p[1].1 - p[0].1) * (p[2].0 - p[1].0);
    -2.0 * cross / (side(0, 1) * side(1, 2) * side(0, 2))
}
