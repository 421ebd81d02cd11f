//! Description of a machine.

use super::{Assembly, Coefficient, Element, FreeCoefficient, Instruments, MachineError, build};

/// Damping in proportion to masses and stiffnesses: C = αM + βK, and K (1 + iη).
///
/// It applies to masses, links and matrices; bearings and other 2 × 2 blocks have separate damping.
/// The damping αM acts on the motion relative to the support.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct ProportionalDamping {
    /// α, in 1/s.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Coefficient::is_zero"))]
    pub alpha: Coefficient,
    /// β, in s.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Coefficient::is_zero"))]
    pub beta: Coefficient,
    /// Loss factor η of all links and matrices that have no separate loss factor.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Coefficient::is_zero"))]
    pub loss_factor: Coefficient,
}

impl ProportionalDamping {
    /// Returns whether α, β and η are all zero.
    pub fn is_zero(&self) -> bool {
        [&self.alpha, &self.beta, &self.loss_factor].into_iter().all(Coefficient::is_zero)
    }
}

/// A machine: named degrees of freedom and named elements; [`Machine::assembly`] checks it.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "super::serde_form::MachineForm"))]
#[cfg_attr(feature = "serde", serde(into = "super::serde_form::MachineForm"))]
pub struct Machine {
    /// Names of the degrees of freedom.
    pub dofs: Vec<String>,
    /// Elements with their names.
    pub elements: Vec<(String, Element)>,
    /// Unknowns that several coefficients share, with their names.
    pub parameters: Vec<(String, FreeCoefficient)>,
    /// Damping in proportion to masses and stiffnesses.
    pub damping: ProportionalDamping,
    /// Degrees of freedom in the direction of the motion of the support; by default all.
    pub support_direction: Option<Vec<String>>,
    /// Degrees of freedom of a part whose receptance was measured: they need no mass in this
    /// machine.
    pub measured: Vec<String>,
}

impl Machine {
    /// Creates a machine without elements; `dofs` are the names of its degrees of freedom.
    pub fn new<S: Into<String>>(dofs: impl IntoIterator<Item = S>) -> Self {
        Self { dofs: dofs.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// Returns the machine with one more element.
    #[must_use]
    pub fn with(mut self, name: &str, element: Element) -> Self {
        self.elements.push((name.to_owned(), element));
        self
    }

    /// Returns the machine with one more unknown, which several coefficients may share.
    #[must_use]
    pub fn with_parameter(mut self, name: &str, parameter: FreeCoefficient) -> Self {
        self.parameters.push((name.to_owned(), parameter));
        self
    }

    /// Returns the terms of the dynamic stiffness, the sensors, the inputs and the unknowns, by
    /// index.
    ///
    /// # Errors
    /// [`MachineError`] with the name of the wrong element, sensor, input or parameter.
    pub fn assembly(&self, instruments: &Instruments) -> Result<Assembly, MachineError> {
        build::assembly(self, instruments)
    }
}
