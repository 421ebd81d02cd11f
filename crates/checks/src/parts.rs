//! Agreement of the parts of the data about the parameters.

use std::fmt::{self, Display, Formatter};

use mechid_estimate::frequency_domain::{self, PartsComparison, PartsOfFit, Split};

use super::digits::{line_hz, six_digits, three_digits};
use super::finding::{Check, Names};
use super::limits::SIGNIFICANCE;
use super::p_value::PValue;
use super::{Subject, Verdict};
use crate::Finding;

/// Difference between the parameters that are estimated from parts of the data (records, bands of
/// lines, sections of time).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PartsAgreement {
    /// Probability that noise alone makes the parts of any split differ at least as much as the
    /// parts of this finding.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// The part that differs most from the others.
    pub part: DataPart,
    /// Parameter in which this part differs most.
    pub parameter: String,
    /// Value of the parameter from this part of the data (unit of the parameter).
    pub by_part: f64,
    /// Value of the parameter from the other parts of the data (unit of the parameter).
    pub by_others: f64,
    /// Standard error of `by_part` − `by_others` due to noise alone (unit of the parameter).
    pub standard_error: f64,
    /// Ratio of the standard errors from the scatter of the parts to the standard errors from the
    /// noise (pure number).
    pub scatter: f64,
    /// Number of independent differences between the parts; `scatter` is computed from these
    /// differences.
    pub degrees_of_freedom: usize,
}

/// A part of the data of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "split", rename_all = "snake_case")
)]
pub enum DataPart {
    /// One of several records, or one of the hits of a hammer test.
    Records {
        /// Index of the record, counted from 0.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        record: usize,
    },
    /// Half of the periods of every record.
    Halves {
        /// Index of the half, counted from 0.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        half: usize,
    },
    /// Band of lines.
    Bands {
        /// Lowest line, in Hz.
        first_hz: f64,
        /// Highest line, in Hz.
        last_hz: f64,
    },
    /// Section of an open record.
    Time {
        /// First sample.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        first_sample: usize,
        /// Last sample.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
        last_sample: usize,
    },
}

/// Meaning of the parts of a [`Split::Rows`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowParts {
    /// Records.
    Records,
    /// Halves of the periods.
    Halves,
}

/// Tests whether the parts of the data agree about the parameters of a fit
/// ([`Finding::PartsAgreement`]), with one error rate for all `splits`. `None` if no split is
/// possible.
///
/// # Source
/// The source of [`PartsOfFit::compare`]; Bonferroni's inequality for several splits.
pub fn agreement_of_parts(fit: &PartsOfFit<'_>, splits: &[(Split, RowParts)]) -> Option<Finding> {
    let compared = splits.iter().filter_map(|(split, rows)| Some((fit.compare(split)?, *rows)));
    agreement(compared.collect())
}

/// Returns the finding on the comparisons of several splits.
pub(crate) fn agreement(compared: Vec<(PartsComparison, RowParts)>) -> Option<Finding> {
    let count = compared.len() as f64;
    let scatter = |of: &PartsComparison| (of.error_scale, of.degrees_of_freedom);
    let significant = compared.iter().filter(|(of, _)| count * of.p_value < SIGNIFICANCE);
    let largest = significant.map(|(of, _)| scatter(of)).max_by(|a, b| a.0.total_cmp(&b.0));
    let (worst, rows) = compared.into_iter().min_by(|a, b| a.0.p_value.total_cmp(&b.0.p_value))?;
    let (scatter, degrees_of_freedom) = largest.unwrap_or(scatter(&worst));
    let difference = worst.largest?;
    Some(Finding::PartsAgreement(PartsAgreement {
        p_value: PValue::new((count * worst.p_value).min(1.0)),
        part: DataPart::new(difference.part, rows),
        parameter: difference.parameter,
        by_part: difference.by_part,
        by_others: difference.by_others,
        standard_error: difference.standard_error,
        scatter,
        degrees_of_freedom,
    }))
}

impl DataPart {
    fn new(part: frequency_domain::Part, rows: RowParts) -> Self {
        use frequency_domain::Part;
        match (part, rows) {
            (Part::Rows { index }, RowParts::Records) => Self::Records { record: index },
            (Part::Rows { index }, RowParts::Halves) => Self::Halves { half: index },
            (Part::Band { first_hz, last_hz }, _) => Self::Bands { first_hz, last_hz },
            (Part::Time { first, end }, _) => {
                Self::Time { first_sample: first, last_sample: end.saturating_sub(1) }
            }
        }
    }
}

impl Check for PartsAgreement {
    fn subject(&self) -> Subject {
        Subject::Parts
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
        let Self { p_value, part, parameter, by_part, by_others, standard_error, .. } = self;
        let [value, others] = [six_digits(*by_part), six_digits(*by_others)];
        let errors = three_digits((by_part - by_others).abs() / standard_error);
        match self.verdict() {
            Verdict::Good => write!(
                f,
                "parts of the data agree ({p_value}): {parameter} differs most, \
                 {value} for {part} and {others} for the rest ({errors} standard errors)"
            ),
            _ => write!(
                f,
                "parts of the data disagree beyond their errors ({p_value}): {parameter} is {value} for \
                 {part} and {others} for the rest, a difference of {errors} standard errors; the model \
                 is wrong or the machine changes"
            ),
        }
    }
}

impl Display for DataPart {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Records { record } => write!(f, "record {}", record + 1),
            Self::Halves { half: 0 } => f.write_str("the first half of the periods"),
            Self::Halves { .. } => f.write_str("the second half of the periods"),
            Self::Bands { first_hz, last_hz } => {
                write!(f, "the lines from {} to {} Hz", line_hz(*first_hz), line_hz(*last_hz))
            }
            Self::Time { first_sample, last_sample } => {
                write!(f, "samples {} to {}", first_sample + 1, last_sample + 1)
            }
        }
    }
}
