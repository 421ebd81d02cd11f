//! A fit: the estimate, its data and settings, and its residual.

use std::fmt;

use mechid_checks::limits::{LAGS, SAMPLES_PER_LAG};
use mechid_checks::{Finding, SpectralResidual};
use mechid_estimate::{Estimate, IdentifiedMode};
use mechid_model::SecondOrderSystem;
use mechid_nonlinear::{Distortion, NonlinearEstimate, RestoringForce};
use mechid_signal::{Record, message};
use mechid_spectra::{FrequencyData, Lines, NoiseModel};

use super::checks::CheckRow;
use super::coherence::ResponseCoherence;
use super::determined;
use super::disagreement::Disagreement;
use super::force_noise::ForceNoise;
use super::keywords::Domain;
use super::prediction::{Model, Prediction};
use super::selection::SelectionSummary;
use super::sinusoids::SinusoidRow;
use crate::AnalysisError;
use crate::limits::UNCERTAIN_ERROR;
use crate::machine::NonlinearPart;
use crate::text::significant;

/// An estimate with its data and findings.
#[derive(Debug)]
pub struct Fitted {
    /// Domain of the fit.
    pub domain: Domain,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// `true` for least squares: the checks after the fit may then warn because of the bias of
    /// least squares, without a fault of the data.
    pub least_squares: bool,
    /// Estimate with its uncertainty; for a fit with nonlinear terms, the estimate of the linear
    /// part. If the equations have no scale, it is the estimate of one of the systems with the same
    /// modes ([`Unscaled`](super::Unscaled)).
    pub estimate: Estimate,
    /// Estimate with nonlinear terms, if there are any.
    pub nonlinear: Option<WithTerms>,
    /// Additions to the standard errors of `estimate`.
    pub(super) disagreement: Disagreement,
    /// Number of real equations per degree of freedom.
    pub equations: usize,
    /// The spectra of a fit in the frequency domain, and the lines of the first record.
    pub frequency: Option<(Lines, FrequencyData)>,
    /// The spectra in `frequency`, but with the noise that the scatter of the periods shows in
    /// every record; `None` if a record has one period, and for fits that do not average periods.
    pub scattered: Option<FrequencyData>,
    /// Coherence of the frequency responses of the first record; `None` if no frequency responses
    /// were fitted.
    pub coherence: Option<ResponseCoherence>,
    /// Findings before the fit on all records together.
    pub before_all: Vec<Finding>,
    /// Findings before the fit, record by record.
    pub before: Vec<Vec<Finding>>,
    /// Findings after the fit other than those on the residuals, record by record.
    pub after: Vec<Vec<Finding>>,
    /// Findings after the fit on all records together.
    pub after_all: Vec<Finding>,
    /// Residual of each record; empty if the residuals of single records are not tested.
    pub residuals: Vec<Residual>,
    /// Kind of prediction of the response to a measured force.
    pub prediction: Prediction,
    /// Ratio of residual power to noise power, if the noise is known.
    pub misfit: Option<Misfit>,
    /// Estimated noise spectra: one of each record, or one from the residual.
    pub noise: Vec<NoiseModel>,
    /// Noise of the forces of each record, if it is not part of the spectra in `noise`.
    pub force_noise: Vec<ForceNoise>,
    /// Sinusoids that were subtracted from open records.
    pub sinusoids: Vec<SinusoidRow>,
    /// Measured responses to draw; `None` if the responses that were fitted are drawn. For open
    /// records, they are the responses to the forces, without the transients; for segments, they
    /// are the averages before the bias of the window is subtracted.
    pub drawn: Option<FrequencyData>,
    /// Remarks on the fit.
    pub remarks: Vec<String>,
}

/// Result of a fit with nonlinear terms.
#[derive(Debug)]
pub struct WithTerms {
    /// The estimate.
    pub estimate: NonlinearEstimate,
    /// Evidence against a linear system in the first record, collected before the fit; `None` for
    /// open records.
    pub distortion: Option<Distortion>,
    /// Points of the restoring-force surface of the first record; `None` for open records.
    pub restoring: Option<RestoringForce>,
    /// Selection of terms; `None` without candidates.
    pub selection: Option<SelectionSummary>,
}

