//! Sensors and inputs of a machine.

use super::{Coefficient, SUPPORT};
use crate::ResponseQuantity;

/// Sensor at a degree of freedom.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Sensor {
    /// Name of the sensor and its channel; by default in JSON, the name of the degree of freedom.
    #[cfg_attr(feature = "serde", serde(default))]
    pub name: String,
    /// Degree of freedom.
    pub at: String,
    /// Degree of freedom whose motion is subtracted: that of the housing for a probe on a housing,
    /// or [`SUPPORT`] for a response relative to the moving support.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub relative_to: Option<String>,
    /// Measured quantity.
    pub quantity: ResponseQuantity,
    /// Reading per unit of the quantity.
    #[cfg_attr(feature = "serde", serde(default = "one", skip_serializing_if = "is_one"))]
    pub gain: f64,
    /// Delay relative to the inputs, in s, for example that of a filter or of a logger with a
    /// separate clock.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Coefficient::is_zero"))]
    pub delay: Coefficient,
}

/// Measured input.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", tag = "kind"))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Input {
    /// Force (N), or moment (N·m) for a rotation.
    Force {
        /// Name of the input and its channel; by default in JSON, the name of the degree of
        /// freedom.
        #[cfg_attr(feature = "serde", serde(default))]
        name: String,
        /// Degree of freedom.
        at: String,
        /// Degree of freedom on which the opposite force acts: for a shaker between two degrees of
        /// freedom.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
        against: Option<String>,
    },
    /// Prescribed motion of the support, equal for all its connections.
    Support {
        /// Name of the input and its channel.
        name: String,
        /// Measured quantity.
        quantity: ResponseQuantity,
    },
    /// Trial unbalance U = m e (kg·m) with its phase: at the speed Ω it causes the force Ω² U in x
    /// and −iΩ² U in y.
    Unbalance {
        /// Name of the input and its channel.
        name: String,
        /// Degrees of freedom in the directions x and y; the rotor turns from x to y.
        at: [String; 2],
    },
}

/// Speed of the rotor on each line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Speed {
    /// No part turns.
    #[default]
    None,
    /// The same speed on all lines, in rad/s.
    Constant(f64),
    /// Each line is the synchronous response at its own speed, Ω = ω.
    Synchronous,
}

/// Sensors in the order of the output channels, and inputs in the order of the input channels.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Instruments {
    /// Sensors, one per output.
    pub sensors: Vec<Sensor>,
    /// Inputs, one per measured input; an unknown unbalance is not an input.
    pub inputs: Vec<Input>,
    /// Speed of the rotor.
    #[cfg_attr(feature = "serde", serde(default))]
    pub speed: Speed,
}

#[cfg(feature = "serde")]
fn one() -> f64 {
    1.0
}

#[cfg(feature = "serde")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

impl Sensor {
    /// Creates a sensor of unit gain with the name of its degree of freedom.
    pub fn new(at: &str, quantity: ResponseQuantity) -> Self {
        let name = at.to_owned();
        let delay = Coefficient::default();
        Self { at: name.clone(), name, relative_to: None, quantity, gain: 1.0, delay }
    }

    /// Returns the sensor with a reading relative to another degree of freedom.
    #[must_use]
    pub fn relative_to(self, dof: &str) -> Self {
        Self { relative_to: Some(dof.to_owned()), ..self }
    }

    /// Returns the sensor with a reading relative to the support.
    #[must_use]
    pub fn relative_to_support(self) -> Self {
        self.relative_to(SUPPORT)
    }
}

#[cfg(feature = "serde")]
impl Sensor {
    /// Returns the sensor with the name of its degree of freedom if it has no name.
    pub(super) fn named(self) -> Self {
        if self.name.is_empty() { Self { name: self.at.clone(), ..self } } else { self }
    }
}

#[cfg(feature = "serde")]
impl Input {
    /// Returns the input. A force without a name gets the name of its degree of freedom.
    pub(super) fn named(self) -> Self {
        match self {
            Self::Force { name, at, against } if name.is_empty() => {
                Self::Force { name: at.clone(), at, against }
            }
            other => other,
        }
    }
}

impl Input {
    /// Returns a force with the name of its degree of freedom.
    pub fn force(at: &str) -> Self {
        Self::Force { name: at.to_owned(), at: at.to_owned(), against: None }
    }

    /// Returns the name of the input and its channel.
    pub fn name(&self) -> &str {
        match self {
            Self::Force { name, .. }
            | Self::Support { name, .. }
            | Self::Unbalance { name, .. } => name,
        }
    }
}

impl Speed {
    /// Returns the speed Ω on a line at `omega`, both in rad/s; 0 if no part turns.
    pub fn at(self, omega: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Constant(speed) => speed,
            Self::Synchronous => omega,
        }
    }
}
