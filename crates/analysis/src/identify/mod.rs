//! Identification of a machine from measured forces and responses.
//!
//! | File | What it does |
//! |---|---|
//! | `options`, `keywords` | settings as values; as the flat keywords of the program and of Python |
//! | `lines`, `left_out` | spectral lines to use and to leave out |
//! | `spectra`, `responses`, `samples` | the three kinds of fit: whole periods, averaged frequency responses, samples in time |
//! | `open_records` | open records (windows that are not whole periods), with their transients |
//! | `tables`, `tabulated`, `table_fit` | tables of frequency responses that were measured elsewhere, their conversion to data, and their fit with its checks |
//! | `nonlinear`, `open_terms` | whole periods and open records with nonlinear terms |
//! | `further_terms` | nonlinear terms that a fit lacks |
//! | `derivatives` | velocity and acceleration that were not measured |
//! | `prediction` | response of the identified system to a measured force |
//! | `counts` | equations and memory that a fit needs, before any work |
//! | `checks` | checks before and after a fit, in order |
//! | `validation` | prediction of a record that was not fitted |
//! | `mass`, `structure` | what is known of M, C and K |
//! | `coherence` | coherence of the records that were fitted |
//! | `fitted` | a fit: the estimate, its data and settings, its residual |
//! | `compared`, `disagreement` | comparison with parts and larger models; standard errors |
//! | `acquisition` | force between samples and AC coupled channels of open records |
//! | `force_noise` | noise of the forces, stated or estimated from the record |
//! | `sinusoids` | sinusoids in open records that are not responses to the forces |
//! | `fitted_lines` | the lines of a fit one by one, with standard errors and residual |
//! | `unscaled` | equations of motion that the data determine only up to factors |
//! | `rows`, `summary` | the result: rows of its tables; numbers, checks, remarks |

pub mod acquisition;
pub(crate) mod added_decay;
pub mod checks;
mod coherence;
mod compared;
pub(crate) mod counts;
mod derivatives;
mod determined;
mod disagreement;
pub(crate) mod fitted;
mod fitted_lines;
mod force_noise;
mod further_terms;
mod keywords;
pub mod left_out;
pub mod lines;
pub mod mass;
pub mod nonlinear;
mod open_records;
mod open_terms;
pub mod options;
mod other_models;
pub mod prediction;
mod quantity;
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
pub(crate) mod table_fit;
pub mod tables;
pub(crate) mod tabulated;
pub(crate) mod thinned;
mod unscaled;
pub mod validation;

use std::fmt;

use mechid_checks::{Finding, Subject};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_io::ParameterCovariance;
use mechid_model::SecondOrderSystem;
use mechid_nonlinear::NonlinearEstimate;
use mechid_numerics::NumericsError;
use mechid_spectra::Pooling;
use serde::{Serialize, Serializer};

pub use self::acquisition::{AcCoupling, Acquisition};
use self::checks::CheckRow;
pub use self::coherence::ResponseCoherence;
pub use self::fitted::{Fitted, Misfit, Residual, SampleResidual, WithTerms};
pub use self::fitted_lines::FittedLine;
pub use self::force_noise::{ForceNoise, ForceNoiseSource};
pub use self::keywords::{Constant, Domain, Keywords};
pub use self::left_out::{Disturbance, LeftOut};
pub use self::lines::{Band, LineChoice};
pub use self::mass::KnownMass;
use self::open_records::Excitation;
pub use self::options::{
    Between, Derivatives, HitFit, Identify, Method, Nonlinear, OpenFit, OpenNoise, PeriodEstimator,
    PeriodFit, Refinement, SampleFit, SegmentFit, Source, SpectralFit, SpectralLines,
    TermEstimator, TermFit,
};
use self::prediction::{Compared, Model, Prediction};
pub use self::response_settings::IdentifyResponses;
pub use self::sinusoids::SinusoidRow;
pub use self::structure::{Form, Structure};
use self::summary::IdentificationSummary;
pub use self::tables::{IdentifiedResponses, identify_responses};
pub use self::unscaled::Unscaled;
pub use self::validation::{Validation, ValidationWindow};
use crate::hits::{self, HitNoise, Windows};
use crate::machine::Machine;
use crate::measurement::{Block, Channels, Hold, Measurement, Windowed, check_distinct};
use crate::modes::resonances;
use crate::{AnalysisError, time_limit};
pub use mechid_nonlinear::RestoringForce;

