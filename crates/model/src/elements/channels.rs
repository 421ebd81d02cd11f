//! Sensors and inputs, by the index of their degrees of freedom.

use nalgebra::Complex;

use super::build::{Builder, Factor};
use super::{Input, MachineError, Sensor, Speed};
use crate::ResponseQuantity;

/// Reading of a sensor: a weighted sum of the motions of degrees of freedom. Index n, the number of
/// degrees of freedom, is the support.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorRow {
    /// Name of the channel.
    pub name: String,
    /// Degrees of freedom with their weights, which include the gain.
    pub entries: Vec<(usize, f64)>,
    /// Measured quantity.
    pub quantity: ResponseQuantity,
    /// Known delay, in s.
    pub delay: f64,
    /// Index of the parameter for the delay (s), if it is unknown.
    pub delay_parameter: Option<usize>,
}

impl SensorRow {
    /// Returns the reading per displacement at `omega` (rad/s), in the unit of the quantity per m.
    /// Its phase includes the known delay and the unknown delay, whose value is one of the
    /// `parameters` (each in its unit).
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 2.2 (a delay τ changes the phase by
    /// −ωτ).
    pub fn factor(&self, parameters: &[f64], omega: f64) -> Complex<f64> {
        let unknown = self.delay_parameter.map_or(0.0, |at| parameters[at]);
        let phase = omega * (self.delay + unknown);
        let factor = self.quantity.per_displacement(omega);
        if phase == 0.0 { factor } else { factor * Complex::cis(-phase) }
    }
}

/// Effect of an input.
#[derive(Debug, Clone, PartialEq)]
pub enum InputColumn {
    /// Forces on degrees of freedom, per unit of the input.
    Force(Vec<(usize, f64)>),
    /// Motion of the support.
    Support(ResponseQuantity),
    /// Unbalance with its degrees of freedom in x and y.
    Unbalance([usize; 2]),
}

impl InputColumn {
    /// Returns the load per unit of the input at `omega` (rad/s): forces (N) by degree of freedom,
    /// and the displacement (m) of the support at index `dof`.
    pub fn load(&self, dof: usize, omega: f64, speed: Speed) -> Vec<(usize, Complex<f64>)> {
        match self {
            Self::Force(entries) => {
                entries.iter().map(|(at, w)| (*at, Complex::from(*w))).collect()
            }
            Self::Support(quantity) => vec![(dof, quantity.per_displacement(omega).inv())],
            Self::Unbalance(at) => unbalance(*at, omega, speed).to_vec(),
        }
    }
}

/// Returns the forces in x and y per kg·m of unbalance on a rotor that turns from x to y; at a
/// negative speed it turns from y to x.
pub(super) fn unbalance(
    [x, y]: [usize; 2],
    omega: f64,
    speed: Speed,
) -> [(usize, Complex<f64>); 2] {
    let turn = speed.at(omega);
    [(x, Complex::from(turn * turn)), (y, Complex::new(0.0, -turn * turn.abs()))]
}

impl Builder<'_> {
    pub(super) fn sensor(&mut self, sensor: &Sensor) -> Result<SensorRow, MachineError> {
        let name = &sensor.name;
        if !sensor.gain.is_finite() {
            return Err(MachineError::NotFinite { name: name.clone(), value: sensor.gain });
        }
        if sensor.gain == 0.0 {
            return Err(MachineError::NoGain { name: name.clone() });
        }
        let mut entries = match &sensor.relative_to {
            Some(other) => self.difference("sensor", name, [&sensor.at, other])?,
            None => vec![(self.dof("sensor", name, &sensor.at)?, 1.0)],
        };
        entries.iter_mut().for_each(|(_, weight)| *weight *= sensor.gain);
        let (delay, delay_parameter) =
            match self.factor(&format!("{name}.delay"), "s", &sensor.delay)? {
                Factor::Known(delay) => (delay, None),
                Factor::Unknown(parameter) => (0.0, Some(parameter)),
            };
        let quantity = sensor.quantity;
        Ok(SensorRow { name: name.clone(), entries, quantity, delay, delay_parameter })
    }

    pub(super) fn input(&self, input: &Input) -> Result<InputColumn, MachineError> {
        let what = "input";
        Ok(match input {
            Input::Force { name, at, against } => InputColumn::Force(match against {
                Some(other) => self.difference(what, name, [at, other])?,
                None => vec![(self.dof(what, name, at)?, 1.0)],
            }),
            Input::Support { quantity, .. } => InputColumn::Support(*quantity),
            Input::Unbalance { name, at } => {
                if self.speed == Speed::None {
                    return Err(MachineError::NoSpeed { what, name: name.clone() });
                }
                let [x, y] = at;
                InputColumn::Unbalance([self.dof(what, name, x)?, self.dof(what, name, y)?])
            }
        })
    }
}
