//! Identification of a machine from measured forces and responses.
//!
//! | File | What it does |
//! |---|---|
//! | `options` | settings, as values |
//! | `lines`, `left_out` | spectral lines to use and to leave out |
//! | `spectra`, `responses`, `samples` | the three kinds of fit: whole periods, averaged frequency responses, samples in time |
//! | `open_records` | lines of records that are no periods, with the loads of their ends |
//! | `tables`, `tabulated` | frequency responses that were measured elsewhere, and such tables as data |
//! | `nonlinear` | whole periods with nonlinear terms |
//! | `derivatives` | velocity and acceleration that were not measured |
//! | `prediction` | response of the identified system to a measured force |
//! | `checks` | checks before and after a fit, in order |
//! | `validation` | prediction of a record that was not fitted |
//! | `mass`, `structure` | what is known of M, C and K |
//! | `coherence` | coherence of the records that were fitted |
//! | `fitted` | a fit: the estimate, how it came about, its residual |
//! | `force_noise` | noise of the forces, stated or as the record shows it |
//! | `sinusoids` | sinusoids beside the response to the forces, in open records |
//! | `fitted_lines` | the lines of a fit one by one, with standard errors and residual |
//! | `unscaled` | equations of motion that the data fix up to factors only |
//! | `rows`, `summary` | the result: rows of its tables; numbers, checks, remarks |

mod added_decay;
pub mod checks;
mod coherence;
mod derivatives;
pub(crate) mod fitted;
mod fitted_lines;
mod force_noise;
pub mod left_out;
pub mod lines;
pub mod mass;
pub mod nonlinear;
mod open_records;
pub mod options;
pub mod prediction;
mod remarks;
mod response_settings;
mod responses;
pub mod rows;
mod samples;
pub mod selection;
mod sinusoids;
pub(crate) mod spectra;
pub mod structure;
pub mod summary;
pub mod tables;
pub(crate) mod tabulated;
mod unscaled;
pub mod validation;

use std::fmt;

use mechid_estimate::{Estimate, Unknowns};
use mechid_io::ParameterCovariance;
use mechid_model::SecondOrderSystem;
use mechid_nonlinear::NonlinearEstimate;
use mechid_signal::Extent;
use mechid_spectra::Pooling;
use serde::{Serialize, Serializer};

use self::checks::CheckRow;
pub use self::coherence::ResponseCoherence;
pub use self::fitted::{Fitted, Misfit, Residual, SampleResidual, WithTerms};
pub use self::fitted_lines::FittedLine;
pub use self::force_noise::{ForceNoise, ForceNoiseSource};
use self::left_out::LineRule;
pub use self::left_out::{Disturbance, LeftOut};
pub use self::lines::{Band, LineChoice};
pub use self::mass::KnownMass;
use self::open_records::{Excitation, NoiseRule};
pub use self::options::{
    Between, Derivatives, Fit, Identify, Method, Nonlinear, Refinement, ResponseFit, SampleFit,
};
use self::prediction::{Compared, Model, Prediction};
pub use self::response_settings::IdentifyResponses;
pub use self::sinusoids::SinusoidRow;
pub use self::structure::{Form, Structure};
use self::summary::IdentificationSummary;
pub use self::tables::{IdentifiedResponses, identify_responses};
pub use self::unscaled::Unscaled;
pub use self::validation::{Validation, ValidationWindow};
use crate::AnalysisError;
use crate::hits;
use crate::machine::Machine;
use crate::measurement::{Block, Channels, Hold, Measurement, Windowed};

/// Unexplained part of the response above which the result says so.
pub const CONSPICUOUS: f64 = 0.05;

