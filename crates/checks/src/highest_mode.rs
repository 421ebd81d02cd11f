//! Highest mode compared with the sampling interval or the band.

use std::f64::consts::TAU;
use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_estimate::EstimateError;
use mechid_estimate::time_domain::Transitions;
use mechid_model::Discretisation;
use mechid_model::SecondOrderSystem;
use mechid_numerics::NumericsError;
use mechid_numerics::RealSchur;
use mechid_spectra::Lines;

use super::finding::{Check, Finding, Names};
use super::limits::{
    EULER_BIAS_BAD, EULER_BIAS_DOUBTFUL, SAMPLES_PER_PERIOD_AT_SAMPLES, SAMPLES_PER_PERIOD_BAD,
    SAMPLES_PER_PERIOD_DOUBTFUL, SAMPLES_PER_PERIOD_NYQUIST,
};
use super::no_logarithm::NoLogarithm;
use super::{Subject, Verdict};

/// Samples per period of the highest mode.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct HighestMode {
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Samples per period of the highest mode (pure number).
    pub samples_per_period: f64,
    /// Requirement on the sampling interval or on the band.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub limit: ModeLimit,
}

/// Requirement of a method on the sampling interval or on the band, with respect to the highest
/// mode.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "limit", rename_all = "snake_case")
)]
pub enum ModeLimit {
    /// The equation of motion holds at each sample.
    AtSamples,
    /// Exact transition from sample to sample, with an assumption on the force between them.
    BetweenSamples,
    /// Transition by Euler's rule.
    Euler {
        /// Relative error that Euler's rule causes in the state matrix (pure number).
        bias: f64,
    },
    /// Lines of the spectrum.
    Lines {
        /// Frequency of the highest line fitted, in Hz.
        last_hz: f64,
    },
}

/// Returns the natural frequency (Hz) of the highest oscillating mode and its samples per period.
/// If no mode oscillates, the frequency is the geometric mean of all natural frequencies, because a
/// fit does not need to resolve fast decays.
pub(super) fn highest_mode(system: &SecondOrderSystem, dt: f64) -> Result<[f64; 2], EstimateError> {
    let modes = system.modes()?;
    let oscillating = modes.iter().filter(|mode| mode.oscillates());
    let highest = match oscillating.map(|mode| mode.natural_frequency()).reduce(f64::max) {
        Some(highest) => highest,
        None => {
            let logarithms = modes.iter().map(|mode| mode.natural_frequency().ln());
            (logarithms.sum::<f64>() / modes.len().max(1) as f64).exp()
        }
    };
    Ok([highest / TAU, TAU / (highest * dt)])
}

/// Compares the highest mode of the data (force held between samples) with the sampling interval.
pub(super) fn step(
    rows: &Transitions,
    discretisation: Discretisation,
) -> Result<Finding, EstimateError> {
    let exact = match rows.state_matrix(Discretisation::ZeroOrderHold) {
        Ok(matrix) => matrix,
        Err(EstimateError::Numerics(NumericsError::NoLogarithm { eigenvalue })) => {
            return Ok(Finding::NoLogarithm(NoLogarithm { eigenvalue }));
        }
        Err(other) => return Err(other),
    };
    let eigenvalues = RealSchur::new(exact.clone())?.eigenvalues();
    let highest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let limit = if discretisation == Discretisation::Euler {
        let n = rows.dof();
        let euler = rows.state_matrix(Discretisation::Euler)?;
        let bias = (euler.rows(n, n) - exact.rows(n, n)).norm() / exact.rows(n, n).norm();
        ModeLimit::Euler { bias }
    } else {
        ModeLimit::BetweenSamples
    };
    let (frequency_hz, samples_per_period) = (highest / TAU, TAU / (highest * rows.dt()));
    Ok(Finding::HighestMode(HighestMode { frequency_hz, samples_per_period, limit }))
}

/// Compares the highest mode of an estimate with the sampling interval `dt`, in s
/// ([`Finding::HighestMode`]).
///
/// # Errors
/// [`EstimateError::Undetermined`] or [`EstimateError::Model`] if there are no modes.
///
/// # Source
/// Ours.
pub fn fitted_step(estimate: &Estimate, dt: f64) -> Result<Finding, EstimateError> {
    let [frequency_hz, samples_per_period] = highest_mode(&estimate.system()?, dt)?;
    Ok(Finding::HighestMode(HighestMode {
        frequency_hz,
        samples_per_period,
        limit: ModeLimit::BetweenSamples,
    }))
}