/// Maximum unexplained part of the response without a remark, a ratio of RMS values.
pub const CONSPICUOUS: f64 = 0.05;

/// Identifies the machine behind one or several records.
///
/// Several records are fitted together; they need the same columns, but not the same length.
///
/// # Errors
/// [`AnalysisError::NoRecord`]; [`AnalysisError::Unfit`] if the fit fails and the checks of its
/// data explain why; the error of the fit if they do not; errors of the settings, such as
/// [`AnalysisError::TimeDomainMotions`]; and [`AnalysisError::Io`] if a file cannot be read again.
pub fn identify(measurements: &[Measurement], how: &Identify) -> Result<Identified, AnalysisError> {
    let memory = measurements.iter().map(Measurement::memory).sum();
    time_limit::bounded(memory, || identify_records(measurements, how))
}

fn identify_records(
    measurements: &[Measurement],
    how: &Identify,
) -> Result<Identified, AnalysisError> {
    check_distinct(measurements)?;
    let hold = how.hold();
    let records = measurements.iter().map(|measured| measured.hold(hold));
    let mut records: Vec<Windowed> = records.collect::<Result<_, _>>()?;
    let dofs = degrees_of_freedom(&records)?;
    let unknowns = how.structure.apply(how.mass.unknowns(dofs)?)?;
    let period_given = measurements.iter().any(|m| m.window_settings().period.is_some());
    let (mut hits, mut hit_noise, mut of_hits) = (Vec::new(), Vec::new(), Vec::new());
    how.check_open(period_given)?;
    if let Source::Hits(HitFit { rule, .. }) = &how.source {
        let cut = hits::cut(&records, rule, Windows::Separate)?;
        (records, hits, hit_noise, of_hits) = (cut.hits, cut.rows, cut.noise, cut.remarks);
    }
    counts::check(how, &records, &unknowns, period_given)?;
    let fit = |unknowns: &Unknowns| how.fitted(&records, unknowns, period_given, &hit_noise);
    let driven: Vec<usize> = records.iter().flat_map(|r| r.held.driven.iter().copied()).collect();
    let fitted = if how.finds_modes_alone() {
        Unscaled::or_fitted(&unknowns, &driven, fit)
    } else {
        fit(&unknowns).map(|fitted| (fitted, None))
    };
    let is_linear = !matches!(how.source, Source::Terms(_));
    let (mut fitted, unscaled) = fitted.map_err(|error| {
        let surplus = if is_linear { resonances::surplus(measurements) } else { None };
        with_surplus(with_few_lines(explained(error, &records), &records, how), surplus)
    })?;
    let mut summary = IdentificationSummary::new(&records, &mut fitted, unscaled, hits, how)?;
    summary.remarks.extend(of_hits);
    let causes = [Subject::Delay, Subject::Linearity, Subject::Alternative];
    let is_named = |check: &CheckRow| check.is_conspicuous() && causes.contains(&check.subject);
    let is_unexplained = summary.fit.unexplained_motion > Some(CONSPICUOUS);
    // The search for modes takes seconds and is omitted if a check has named the cause.
    if is_linear && is_unexplained && !summary.checks.iter().any(is_named) {
        summary.remarks.extend(resonances::surplus(measurements));
    }
    if !period_given && is_linear && !matches!(how.source, Source::Hits(_)) {
        summary.remarks.extend(hits::uncut(&records));
        if !matches!(how.source, Source::Segments(_) | Source::Samples(_)) {
            summary.remarks.extend(records.iter().find_map(spectra::unstated_period));
        }
    }
    summary.checks.extend(time_limit::check());
    Ok(Identified {
        measurements: measurements.to_vec(),
        records,
        validated: None,
        fitted,
        summary,
    })
}

/// Returns the number of degrees of freedom, which all records must have in common.
fn degrees_of_freedom(records: &[Windowed]) -> Result<usize, AnalysisError> {
    let dofs = records.first().ok_or(AnalysisError::NoRecord)?.held.force.channels();
    for record in records {
        let got = record.held.force.channels();
        if got != dofs {
            let file = record.held.file.clone();
            return Err(AnalysisError::DegreesOfFreedom { file, got, dofs });
        }
    }
    Ok(dofs)
}