/// Identifies the machine behind one or several records.
///
/// Several records are fitted together; they need the same columns, but not the same length.
///
/// # Errors
/// [`AnalysisError::NoRecord`]; [`AnalysisError::Unfit`] if the fit fails and the checks of its data
/// say why, otherwise that failure as it is; what the settings of `how` cannot be done with, such as
/// [`AnalysisError::TimeDomainMotions`]; and if a file cannot be read again.
pub fn identify(measurements: &[Measurement], how: &Identify) -> Result<Identified, AnalysisError> {
    let hold = how.hold();
    let records = measurements.iter().map(|measured| measured.hold(hold));
    let mut records: Vec<Windowed> = records.collect::<Result<_, _>>()?;
    let first = records.first().ok_or(AnalysisError::NoRecord)?;
    let dofs = first.held.force.channels();
    for record in &records {
        let got = record.held.force.channels();
        if got != dofs {
            let file = record.held.file.clone();
            return Err(AnalysisError::DegreesOfFreedom { file, got, dofs });
        }
    }
    let unknowns = how.structure.apply(how.mass.unknowns(dofs)?)?;
    let period_given = measurements.iter().any(|m| m.window_settings().period.is_some());
    let (mut hits, mut hit_noise, mut of_hits) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(rule) = &how.hits {
        how.check_hits(period_given)?;
        let cut = hits::cut(&records, rule)?;
        (records, hits, hit_noise, of_hits) = (cut.hits, cut.rows, cut.noise, cut.remarks);
    }
    let excitation = match &how.hits {
        Some(_) => Excitation::Hits(&hit_noise),
        None => Excitation::Lasting,
    };
    let fit = |unknowns: &Unknowns| how.fitted(&records, unknowns, period_given, excitation);
    let driven: Vec<usize> = records.iter().flat_map(|r| r.held.driven.iter().copied()).collect();
    let fitted = match how.finds_modes_alone() {
        true => Unscaled::or_fitted(&unknowns, &driven, fit),
        false => fit(&unknowns).map(|fitted| (fitted, None)),
    };
    let (fitted, unscaled) = fitted.map_err(|error| explained(error, &records))?;
    let mut summary = IdentificationSummary::new(&records, &fitted, unscaled, hits, how)?;
    summary.remarks.extend(of_hits);
    if how.hits.is_none() && how.nonlinear.is_none() && !period_given {
        summary.remarks.extend(hits::uncut(&records));
        if matches!(how.fit, Fit::Spectra { .. }) {
            summary.remarks.extend(records.iter().find_map(spectra::unsaid_period));
        }
    }
    Ok(Identified {
        measurements: measurements.to_vec(),
        records,
        validated: None,
        fitted,
        summary,
    })
}

/// An identified machine, and what it was identified from.
///
/// [`Display`](fmt::Display) gives the result as a person reads it, `serde` the same for programs.
#[derive(Debug)]
pub struct Identified {
    measurements: Vec<Measurement>,
    records: Vec<Windowed>,
    validated: Option<Block>,
    fitted: Fitted,
    summary: IdentificationSummary,
}

impl Identify {
    /// Returns how much of a record must be held in memory to fit it.
    pub(crate) fn hold(&self) -> Hold {
        match &self.fit {
            _ if self.hits.is_some() => Hold::Whole,
            Fit::Spectra { .. } if self.nonlinear.is_some() => Hold::Whole,
            Fit::Spectra { extent: Some(Extent::Open), .. }
            | Fit::Spectra { force_noise: Some(_), .. } => Hold::Whole,
            Fit::Spectra { .. } => Hold::Periods,
            Fit::Responses(how) => how.segments.hold(),
            Fit::Samples(how) => how.hold(),
        }
    }

    /// Returns whether modes are found where M, C and K have no scale: those of linear systems, from spectra
    /// and frequency responses.
    fn finds_modes_alone(&self) -> bool {
        self.nonlinear.is_none() && !matches!(self.fit, Fit::Samples(_))
    }

    /// Refuses what hits are not fitted with.
    fn check_hits(&self, period_given: bool) -> Result<(), AnalysisError> {
        let why = match &self.fit {
            _ if period_given => "hits have no `period`: leave one of them out",
            _ if self.nonlinear.is_some() => "nonlinear terms are fitted to whole periods",
            Fit::Responses(_) => "the hits themselves are fitted: leave `from_frf` out",
            _ => return Ok(()),
        };
        Err(AnalysisError::Setting { setting: "hits", why: why.into() })
    }

