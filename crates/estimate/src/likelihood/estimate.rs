//! Results of a fit: parameters with intervals, priors, minima and undetermined combinations.

use std::fmt;

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, Normal};

use super::fit::Fit;
use super::limits::{COMMON_FACTOR, WEAK};
use super::profile;
use super::response_model::ResponseModel;

/// Method of an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum IntervalKind {
    /// Value ± quantile × standard error.
    Wald,
    /// Limits of the profile likelihood, for a weakly determined parameter or near a bound.
    Profile,
    /// Range from a bound to the one-sided limit of the profile likelihood; the estimate is at this
    /// bound.
    OneSided,
    /// Full range between the bounds, because the data do not determine the parameter.
    Open,
}

/// Contribution of a prior to a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PriorReport {
    /// Mean, in the unit of the parameter.
    pub mean: f64,
    /// Standard deviation, in the unit of the parameter.
    pub standard_deviation: f64,
    /// Share of the information about the parameter that comes from its prior, 0 to 1.
    pub share: f64,
    /// Probability of a larger difference between the estimate and the mean of the prior, if prior
    /// and data agree; `None` if the data have no information about the parameter.
    pub p_value: Option<f64>,
}

/// Estimate of one parameter.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ParameterEstimate {
    /// Name.
    pub name: String,
    /// Most likely value, in the unit of the parameter.
    pub value: f64,
    /// Standard error, in the unit of the parameter; `None` if the parameter is at a bound or not
    /// determined.
    pub standard_error: Option<f64>,
    /// Interval at the confidence level of the settings, in the unit of the parameter.
    pub interval: [f64; 2],
    /// Method of the interval.
    pub interval_kind: IntervalKind,
    /// `true` if a bound limits the estimate.
    pub at_bound: bool,
    /// Prior, if there is one.
    pub prior: Option<PriorReport>,
}

/// Parameters for which the data determine only some combinations.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Combination {
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// One possible set of values: one value for each parameter, in the unit of the parameter. The
    /// data determine only the combinations; other values with the same combinations fit equally
    /// well.
    pub values: Vec<f64>,
    /// Coefficients of the parameters in the differential of each determined combination; the
    /// largest coefficient is 1. The unit of a coefficient is the unit of the parameter with the
    /// largest coefficient, divided by the unit of the parameter that the coefficient multiplies.
    pub determined: Vec<Vec<f64>>,
}

impl fmt::Display for Combination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (last, first) = match self.parameters.split_last() {
            Some(parts) => parts,
            None => return Ok(()),
        };
        let names = if first.is_empty() {
            last.clone()
        } else {
            format!("{} and {last}", first.join(", "))
        };
        if self.determined.is_empty() {
            return write!(f, "the data do not determine {names}");
        }
        if self.has_common_factor() {
            return write!(
                f,
                "the data determine {names} except for one common factor: state one of these values"
            );
        }
        let sums = self.determined.iter().map(|coefficients| self.combination(coefficients));
        let sums: Vec<String> = sums.collect();
        write!(f, "the data do not determine {names} separately, but only {}", sums.join(" and "))
    }
}

impl Combination {
    /// Returns whether only a common factor of all values is undetermined: every determined
    /// combination depends only on ratios of the values.
    fn has_common_factor(&self) -> bool {
        let is_ratio = |coefficients: &Vec<f64>| {
            let terms = || coefficients.iter().zip(&self.values).map(|(c, value)| c * value);
            terms().sum::<f64>().abs() <= COMMON_FACTOR * terms().map(f64::abs).sum::<f64>()
        };
        let members = self.parameters.len();
        members > 2 && self.determined.len() + 1 == members && self.determined.iter().all(is_ratio)
    }

