//! Notes on the numbers of an identified machine.

use std::fmt;

use mechid_estimate::likelihood::machine::{FreedCoefficient, MachineEstimate};
use serde::Serialize;

use crate::text::{compact, scaled_errors, significant};

/// A note on the result, with its numbers; [`Display`](fmt::Display) gives one sentence.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum ElementNote {
    /// A bound limits a parameter.
    AtBound {
        /// Name of the parameter.
        parameter: String,
        /// Bound, in the unit of the parameter.
        bound: f64,
    },
    /// Standard errors and intervals are multiplied by a factor, because model and data disagree by
    /// more than the noise explains.
    ScaledErrors {
        /// Factor.
        factor: f64,
        /// Subjects of the checks that determine the factor.
        checks: String,
    },
    /// Most of the information on a parameter comes from its prior.
    FromPrior {
        /// Name of the parameter.
        parameter: String,
        /// Share of the prior in the information, from 0 to 1.
        share: f64,
    },
    /// M, C and K do not form a valid system, so the result does not contain them.
    NoSystem {
        /// Reason.
        reason: String,
    },
    /// Structural damping cannot be a part of M, C and K.
    Hysteresis,
    /// M, C and K describe the rotor at rest, because the speed differs from line to line.
    AtRest,
    /// The covariance of M, C and K is not computed, because too many of their entries are
    /// uncertain.
    NoCovariance {
        /// Maximum number of uncertain entries for which the covariance is computed.
        most: usize,
    },
    /// Standard errors and intervals include the change that a delay of the sensors causes in the
    /// parameters; the residual shows this delay.
    Delayed,
    /// A coefficient that is stated as known may be wrong: as a further unknown, the coefficient
    /// raises the likelihood significantly. Standard errors and intervals include the changes that
    /// this unknown causes in the parameters.
    DoubtfulKnown {
        /// Name of the element and its coefficient.
        parameter: String,
        /// Stated value, in the unit of the coefficient.
        known: f64,
        /// Most likely value, in the unit of the coefficient.
        value: f64,
        /// Standard error of the most likely value, in the unit of the coefficient.
        standard_error: f64,
        /// Probability of a larger rise of the likelihood if all known values are right.
        p_value: f64,
        /// Ratio of the misfit to its expectation: first with the stated value, then with the
        /// coefficient as a further unknown. Absent if the noise comes from the residual.
        #[serde(skip_serializing_if = "Option::is_none")]
        misfit: Option<[f64; 2]>,
    },
    /// Standard errors of M, C and K do not include the uncertainty of a parameter at its bound.
    BoundInSystem,
    /// Remark on the data that were read.
    Read {
        /// The remark.
        text: String,
    },
}

impl ElementNote {
    /// Creates the note about a known coefficient that the data contradict.
    pub(super) fn doubtful_known(freed: &FreedCoefficient, estimate: &MachineEstimate) -> Self {
        Self::DoubtfulKnown {
            parameter: freed.name.clone(),
            known: freed.known,
            value: freed.value,
            standard_error: freed.standard_error,
            p_value: freed.p_value,
            misfit: estimate.likelihood.misfit_ratio.zip(freed.misfit_ratio).map(<[f64; 2]>::from),
        }
    }
}

impl fmt::Display for ElementNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtBound { parameter, bound } => write!(
                f,
                "{parameter} lies at its bound {}: the data favour a value beyond this bound, and the interval is \
                 one-sided",
                compact(*bound, 6)
            ),
            Self::ScaledErrors { factor, checks } => f.write_str(&scaled_errors(*factor, checks)),
            Self::FromPrior { parameter, share } => write!(
                f,
                "{} % of the information on {parameter} comes from its prior",
                significant(100.0 * share, 3)
            ),
            Self::NoSystem { reason } => write!(f, "the result has no M, C and K: {reason}"),
            Self::Hysteresis => f.write_str("structural damping is not in M, C and K"),
            Self::AtRest => f.write_str(
                "M, C and K are those of the rotor at rest, without Ω G, because each line has a different speed",
            ),
            Self::NoCovariance { most } => write!(
                f,
                "more than {most} entries of M, C and K are uncertain: their covariance is left out"
            ),
            Self::Delayed => f.write_str(
                "the residual shows a delay of the sensors: the values are not corrected for it, but \
                 standard errors and intervals include the change that the delay causes",
            ),
            Self::DoubtfulKnown { parameter, known, value, standard_error, misfit, .. } => {
                write!(
                    f,
                    "{parameter} is stated as {}, but the estimate from the data is {} ± {}",
                    compact(*known, 6),
                    compact(*value, 6),
                    compact(*standard_error, 2)
                )?;
                if let Some([before, after]) = misfit.map(|both| both.map(|one| significant(one, 3))) {
                    write!(
                        f,
                        ", and with the estimate the residual power falls from {before} to {after} × the noise power"
                    )?;
                }
                f.write_str(
                    ": the stated value may be wrong; standard errors and intervals include the changes \
                     that such an error causes",
                )
            }
            Self::BoundInSystem => f.write_str(
                "the covariance of M, C and K treats parameters at their bounds as known",
            ),
            Self::Read { text } => f.write_str(text),
        }
    }
}
