//! Delay between the inputs and the sensors of a machine.

use std::fmt::{self, Formatter};

use mechid_estimate::likelihood::machine::MachineEstimate;

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Delay of one sensor, or of all sensors, that explains most of the residual of a machine.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SensorDelay {
    /// Name of the sensor; `None`: all sensors are late by the same time.
    pub sensor: Option<String>,
    /// Delay of the sensor, in s, to first order.
    pub seconds: f64,
    /// Standard error of the delay due to the noise, in s. A large delay has an additional error of
    /// second order.
    pub standard_error: f64,
    /// Probability that noise alone gives a delay at least as large.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

/// Tests the residual of a machine for a delay between its inputs and its sensors
/// ([`Finding::SensorDelay`]); `None` if the data do not determine any delay.
///
/// # Source
/// The score test of [`DelayScore`](mechid_estimate::likelihood::DelayScore).
pub fn delay_of_sensors(estimate: &MachineEstimate) -> Option<Finding> {
    let score = estimate.delay.as_ref()?;
    let name = |output: usize| estimate.assembly.sensors()[output].name.clone();
    Some(Finding::SensorDelay(SensorDelay {
        sensor: score.output.map(name),
        seconds: score.delay,
        standard_error: score.standard_error,
        p_value: PValue::new(score.p_value),
    }))
}

impl Check for SensorDelay {
    fn subject(&self) -> Subject {
        Subject::Delay
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
        if self.verdict() == Verdict::Good {
            return write!(f, "no delay between inputs and sensors ({})", self.p_value);
        }
        let direction = if self.seconds > 0.0 { "late" } else { "early" };
        let size = three_digits(1e3 * self.seconds.abs());
        let late = match &self.sensor {
            Some(sensor) => format!("{sensor} is"),
            None => "all sensors are".to_owned(),
        };
        write!(
            f,
            "{late} about {size} ms {direction} ({}). Possible causes: a filter, a scanning converter, an error of \
             the model with the same effect. Shift the channel, or make the delay of the sensors \
             a parameter",
            self.p_value
        )
    }
}
