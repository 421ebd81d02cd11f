//! The estimators, and what the identified model leaves unexplained.

use std::fmt;

use mechid_estimate::checks::{
    AfterSpectralFit, Finding, SpectralResidual, Subject, Verdict, after_spectral_fit,
    before_spectral_fit, delay_of_lines, fitted_band, steady_periods,
};
use mechid_estimate::frequency_domain::{
    FrequencyData, Lines, NoiseModel, Pooling, RepeatedPeriods, equation_error,
    instrumental_variables, output_error_pooling,
};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::SecondOrderSystem;
use mechid_signal::Record;

use super::left_out::LineRule;
use super::nonlinear::WithTerms;
use super::options::Method;
use super::prediction::{Model, Prediction};
use crate::AnalysisError;
use crate::machine::NonlinearPart;
use crate::measurement::{Block, Windowed};

/// An estimate and how it came about.
#[derive(Debug)]
pub struct Fitted {
    /// Domain of the fit: frequency or time.
    pub domain: &'static str,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// The checks after the fit see the bias of least squares, which another method does not have.
    pub least_squares: bool,
    /// Estimate with its uncertainty; with nonlinear terms, of the linear part.
    pub estimate: Estimate,
    /// Estimate with nonlinear terms, if there are any.
    pub nonlinear: Option<WithTerms>,
    /// Real equations used, of each degree of freedom.
    pub equations: usize,
    /// The spectra, if it was done in the frequency domain, and the lines of the first record.
    pub frequency: Option<(Lines, FrequencyData)>,
    /// Findings before the fit on all records together.
    pub before_all: Vec<Finding>,
    /// Findings before the fit, record by record.
    pub before: Vec<Vec<Finding>>,
    /// Findings after the fit beside those on the residuals, record by record.
    pub after: Vec<Vec<Finding>>,
    /// Findings after the fit on all records together.
    pub after_all: Vec<Finding>,
    /// Residual of each record; empty where it is not tested by itself.
    pub residuals: Vec<Residual>,
    /// Kind of prediction of the response to a measured force.
    pub prediction: Prediction,
    /// Residual power against that of the noise, where the noise is known.
    pub misfit: Option<Misfit>,
    /// Noise spectra that were estimated: one of each record, or one from the residual.
    pub noise: Vec<NoiseModel>,
    /// Remarks on how the fit was done.
    pub remarks: Vec<String>,
}

/// Power of a residual over what the noise explains: 1 if the model is right.
#[derive(Debug, Clone, Copy)]
pub struct Misfit {
    /// Ratio of residual power to noise power.
    pub ratio: f64,
    /// Source of the noise level.
    pub noise: &'static str,
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ratio, noise) = (self.ratio, self.noise);
        write!(f, "residual power is {ratio:.3} × the noise power {noise}")
    }
}

/// Residual of a fit, as it is tested.
#[derive(Debug)]
pub enum Residual {
    /// Samples.
    Samples(SampleResidual),
    /// Lines of a spectrum, weighted by their noise.
    Lines(SpectralResidual),
}

/// Residual of a fit sample by sample.
#[derive(Debug)]
pub struct SampleResidual {
    /// Residual, samples × degrees of freedom.
    pub left: Record,
    /// The fitted signal, used to tell rounding from noise.
    pub fitted: Record,
    /// Force, samples × degrees of freedom, in N.
    pub force: Record,
    /// Lags over which noise on the motion correlates it.
    pub noise_span: usize,
}

/// Maximum number of unknown parameters for which maximum likelihood is chosen without being asked for: 20
/// degrees of freedom, which take seconds.
const LIKELIHOOD_PARAMETERS: usize = 1200;

/// The periods of a record on the lines found in its force.
type Spectra = (RepeatedPeriods, Lines);

/// Fits the spectra of the windows of one or several records, each on the lines that `lines`
/// finds in a period of its force.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    lines: LineRule<'_>,
    method: Option<Method>,
    noise: Pooling,
) -> Result<Fitted, AnalysisError> {
    let mut spectra = Vec::new();
    for recorded in records {
        let held = &recorded.held;
        let chosen = lines.lines(&held.force, held.period)?;
        let lines = Lines::new(held.force.sampling().with_len(held.period)?, chosen)?;
        spectra.push((periods(recorded, &lines)?, lines));
    }
    let data = together(&spectra, &RepeatedPeriods::mean)?;
    let Found { estimator, estimate, mut misfit, noise: models, remark } =
        found(&spectra, &data, unknowns, method, noise)?;
    // Says what the data leave open, before anything is made of it.
    estimate.system()?;
    let (mut before, mut after, mut weighted) = (Vec::new(), Vec::new(), Vec::new());
    for (Windowed { held, .. }, (periods, lines)) in records.iter().zip(&spectra) {
        let motion = held.response().0;
        let checks = steady_periods(&held.force, motion, held.period)?;
        // What differs between windows that are no periods is no noise.
        let repeats = !checks.iter().any(no_period);
        let data = if repeats { with_noise(periods, noise)? } else { periods.mean()? };
        misfit = misfit.filter(|_| repeats);
        before.push(checks);
        let band = fitted_band(&estimate, lines)?;
        let late = delay_of_lines(&data, lines.sampling().dt(), unknowns);
        after.push(band.into_iter().chain(late).collect());
        weighted.push(data);
    }
    let AfterSpectralFit { records: residuals, bias } = after_spectral_fit(&weighted, &estimate)?;
    Ok(Fitted {
        domain: "frequency",
        estimator,
        least_squares: false,
        equations: 2 * data.len(),
        before_all: before_spectral_fit(&data, unknowns)?,
        frequency: Some((spectra.swap_remove(0).1, data)),
        before,
        after,
        after_all: Vec::from_iter(bias),
        residuals: residuals.into_iter().map(Residual::Lines).collect(),
        prediction: Prediction::Steady,
        misfit,
        noise: models,
        nonlinear: None,
        remarks: one_motion_of(&records[0].held).into_iter().chain(remark).collect(),
        estimate,
    })
}

