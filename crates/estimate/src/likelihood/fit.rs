//! Fit of a model to line data by maximum likelihood.

use mechid_signal::correlation::probability_above_of;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::covariance::Information;
use super::limits::{
    CONFIRMED, CONFIRMED_WITHOUT_NOISE, FIRST_RELATIVE_NOISE, MISFIT_SIGNIFICANCE, PLAUSIBLE,
};
use super::multi_start::{self, Minima, starts};
use super::residual::{PriorRow, Residual};
use super::response_model::ResponseModel;
use super::search::{Bounds, Minimum};
use super::thinned::Thinned;
use super::unknown_noise::{UnknownNoise, WeightedMinimum};
use super::weights::Weights;
use super::{LikelihoodError, NoiseSource, Settings};
use crate::pulse_covariance::PulseCovariance;

/// Initial values, bounds and priors of the parameters of a model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ParameterSpace {
    pub(super) start: Vec<f64>,
    pub(super) bounds: Bounds,
    pub(super) priors: Vec<PriorRow>,
}

/// A fit with its data, weights and information.
pub(super) struct Fit<'a, M> {
    pub(super) model: &'a M,
    pub(super) data: &'a LineData,
    pub(super) space: &'a ParameterSpace,
    pub(super) weights: Weights,
    pub(super) minimum: Minimum,
    pub(super) minima: Minima,
    /// Information of data and priors about the parameters that are not at a bound.
    pub(super) information: Information,
    /// Degrees of freedom of the noise level; ∞ for known noise.
    pub(super) degrees_of_freedom: f64,
    /// Ratio of the sum of squares of the data to its expectation; `None` if the noise comes from
    /// the residual.
    pub(super) misfit_ratio: Option<f64>,
    /// Probability of a larger misfit than this one if the model is correct.
    pub(super) misfit_p_value: Option<f64>,
    pub(super) is_white: Option<bool>,
}

/// Fits `model` to `data`.
///
/// # Errors
/// [`LikelihoodError`].
pub(super) fn fit<'a, M: ResponseModel>(
    model: &'a M,
    data: &'a LineData,
    space: &'a ParameterSpace,
    settings: &Settings,
) -> Result<Fit<'a, M>, LikelihoodError> {
    settings.check()?;
    check(model, data, space)?;
    let noise = match settings.noise {
        NoiseSource::Automatic => data.noise(),
        _ => None,
    };
    match noise {
        Some(noise) => {
            let weights = Weights::new(noise.covariance().to_vec(), data.outputs().ncols());
            weights.check(data)?;
            with_known_noise(model, data, space, weights, settings)
        }
        None => with_unknown_noise(model, data, space, settings),
    }
}

fn check<M: ResponseModel>(
    model: &M,
    data: &LineData,
    space: &ParameterSpace,
) -> Result<(), LikelihoodError> {
    let dimensions = model.dimensions();
    for (what, expected, got) in [
        ("outputs of the data, one per sensor", dimensions.outputs, data.outputs().ncols()),
        (
            "inputs of the data, one per input of the machine",
            dimensions.inputs,
            data.inputs().ncols(),
        ),
        ("lines of the data", model.omega().len(), data.len()),
    ] {
        if expected != got {
            return Err(LikelihoodError::Size { what, expected, got });
        }
    }
    if space.start.is_empty() {
        return Err(LikelihoodError::NoParameter);
    }
    let none = Weights::new(Vec::new(), dimensions.outputs);
    let residual = Residual { model, data, weights: &none, priors: &[] };
    let transient = residual.transient_unknowns();
    let unknowns = space.start.len() + transient;
    let numbers = residual.len();
    // If there are as many unknowns as measured numbers and priors, no residual remains.
    if numbers + space.priors.len() <= unknowns {
        return Err(LikelihoodError::TooFewLines { numbers, unknowns });
    }
    Ok(())
}