    /// Returns the combination in words: a sum, a series sum, or a list of terms.
    fn combination(&self, coefficients: &[f64]) -> String {
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
        let inverse_squares: Vec<f64> = self.values.iter().map(|v| v.powi(-2)).collect();
        let largest = inverse_squares.iter().copied().fold(0.0, f64::max);
        let equal = coefficients.iter().all(|c| close(*c, 1.0));
        let series = coefficients.iter().zip(&inverse_squares).all(|(c, i)| close(*c, i / largest));
        let of_both = equal && series;
        if equal && !of_both {
            return format!("their sum {}", self.parameters.join(" + "));
        }
        if series && !of_both {
            let parts: Vec<String> = self.parameters.iter().map(|p| format!("1/{p}")).collect();
            return format!("their series sum 1/({})", parts.join(" + "));
        }
        let terms = coefficients.iter().zip(&self.parameters);
        let terms: Vec<String> =
            terms.map(|(coefficient, name)| format!("{coefficient:.4}·δ{name}")).collect();
        format!("the combination {}", terms.join(" + "))
    }
}

/// Common minimum of one or more searches.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FoundMinimum {
    /// Values of the parameters, each in the unit of its parameter.
    pub parameters: Vec<f64>,
    /// Sum of squares including the priors, a pure number: −2 times the log-likelihood, up to a
    /// constant.
    pub sum_of_squares: f64,
    /// Number of searches that ended at this minimum.
    pub searches: usize,
    /// Number of steps of the best search.
    pub steps: usize,
}

/// Result of a maximum-likelihood fit of any model.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LikelihoodEstimate {
    /// Parameters, in the order of the model.
    pub parameters: Vec<ParameterEstimate>,
    /// Covariance of the parameters, parameters × parameters, each entry in the product of the
    /// units of its two parameters; 0 for parameters at a bound. Undetermined directions do not
    /// contribute.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub covariance: DMatrix<f64>,
    /// Logarithm of the likelihood, a pure number.
    pub log_likelihood: f64,
    /// Ratio of the sum of squares in units of the noise to its expectation: 1 for a correct model;
    /// `None` if the noise comes from the residual.
    pub misfit_ratio: Option<f64>,
    /// Probability of a larger misfit than this one if model and noise are correct; `None` if the
    /// noise comes from the residual.
    pub misfit_p_value: Option<f64>,
    /// Factor that multiplies the standard errors and intervals if model and data differ by more
    /// than the noise; otherwise 1.
    pub error_scale: f64,
    /// `true` if the noise of all outputs was found to be white; `None` if the noise is stated.
    pub white_noise: Option<bool>,
    /// Ratio of the root mean squares of residual and output, per output.
    pub relative_residual: Vec<f64>,
    /// Minima of all searches, the lowest first.
    pub minima: Vec<FoundMinimum>,
    /// Number of searches.
    pub searches: usize,
    /// Condition number of the Jacobian with columns of unit length, a pure number.
    pub condition: f64,
    /// Sets of parameters that the data do not determine one by one, with the combinations that
    /// they do determine.
    pub combinations: Vec<Combination>,
    /// Degrees of freedom of the noise level; infinite for known noise.
    pub degrees_of_freedom: f64,
}

impl LikelihoodEstimate {
    /// Returns the estimate of a parameter by its name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Returns the values of the parameters, each in the unit of its parameter.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.value).collect()
    }

    /// Returns the number of searches that ended at the lowest minimum.
    pub fn agreeing(&self) -> usize {
        self.minima.first().map_or(0, |minimum| minimum.searches)
    }

    pub(super) fn new<M: ResponseModel>(
        fit: &Fit<'_, M>,
        names: &[String],
        confidence: f64,
    ) -> Self {
        let parameter = |at: usize| estimated(fit, names, at, confidence);
        let combinations = fit.information.combinations().into_iter();
        let combinations = combinations.map(|(members, determined)| Combination {
            parameters: members.iter().map(|at| names[*at].clone()).collect(),
            values: members.iter().map(|at| fit.minimum.parameters[*at]).collect(),
            determined,
        });
        let minima = fit.minima.ends.iter().map(|end| FoundMinimum {
            parameters: end.minimum.parameters.clone(),
            sum_of_squares: end.minimum.cost,
            searches: end.searches,
            steps: end.minimum.steps,
        });
        Self {
            parameters: (0..names.len()).map(parameter).collect(),
            covariance: &fit.information.covariance * fit.error_scale().powi(2),
            error_scale: fit.error_scale(),
            log_likelihood: fit.log_likelihood().unwrap_or(f64::NAN),
            misfit_ratio: fit.misfit_ratio,
            misfit_p_value: fit.misfit_p_value,
            white_noise: fit.is_white,
            relative_residual: fit.relative_errors().unwrap_or_default(),
            minima: minima.collect(),
            searches: fit.minima.searches,
            condition: fit.information.condition(),
            combinations: combinations.collect(),
            degrees_of_freedom: fit.degrees_of_freedom,
        }
    }
}