/// Compares the highest mode of an estimate with the fitted lines and the Nyquist frequency
/// ([`Finding::HighestMode`]); `None` if the data do not determine a system.
///
/// # Errors
/// [`EstimateError::Model`] if the modes cannot be computed.
///
/// # Source
/// Ours.
pub fn fitted_band(estimate: &Estimate, lines: &Lines) -> Result<Option<Finding>, EstimateError> {
    let Ok(system) = estimate.system() else { return Ok(None) };
    let [frequency_hz, samples_per_period] = highest_mode(&system, lines.sampling().dt())?;
    let last = lines.as_slice().iter().copied().max().unwrap_or(0);
    let limit = ModeLimit::Lines { last_hz: last as f64 * lines.sampling().line_spacing_hz() };
    Ok(Some(Finding::HighestMode(HighestMode { frequency_hz, samples_per_period, limit })))
}

impl Check for HighestMode {
    fn subject(&self) -> Subject {
        Subject::Step
    }

    fn verdict(&self) -> Verdict {
        self.limit.verdict(self.frequency_hz, self.samples_per_period)
    }

    fn value(&self) -> f64 {
        match self.limit {
            ModeLimit::Euler { bias } => bias,
            _ => self.samples_per_period,
        }
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { frequency_hz, samples_per_period, limit } = self;
        let condition = match limit {
            ModeLimit::Euler { .. } => " if the force is held between the samples",
            _ => "",
        };
        write!(
            f,
            "the highest mode ({frequency_hz:.4} Hz{condition}) has {samples_per_period:.1} samples per \
             period{}",
            limit.clause(self.verdict(), *samples_per_period)
        )
    }
}

impl ModeLimit {
    fn verdict(self, frequency_hz: f64, samples_per_period: f64) -> Verdict {
        let few = |doubtful: f64, bad: f64| match samples_per_period {
            samples if samples > doubtful => Verdict::Good,
            samples if samples > bad => Verdict::Doubtful,
            _ => Verdict::Bad,
        };
        match self {
            ModeLimit::AtSamples => few(SAMPLES_PER_PERIOD_AT_SAMPLES, SAMPLES_PER_PERIOD_NYQUIST),
            ModeLimit::BetweenSamples => few(SAMPLES_PER_PERIOD_DOUBTFUL, SAMPLES_PER_PERIOD_BAD),
            ModeLimit::Euler { bias } => Verdict::graded(bias, EULER_BIAS_DOUBTFUL, EULER_BIAS_BAD),
            ModeLimit::Lines { last_hz } => match samples_per_period {
                samples if samples <= SAMPLES_PER_PERIOD_NYQUIST => Verdict::Bad,
                _ if frequency_hz > last_hz => Verdict::Doubtful,
                _ => Verdict::Good,
            },
        }
    }
}

impl ModeLimit {
    fn clause(&self, verdict: Verdict, samples_per_period: f64) -> String {
        match (self, verdict) {
            (ModeLimit::AtSamples, Verdict::Good) => {
                ": enough, because the fitted equation of motion holds at each sample".into()
            }
            (ModeLimit::BetweenSamples, Verdict::Good) => String::new(),
            (ModeLimit::BetweenSamples, Verdict::Doubtful) => {
                ", so few that the change of the force between samples matters: sample faster, or state how the \
                 force changes (`between_samples`)"
                    .into()
            }
            (ModeLimit::AtSamples | ModeLimit::BetweenSamples, _) => {
                ", so few that this mode may be the alias of a mode above the Nyquist frequency: sample faster"
                    .into()
            }
            (ModeLimit::Euler { bias }, _) => {
                format!("; the bias of Euler's rule is about {:.1} %", 100.0 * bias)
            }
            (ModeLimit::Lines { .. }, Verdict::Good) => " and lies within the fitted band".into(),
            (ModeLimit::Lines { .. }, _) if samples_per_period <= 2.0 => {
                " and lies above the Nyquist frequency: sample faster".into()
            }
            (ModeLimit::Lines { last_hz }, _) => {
                format!(" and lies above the fitted band, which ends at {last_hz:.4} Hz")
            }
        }
    }
}