    fn fitted(
        &self,
        records: &[Windowed],
        unknowns: &Unknowns,
        period_given: bool,
        excitation: Excitation<'_>,
    ) -> Result<Fitted, AnalysisError> {
        let lines = LineRule { choice: &self.lines, without: &self.without };
        if let Some(how) = &self.nonlinear {
            let Fit::Spectra { method, noise, extent, force_noise } = &self.fit else {
                let why = "nonlinear terms are fitted to spectra of whole periods: leave `domain` time \
                           and `from_frf` out";
                return Err(AnalysisError::Setting { setting: "nonlinear", why: why.into() });
            };
            if *noise != Pooling::Automatic {
                let why = "fits with nonlinear terms have weights of their own: leave it out";
                return Err(AnalysisError::Setting { setting: "noise", why: why.into() });
            }
            if force_noise.is_some() {
                let why = "fits with nonlinear terms take the force as exact: leave it out";
                return Err(AnalysisError::Setting { setting: "force_noise", why: why.into() });
            }
            if *extent == Some(Extent::Open) {
                let why = "nonlinear terms are fitted to whole periods";
                return Err(AnalysisError::Setting { setting: "extent", why: why.into() });
            }
            return nonlinear::fit(records, unknowns, lines, *method, how);
        }
        match &self.fit {
            Fit::Spectra { method, noise, extent, force_noise } => {
                let likelihood = matches!(method, None | Some(Method::MaximumLikelihood));
                let wrong =
                    |setting, why: &str| Err(AnalysisError::Setting { setting, why: why.into() });
                if *noise != Pooling::Automatic && !likelihood {
                    return wrong("noise", "it weights `method` maximum-likelihood alone");
                }
                if *noise == Pooling::PerLine && *extent == Some(Extent::Open) {
                    return wrong(
                        "noise",
                        "per-line is for periods: an open record has no scatter at a line",
                    );
                }
                // Weights that were asked for are used.
                let method = match noise {
                    Pooling::Automatic => *method,
                    _ => Some(Method::MaximumLikelihood),
                };
                let rule = NoiseRule { response: *noise, force: force_noise.as_deref() };
                let open = || open_records::fit(records, unknowns, lines, rule, excitation);
                let periods = || spectra::fit(records, unknowns, lines, method, *noise);
                // A hit dies out in its window or not, and periods are not asked about the noise of their force.
                let is_open = self.hits.is_some() || (force_noise.is_some() && !period_given);
                let extent = extent.or(is_open.then_some(Extent::Open));
                match extent {
                    Some(Extent::Open) if period_given => {
                        wrong("extent", "an open record has no `period`: leave one of them out")
                    }
                    Some(Extent::Open) if !likelihood && force_noise.is_some() => {
                        wrong("force_noise", "`method` maximum-likelihood alone allows for it")
                    }
                    Some(Extent::Open) if !likelihood => {
                        wrong("extent", "the ends of open records take `method` maximum-likelihood")
                    }
                    Some(Extent::Open) => Ok(open()?.fitted),
                    _ if force_noise.is_some() => wrong(
                        "force_noise",
                        "it is for open records: periods show the noise of their force by their scatter",
                    ),
                    None if likelihood
                        && !period_given
                        && open_records::suit(records, unknowns) =>
                    {
                        match open() {
                            Ok(open) if open.ends_show => Ok(open.fitted),
                            _ => periods(),
                        }
                    }
                    _ => periods(),
                }
            }
            Fit::Responses(how) => responses::fit(records, unknowns, lines, how, period_given),
            Fit::Samples(_) if unknowns.is_related() => {
                let why =
                    "symmetric matrices and proportional damping belong to `domain` frequency";
                Err(AnalysisError::Setting { setting: "structure", why: why.into() })
            }
            Fit::Samples(how) => how.fit(records, unknowns),
        }
    }
}

impl Identified {
    /// Returns the numbers, checks and remarks.
    pub fn summary(&self) -> &IdentificationSummary {
        &self.summary
    }