/// Ratio of the residual power to the noise power, near 1 if the model is right, and the source of
/// the noise.
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

/// Residual of a fit in the form that its tests use.
#[derive(Debug)]
pub enum Residual {
    /// Samples.
    Samples(SampleResidual),
    /// Lines of a spectrum, weighted by their noise.
    Lines(Box<SpectralResidual>),
}

impl Residual {
    /// Returns the residuals of the lines of several records.
    pub(super) fn from_lines(records: Vec<SpectralResidual>) -> Vec<Self> {
        records.into_iter().map(|residual| Self::Lines(Box::new(residual))).collect()
    }
}

/// Residual of a fit sample by sample.
#[derive(Debug)]
pub struct SampleResidual {
    /// Residual, samples × degrees of freedom.
    pub samples: Record,
    /// The fitted signal, used to distinguish rounding from noise.
    pub fitted: Record,
    /// Force, samples × degrees of freedom, in N.
    pub force: Record,
    /// Number of lags over which noise on the response correlates the residual.
    pub noise_span: usize,
}

impl SampleResidual {
    /// Returns the number of lags for the tests; 0 if there are too few samples.
    pub(crate) fn lags(&self) -> usize {
        LAGS.min(self.samples.len().saturating_sub(self.noise_span) / SAMPLES_PER_LAG)
    }
}

impl Fitted {
    /// Creates a fit with the fields that every fit has; the optional fields are empty.
    pub(super) fn new(
        domain: Domain,
        estimator: &'static str,
        prediction: Prediction,
        estimate: Estimate,
    ) -> Self {
        Self {
            domain,
            estimator,
            least_squares: false,
            estimate,
            nonlinear: None,
            disagreement: Disagreement::default(),
            equations: 0,
            frequency: None,
            scattered: None,
            coherence: None,
            before_all: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            after_all: Vec::new(),
            residuals: Vec::new(),
            prediction,
            misfit: None,
            noise: Vec::new(),
            force_noise: Vec::new(),
            sinusoids: Vec::new(),
            drawn: None,
            remarks: Vec::new(),
        }
    }

    /// Returns a remark if the fit has so few degrees of freedom that the standard errors are
    /// uncertain.
    pub(crate) fn few_equations(&self) -> Option<String> {
        let unknowns = self.estimate.unknowns();
        let of_one = unknowns.independent().div_ceil(unknowns.dof().max(1));
        let spare = self.equations.saturating_sub(of_one);
        // Relative standard deviation of the root mean square of `spare` values.
        let error = 1.0 / (2.0 * spare as f64).sqrt();
        (error > UNCERTAIN_ERROR).then(|| {
            let how_few = match spare {
                0 => "no equation remains to estimate the errors".to_owned(),
                _ => format!(
                    "the standard errors themselves are uncertain by {} %",
                    significant(100.0 * error, 2)
                ),
            };
            format!(
                "{} for {}: {how_few}, and even a wrong model may pass the checks; use a longer record",
                message::count(self.equations, "equation"),
                message::count(of_one, "unknown")
            )
        })
    }

    /// Increases the standard errors by the disagreement of model and data that the checks show.
    /// With nonlinear terms it adds only the effect of further terms, because the standard errors
    /// already follow from the residual.
    pub(super) fn count_disagreement(&mut self, checks: &[CheckRow]) -> Result<(), AnalysisError> {
        let unjudged = std::mem::take(&mut self.disagreement);
        let judged = unjudged.with_warnings_only(checks, self.estimate.degrees_of_freedom());
        match &mut self.nonlinear {
            Some(fitted) => {
                self.disagreement = judged.without_scale();
                fitted.estimate = self.disagreement.with_omitted(fitted.estimate.clone())?;
                self.estimate = fitted.estimate.linear().clone();
            }
            None => {
                self.estimate = judged.included_in(self.estimate.clone())?;
                self.disagreement = judged;
            }
        }
        Ok(())
    }

