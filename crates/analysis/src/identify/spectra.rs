//! The estimators, and what the identified model leaves unexplained.

use std::fmt;

use mechid_estimate::checks::{Finding, after_spectral_fit, before_spectral_fit, delay_of_lines};
use mechid_estimate::frequency_domain::{
    FrequencyData, Lines, Pooling, RepeatedPeriods, equation_error, instrumental_variables,
    output_error,
};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::SecondOrderSystem;
use mechid_signal::Record;

use super::lines::{LineChoice, choose_lines};
use super::nonlinear::WithTerms;
use super::options::Method;
use super::prediction::{Model, Prediction};
use crate::AnalysisError;
use crate::machine::NonlinearPart;
use crate::measurement::{Block, CHUNK_SAMPLES, Windowed};

/// An estimate and how it came about.
#[derive(Debug)]
pub struct Fitted {
    /// Domain of the fit: frequency or time.
    pub domain: &'static str,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Spectra were fitted by least squares, where another method allows for noise.
    pub least_squares: bool,
    /// Estimate with its uncertainty; with nonlinear terms, of the linear part.
    pub estimate: Estimate,
    /// Estimate with nonlinear terms, if there are any.
    pub nonlinear: Option<WithTerms>,
    /// Real equations used, of each degree of freedom.
    pub equations: usize,
    /// The spectra, if it was done in the frequency domain, and the lines of the first record.
    pub frequency: Option<(Lines, FrequencyData)>,
    /// Findings before the fit, record by record.
    pub before: Vec<Vec<Finding>>,
    /// Findings after the fit beside those on the residuals, record by record.
    pub after: Vec<Vec<Finding>>,
    /// Residual of each record; empty where it is not a row of samples.
    pub residuals: Vec<Residual>,
    /// Kind of prediction of the response to a measured force.
    pub prediction: Prediction,
    /// Residual power against that of the noise, where the noise is known.
    pub misfit: Option<Misfit>,
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

/// Residual of a fit.
#[derive(Debug)]
pub struct Residual {
    /// Residual, samples × degrees of freedom.
    pub left: Record,
    /// The fitted signal, used to tell rounding from noise.
    pub fitted: Record,
    /// Force, samples × degrees of freedom, in N.
    pub force: Record,
    /// Lags over which noise on the motion correlates it.
    pub noise_span: usize,
}

/// The periods of a record on the lines found in its force.
type Spectra = (RepeatedPeriods, Lines);

/// Fits the spectra of the windows of one or several records, each on the lines that `choose` finds
/// in a period of its force.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    lines: &LineChoice,
    method: Method,
) -> Result<Fitted, AnalysisError> {
    let mut spectra = Vec::new();
    for recorded in records {
        let held = &recorded.held;
        let chosen = choose_lines(&held.force, held.period, lines)?;
        let lines = Lines::new(held.force.sampling().with_len(held.period)?, chosen)?;
        spectra.push((periods(recorded, &lines)?, lines));
    }
    let data = together(&spectra, &RepeatedPeriods::mean)?;
    let Found { estimator, estimate, misfit, remark } = found(&spectra, &data, unknowns, method)?;
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for (Windowed { held, .. }, (periods, lines)) in records.iter().zip(&spectra) {
        let (motion, kind) = held.response();
        before.push(before_spectral_fit(lines, &held.force, motion, kind, unknowns)?);
        let own = lines.as_slice().len() as f64 / data.len() as f64;
        let fitted = own * estimate.parameters().len() as f64;
        let late = delay_of_lines(&weighted(periods)?, lines.sampling().dt(), unknowns);
        after.push(late.into_iter().chain(of_noise(periods, &estimate, fitted)?).collect());
    }
    Ok(Fitted {
        domain: "frequency",
        estimator,
        least_squares: method == Method::LeastSquares,
        equations: 2 * data.len(),
        frequency: Some((spectra.swap_remove(0).1, data)),
        before,
        after,
        residuals: steady_residuals(records, &Model::Linear(estimate.system()?))?,
        prediction: Prediction::Steady,
        misfit,
        nonlinear: None,
        remarks: one_motion_of(&records[0].held).into_iter().chain(remark).collect(),
        estimate,
    })
}

/// An estimate from spectra.
struct Found {
    estimator: &'static str,
    estimate: Estimate,
    misfit: Option<Misfit>,
    remark: Option<String>,
}

/// Returns the estimate of a method from the spectra, of which `data` are the means.
fn found(
    spectra: &[Spectra],
    data: &FrequencyData,
    unknowns: &Unknowns,
    method: Method,
) -> Result<Found, AnalysisError> {
    let plain = |estimator, estimate| Found { estimator, estimate, misfit: None, remark: None };
    Ok(match method {
        Method::LeastSquares => plain(
            "least squares on the equation of motion, in the frequency domain",
            equation_error(data, unknowns)?,
        ),
        Method::Instrumental => {
            let first = together(spectra, &|periods| Ok(periods.halves()?.0))?;
            let second = together(spectra, &|periods| Ok(periods.halves()?.1))?;
            plain(
                "instrumental variables, half of the periods against the other",
                instrumental_variables(&first, &second, unknowns)?,
            )
        }
        Method::MaximumLikelihood => {
            let fewest = spectra.iter().map(|(periods, _)| periods.count()).min().unwrap_or(1);
            let fit = match pooling(fewest) {
                None => output_error(data, unknowns)?,
                Some(pooling) => {
                    let noisy = together(spectra, &|periods| periods.mean_with_noise(pooling))?;
                    output_error(&noisy, unknowns)?
                }
            };
            let noise = "estimated from the periods";
            Found {
                estimator: "maximum likelihood, in the frequency domain",
                estimate: fit.estimate,
                misfit: (fewest > 1).then_some(Misfit { ratio: fit.misfit_ratio, noise }),
                remark: of_pooling(fewest),
            }
        }
    })
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
    let samples = period * (CHUNK_SAMPLES / period).max(1);
    recorded
        .chunks(samples, samples, &mut |chunk| Ok(all.push(&chunk.force, chunk.response().0)?))?;
    Ok(all)
}