    /// Returns the estimate of M, C and K with its covariance; with nonlinear terms, of the linear part.
    /// They are those of one of the systems with the same modes where equations have no scale
    /// ([`IdentificationSummary::unscaled`]).
    pub fn estimate(&self) -> &Estimate {
        &self.fitted.estimate
    }

    /// Returns the estimate with nonlinear terms; `None` for a linear system.
    pub fn nonlinear(&self) -> Option<&NonlinearEstimate> {
        self.fitted.nonlinear.as_ref().map(|fitted| &fitted.estimate)
    }

    /// Returns the identified system with its nonlinear terms, if it has any.
    ///
    /// # Errors
    /// As [`Identified::system`].
    pub fn model(&self) -> Result<Model, AnalysisError> {
        self.check_scale()?;
        self.fitted.model()
    }

    /// Returns the identified system; with nonlinear terms, its linear part.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined, [`AnalysisError::Unscaled`] if
    /// they give its modes alone.
    pub fn system(&self) -> Result<SecondOrderSystem, AnalysisError> {
        self.check_scale()?;
        Ok(self.fitted.estimate.system()?)
    }

    /// Returns the covariance of the parameters that were estimated, whatever their number; with nonlinear
    /// terms, of theirs, too.
    pub fn covariance(&self) -> ParameterCovariance {
        summary::covariance(&self.fitted, self.summary.unscaled.as_ref())
    }

    fn check_scale(&self) -> Result<(), AnalysisError> {
        Unscaled::check(self.summary.unscaled.as_ref())
    }

    /// Returns the identified system with the covariance of its parameters, for the reconstruction of
    /// a force.
    ///
    /// # Errors
    /// As [`Identified::system`].
    pub fn machine(&self) -> Result<Machine, AnalysisError> {
        self.check_scale()?;
        Ok(Machine {
            nonlinear: self.fitted.nonlinear_part()?,
            names: self.names().clone(),
            ..Machine::of_estimate(&self.fitted.estimate)?
        })
    }

    /// Returns every check, those before the fit first.
    pub fn checks(&self) -> &[CheckRow] {
        &self.summary.checks
    }

    /// Returns what in the numbers themselves speaks against them, a sentence each.
    pub fn doubts(&self) -> Vec<String> {
        self.summary.doubts()
    }

    /// Returns the records that were fitted.
    pub fn measurements(&self) -> &[Measurement] {
        &self.measurements
    }

    /// Predicts a record that was not fitted, and adds the result to [`Identified::summary`].
    ///
    /// The window of `other` is predicted; a steady state over whole periods, anything else from the
    /// start that fits it best.
    ///
    /// # Errors
    /// [`AnalysisError::DegreesOfFreedom`] if the record has another number of them,
    /// [`AnalysisError::Diverges`] if the identified system is unstable, [`AnalysisError::Unscaled`] if a
    /// force acts there to which the response is not known.
    pub fn add_validation(&mut self, other: &Measurement) -> Result<(), AnalysisError> {
        let (validation, held) = self.predict(other)?;
        if held.file != self.summary.file {
            self.summary.remarks.extend(held.unit_notes());
        }
        self.summary.validation = Some(validation);
        self.validated = Some(held);
        Ok(())
    }

    /// Adds every line of the fit to [`Identified::summary`]: force, measured and fitted response with their
    /// standard errors, and the residual.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] of a fit in the time domain or with nonlinear terms.
    pub fn add_fitted_lines(&mut self) -> Result<(), AnalysisError> {
        let refused =
            |why: &str| Err(AnalysisError::Setting { setting: "fitted_lines", why: why.into() });
        let Some((_, data)) = &self.fitted.frequency else {
            return refused("a fit in the time domain has none");
        };
        if self.fitted.nonlinear.is_some() {
            return refused(
                "the response of a system with nonlinear terms is no matter of single lines",
            );
        }
        let data = self.fitted.scattered.as_ref().unwrap_or(data);
        self.summary.fitted_lines = Some(FittedLine::all(data, &self.fitted.estimate)?);
        Ok(())
    }

