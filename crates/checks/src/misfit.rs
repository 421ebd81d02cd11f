//! Residual power compared with the noise power.

use std::fmt::{self, Display, Formatter};

use super::digits::{line_hz, listed};
use super::finding::{Check, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Residual power compared with the noise power.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Misfit {
    /// Ratio of the residual power to its expectation for noise alone (pure number).
    pub ratio: f64,
    /// Probability that noise alone gives a ratio that deviates at least as much from 1. The test
    /// is two-sided for noise from periods. For the noise of the force, only ratios below 1 count;
    /// for other sources, only ratios above 1 count.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Source of the noise power.
    pub source: NoiseSource,
    /// Few lines with most of the power beyond the noise; `None` if there are no such lines.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub concentration: Option<Concentration>,
}

/// Few lines with most of a misfit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Concentration {
    /// Frequencies of the lines, in Hz, rising.
    pub frequencies_hz: Vec<f64>,
    /// Fraction of the excess of the residual power over the noise power that vanishes if the lines
    /// at `frequencies_hz` are excluded.
    pub share: f64,
    /// Frequency, in Hz, whose multiples are near all lines at `frequencies_hz`; `None` if this
    /// agreement may be chance, or for a single line.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub multiples_of_hz: Option<f64>,
}

/// Source of the noise power that a residual is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum NoiseSource {
    /// Scatter of repeated periods.
    Periods,
    /// Coherence of averaged frequency responses.
    Coherence,
    /// Standard errors that the data state.
    Stated,
    /// Noise of the force, stated or estimated above the excited band, on the lines where this
    /// noise dominates.
    Force,
}

impl Check for Misfit {
    fn subject(&self) -> Subject {
        Subject::Misfit
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.ratio
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let (verdict, ratio) = (self.verdict(), self.ratio);
        let times = if ratio < 1e4 { format!("{ratio:.3}") } else { format!("{ratio:.1e}") };
        let (source, p_value) = (self.source, self.p_value);
        write!(f, "residual power is {times} × the noise power {source} ({p_value}): ")?;
        match &self.concentration {
            Some(few) if verdict > Verdict::Good && ratio > 1.0 => few.sentence(f),
            _ => f.write_str(self.explanation(verdict)),
        }
    }
}

impl Display for NoiseSource {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoiseSource::Periods => "estimated from the periods",
            NoiseSource::Coherence => "that follows from the coherence",
            NoiseSource::Stated => "that follows from the standard errors",
            NoiseSource::Force => "on the lines where the noise of the force dominates",
        })
    }
}

impl Concentration {
    fn sentence(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let hz: Vec<String> = self.frequencies_hz.iter().map(|hz| line_hz(*hz)).collect();
        let share = (100.0 * self.share).floor();
        write!(
            f,
            "{share} % of the power above the noise is at {} Hz. Possible causes: run-out, mains, another \
             disturbance. Exclude these lines with `without_hz` {}",
            listed(&hz),
            hz.join(",")
        )?;
        match self.multiples_of_hz.map(line_hz) {
            Some(of) => write!(
                f,
                ". All these lines are near multiples of {of} Hz; if this is a speed of rotation, use `without_hz` \
                 {of}:multiples"
            ),
            None => Ok(()),
        }
    }
}

impl Misfit {
    fn explanation(&self, verdict: Verdict) -> &'static str {
        match verdict {
            Verdict::Good => "consistent with noise",
            _ if self.ratio < 1.0 && self.source == NoiseSource::Force => {
                "the noise of the force is less than assumed, and the wrong value biases the estimate; \
                 state the noise with `force_noise`"
            }
            _ if self.ratio < 1.0 => {
                "the periods differ by more than noise (hits of unequal strength, a drift, a transient), and the \
                 standard errors are too large; average frequency responses over the periods instead"
            }
            _ => {
                "the residual exceeds the noise. Possible causes: a wrong model (nonlinearity, missing degree of \
                 freedom, wrong known mass), spectral leakage, or a biased estimate. Do not rely on the intervals"
            }
        }
    }
}