/// Whether a finding says that the windows are no periods of the record.
fn no_period(finding: &Finding) -> bool {
    finding.subject() == Subject::Periodicity && finding.verdict() == Verdict::Bad
}

/// An estimate from spectra.
struct Found {
    estimator: &'static str,
    estimate: Estimate,
    misfit: Option<Misfit>,
    noise: Vec<NoiseModel>,
    remark: Option<String>,
}

/// Returns the estimate of a method from the spectra, of which `data` are the means; without a method, of
/// maximum likelihood if the periods show the noise and the search ends well, otherwise of least squares.
fn found(
    spectra: &[Spectra],
    data: &FrequencyData,
    unknowns: &Unknowns,
    method: Option<Method>,
    noise: Pooling,
) -> Result<Found, AnalysisError> {
    let with_noise = |periods: &RepeatedPeriods| with_noise(periods, noise);
    let least_squares = |remark| -> Result<Found, AnalysisError> {
        let estimator = "least squares on the equation of motion, in the frequency domain";
        let estimate = equation_error(data, unknowns)?;
        Ok(Found { estimator, estimate, misfit: None, noise: Vec::new(), remark })
    };
    let likelihood = |noisy: &FrequencyData| -> Result<Found, EstimateError> {
        let fit = output_error_pooling(noisy, unknowns, noise)?;
        let source = "estimated from the periods";
        let fewest = spectra.iter().map(|(periods, _)| periods.count()).min().unwrap_or(1);
        Ok(Found {
            estimator: "maximum likelihood, in the frequency domain",
            estimate: fit.estimate,
            misfit: noisy.noise().map(|_| Misfit { ratio: fit.misfit_ratio, noise: source }),
            remark: Some(of_noise(fewest, noisy.noise().is_some(), &fit.noise)),
            noise: fit.noise,
        })
    };
    match method {
        Some(Method::LeastSquares) => least_squares(None),
        Some(Method::Instrumental) => {
            let first = together(spectra, &|periods| Ok(periods.halves()?.0))?;
            let second = together(spectra, &|periods| Ok(periods.halves()?.1))?;
            Ok(Found {
                estimator: "instrumental variables, half of the periods against the other",
                estimate: instrumental_variables(&first, &second, unknowns)?,
                misfit: None,
                noise: Vec::new(),
                remark: None,
            })
        }
        Some(Method::MaximumLikelihood) => Ok(likelihood(&together(spectra, &with_noise)?)?),
        None => {
            let noisy = together(spectra, &with_noise)?;
            if noisy.noise().is_none() {
                return least_squares(None);
            }
            if unknowns.free().len() > LIKELIHOOD_PARAMETERS {
                return least_squares(Some(format!(
                    "least squares was used, for {} parameters: noise on the response biases it. \
                     Maximum likelihood takes minutes; --method maximum-likelihood chooses it",
                    unknowns.free().len()
                )));
            }
            match likelihood(&noisy) {
                Err(error @ EstimateError::NotConverged { .. }) => least_squares(Some(format!(
                    "least squares was used, which noise on the response biases: {error}"
                ))),
                other => Ok(other?),
            }
        }
    }
}

/// The rows of all records.
fn together(
    spectra: &[Spectra],
    of: &dyn Fn(&RepeatedPeriods) -> Result<FrequencyData, EstimateError>,
) -> Result<FrequencyData, AnalysisError> {
    let mut all = of(&spectra[0].0)?;
    for (periods, _) in &spectra[1..] {
        all = all.and(&of(periods)?)?;
    }
    Ok(all)
}

/// Returns all periods of a record, read chunk by chunk.
pub fn periods(recorded: &Windowed, lines: &Lines) -> Result<RepeatedPeriods, AnalysisError> {
    let Block { force, period, periods, .. } = &recorded.held;
    let kind = recorded.held.response().1;
    let mut all = RepeatedPeriods::expecting(lines, force.channels(), kind, *periods);
    let samples = period * recorded.at_once().div_ceil(*period);
    recorded
        .chunks(samples, samples, &mut |chunk| Ok(all.push(&chunk.force, chunk.response().0)?))?;
    Ok(all)
}