    /// Predicts a record that was not fitted: returns how much of each channel is predicted, in per
    /// cent.
    ///
    /// # Errors
    /// As [`Identified::add_validation`].
    pub fn validate(&self, other: &Measurement) -> Result<Validation, AnalysisError> {
        Ok(self.predict(other)?.0)
    }

    fn predict(&self, other: &Measurement) -> Result<(Validation, Block), AnalysisError> {
        let prediction = self.fitted.prediction;
        let record = other.hold(validation::hold(self.summary.analysis.hold(), prediction))?;
        let (got, dofs) = (record.held.force.channels(), self.fitted.estimate.dof());
        if got != dofs {
            let file = record.held.file.clone();
            return Err(AnalysisError::DegreesOfFreedom { file, got, dofs });
        }
        if let Some(unscaled) = &self.summary.unscaled {
            unscaled.check_forces(&record.held.driven)?;
        }
        let validation = Validation::of(&record, &self.fitted.model()?, prediction)?;
        Ok((validation, record.into_held()))
    }

    /// Returns the window of a record to predict, in keeping with how the machine was identified:
    /// whole periods of a steady state as of the record fitted, otherwise any samples.
    ///
    /// # Errors
    /// [`AnalysisError::ValidationPeriod`] if the samples are less than a period of a steady state,
    /// [`AnalysisError::Window`] if the record does not have them.
    pub fn validation_window(
        &self,
        other: Measurement,
        samples: &ValidationWindow,
    ) -> Result<Measurement, AnalysisError> {
        let period = self.measurements[0].window_settings().period;
        other.window(samples.window(period, self.fitted.prediction)?)
    }

    pub(crate) fn records(&self) -> &[Windowed] {
        &self.records
    }

    pub(crate) fn validated(&self) -> Option<&Block> {
        self.validated.as_ref()
    }

    /// Returns how the fit was done, and what it leaves.
    pub fn fitted(&self) -> &Fitted {
        &self.fitted
    }

    /// Returns whether the records are the hits of a hammer test.
    pub(crate) fn is_hammer_test(&self) -> bool {
        !self.summary.hits.is_empty()
    }

    /// Returns the names of the channels, without units.
    pub fn names(&self) -> &Channels {
        &self.summary.channels
    }

    /// Returns each kind of response of the first record, measured and predicted.
    ///
    /// # Errors
    /// [`AnalysisError::Diverges`] if the identified system is unstable.
    pub fn compared(&self) -> Result<Vec<Compared>, AnalysisError> {
        self.fitted.prediction.predict(&self.fitted.model()?, &self.records[0].held)
    }

    /// Returns how the response of the identified system to a record is predicted.
    pub fn prediction(&self) -> Prediction {
        self.fitted.prediction
    }

    /// Returns the spectra that were fitted; `None` for a fit in the time domain.
    pub fn spectra(&self) -> Option<&mechid_spectra::FrequencyData> {
        self.fitted.frequency.as_ref().map(|(_, data)| data)
    }

    /// Returns the spectra to draw: of open records the responses to the forces alone, of segments their averages as
    /// measured, otherwise those fitted; `None` for a fit in the time domain.
    pub fn drawn_spectra(&self) -> Option<&mechid_spectra::FrequencyData> {
        self.fitted.drawn.as_ref().or_else(|| self.spectra())
    }
}

impl fmt::Display for Identified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for Identified {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

/// Adds what the checks of the channels say to the failure of a fit.
fn explained(error: AnalysisError, records: &[Windowed]) -> AnalysisError {
    let AnalysisError::Estimate(error) = error else { return error };
    let seen = records.iter().flat_map(|record| {
        let findings = checks::of_channels(&record.held).unwrap_or_default();
        findings.into_iter().map(|finding| checks::sentence(&finding, &record.held.names))
    });
    let reasons: Vec<String> = seen.collect();
    match reasons.is_empty() {
        true => AnalysisError::Estimate(error),
        false => AnalysisError::Unfit { error, reasons: reasons.join("; ") },
    }
}
