//! JSON form of the description of a machine with its sensors and inputs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::serde_form::{ElementForm, MachineForm};
use super::{
    Candidates, FreeCoefficient, Input, InstrumentedMachine, Instruments, MachineError,
    ProportionalDamping, Sensor, Speed,
};

/// A machine with its sensors and inputs; the fields of [`MachineForm`] come first.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct InstrumentedForm {
    dofs: Vec<String>,
    elements: Vec<ElementForm>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, FreeCoefficient>,
    #[serde(default, skip_serializing_if = "ProportionalDamping::is_zero")]
    damping: ProportionalDamping,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    support_direction: Option<Vec<String>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    measured: Vec<String>,
    sensors: Vec<Sensor>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    inputs: Vec<Input>,
    #[serde(default, skip_serializing_if = "is_none")]
    speed: Speed,
    #[serde(default, skip_serializing_if = "Candidates::is_empty")]
    candidates: Candidates,
}

fn is_none(speed: &Speed) -> bool {
    *speed == Speed::None
}

impl TryFrom<InstrumentedForm> for InstrumentedMachine {
    type Error = MachineError;

    fn try_from(form: InstrumentedForm) -> Result<Self, MachineError> {
        let InstrumentedForm { dofs, elements, parameters, damping, .. } = form;
        let InstrumentedForm { support_direction, measured, sensors, inputs, speed, .. } = form;
        let machine =
            MachineForm { dofs, elements, parameters, damping, support_direction, measured };
        let named = |sensors: Vec<Sensor>| sensors.into_iter().map(Sensor::named).collect();
        let forces = |inputs: Vec<Input>| inputs.into_iter().map(Input::named).collect();
        Ok(Self {
            machine: machine.try_into()?,
            instruments: Instruments { sensors: named(sensors), inputs: forces(inputs), speed },
            candidates: Candidates {
                sensors: named(form.candidates.sensors),
                forces: forces(form.candidates.forces),
            },
        })
    }
}

impl From<InstrumentedMachine> for InstrumentedForm {
    fn from(described: InstrumentedMachine) -> Self {
        let InstrumentedMachine { machine, instruments, candidates } = described;
        let Instruments { sensors, inputs, speed } = instruments;
        let MachineForm { dofs, elements, parameters, damping, support_direction, measured } =
            machine.into();
        Self {
            dofs,
            elements,
            parameters,
            damping,
            support_direction,
            measured,
            sensors,
            inputs,
            speed,
            candidates,
        }
    }
}
