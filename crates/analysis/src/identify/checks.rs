//! Checks before and after the fit, record by record.

use mechid_checks::UnmeasuredForce;
use mechid_checks::{
    Channel, Finding, Quantity, Subject, Verdict, adjust_p_values, after_fit, clipped_channels,
    constant_channels, dropped_channels, gain_symmetry, instability, kinematics, mass_symmetry,
    negative_mass, power, quantised_channels, repeated_channels, spiked_channels,
    unrelated_response,
};
use mechid_estimate::IdentifiedMode;
use mechid_model::ResponseQuantity;
use mechid_spectra::NoiseModel;
use serde::Serialize;

use super::fitted::{Fitted, Residual, SampleResidual};
use crate::AnalysisError;
use crate::measurement::{Block, Channels};

/// A finding and its record.
#[derive(Debug, Serialize)]
pub struct CheckRow {
    /// Stage of the analysis to which the check belongs: before or after the fit.
    pub when: When,
    /// Name of the record; `None` with one record.
    pub record: Option<String>,
    /// Subject of the check.
    #[serde(serialize_with = "as_text")]
    pub subject: Subject,
    /// Good, doubtful or bad.
    pub verdict: Verdict,
    /// Number that decides the verdict, a ratio or a probability; `None` if it is infinite.
    pub value: Option<f64>,
    /// The finding, in a sentence.
    pub text: String,
    /// All numbers of the finding.
    pub finding: Finding,
}

/// Stage of a check: before or after the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// Check of the data, before the fit.
    Before,
    /// Check of the residual, after the fit.
    After,
}

/// Circumstances of a fit that decide which checks apply.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scope {
    /// `false` if the scale of some equations of motion is unknown.
    pub scaled: bool,
    /// `true` for hits of a hammer: a hit on a moving machine may extract power.
    pub hits: bool,
    /// Unexplained part of the response; `None` if it is unknown.
    pub unexplained: Option<f64>,
}

/// Returns all findings before and after a fit, with one error rate for the statistical tests among
/// them; `modes` are the modes of the estimate.
pub(crate) fn rows(
    fitted: &Fitted,
    modes: &[IdentifiedMode],
    records: &[&Block],
    Scope { scaled, hits, unexplained }: Scope,
) -> Result<Vec<CheckRow>, AnalysisError> {
    let mut rows: Vec<(When, Option<usize>, Finding)> = Vec::new();
    let mut add = |when, at: Option<usize>, findings: &[Finding]| {
        rows.extend(findings.iter().map(|finding| (when, at, finding.clone())));
    };
    add(When::Before, None, &fitted.before_all);
    for (at, (record, checks)) in records.iter().zip(&fitted.before).enumerate() {
        add(When::Before, Some(at), checks);
        add(When::Before, Some(at), &record.unit_findings);
        let mut channels = channel_findings(record)?;
        channels.retain(|finding| !(hits && finding.subject() == Subject::Power));
        add(When::Before, Some(at), &channels);
    }
    for (at, checks) in fitted.after.iter().enumerate() {
        add(When::After, Some(at), checks);
    }
    add(When::After, None, &fitted.after_all);
    add(When::After, None, instability(modes).as_slice());
    let unknowns =
        fitted.estimate.unknowns().independent().div_ceil(fitted.estimate.unknowns().dof());
    let unrelated = unexplained
        .filter(|_| fitted.nonlinear.is_none())
        .and_then(|part| unrelated_response(part, fitted.equations, unknowns));
    add(When::After, None, unmeasured_force(fitted, unexplained).as_slice());
    add(When::After, None, unrelated.as_slice());
    if scaled {
        add(When::After, None, negative_mass(&fitted.estimate).as_slice());
        add(When::After, None, mass_symmetry(&fitted.estimate).as_slice());
        add(When::After, None, gain_symmetry(&fitted.estimate).as_slice());
    }
    for (at, residual) in fitted.residuals.iter().enumerate() {
        let checks = match residual {
            Residual::Samples(residual) => sample_findings(residual)?,
            Residual::Lines(residual) => residual.findings(),
        };
        add(When::After, Some(at), &checks);
    }
    // A nonlinearity disturbs the lines at the resonances most, so a misfit there does not show an
    // outside disturbance of these lines.
    if rows.iter().any(|(_, _, finding)| matches!(finding, Finding::Distortion(_))) {
        rows.iter_mut().for_each(|(_, _, finding)| finding.forget_lines());
    }
    adjust_p_values(rows.iter_mut().map(|(_, _, finding)| finding));
    let name = |at: usize| (records.len() > 1).then(|| records[at].file.clone());
    let row = |(when, at, finding): &(When, Option<usize>, Finding)| {
        let names = &records[at.unwrap_or(0)].names;
        CheckRow::new(*when, at.and_then(name), finding, names)
    };
    Ok(rows.iter().map(row).collect())
}

