//! Machine with its sensors and inputs.

use super::{Assembly, Input, Instruments, Machine, MachineError};

/// A machine with its sensors and inputs: the full content of a description in JSON.
///
/// ```
/// # #[cfg(feature = "serde")] {
/// use mechid_model::elements::InstrumentedMachine;
///
/// let described = r#"{
///     "dofs": ["x1", "x2"],
///     "elements": [
///         {"name": "m1", "at": "x1", "m": 2.0},
///         {"name": "m2", "at": "x2", "m": 1.5},
///         {"name": "foot", "at": "x1", "k": {"start": 3e4, "min": 0}, "c": {"start": 5}},
///         {"name": "link", "between": ["x1", "x2"], "k": 2e4, "c": 4}
///     ],
///     "sensors": [{"at": "x2", "quantity": "acceleration"}],
///     "inputs": [{"kind": "force", "at": "x1", "name": "shaker"}]
/// }"#;
/// let machine: InstrumentedMachine = serde_json::from_str(described).unwrap();
/// let names: Vec<String> =
///     machine.assembly().unwrap().parameters().iter().map(|p| p.name.clone()).collect();
/// assert_eq!(names, ["foot.k", "foot.c"]);
/// assert_eq!(machine.instruments.sensors[0].name, "x2");
/// # }
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "super::serde_instrumented::InstrumentedForm"))]
#[cfg_attr(feature = "serde", serde(into = "super::serde_instrumented::InstrumentedForm"))]
pub struct InstrumentedMachine {
    /// Degrees of freedom and elements.
    pub machine: Machine,
    /// Sensors and inputs, whose names are the names of their channels, and the speed of the rotor.
    pub instruments: Instruments,
    /// Sensors and forces that could be added to the test.
    pub candidates: Candidates,
}

/// Sensors and forces that could be added to a test.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct Candidates {
    /// Additional sensors; each has the noise level of the existing sensors of the same quantity.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Vec::is_empty"))]
    pub sensors: Vec<super::Sensor>,
    /// Forces of a second test; each has the level of the forces of the first test.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Vec::is_empty"))]
    pub forces: Vec<Input>,
}

impl Candidates {
    /// Returns whether there are no candidates.
    pub fn is_empty(&self) -> bool {
        self.sensors.is_empty() && self.forces.is_empty()
    }
}

impl InstrumentedMachine {
    /// Returns the terms of the dynamic stiffness, the sensors, the inputs and the unknowns, by
    /// index.
    ///
    /// # Errors
    /// [`MachineError`] with the name of the wrong element, sensor, input or parameter.
    pub fn assembly(&self) -> Result<Assembly, MachineError> {
        self.machine.assembly(&self.instruments)
    }
}