/// The mean of the periods, with their noise if they show more than rounding.
fn with_noise(periods: &RepeatedPeriods, noise: Pooling) -> Result<FrequencyData, EstimateError> {
    if periods.count() < 2 {
        return periods.mean();
    }
    // Rounding has no spectrum that could be found.
    match periods.mean_with_noise(Pooling::AllLines)?.noise_above_rounding() {
        Some(_) => periods.mean_with_noise(noise),
        None => periods.mean(),
    }
}

/// Returns the remark on weights from `periods` periods or more, whose noise shows or not.
fn of_noise(periods: usize, shows: bool, models: &[NoiseModel]) -> String {
    let mut distinct: Vec<String> = models.iter().map(NoiseModel::to_string).collect();
    distinct.dedup();
    let model = distinct.join("; ");
    match (periods, shows) {
        (0 | 1, _) => format!(
            "one period does not show its noise: it was taken from the residual, on the motion alone; \
             noise spectrum: {model}"
        ),
        (_, false) => format!(
            "the periods differ by rounding only: the noise was taken from the residual, on the motion \
             alone; noise spectrum: {model}"
        ),
        (periods, true) => format!("noise spectrum, from {periods} periods: {model}"),
    }
}

/// Returns the remark on kinds of response that are not used.
pub fn one_motion_of(measured: &Block) -> Vec<String> {
    let unused = measured.responses().len() > 1;
    let kind = measured.response().1;
    Vec::from_iter(unused.then(|| format!("of the motions measured, the {kind} was used")))
}

impl Fitted {
    /// Returns the identified system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined.
    pub fn model(&self) -> Result<Model, AnalysisError> {
        Ok(match &self.nonlinear {
            None => Model::Linear(self.estimate.system()?),
            Some(WithTerms { found, .. }) => {
                Model::Nonlinear { system: found.system()?, channels: found.channels() }
            }
        })
    }

    /// Returns the identified system with its nonlinear terms, if it has any.
    ///
    /// # Errors
    /// As [`Fitted::model`].
    pub(super) fn nonlinear_part(&self) -> Result<Option<NonlinearPart>, AnalysisError> {
        let Some(WithTerms { found, .. }) = &self.nonlinear else { return Ok(None) };
        let (uncertain, channels) = (found.uncertain_system()?, found.channels());
        let largest_displacement = found.ranges().iter().map(|range| range[0]).reduce(f64::max);
        Ok(Some(NonlinearPart { uncertain, channels, largest_displacement }))
    }

    /// Residual of the equations over their right-hand sides, all degrees of freedom together.
    pub(crate) fn nrmse(&self) -> f64 {
        let each = self.estimate.residual_nrmse();
        (each.iter().map(|e| e * e).sum::<f64>() / each.len() as f64).sqrt()
    }

    /// Returns whether frequency responses were fitted, weighted by their noise.
    pub(crate) fn is_weighted(&self) -> bool {
        let noise_stated = self.frequency.as_ref().is_some_and(|(_, data)| data.noise().is_some());
        noise_stated && !self.least_squares
    }

    /// RMS of measured minus modelled response over RMS of the measured response, on the lines used:
    /// in the quantity measured or, where the fit was weighted by the noise, in units of the noise.
    ///
    /// # Errors
    /// If the model has no receptance at a line.
    pub(crate) fn unexplained_motion(
        &self,
        system: &SecondOrderSystem,
    ) -> Result<Option<f64>, AnalysisError> {
        if let Some(WithTerms { found, .. }) = &self.nonlinear {
            let each = found.unexplained();
            let mean = each.iter().map(|part| part * part).sum::<f64>() / each.len() as f64;
            return Ok(Some(mean.sqrt()));
        }
        match &self.frequency {
            Some((_, data)) => unexplained_motion(data, system),
            None => Ok(None),
        }
    }
}

/// RMS of measured minus modelled motion over RMS of the measured motion, at the frequencies of data,
/// weighted by the noise where it is known; `None` if nothing moves.
pub(super) fn unexplained_motion(
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Option<f64>, AnalysisError> {
    let (mut left, mut all) = (0.0, 0.0);
    for (row, omega) in data.omega().iter().enumerate() {
        let measured = data.displacement().row(row).transpose();
        let modelled = system.receptance(*omega)? * data.force().row(row).transpose();
        // A displacement weighs low lines most, whatever their noise.
        let quantity = data.measured().per_displacement(*omega).norm_sqr();
        for channel in 0..data.dof() {
            let weight = match data.noise() {
                Some(noise) => noise.covariance(row)[(channel, channel)].re.recip(),
                None => quantity,
            };
            if weight.is_finite() {
                left += weight * (measured[channel] - modelled[channel]).norm_sqr();
                all += weight * measured[channel].norm_sqr();
            }
        }
    }
    Ok((all > 0.0).then(|| (left / all).sqrt()))
}
