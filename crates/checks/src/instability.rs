//! Free responses that grow.

use std::fmt::{self, Formatter};

use mechid_estimate::IdentifiedMode;
use mechid_model::EIGENVALUE_ROUNDING;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Tests whether a mode of the estimate grows; `None` if all modes decay, apart from rounding and
/// rigid-body modes.
///
/// The p-value is the probability that the estimate of a neutrally stable system grows by at least
/// as many standard errors in any mode: the one-sided probability of Student's t distribution,
/// times the number of modes. If one eigenvalue of a real pair is positive, the test uses the
/// product of the pair, which is the ratio of stiffness to mass.
pub fn instability(modes: &[IdentifiedMode]) -> Option<Finding> {
    let largest = modes.iter().map(|mode| mode.mode.natural_frequency()).fold(0.0, f64::max);
    let grows = |mode: &&IdentifiedMode| {
        !mode.is_rigid_body && mode.growth_rate.value > EIGENVALUE_ROUNDING * largest
    };
    let p_value = |mode: &IdentifiedMode| {
        let mut rate = mode.growth_rate;
        if mode.partner.is_some() && mode.squared_frequency.value < 0.0 {
            // The product of the two eigenvalues is a smooth function of the parameters, even where
            // both are zero.
            rate = mode.squared_frequency;
            rate.value = -rate.value;
        }
        let alone = match (rate.value / rate.standard_error, rate.degrees_of_freedom) {
            (ratio, 1..) if ratio.is_finite() => {
                StudentsT::new(0.0, 1.0, rate.degrees_of_freedom as f64)
                    .expect("positive degrees of freedom")
                    .sf(ratio)
            }
            (ratio, _) if ratio == f64::INFINITY => 0.0,
            _ => 1.0,
        };
        (alone * modes.len() as f64).min(1.0)
    };
    let growing = modes.iter().enumerate().filter(|(_, mode)| grows(mode));
    let (index, mode) = growing.min_by(|(_, a), (_, b)| p_value(a).total_cmp(&p_value(b)))?;
    Some(Finding::Instability(Instability {
        mode: index,
        frequency_hz: mode.damped_frequency_hz.value,
        growth_rate: mode.growth_rate.value,
        standard_error: mode.growth_rate.standard_error,
        p_value: PValue::new(p_value(mode)),
    }))
}

/// Mode of the identified system whose free response grows.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Instability {
    /// Index of the mode, by rising natural frequency.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub mode: usize,
    /// Damped frequency of the mode, in Hz; 0 for a growth without oscillation.
    pub frequency_hz: f64,
    /// Real part of the eigenvalue of the mode, in 1/s.
    pub growth_rate: f64,
    /// Standard error of the growth rate, in 1/s.
    pub standard_error: f64,
    /// Probability that noise alone gives a growth at least as large.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for Instability {
    fn subject(&self) -> Subject {
        Subject::Instability
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
        let Self { mode, frequency_hz, growth_rate, standard_error, p_value } = self;
        let number = mode + 1;
        let growth = [*growth_rate, *standard_error].map(three_digits).join(" ± ");
        let frequency = three_digits(*frequency_hz);
        if self.verdict() == Verdict::Good {
            return write!(
                f,
                "mode {number} ({frequency} Hz) of the estimate grows at {growth} 1/s. Noise \
                 alone can cause this growth ({p_value}); the free response cannot be predicted"
            );
        }
        let doubling = three_digits(std::f64::consts::LN_2 / growth_rate);
        write!(
            f,
            "mode {number} ({frequency} Hz) is unstable ({p_value}): its free response grows \
             at {growth} 1/s and doubles every {doubling} s. Possible causes: self-excited \
             vibration (oil film, control), a channel of the wrong sign or with \
             a delay"
        )
    }
}