fn with_known_noise<'a, M: ResponseModel>(
    model: &'a M,
    data: &'a LineData,
    space: &'a ParameterSpace,
    weights: Weights,
    settings: &Settings,
) -> Result<Fit<'a, M>, LikelihoodError> {
    let outputs = data.outputs().ncols();
    let known = f64::INFINITY;
    let [freedom, total] = data.noise().map_or([known, known], |noise| {
        [noise.degrees_of_freedom(), noise.total_degrees_of_freedom()]
    });
    let [inflation, _] = sampled_weights(freedom, outputs)?;
    let residual = Residual { model, data, weights: &weights, priors: &space.priors };
    let spare = (residual.len() + space.priors.len())
        .saturating_sub(space.start.len() + residual.transient_unknowns());
    let expected = Expected::new([freedom, total], outputs, data.len(), spare);
    let plausible = expected.cost + PLAUSIBLE * expected.deviation();
    let agreeing = |cost: f64| if cost <= plausible { CONFIRMED } else { usize::MAX };
    let minima = searched(&residual, space, settings, agreeing)?;
    let minimum = minima.best().minimum.clone();
    let information = Information::new(&residual, &minimum, inflation)?;
    Ok(Fit {
        model,
        data,
        space,
        misfit_ratio: Some(minimum.cost / expected.cost),
        misfit_p_value: Some(expected.p_value(minimum.cost)),
        weights,
        minimum,
        minima,
        information,
        degrees_of_freedom: 2.0 * total,
        is_white: None,
    })
}

/// Mean and variance of the sum of squares of a correct model, in units of the noise. The
/// covariances of the noise may be sample covariances.
struct Expected {
    cost: f64,
    variance: f64,
}

impl Expected {
    /// Computes the mean and the variance of the sum of squares. Each sample covariance has
    /// `freedom` degrees of freedom, and all covariances together have `total`; `spare` is the
    /// number of real residuals minus the number of parameters. Rows with the same sample
    /// covariance form one statistic, Hotelling's T².
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
    /// chapter 9.
    fn new([freedom, total]: [f64; 2], outputs: usize, lines: usize, spare: usize) -> Self {
        let (p, lines) = (outputs as f64, lines as f64);
        let share = spare.max(1) as f64 / (2.0 * p * lines);
        let (mean, variance) = if freedom.is_infinite() {
            (p * lines, p * lines)
        } else {
            let groups = total / freedom;
            let size = p * lines / groups;
            let mean = size * freedom / (freedom - p);
            let square =
                size * (size + 1.0) * freedom * freedom / ((freedom - p) * (freedom - p - 1.0));
            (groups * mean, groups * (square - mean * mean))
        };
        // Real and imaginary parts have unit variance each.
        Self { cost: 2.0 * mean * share, variance: 4.0 * variance * share }
    }

    fn deviation(&self) -> f64 {
        self.variance.sqrt()
    }

    /// Returns the probability that a correct model has a larger sum of squares than `cost`.
    fn p_value(&self, cost: f64) -> f64 {
        probability_above_of(cost, self.cost, 0.5 * self.variance)
    }
}

fn with_unknown_noise<'a, M: ResponseModel>(
    model: &'a M,
    data: &'a LineData,
    space: &'a ParameterSpace,
    settings: &Settings,
) -> Result<Fit<'a, M>, LikelihoodError> {
    let unknown = UnknownNoise { model, data, priors: &space.priors, bounds: &space.bounds };
    let weights = unknown.first_weights();
    let residual = Residual { model, data, weights: &weights, priors: &space.priors };
    let mut minima = searched(&residual, space, settings, |_| CONFIRMED_WITHOUT_NOISE)?;
    let white = unknown.white(&minima.best().minimum)?;
    let smooth = match settings.noise {
        NoiseSource::WhiteResidual => None,
        _ => unknown.smooth(&white)?,
    };
    let WeightedMinimum { minimum, weights, is_white, bases } = smooth.unwrap_or(white);
    minima.ends[0].minimum = minimum.clone();
    let residual = Residual { model, data, weights: &weights, priors: &space.priors };
    let mut information = Information::new(&residual, &minimum, 1.0)?;
    let unknowns = space.start.len() + residual.transient_unknowns();
    let mut freedom = residual.len().saturating_sub(unknowns).max(1) as f64;
    if let Some(linearisation) = residual.linearise(&minimum.parameters).filter(|_| !is_white) {
        let jacobian = linearisation.jacobian;
        let of_weights = information.add_weight_uncertainty(data, &jacobian, &bases);
        freedom = of_weights.map_or(freedom, |of_weights| of_weights.clamp(1.0, freedom));
    }
    Ok(Fit {
        model,
        data,
        space,
        weights,
        minimum,
        minima,
        information,
        degrees_of_freedom: freedom,
        misfit_ratio: None,
        misfit_p_value: None,
        is_white: Some(is_white),
    })
}