    /// Returns the remark on a fit of a linear system that determines modes but no parameter.
    pub(super) fn modes_alone(&self, modes: &[IdentifiedMode]) -> Option<String> {
        let is_linear = self.nonlinear.is_none();
        is_linear.then(|| determined::modes_alone(&self.estimate, modes)).flatten()
    }

    /// Returns the fitted system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined.
    pub fn model(&self) -> Result<Model, AnalysisError> {
        Ok(match &self.nonlinear {
            None => Model::Linear(self.estimate.system()?),
            Some(WithTerms { estimate, .. }) => {
                Model::Nonlinear { system: estimate.system()?, channels: estimate.channels() }
            }
        })
    }

    /// Returns the identified system with its nonlinear terms and its uncertainty; `None` for a
    /// linear system.
    ///
    /// # Errors
    /// As [`Fitted::model`].
    pub(super) fn nonlinear_part(&self) -> Result<Option<NonlinearPart>, AnalysisError> {
        let Some(WithTerms { estimate, .. }) = &self.nonlinear else { return Ok(None) };
        let (uncertain, channels) = (estimate.uncertain_system()?, estimate.channels());
        let largest_displacement = estimate.ranges().iter().map(|range| range[0]).reduce(f64::max);
        Ok(Some(NonlinearPart { uncertain, channels, largest_displacement }))
    }

    /// Returns the ratio of the RMS of the residual to the RMS of the right-hand side, for the
    /// equations of all degrees of freedom together.
    pub(crate) fn nrmse(&self) -> f64 {
        let residuals = self.estimate.residual_nrmse();
        (residuals.iter().map(|e| e * e).sum::<f64>() / residuals.len() as f64).sqrt()
    }

    /// Returns whether the fit minimises the residual of the response, weighted by the noise of the
    /// response, instead of the residual of the force.
    pub(crate) fn fits_response(&self) -> bool {
        let noise_stated = self.frequency.as_ref().is_some_and(|(_, data)| data.noise().is_some());
        !self.noise.is_empty() || (noise_stated && !self.least_squares)
    }

    /// Returns the ratio of two RMS values on the lines used: that of the measured minus the
    /// modelled response, and that of the measured response. Both are in the measured quantity or,
    /// if the fit was weighted, in units of the standard deviation of the noise.
    ///
    /// # Errors
    /// [`AnalysisError::Model`] if the model has no receptance at a line.
    pub(crate) fn unexplained_motion(
        &self,
        system: &SecondOrderSystem,
    ) -> Result<Option<f64>, AnalysisError> {
        if let Some(WithTerms { estimate, .. }) = &self.nonlinear {
            let parts = estimate.unexplained();
            let mean = parts.iter().map(|part| part * part).sum::<f64>() / parts.len() as f64;
            return Ok(Some(mean.sqrt()));
        }
        match &self.frequency {
            Some((_, data)) => unexplained_motion(data, system),
            None => Ok(None),
        }
    }
}

/// Returns the RMS of measured minus modelled response over the RMS of the measured response, at
/// the frequencies of the data, weighted by the noise if it is known; `None` without a response.
pub(super) fn unexplained_motion(
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Option<f64>, AnalysisError> {
    let (mut unexplained, mut all) = (0.0, 0.0);
    for (row, omega) in data.omega().iter().enumerate() {
        let measured = data.displacement().row(row).transpose();
        let modelled = system.receptance(*omega)? * data.force().row(row).transpose();
        // The responses are compared in the measured quantity: as displacements, the lines at low
        // frequencies would have too much weight.
        let quantity = data.measured().per_displacement(*omega).norm_sqr();
        for channel in 0..data.dof() {
            let weight = match data.noise() {
                Some(noise) => noise.covariance(row)[(channel, channel)].re.recip(),
                None => quantity,
            };
            if weight.is_finite() {
                unexplained += weight * (measured[channel] - modelled[channel]).norm_sqr();
                all += weight * measured[channel].norm_sqr();
            }
        }
    }
    Ok((all > 0.0).then(|| (unexplained / all).sqrt()))
}