fn estimated<M: ResponseModel>(
    fit: &Fit<'_, M>,
    names: &[String],
    at: usize,
    confidence: f64,
) -> ParameterEstimate {
    let value = fit.minimum.parameters[at];
    let at_bound = fit.minimum.at_bound[at];
    let of_noise = fit.information.standard_error(at).filter(|_| !at_bound);
    let standard_error = of_noise.map(|error| error * fit.error_scale());
    let (interval, interval_kind) = interval(fit, at, standard_error, confidence);
    ParameterEstimate {
        name: names[at].clone(),
        value,
        standard_error,
        interval,
        interval_kind,
        at_bound,
        prior: prior(fit, at, of_noise),
    }
}

fn interval<M: ResponseModel>(
    fit: &Fit<'_, M>,
    at: usize,
    standard_error: Option<f64>,
    confidence: f64,
) -> ([f64; 2], IntervalKind) {
    let value = fit.minimum.parameters[at];
    let (min, max) = (fit.space.bounds.min[at], fit.space.bounds.max[at]);
    if fit.minimum.at_bound[at] {
        let rise = (fit.error_scale() * fit.quantile(confidence)).powi(2);
        let first = (fit.space.start[at] - value).abs().max(1e-6 * value.abs());
        let end = |direction| profile::limit(fit, at, direction, 0.01 * first, rise);
        let interval = if value <= min { [value, end(1.0)] } else { [end(-1.0), value] };
        return (interval, IntervalKind::OneSided);
    }
    let Some(error) = standard_error else { return ([min, max], IntervalKind::Open) };
    let quantile = fit.quantile(0.5 + 0.5 * confidence);
    let wald = [value - quantile * error, value + quantile * error];
    if error <= WEAK * value.abs() && wald[0] >= min && wald[1] <= max {
        return (wald, IntervalKind::Wald);
    }
    let rise = (fit.error_scale() * quantile).powi(2);
    let end = |direction| profile::limit(fit, at, direction, quantile * error, rise);
    ([end(-1.0), end(1.0)], IntervalKind::Profile)
}

/// Returns the report on the prior of parameter `at`, with the share of the prior and its test. If
/// data and prior agree, the difference between the estimate and the prior mean has the variance s²
/// − v, with the prior variance s² and the posterior variance v.
fn prior<M: ResponseModel>(
    fit: &Fit<'_, M>,
    at: usize,
    standard_error: Option<f64>,
) -> Option<PriorReport> {
    let prior = fit.space.priors.iter().find(|prior| prior.parameter == at)?;
    let variance = prior.deviation * prior.deviation;
    let posterior = standard_error.map_or(0.0, |error| error * error);
    let difference = variance - posterior;
    // A difference of the size of rounding means that the data have no information.
    let p_value = (difference > 1e-9 * variance).then(|| {
        let z = (fit.minimum.parameters[at] - prior.mean).abs() / difference.sqrt();
        Normal::standard().sf(z) * 2.0
    });
    Some(PriorReport {
        mean: prior.mean,
        standard_deviation: prior.deviation,
        share: (posterior / variance).min(1.0),
        p_value,
    })
}
