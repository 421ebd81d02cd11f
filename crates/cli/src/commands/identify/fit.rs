//! The estimators, and what the identified model leaves unexplained.

use clap::ValueEnum;
use mechid::estimate::frequency_domain::{
    FrequencyData, Lines, Motion, Pooling, RepeatedPeriods, equation_error, instrumental_variables,
    output_error,
};
use mechid::estimate::time_domain::{self, Discretisation, Extent, TimeDomain};
use mechid::estimate::{Estimate, Unknowns};
use mechid::model::{Response, SecondOrderSystem};
use mechid::signal::Record;

use super::measurement::Measurement;
use crate::error::CliError;

/// How the parameters are found from the spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Least squares on the equation of motion; biased by noise on the motion
    LeastSquares,
    /// Instrumental variables, one half of the periods against the other; not biased
    Instrumental,
    /// Maximum likelihood on the motion, weighted by the noise that the periods show; not biased,
    /// of least scatter
    MaximumLikelihood,
}

/// What leads from one sample to the next, in the time domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BetweenSamples {
    /// Euler's rule, the dissertation's; biased in proportion to the step
    Euler,
    /// The force is held, as a digital converter drives a shaker; then exact
    Held,
    /// The force is linear; then exact
    Linear,
}

/// An estimate and how it came about.
#[derive(Debug)]
pub struct Fitted {
    pub domain: &'static str,
    pub estimator: &'static str,
    pub estimate: Estimate,
    /// Real equations used, of each degree of freedom.
    pub equations: usize,
    /// The spectra, if it was done in the frequency domain.
    pub frequency: Option<(Lines, FrequencyData)>,
    pub remarks: Vec<String>,
}

/// Fits the spectra of the window on the lines given.
pub fn frequency_domain(
    measured: &Measurement,
    unknowns: &Unknowns,
    lines: Vec<usize>,
    method: Method,
) -> Result<Fitted, CliError> {
    let (motion, kind) = measured.motion();
    let lines = Lines::new(measured.force.sampling().with_len(measured.period)?, lines)?;
    let periods = RepeatedPeriods::new(&lines, &measured.force, motion, kind)?;
    let data = periods.mean()?;
    let mut remarks = Vec::new();
    if measured.motions() > 1 {
        remarks.push(format!("of the motions measured, the {kind} was used"));
    }
    let (estimator, estimate) = match method {
        Method::LeastSquares => (
            "least squares on the equation of motion, in the frequency domain",
            equation_error(&data, unknowns)?,
        ),
        Method::Instrumental => {
            let (first, second) = periods.halves()?;
            (
                "instrumental variables, half of the periods against the other",
                instrumental_variables(&first, &second, unknowns)?,
            )
        }
        Method::MaximumLikelihood => {
            let data = match periods.count() {
                1 => {
                    remarks.push(
                        "one period does not show its noise: it was taken as white on the motion, \
                         of the level the residual has"
                            .into(),
                    );
                    data.clone()
                }
                few @ 2..8 => {
                    remarks.push(format!("{few} periods are few: one noise level for all lines"));
                    periods.mean_with_noise(Pooling::AllLines)?
                }
                _ => periods.mean_with_noise(Pooling::PerLine)?,
            };
            let fit = output_error(&data, unknowns)?;
            if measured.periods > 1 {
                remarks.push(format!(
                    "the residual has {:.3} times the power that the noise of the periods explains",
                    fit.misfit_ratio
                ));
            }
            ("maximum likelihood, in the frequency domain", fit.estimate)
        }
    };
    Ok(Fitted {
        domain: "frequency",
        estimator,
        estimate,
        equations: 2 * data.len(),
        frequency: Some((lines, data)),
        remarks,
    })
}

/// Fits the samples of the window: the equation of motion itself where the acceleration is measured
/// and nothing else is asked for, otherwise what leads from one sample to the next.
pub fn time_domain(
    measured: &Measurement,
    unknowns: &Unknowns,
    between: Option<BetweenSamples>,
) -> Result<Fitted, CliError> {
    let (Some(x), Some(v)) = (&measured.displacement, &measured.velocity) else {
        return Err(CliError::TimeDomainMotions);
    };
    let force = &measured.force;
    let (estimator, estimate, equations) = match (between, &measured.acceleration) {
        (None, Some(a)) => {
            let response = Response::new(x.clone(), v.clone(), a.clone())?;
            let found = time_domain::equation_of_motion(&response, force, unknowns)?;
            ("least squares on the equation of motion, sample by sample", found, force.len())
        }
        (between, _) => {
            let between = between.unwrap_or(BetweenSamples::Linear);
            let method = TimeDomain::new(between.discretisation(), Extent::Open);
            let fit = method.fit(x, v, force, unknowns)?;
            (between.estimator(), fit.into_estimate(), force.len() - 1)
        }
    };
    let remarks = Vec::new();
    Ok(Fitted { domain: "time", estimator, estimate, equations, frequency: None, remarks })
}

impl BetweenSamples {
    /// What the time domain calls it.
    pub fn discretisation(self) -> Discretisation {
        match self {
            BetweenSamples::Euler => Discretisation::Euler,
            BetweenSamples::Held => Discretisation::ZeroOrderHold,
            BetweenSamples::Linear => Discretisation::FirstOrderHold,
        }
    }

    fn estimator(self) -> &'static str {
        match self {
            BetweenSamples::Euler => "least squares from sample to sample, Euler's rule",
            BetweenSamples::Held => {
                "least squares from sample to sample, the force held between them"
            }
            BetweenSamples::Linear => {
                "least squares from sample to sample, the force linear between them"
            }
        }
    }
}

impl Fitted {
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
    pub fn unexplained_motion(&self, system: &SecondOrderSystem) -> Result<Option<f64>, CliError> {
        let Some((_, data)) = &self.frequency else { return Ok(None) };
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
}

impl Measurement {
    /// The motion used in the frequency domain, and what it is.
    pub fn motion(&self) -> (&Record, Motion) {
        let candidates = [
            (&self.displacement, Motion::Displacement),
            (&self.velocity, Motion::Velocity),
            (&self.acceleration, Motion::Acceleration),
        ];
        let found =
            candidates.into_iter().find_map(|(record, kind)| Some((record.as_ref()?, kind)));
        found.expect("a measurement has a motion")
    }

    fn motions(&self) -> usize {
        [&self.displacement, &self.velocity, &self.acceleration].into_iter().flatten().count()
    }
}