fn searched<M: ResponseModel>(
    residual: &Residual<'_, M>,
    space: &ParameterSpace,
    settings: &Settings,
    agreeing: impl Fn(f64) -> usize,
) -> Result<Minima, LikelihoodError> {
    let model = Thinned::new(residual);
    let data = model.lines(residual.data);
    let data = data.ok_or(LikelihoodError::TooFewLines { numbers: 0, unknowns: 1 })?;
    let weights = residual.weights.rows(&model.rows).with_relative(&data, FIRST_RELATIVE_NOISE);
    let rough = Residual { model: &model, data: &data, weights: &weights, priors: residual.priors };
    let starts =
        starts(&space.start, &space.bounds, settings.starts.max(1), settings.spread, settings.seed);
    multi_start::search(&rough, residual, &space.bounds, &starts, agreeing)
}

/// Returns two factors for weights Ŝ⁻¹ of p outputs, where the sample covariances Ŝ have ν degrees
/// of freedom. The first, ν²/((ν − p)² − 1), is the ratio of the covariance of an estimate to the
/// inverse of the Fisher information. The second, ν/(ν − p), is the mean of a squared residual.
fn sampled_weights(freedom: f64, outputs: usize) -> Result<[f64; 2], LikelihoodError> {
    if freedom.is_infinite() {
        return Ok([1.0, 1.0]);
    }
    let p = outputs as f64;
    if freedom <= p + 1.0 {
        return Err(LikelihoodError::FewDegreesOfFreedom { degrees_of_freedom: freedom, outputs });
    }
    let reduced = freedom - p;
    Ok([freedom * freedom / (reduced * reduced - 1.0), freedom / reduced])
}

impl<'a, M: ResponseModel> Fit<'a, M> {
    pub(super) fn residual(&self) -> Residual<'_, M> {
        Residual {
            model: self.model,
            data: self.data,
            weights: &self.weights,
            priors: &self.space.priors,
        }
    }

    /// Returns the ratio of the standard errors to the standard errors from the noise alone: the
    /// Birge ratio if the misfit is too large for the noise, otherwise 1.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    pub(super) fn error_scale(&self) -> f64 {
        let is_misfit = self.misfit_p_value.is_some_and(|p_value| p_value < MISFIT_SIGNIFICANCE);
        match self.misfit_ratio.filter(|_| is_misfit) {
            Some(ratio) => ratio.sqrt().max(1.0),
            None => 1.0,
        }
    }

    /// Returns a quantile of the error of an estimate, in units of the standard error before its
    /// multiplication by [`Fit::error_scale`].
    pub(super) fn quantile(&self, probability: f64) -> f64 {
        let freedom = self.degrees_of_freedom.clamp(1.0, 1e6);
        StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |law| law.inverse_cdf(probability))
    }

    /// Returns the log-likelihood −½ Σ r² − Σ ln det(π S) over the lines, with the true inputs
    /// eliminated.
    pub(super) fn log_likelihood(&self) -> Option<f64> {
        let p = self.data.outputs().ncols() as f64;
        let mut log_determinant = 0.0;
        for row in 0..self.data.len() {
            let line = self.model.at(&self.minimum.parameters, row)?;
            let input = self.data.inputs().row(row).transpose();
            let of_model = self.model.covariance(row, &line, &input);
            let receptance = super::LineResponse::receptance(&line);
            let weighted = self.weights.line(row, receptance, of_model)?;
            let roots: f64 = weighted.lower.diagonal().iter().map(|z| z.re.ln()).sum();
            log_determinant += 2.0 * roots + p * std::f64::consts::PI.ln();
        }
        self.residual().for_each_record(&self.minimum.parameters, |record| {
            let of_pulses = record.pulses.as_ref().map(PulseCovariance::log_determinant);
            log_determinant += 0.5 * of_pulses.unwrap_or(0.0);
            Some(())
        })?;
        Some(-0.5 * self.minimum.cost - log_determinant)
    }

    /// Returns, for each output, the ratio of the root mean square of the error to that of the
    /// output.
    pub(super) fn relative_errors(&self) -> Option<Vec<f64>> {
        let errors = self.residual().errors(&self.minimum.parameters)?.errors;
        let norm = |of: &DMatrix<Complex<f64>>, at: usize| of.column(at).norm();
        let ratio = |at: usize| norm(&errors, at) / norm(self.data.outputs(), at);
        Some((0..errors.ncols()).map(ratio).collect())
    }
}