/// Returns the misfit against the noise of the periods, if there are several.
fn of_noise(
    periods: &RepeatedPeriods,
    estimate: &Estimate,
    fitted: f64,
) -> Result<Option<Finding>, AnalysisError> {
    let Some(pooling) = pooling(periods.count()) else { return Ok(None) };
    Ok(after_spectral_fit(&periods.mean_with_noise(pooling)?, estimate, fitted))
}

/// The mean of the periods, with their noise if it shows.
fn weighted(periods: &RepeatedPeriods) -> Result<FrequencyData, EstimateError> {
    match pooling(periods.count()) {
        Some(pooling) => periods.mean_with_noise(pooling),
        None => periods.mean(),
    }
}

/// Returns how the noise of `periods` periods is averaged over the lines; `None` for one period.
fn pooling(periods: usize) -> Option<Pooling> {
    match periods {
        0 | 1 => None,
        2..8 => Some(Pooling::AllLines),
        _ => Some(Pooling::PerLine),
    }
}

/// Returns the remark on weights from `periods` periods.
fn of_pooling(periods: usize) -> Option<String> {
    match periods {
        0 | 1 => Some(
            "one period does not show its noise: it was taken as white on the motion, of the level \
             the residual has"
                .into(),
        ),
        few @ 2..8 => Some(format!("{few} periods are few: one noise level for all lines")),
        _ => None,
    }
}

/// Returns the remark on kinds of response that are not used.
pub fn one_motion_of(measured: &Block) -> Vec<String> {
    let unused = measured.responses().len() > 1;
    let kind = measured.response().1;
    Vec::from_iter(unused.then(|| format!("of the motions measured, the {kind} was used")))
}

/// The motion that is left of what is held when the machine's steady state under the measured force
/// is taken away, means apart.
pub fn steady_residuals(
    records: &[Windowed],
    model: &Model,
) -> Result<Vec<Residual>, AnalysisError> {
    let mut residuals = Vec::new();
    for Windowed { held: measured, .. } in records {
        let motion = measured.response().0.without_mean();
        let predicted = Prediction::Steady.predict(model, measured)?.swap_remove(0).predicted;
        residuals.push(Residual {
            left: Record::new(motion.sampling(), motion.data() - predicted.data())?,
            fitted: motion,
            force: measured.force.clone(),
            noise_span: 0,
        });
    }
    Ok(residuals)
}

impl Fitted {
    /// Returns the identified system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined.
    pub fn model(&self) -> Result<Model, AnalysisError> {
        Ok(match self.nonlinear_part()? {
            None => Model::Linear(self.estimate.system()?),
            Some(NonlinearPart { system, channels }) => Model::Nonlinear { system, channels },
        })
    }

    /// Returns the identified system with its nonlinear terms, if it has any.
    ///
    /// # Errors
    /// As [`Fitted::model`].
    pub(super) fn nonlinear_part(&self) -> Result<Option<NonlinearPart>, AnalysisError> {
        let Some(WithTerms { found, .. }) = &self.nonlinear else { return Ok(None) };
        Ok(Some(NonlinearPart { system: found.system()?, channels: found.channels() }))
    }

    /// Residual of the equations over their right-hand sides, all degrees of freedom together.
    pub fn nrmse(&self) -> f64 {
        let each = self.estimate.residual_nrmse();
        (each.iter().map(|e| e * e).sum::<f64>() / each.len() as f64).sqrt()
    }

    /// RMS of measured minus modelled motion over RMS of the measured motion, on the lines used:
    /// what no choice of these parameters' uncertainty accounts for.
    ///
    /// # Errors
    /// If the model has no receptance at a line.
    pub fn unexplained_motion(
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

/// RMS of measured minus modelled motion over RMS of the measured motion, at the frequencies of data;
/// `None` if nothing moves.
pub(super) fn unexplained_motion(
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Option<f64>, AnalysisError> {
    let (mut left, mut all) = (0.0, 0.0);
    for (row, omega) in data.omega().iter().enumerate() {
        // In the quantity that was measured: a displacement weighs low lines most.
        let factor = data.measured().per_displacement(*omega);
        let measured = data.displacement().row(row).transpose() * factor;
        let force = data.force().row(row).transpose();
        let modelled = system.receptance(*omega)? * force * factor;
        left += (&measured - modelled).norm_squared();
        all += measured.norm_squared();
    }
    Ok((all > 0.0).then(|| (left / all).sqrt()))
}