/// Returns the failure of a fit. If `surplus` reports more modes in the data than responses, it is
/// added as a reason.
fn with_surplus(failure: AnalysisError, surplus: Option<String>) -> AnalysisError {
    match (failure, surplus) {
        (AnalysisError::Unfit { error, reasons }, Some(surplus)) => {
            AnalysisError::Unfit { error, reasons: format!("{reasons}; {surplus}") }
        }
        (AnalysisError::Estimate(error), Some(reasons)) => AnalysisError::Unfit { error, reasons },
        (failure, _) => failure,
    }
}

/// Returns the failure of a fit with too few equations, with the number of excited lines as a
/// reason.
fn with_few_lines(failure: AnalysisError, records: &[Windowed], how: &Identify) -> AnalysisError {
    let (error, reasons) = match failure {
        AnalysisError::Estimate(error) => (error, None),
        AnalysisError::Unfit { error, reasons } => (error, Some(reasons)),
        other => return other,
    };
    let is_short = matches!(error, EstimateError::Numerics(NumericsError::TooFewRows { .. }));
    let few = how
        .source
        .lines()
        .filter(|_| is_short)
        .and_then(|lines| lines::few(records, &lines.choice));
    match (reasons, few) {
        (None, None) => AnalysisError::Estimate(error),
        (Some(one), None) | (None, Some(one)) => AnalysisError::Unfit { error, reasons: one },
        (Some(reasons), Some(few)) => {
            AnalysisError::Unfit { error, reasons: format!("{reasons}; {few}") }
        }
    }
}

/// An identified machine with its records.
///
/// [`Display`](fmt::Display) writes the result for people, `serde` for programs.
#[derive(Debug)]
pub struct Identified {
    measurements: Vec<Measurement>,
    records: Vec<Windowed>,
    validated: Option<Block>,
    fitted: Fitted,
    summary: IdentificationSummary,
}

impl Identify {
    /// Returns the part of a record that must be in memory for the fit.
    pub(crate) fn hold(&self) -> Hold {
        match &self.source {
            Source::Spectra(_) | Source::Periods(_) => Hold::Periods,
            Source::Open(_) | Source::Hits(_) | Source::Terms(_) => Hold::Whole,
            Source::Segments(how) => how.segments.hold(),
            Source::Samples(how) => how.hold(),
        }
    }

    /// Returns whether modes can be identified without the scale of M, C and K: for linear systems,
    /// from spectra and frequency responses.
    fn finds_modes_alone(&self) -> bool {
        !matches!(self.source, Source::Terms(_) | Source::Samples(_))
    }

    /// Returns an error if open records or hits have a period, or if the noise of each line is
    /// requested: an open record has only one value on each line, and one value does not show the
    /// noise.
    fn check_open(&self, period_given: bool) -> Result<(), AnalysisError> {
        let (noise, setting, of_period) = match &self.source {
            Source::Hits(how) => {
                (&how.noise, "hits", "hits have no period: leave `hits` or `period` out")
            }
            Source::Open(how) if how.noise.force.is_some() => (
                &how.noise,
                "force_noise",
                "available only for open records: for whole periods, the scatter of the force shows its noise",
            ),
            Source::Open(how) => (
                &how.noise,
                "extent",
                "an open record has no period: leave `extent` or `period` out",
            ),
            _ => return Ok(()),
        };
        let (setting, why) = match (period_given, noise.response) {
            (true, _) => (setting, of_period),
            (false, Pooling::PerLine) => (
                "noise",
                "per-line is for whole periods: an open record has only one value at each line, so its scatter is not known",
            ),
            (false, _) => return Ok(()),
        };
        Err(AnalysisError::Setting { setting, why: why.into() })
    }

    fn fitted(
        &self,
        records: &[Windowed],
        unknowns: &Unknowns,
        period_given: bool,
        hit_noise: &[HitNoise],
    ) -> Result<Fitted, AnalysisError> {
        let open = |noise: &OpenNoise, lines: &SpectralLines, acquisition, excitation| {
            let how = open_records::How { rule: lines.rule(), noise, acquisition, excitation };
            open_records::fit(records, unknowns, how)
        };
        match &self.source {
            Source::Spectra(how) => spectral(records, unknowns, how, period_given),
            Source::Periods(PeriodFit { estimator, lines }) => {
                spectra::fit(records, unknowns, lines.rule(), *estimator)
            }
            Source::Open(OpenFit { noise, lines, acquisition }) => {
                Ok(open(noise, lines, acquisition, Excitation::Lasting)?.fitted)
            }
            Source::Hits(HitFit { noise, lines, acquisition, .. }) => {
                Ok(open(noise, lines, acquisition, Excitation::Hits(hit_noise))?.fitted)
            }
            Source::Terms(how) => nonlinear::fit(records, unknowns, how, period_given),
            Source::Segments(how) => responses::fit(records, unknowns, how, period_given),
            Source::Samples(_) if unknowns.is_related() => {
                let why = "symmetric matrices and proportional damping are available only with `domain` frequency";
                Err(AnalysisError::Setting { setting: "structure", why: why.into() })
            }
            Source::Samples(how) => how.fit(records, unknowns),
        }
    }
}

