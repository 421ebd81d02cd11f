//! Terms that a model omits, and the changes of the parameters if these terms are included.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_estimate::frequency_domain::{OmittedTerm, OmittedTerms, PartsOfFit, SampledRows};
use mechid_model::{Parameter, ResponseQuantity};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::LISTED_CHANGES;
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Term that the model omits and that the residual indicates.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TermLeftOut {
    /// The most likely term.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub term: OmittedTerm,
    /// Fraction of the residual power that the term explains.
    pub explained: f64,
    /// Probability that noise alone makes one of the tested terms explain at least as large a
    /// fraction of the residual power.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Change of each parameter if the term is included (unit of the parameter).
    pub changes: Vec<ChangeByTerm>,
}

/// Change of a parameter if an omitted term is included.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ChangeByTerm {
    /// The parameter.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::as_text"))]
    pub parameter: Parameter,
    /// Change of the parameter, to first order (unit of the parameter).
    pub by: f64,
    /// Standard error of the change (unit of the parameter).
    pub standard_error: f64,
    /// Ratio of the change to the standard error of the parameter in the fit without the term (pure
    /// number).
    pub in_errors: f64,
}

/// Tests for terms that the model of a fit leaves out ([`Finding::TermLeftOut`]); `None` if noise
/// alone is sufficient to explain the residual. `records` are those of [`PartsOfFit::omitted`].
///
/// # Source
/// The source of [`PartsOfFit::omitted`].
pub fn omitted_term(
    fit: &PartsOfFit<'_>,
    records: &[SampledRows],
    estimate: &Estimate,
) -> Option<(Finding, OmittedTerms)> {
    let omitted = fit.omitted(records)?;
    let p_value = PValue::new(omitted.p_value);
    if !p_value.is_significant() {
        return None;
    }
    let rows = estimate.parameters().zip(omitted.changes.iter().zip(&omitted.errors));
    let changes = rows.map(|(estimated, (by, error))| ChangeByTerm {
        parameter: estimated.parameter,
        by: *by,
        standard_error: *error,
        in_errors: by / estimated.standard_error,
    });
    let finding = Finding::TermLeftOut(TermLeftOut {
        term: omitted.term,
        explained: omitted.explained,
        p_value,
        changes: changes.collect(),
    });
    Some((finding, omitted))
}

/// Nonlinear terms that are missing from a fit with other nonlinear terms.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NonlinearTermsLeftOut {
    /// Laws of the terms, such as `x1^5`.
    pub laws: Vec<String>,
    /// Fraction of the power of the unexplained force that the terms explain.
    pub explained: f64,
    /// Probability that noise alone makes the coefficient of any candidate differ from zero by at
    /// least as many standard errors as the most significant coefficient of these terms.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Change of each parameter if the terms are included (unit of the parameter).
    pub changes: Vec<NamedChange>,
}

/// Change of a named parameter if the omitted terms are included.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NamedChange {
    /// Name of the parameter.
    pub parameter: String,
    /// SI unit of the parameter.
    pub unit: String,
    /// Change of the parameter (unit of the parameter).
    pub by: f64,
    /// Ratio of the change to the standard error of the parameter in the fit without the terms
    /// (pure number).
    pub in_errors: f64,
}

impl TermLeftOut {
    fn write_term(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let name = |dof| names.response(ResponseQuantity::Displacement, dof);
        f.write_str(match self.term {
            OmittedTerm::ResidualFlexibility => "a residual flexibility of modes above the band",
            OmittedTerm::HiddenMass => {
                "an additional mass on a spring, with its mode above the band,"
            }
            OmittedTerm::ResidualMass => "a residual mass of modes below the band",
            OmittedTerm::StructuralDamping => {
                "structural damping, a force that does not grow with the frequency,"
            }
            OmittedTerm::KnownEntry { entry } => {
                return write!(f, "another value of the known {entry}");
            }
            OmittedTerm::Nonlinear { power, dof, other: None } => {
                return write!(f, "a force proportional to the {power} {}", name(dof));
            }
            OmittedTerm::Nonlinear { power, dof, other: Some(other) } => {
                return write!(
                    f,
                    "a force proportional to the {power} the difference {} minus {}",
                    name(dof),
                    name(other)
                );
            }
            _ => "another term",
        })
    }
}

impl Check for TermLeftOut {
    fn subject(&self) -> Subject {
        Subject::Alternative
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_term(names, f)?;
        let percent = three_digits(100.0 * self.explained);
        write!(f, " explains {percent} % of the residual power ({}); with it", self.p_value)?;
        let changes = self.changes.iter().map(|change| NamedChange {
            parameter: change.parameter.to_string(),
            unit: change.parameter.matrix().unit().to_owned(),
            by: change.by,
            in_errors: change.in_errors,
        });
        write_changes(changes.collect(), f)?;
        f.write_str(match self.term {
            OmittedTerm::Nonlinear { .. } => {
                ": the machine is nonlinear at this level of the force; fit the term, too (`nonlinear`)"
            }
            OmittedTerm::StructuralDamping => {
                ": choose a narrow band (`band_hz`), in which viscous damping has the same effect"
            }
            OmittedTerm::KnownEntry { .. } => {
                ": leave this entry free (`mass`, `structure`), or measure more degrees of freedom"
            }
            _ => ": choose a narrower band (`band_hz`), or measure more degrees of freedom",
        })
    }
}

impl Check for NonlinearTermsLeftOut {
    fn subject(&self) -> Subject {
        Subject::Alternative
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let laws = self.laws.join(", ");
        let percent = three_digits(100.0 * self.explained);
        let (term, verb, name) = match self.laws.len() {
            1 => ("the further term ", "explains", "it"),
            _ => ("the further terms ", "explain", "them"),
        };
        let p_value = self.p_value;
        write!(
            f,
            "{term}{laws} {verb} {percent} % of the residual power of the force ({p_value}); with {name}"
        )?;
        write_changes(self.changes.clone(), f)?;
        write!(f, ": fit {name}, too (`nonlinear`), or measure at a lower level of the force")
    }
}

/// Writes the largest changes, in standard errors.
fn write_changes(mut changes: Vec<NamedChange>, f: &mut Formatter<'_>) -> fmt::Result {
    changes.sort_by(|a, b| b.in_errors.abs().total_cmp(&a.in_errors.abs()));
    for (at, change) in changes.iter().take(LISTED_CHANGES).enumerate() {
        let NamedChange { parameter, unit, by, in_errors } = change;
        let sign = if *by < 0.0 { '−' } else { '+' };
        let (by, errors) = (three_digits(by.abs()), three_digits(in_errors.abs()));
        let comma = if at > 0 { "," } else { "" };
        write!(f, "{comma} {parameter} changes by {sign}{by} {unit} ({errors} standard errors)")?;
    }
    Ok(())
}
