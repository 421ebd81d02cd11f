//! Before a fit: will these data do? After it: is what is left over noise?
//!
//! Every [`Check`] says in words and numbers what was looked at and what it means.

mod after;
mod before;
mod correlation;
mod delay;
mod kinematics;
mod linearity;
mod misfit;
mod period;
mod power;
mod range;
mod regressors;
mod spectral;

use std::fmt;

pub use after::after_fit;
pub use before::{before_equation_of_motion, before_fit, periodicity, periodicity_across};
pub use correlation::{Correlation, cross_correlation, whiteness, whiteness_beyond};
pub use delay::{delay_at_samples, delay_between_samples, delay_of_lines};
pub use kinematics::kinematics;
pub use linearity::linearity;
pub use misfit::{after_response_fit, after_spectral_fit};
pub use period::claimed_period;
pub use power::power;
pub use range::{range, still};
pub use regressors::noise_on_motion;
pub use spectral::{before_response_fit, before_spectral_fit};

/// Samples that are looked at, at most, where each takes much time or memory.
const LOOKED_AT: usize = 1 << 15;

/// How a check came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Verdict {
    /// Nothing to worry about.
    Good,
    /// The fit can be done; the number says how far to trust it.
    Doubtful,
    /// The fit will fail or mislead.
    Bad,
}

/// What a check looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Subject {
    /// Whether the force excites enough for the unknowns.
    Excitation,
    /// Whether the data tell the unknowns apart.
    Conditioning,
    /// Whether a channel was cut off at the end of its range, or is dead.
    Range,
    /// Whether the motions measured are those of one motion.
    Kinematics,
    /// Whether the force puts power into the machine.
    Power,
    /// Whether the record is the period it is said to be.
    Periodicity,
    /// Whether the step suits the fastest mode and the discretisation.
    Step,
    /// Whether motion and force belong together.
    Coherence,
    /// Whether force and motion are apart in time.
    Delay,
    /// Whether noise on the motion biases the fit.
    NoiseOnMotion,
    /// Whether the residual is as large as the noise.
    Misfit,
    /// Whether the residual goes with a power of the motion.
    Linearity,
    /// Whether the residual is white.
    Whiteness,
    /// Whether the residual has anything in common with the force.
    CrossCorrelation,
}

/// One thing looked at, in words with numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What was looked at.
    pub subject: Subject,
    /// How it came out.
    pub verdict: Verdict,
    /// The number behind the verdict; the text says of what, and in which unit.
    pub value: f64,
    /// One sentence.
    pub text: String,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Verdict::Good => "good",
            Verdict::Doubtful => "doubtful",
            Verdict::Bad => "bad",
        })
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Subject::Excitation => "excitation",
            Subject::Conditioning => "conditioning",
            Subject::Range => "range",
            Subject::Kinematics => "kinematics",
            Subject::Power => "power",
            Subject::Periodicity => "periodicity",
            Subject::Step => "step",
            Subject::Coherence => "coherence",
            Subject::Delay => "delay",
            Subject::NoiseOnMotion => "noise on motion",
            Subject::Misfit => "misfit",
            Subject::Linearity => "linearity",
            Subject::Whiteness => "whiteness",
            Subject::CrossCorrelation => "cross-correlation",
        })
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.verdict, self.text)
    }
}

/// A number to six digits, as a person writes it.
fn six_digits(value: f64) -> String {
    let exponent = value.abs().log10().floor();
    match exponent {
        e if (-4.0..6.0).contains(&e) => format!("{value:.0$}", (5.0 - e) as usize),
        _ => format!("{value:.5e}"),
    }
}