/// Fits the spectra of windows as whole periods or as open records. If the windows are not periods
/// and are too long to be fitted as open records by default, it fits averages over segments
/// instead.
fn spectral(
    records: &[Windowed],
    unknowns: &Unknowns,
    SpectralFit { likelihood, lines }: &SpectralFit,
    period_given: bool,
) -> Result<Fitted, AnalysisError> {
    let is_short = open_records::suit(records, unknowns);
    let mut unfit = None;
    if !period_given && is_short {
        let noise = OpenNoise { response: likelihood.unwrap_or_default(), force: None };
        let how = open_records::How {
            rule: lines.rule(),
            noise: &noise,
            acquisition: &Acquisition::default(),
            excitation: Excitation::Lasting,
        };
        match open_records::fit(records, unknowns, how) {
            Ok(open) if open.decides => return Ok(open.fitted),
            Err(error @ AnalysisError::Unfit { .. }) => unfit = Some(error),
            _ => {}
        }
    }
    let is_default = !period_given && likelihood.is_none();
    if is_default && !is_short && responses::suit(records, lines)? {
        let segments = SegmentFit { lines: lines.clone(), ..SegmentFit::default() };
        let mut fitted = responses::fit(records, unknowns, &segments, false)?;
        fitted.remarks.push(responses::UNTRIED.into());
        return Ok(fitted);
    }
    let estimator = likelihood.map(PeriodEstimator::MaximumLikelihood);
    let fitted = spectra::fit(records, unknowns, lines.rule(), estimator);
    // The failed fit as open records may have shown a delay or another quantity. The failure is
    // returned if the fit of whole periods does not report a delay: its quantity may be wrong,
    // because it has no transients.
    let is_delay = |finding: &Finding| finding.subject() == Subject::Delay;
    let names_delay = |fitted: &Fitted| fitted.after.iter().flatten().any(is_delay);
    match unfit {
        Some(error) if !fitted.as_ref().is_ok_and(names_delay) => Err(error),
        _ => fitted,
    }
}

impl Identified {
    /// Returns the summary of the result: numbers, checks and remarks.
    pub fn summary(&self) -> &IdentificationSummary {
        &self.summary
    }

    /// Returns the estimate of M, C and K with its covariance; for a fit with nonlinear terms, the
    /// estimate of the linear part. If the equations have no scale, it is the estimate of one of
    /// the systems with the same modes ([`IdentificationSummary::unscaled`]).
    pub fn estimate(&self) -> &Estimate {
        &self.fitted.estimate
    }

    /// Returns the estimate with nonlinear terms; `None` for a linear system.
    pub fn nonlinear(&self) -> Option<&NonlinearEstimate> {
        self.fitted.nonlinear.as_ref().map(|fitted| &fitted.estimate)
    }

    /// Returns the identified system; if it has nonlinear terms, they are included.
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
    /// [`AnalysisError::Estimate`] if the data do not determine a parameter,
    /// [`AnalysisError::Unscaled`] if the data determine only the modes.
    pub fn system(&self) -> Result<SecondOrderSystem, AnalysisError> {
        self.check_scale()?;
        Ok(self.fitted.estimate.system()?)
    }

    /// Returns the covariance of the estimated parameters, including those of nonlinear terms. The
    /// summary omits it if there are many parameters; this function always returns it.
    pub fn covariance(&self) -> ParameterCovariance {
        summary::covariance(&self.fitted, self.summary.unscaled.as_ref())
    }

    fn check_scale(&self) -> Result<(), AnalysisError> {
        Unscaled::check(self.summary.unscaled.as_ref())
    }