/// Returns the finding that the fit attributes the residual to unmeasured forces, if the noise
/// level is not known and these forces were inferred from the residual alone.
fn unmeasured_force(fitted: &Fitted, unexplained: Option<f64>) -> Option<Finding> {
    let is_of_forces = |model: &NoiseModel| matches!(model, NoiseModel::UnmeasuredForce { .. });
    let is_seen = fitted.misfit.is_none() && fitted.noise.iter().any(is_of_forces);
    unexplained
        .filter(|_| is_seen)
        .map(|fraction| Finding::UnmeasuredForce(UnmeasuredForce { fraction }))
}

/// Returns the faults of the sensors, independent of any model.
pub(crate) fn sensor_findings(measured: &Block) -> Vec<Finding> {
    let mut findings = clipped_channels(Quantity::Force, &measured.force);
    findings.extend(dropped_channels(Quantity::Force, &measured.force));
    for (kind, motion) in measured.responses() {
        findings.extend(clipped_channels(Quantity::Response(kind), motion));
        findings.extend(constant_channels(Quantity::Response(kind), motion));
        findings.extend(quantised_channels(Quantity::Response(kind), motion));
        findings.extend(spiked_channels(Quantity::Response(kind), motion, &measured.force));
        findings.extend(dropped_channels(Quantity::Response(kind), motion));
    }
    let responses = measured.responses();
    let motions = responses.iter().map(|(kind, motion)| (Quantity::Response(*kind), *motion));
    let channels: Vec<_> =
        std::iter::once((Quantity::Force, &measured.force)).chain(motions).collect();
    findings.extend(repeated_channels(&channels));
    findings
}

/// Returns the faults of the channels, which do not depend on the model.
pub(crate) fn channel_findings(measured: &Block) -> Result<Vec<Finding>, AnalysisError> {
    let mut findings = sensor_findings(measured);
    findings.extend(kinematics(&measured.responses())?);
    // A measured velocity gives the power without differentiation.
    let (motion, kind) = match &measured.velocity {
        Some(velocity) => (velocity, ResponseQuantity::Velocity),
        None => measured.response(),
    };
    findings.extend(power(&measured.force, motion, kind)?);
    Ok(findings)
}

/// Returns the tests of a residual; none if it has too few samples.
fn sample_findings(residual: &SampleResidual) -> Result<Vec<Finding>, AnalysisError> {
    let SampleResidual { samples, fitted, force, noise_span } = residual;
    match residual.lags() {
        0 => Ok(Vec::new()),
        lags => Ok(after_fit(samples, fitted, force, lags, *noise_span)?),
    }
}

impl CheckRow {
    pub(crate) fn new(
        when: When,
        record: Option<String>,
        finding: &Finding,
        names: &Channels,
    ) -> Self {
        Self {
            when,
            record,
            subject: finding.subject(),
            verdict: finding.verdict(),
            value: Some(finding.value()).filter(|value| value.is_finite()),
            text: sentence(finding, names),
            finding: finding.clone(),
        }
    }

    /// Returns whether the user must be warned.
    pub fn is_conspicuous(&self) -> bool {
        self.verdict > Verdict::Good
    }

    /// Returns whether the finding warns and names a delay, a fault of the acquisition or another
    /// model that explains the residual.
    pub(crate) fn is_explanation(&self) -> bool {
        self.is_conspicuous() && matches!(self.finding, Finding::Delay(_) | Finding::Alternative(_))
    }

    /// Returns whether the finding names a fault.
    pub fn is_bad(&self) -> bool {
        self.verdict == Verdict::Bad
    }

    /// Returns whether `other` is the same kind of finding in another record.
    pub(crate) fn has_same_kind_in_other_record(&self, other: &Self) -> bool {
        let kind = |row: &Self| (row.subject, std::mem::discriminant(&row.finding));
        self.record != other.record && kind(self) == kind(other)
    }

    /// Returns the sentence of the finding, preceded by the name of its record.
    pub fn sentence(&self) -> String {
        match &self.record {
            Some(record) => format!("{record}: {}", self.text),
            None => self.text.clone(),
        }
    }
}

/// Returns a finding as a sentence that calls the channels by their names.
pub(crate) fn sentence(finding: &Finding, names: &Channels) -> String {
    let name = |Channel { quantity, index }| match quantity {
        Quantity::Force => names.force_name(index),
        Quantity::Response(kind) => names.response_name(kind, index),
    };
    finding.sentence(&name).to_string()
}

/// Serialises a value as the text that its `Display` writes.
fn as_text<T: std::fmt::Display, S: serde::Serializer>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}
