//! Nonlinearity in whole periods.

use std::fmt::{self, Formatter};

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_nonlinear::{Level, distortion};
use mechid_signal::Record;
use mechid_spectra::Lines;

use super::finding::{Check, Finding, Names};
use super::limits::DISTORTION_EXPLAINED;
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Finds the nonlinear term that explains most of the residual of a linear model
/// ([`Finding::Distortion`]). The data are whole periods of force (N) and response of one or
/// several experiments, on the lines of a band. Returns `None` if the term explains less than half
/// of the residual power or is not significant.
///
/// # Errors
/// The errors of [`distortion`].
///
/// # Source
/// The source of [`distortion`].
pub fn distortion_of_periods(
    band: &Lines,
    experiments: &[[&Record; 2]],
    measured: ResponseQuantity,
    unknowns: &Unknowns,
) -> Result<Option<Finding>, EstimateError> {
    let detected = distortion(band, experiments, measured, unknowns)?;
    let [even_db, odd_db] = [detected.even, detected.odd]
        .map(|level: Option<Level>| level.map(|level| level.db).filter(|db| db.is_finite()));
    let kind = detected.kind().filter(|kind| kind.explained >= DISTORTION_EXPLAINED);
    Ok(kind.map(|kind| {
        Finding::Distortion(Distortion {
            term: kind.to_string(),
            explained: kind.explained,
            even_db,
            odd_db,
            p_value: PValue::new(kind.p_value),
        })
    }))
}

/// Nonlinear term that explains most of the residual of a linear model in whole periods.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Distortion {
    /// Name of the term.
    pub term: String,
    /// Share of the residual power of a linear model that the term explains.
    pub explained: f64,
    /// Level of the response on even lines relative to the driven lines, in dB, if only odd lines
    /// are driven; `None` otherwise, or if there is only noise.
    pub even_db: Option<f64>,
    /// Level of the response on odd lines without force relative to the driven lines, in dB, if
    /// only odd lines are driven; `None` otherwise, or if there is only noise.
    pub odd_db: Option<f64>,
    /// Probability that noise alone makes one of the tested terms explain at least as large a
    /// fraction of the residual power.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for Distortion {
    fn subject(&self) -> Subject {
        Subject::Linearity
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
        let Self { term, explained, even_db, odd_db, p_value } = self;
        write!(
            f,
            "{term} explains {:.1} % of the residual power of a linear model ({p_value})",
            100.0 * explained
        )?;
        for (name, level) in [("even", even_db), ("odd", odd_db)] {
            if let Some(level) = level {
                write!(f, "; {name} distortion {level:.0} dB relative to the response")?;
            }
        }
        f.write_str(
            ": the machine is nonlinear at this level of the force, and its parameters hold at this level only; fit \
             the term, too (`nonlinear`), or test at a lower level",
        )
    }
}