    /// Returns the identified system with the covariance of its parameters, for the reconstruction
    /// of a force.
    ///
    /// # Errors
    /// As [`Identified::system`].
    pub fn machine(&self) -> Result<Machine, AnalysisError> {
        self.check_scale()?;
        Ok(Machine {
            nonlinear: self.fitted.nonlinear_part()?,
            names: self.names().clone(),
            ..Machine::from_estimate(&self.fitted.estimate)?
        })
    }

    /// Returns every check, those before the fit first.
    pub fn checks(&self) -> &[CheckRow] {
        &self.summary.checks
    }

    /// Returns warnings that follow from the identified parameters and the residual, one sentence
    /// each.
    pub fn doubts(&self) -> Vec<String> {
        self.summary.doubts()
    }

    /// Returns the records that were fitted.
    pub fn measurements(&self) -> &[Measurement] {
        &self.measurements
    }

    /// Predicts a record that was not fitted, and adds the result to [`Identified::summary`].
    ///
    /// The prediction covers the window of `other`. A steady state is predicted over whole periods;
    /// any other response is predicted from the initial state that fits this response best.
    ///
    /// # Errors
    /// [`AnalysisError::DegreesOfFreedom`] if the record has another number of degrees of
    /// freedom, [`AnalysisError::Diverges`] if the identified system is unstable,
    /// [`AnalysisError::Unscaled`] if the response to one of the forces is not known.
    pub fn add_validation(&mut self, other: &Measurement) -> Result<(), AnalysisError> {
        let (validation, held) = self.predict(other)?;
        if held.file != self.summary.file {
            self.summary.remarks.extend(held.unit_notes());
        }
        self.summary.validation = Some(validation);
        self.validated = Some(held);
        Ok(())
    }

    /// Adds every line of the fit to [`Identified::summary`]: force, measured and fitted response
    /// with their standard errors, and the residual.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for a fit in the time domain or with nonlinear terms.
    pub fn add_fitted_lines(&mut self) -> Result<(), AnalysisError> {
        let refused =
            |why: &str| Err(AnalysisError::Setting { setting: "fitted_lines", why: why.into() });
        let Some((_, data)) = &self.fitted.frequency else {
            return refused("a fit in the time domain has no lines");
        };
        if self.fitted.nonlinear.is_some() {
            return refused(
                "the response of a system with nonlinear terms cannot be given line by line",
            );
        }
        let data = self.fitted.scattered.as_ref().unwrap_or(data);
        self.summary.fitted_lines = Some(FittedLine::all(data, &self.fitted.estimate)?);
        Ok(())
    }

    /// Predicts a record that was not fitted, and returns the predicted part of each channel, in
    /// per cent.
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
        let validation = Validation::new(&record, &self.fitted.model()?, prediction)?;
        Ok((validation, record.into_held()))
    }

    /// Returns the window of a record to predict: whole periods if the fitted record was a steady
    /// state, otherwise any samples.
    ///
    /// # Errors
    /// [`AnalysisError::ValidationPeriod`] if a steady state has fewer samples than a period,
    /// [`AnalysisError::Window`] if the record does not have these samples.
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

    /// Returns the fit with its data, findings and residual.
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

    /// Returns the kind of prediction of the response to a measured force.
    pub fn prediction(&self) -> Prediction {
        self.fitted.prediction
    }

    /// Returns the spectra that were fitted; `None` for a fit in the time domain.
    pub fn spectra(&self) -> Option<&mechid_spectra::FrequencyData> {
        self.fitted.frequency.as_ref().map(|(_, data)| data)
    }

    /// Returns the spectra to draw: for open records the responses to the forces without the
    /// transients, for segments the averages as measured, otherwise the fitted spectra; `None` for
    /// a fit in the time domain.
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

/// Adds the findings on the channels to the failure of a fit.
fn explained(error: AnalysisError, records: &[Windowed]) -> AnalysisError {
    let AnalysisError::Estimate(error) = error else { return error };
    let sentences = records.iter().flat_map(|record| {
        let findings = checks::channel_findings(&record.held).unwrap_or_default();
        findings.into_iter().map(|finding| checks::sentence(&finding, &record.held.names))
    });
    let reasons: Vec<String> = sentences.collect();
    if reasons.is_empty() {
        AnalysisError::Estimate(error)
    } else {
        AnalysisError::Unfit { error, reasons: reasons.join("; ") }
    }
}
